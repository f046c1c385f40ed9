//! `blade_twist`: the light beam over-reads at high speed.
//!
//! What it is: above the onset the blade twists so far that its edge cuts the beam a second time on some passes, more often
//! the faster it turns.
//! What can go wrong: the board flags the channel where a reading holds such a cut.
//! Units: rev/min, 1.
//! Reference: Beharie 2013 section 5.7.1, Fig. 5.54-5.55. Whole revolutions of the same mark cancel any constant twist, so
//! extra edges are the only way to over-read.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BladeTwist {
    /// Speed above which it happens, rev/min.
    pub onset_rpm: f64,
    /// Probability of the second cut at twice that speed.
    pub probability: f64,
}

impl Effect for BladeTwist {
    const ID: &'static str = "blade_twist";
    const EQUATION: &'static str = "a blade gives a second edge with probability (rpm / onset - 1) above the onset";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { onset_rpm: stream.between(3500.0, 4800.0), probability: stream.log_between(0.05, 0.3) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.geometry.twist_onset_rpm = self.onset_rpm;
        parts.geometry.twist = self.probability;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("onset", self.onset_rpm, "rpm"), ("probability", self.probability, "1")]
    }
}
