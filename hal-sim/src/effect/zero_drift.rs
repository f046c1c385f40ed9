//! `zero_drift`: the strain amplifier's zero drifts with time.
//!
//! What it is: a constant rate from a moment on.
//! What can go wrong: on an upward staircase time, pulse and heat rise together.
//! Units: N/s, s.
//! Reference: specification `closing-the-loop.md`, `zero_drift`.

use super::{Effect, Levers};
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ZeroDrift {
    /// Rate, N/s.
    pub rate_n_per_s: f64,
    /// Onset, s into the run.
    #[serde(default)]
    pub t0_s: f64,
}

impl Effect for ZeroDrift {
    const ID: &'static str = "zero_drift";
    const EQUATION: &'static str = "thrust_n += rate * (t - t0)";

    fn draw(stream: &mut Stream, run_s: f64) -> Self {
        Self { rate_n_per_s: stream.sign() * stream.log_between(0.05, 0.2) / run_s, t0_s: 0.0 }
    }

    fn act(&self, run_s: f64, levers: &mut Levers) {
        levers.strain_zero_n += self.rate_n_per_s * (run_s - self.t0_s).max(0.0);
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("rate", self.rate_n_per_s, "N/s"), ("t0", self.t0_s, "s")]
    }
}
