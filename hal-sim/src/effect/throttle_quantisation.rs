//! `throttle_quantisation`: the ESC reads its pulse in coarse steps.
//!
//! What it is: the throttle input is rounded down to a multiple of the step above 1000 us.
//! What can go wrong: a schedule on multiples of the step shows nothing.
//! Units: us.
//! Reference: specification `closing-the-loop.md`, `throttle_quantisation`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThrottleQuantisation {
    /// Step, us.
    pub step_us: f64,
}

impl Effect for ThrottleQuantisation {
    const ID: &'static str = "throttle_quantisation";
    const EQUATION: &'static str = "pulse = 1000 + step * floor((pulse_us - 1000) / step)";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { step_us: stream.between(8.0, 24.0) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.plant.limiter.step_us = self.step_us;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("step", self.step_us, "us")]
    }
}
