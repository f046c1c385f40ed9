//! `clock_drift`: thrust and torque come from a logger whose clock runs slow.
//!
//! What it is: the logger plays both channels back later and later.
//! What can go wrong: a clock that runs fast would have to know the future and is refused.
//! Units: 1 (seconds late a second).
//! Reference: frequency tolerance of two free-running oscillators.

use super::{Effect, Levers};
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClockDrift {
    /// Seconds late a second, not negative.
    #[serde(deserialize_with = "crate::number::not_negative")]
    pub rate: f64,
}

impl Effect for ClockDrift {
    const ID: &'static str = "clock_drift";
    const EQUATION: &'static str = "reading(t) = truth(t - rate t) on thrust_n and torque_nm";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { rate: stream.log_between(1.5e-3, 8.0e-3) }
    }

    fn act(&self, run_s: f64, levers: &mut Levers) {
        levers.late_s += self.rate * run_s;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("rate", self.rate, "1")]
    }
}
