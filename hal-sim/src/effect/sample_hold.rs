//! `sample_hold`: the thrust channel repeats old values.
//!
//! What it is: a digital conditioner that converts at its own slow rate.
//! What can go wrong: plateaus stay where they were; only the time after a step shows it.
//! Units: s.
//! Reference: specification `closing-the-loop.md`, `sample_hold`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SampleHold {
    /// Time between two conversions, s.
    pub period_s: f64,
}

impl Effect for SampleHold {
    const ID: &'static str = "sample_hold";
    const EQUATION: &'static str = "thrust_n holds its last value for a period";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { period_s: stream.log_between(0.7, 2.5) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.bridge.meter.hold_s = self.period_s;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("period", self.period_s, "s")]
    }
}
