//! `gain_change`: the load cell's slope changes during the run.
//!
//! What it is: a step (`gain_change` at `t0_s`), a drift (`rate_per_s`), or both; the excitation of the bridge moved.
//! What can go wrong: a step before the run is part of the calibration and shows nowhere.
//! Units: 1, 1/s, s.
//! Reference: specification `closing-the-loop.md`, `gain_change` (0.05 reads 5 % more).

use super::{Effect, Levers};
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainChange {
    /// Relative step.
    #[serde(default)]
    pub gain_change: f64,
    /// When it steps and the drift begins, s into the run.
    #[serde(default)]
    pub t0_s: f64,
    /// Relative drift, 1/s.
    #[serde(default)]
    pub rate_per_s: f64,
}

impl Effect for GainChange {
    const ID: &'static str = "gain_change";
    const EQUATION: &'static str = "thrust_n *= 1 + gain_change + rate * (t - t0) from t0";

    fn draw(stream: &mut Stream, run_s: f64) -> Self {
        Self {
            gain_change: stream.sign() * stream.log_between(0.01, 0.04),
            t0_s: run_s * stream.between(0.2, 0.7),
            rate_per_s: 0.0,
        }
    }

    fn act(&self, run_s: f64, levers: &mut Levers) {
        if run_s >= self.t0_s {
            levers.strain_gain *= 1.0 + self.gain_change + self.rate_per_s * (run_s - self.t0_s);
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("gain_change", self.gain_change, "1"), ("t0", self.t0_s, "s"), ("rate", self.rate_per_s, "1/s")]
    }
}
