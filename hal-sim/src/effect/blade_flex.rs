//! `blade_flex`: the blades bend at high speed.
//!
//! What it is: above the onset thrust falls short of the square law, and torque by half as much.
//! What can go wrong: an onset above the run's highest speed shows nowhere.
//! Units: rev/min, 1.
//! Reference: Beharie 2013 section 2.4 (aero-elastic blades).

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BladeFlex {
    /// Speed above which they bend, rev/min.
    pub onset_rpm: f64,
    /// Loss of thrust at twice that speed, 0..1.
    pub loss: f64,
    /// Exponent of the loss.
    pub exponent: f64,
}

impl Effect for BladeFlex {
    const ID: &'static str = "blade_flex";
    const EQUATION: &'static str = "thrust_n *= 1 - loss * (rpm / onset - 1)^exponent above the onset";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { onset_rpm: stream.between(2800.0, 4200.0), loss: stream.between(0.1, 0.4), exponent: stream.between(1.2, 2.0) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.plant.blade.flex_onset_rpm = self.onset_rpm;
        parts.plant.blade.flex_loss = self.loss;
        parts.plant.blade.flex_exponent = self.exponent;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        // a verdict's `exponent` is one of the speed, this one of the speed's excess
        vec![("onset", self.onset_rpm, "rpm"), ("loss", self.loss, "1"), ("excess_exponent", self.exponent, "1")]
    }
}
