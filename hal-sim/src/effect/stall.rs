//! `stall`: the blades stall above a speed.
//!
//! What it is: above the onset the stall spreads from the tip inboard: stalled sections keep part of their lift and drag
//! more.
//! What can go wrong: an onset above the run's highest speed shows nowhere.
//! Units: rev/min, 1.
//! Reference: Leishman 2006, *Principles of Helicopter Aerodynamics*, 7.1; lift grows with r^2, torque with r^3 along the
//! blade.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stall {
    /// Speed at which the tip stalls, rev/min.
    pub onset_rpm: f64,
    /// Share of lift that a stalled section loses.
    pub loss: f64,
    /// Share by which its drag grows.
    #[serde(default)]
    pub rise: f64,
}

impl Effect for Stall {
    const ID: &'static str = "stall";
    const EQUATION: &'static str = "thrust_n *= 1 - loss (1 - r^3), torque_nm *= 1 + rise (1 - r^4), r = onset / rpm, above the onset";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { onset_rpm: stream.between(3800.0, 4900.0), loss: stream.between(0.2, 0.5), rise: stream.between(0.1, 0.4) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.plant.blade.stall_onset_rpm = self.onset_rpm;
        parts.plant.blade.stall_loss = self.loss;
        parts.plant.blade.stall_rise = self.rise;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("onset", self.onset_rpm, "rpm"), ("loss", self.loss, "1"), ("rise", self.rise, "1")]
    }
}
