//! `dead_rotor_speed`: a speed sensor gives a fixed share of its pulses, twice as many, or none.
//!
//! What it is: a blade that the beam does not see (red plastic), a tab that has fallen off, a sensor that triggers on both
//! flanks, a broken wire.
//! What can go wrong: a channel at a wrong factor disagrees with the others and is flagged.
//! Units: 1, channel number.
//! Reference: Beharie 2013 section 5.7.1 (red blade); specification `rig.md`, faults.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeadRotorSpeed {
    /// Channel: 0 beam, 1 reflective, 2 hall, 3 encoder.
    pub channel: u8,
    /// Pulses for each mark: 0, a whole fraction of 1, or 2.
    pub factor: f64,
}

impl Effect for DeadRotorSpeed {
    const ID: &'static str = "dead_rotor_speed";
    const EQUATION: &'static str = "rpm_x = factor rpm";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { channel: (stream.uniform() * 3.0) as u8, factor: if stream.sign() > 0.0 { 0.5 } else { 2.0 } }
    }

    fn fit(&self, parts: &mut BenchParts) {
        if let Some(factor) = parts.geometry.factor.get_mut(usize::from(self.channel)) {
            *factor = self.factor;
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("channel", f64::from(self.channel), "1"), ("factor", self.factor, "1")]
    }
}
