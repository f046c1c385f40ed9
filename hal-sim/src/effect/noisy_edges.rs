//! `noisy_edges`: a speed sensor triggers far from its marks.
//!
//! What it is: dirt on a tab, a weak magnet, a worn encoder disc: the angle at which a mark is seen scatters.
//! What can go wrong: a scatter wider than half the distance of two marks is held back by the order of the edges.
//! Units: deg, channel number.
//! Reference: specification `rig.md`, "The simulator" (noisy sensors). Not in the library of `ident`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoisyEdges {
    /// Channel: 0 beam, 1 reflective, 2 hall, 3 encoder.
    pub channel: u8,
    /// Standard deviation of the angle, mechanical degrees.
    pub jitter_deg: f64,
}

impl Effect for NoisyEdges {
    const ID: &'static str = "noisy_edges";
    const EQUATION: &'static str = "marks of the channel are seen at angle + jitter";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { channel: (stream.uniform() * 3.0) as u8, jitter_deg: stream.log_between(1.0, 5.0) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        if let Some(jitter) = parts.geometry.jitter_deg.get_mut(usize::from(self.channel)) {
            *jitter = self.jitter_deg;
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("channel", f64::from(self.channel), "1"), ("jitter", self.jitter_deg, "deg")]
    }
}
