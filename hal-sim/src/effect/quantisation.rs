//! `quantisation`: the thrust channel has coarse steps.
//!
//! What it is: a digital conditioner with few bits.
//! What can go wrong: noise behind it blurs the steps.
//! Units: N.
//! Reference: specification `closing-the-loop.md`, `quantisation`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quantisation {
    /// Step, N.
    pub step_n: f64,
}

impl Effect for Quantisation {
    const ID: &'static str = "quantisation";
    const EQUATION: &'static str = "thrust_n = step * round(thrust / step)";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { step_n: stream.log_between(0.05, 0.2) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.bridge.meter.step_v = self.step_n * parts.bridge.volt_per_newton * parts.bridge.divider;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("step", self.step_n, "N")]
    }
}
