//! `double_pulses`: a speed sensor sees a mark twice.
//!
//! What it is: the sensor rings: with a probability a mark gives a second edge a few degrees behind the first.
//! What can go wrong: with many second edges the board flags the channel.
//! Units: 1, channel number, deg.
//! Reference: Beharie 2013 section 5.7.1 and Fig. 5.14 (edges that ring).

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DoublePulses {
    /// Channel: 0 beam, 1 reflective, 2 hall, 3 encoder.
    pub channel: u8,
    /// Probability.
    pub probability: f64,
    /// Distance of the second edge, deg.
    #[serde(default = "four")]
    pub ring_deg: f64,
}

fn four() -> f64 {
    4.0
}

impl Effect for DoublePulses {
    const ID: &'static str = "double_pulses";
    const EQUATION: &'static str = "a mark of the channel gives a second edge with this probability";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { channel: (stream.uniform() * 3.0) as u8, probability: stream.log_between(0.005, 0.03), ring_deg: four() }
    }

    fn fit(&self, parts: &mut BenchParts) {
        if let Some(double) = parts.geometry.double.get_mut(usize::from(self.channel)) {
            *double = self.probability;
            parts.geometry.ring_deg = self.ring_deg;
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("channel", f64::from(self.channel), "1"), ("probability", self.probability, "1"), ("ring", self.ring_deg, "deg")]
    }
}
