//! `missed_pulses`: a speed sensor does not see every mark.
//!
//! What it is: each mark of one channel is missed with a probability; the capture unit sees a longer period.
//! What can go wrong: with many marks missing the board calls the channel lost.
//! Units: 1, channel number.
//! Reference: specification `closing-the-loop.md`, `missed_pulses`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MissedPulses {
    /// Channel: 0 beam, 1 reflective, 2 hall, 3 encoder.
    pub channel: u8,
    /// Probability.
    pub probability: f64,
}

impl Effect for MissedPulses {
    const ID: &'static str = "missed_pulses";
    const EQUATION: &'static str = "a mark of the channel gives no edge with this probability";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { channel: (stream.uniform() * 3.0) as u8, probability: stream.log_between(0.005, 0.03) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        if let Some(miss) = parts.geometry.miss.get_mut(usize::from(self.channel)) {
            *miss = self.probability;
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("channel", f64::from(self.channel), "1"), ("probability", self.probability, "1")]
    }
}
