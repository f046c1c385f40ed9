//! `stator_saturation`: the stator's teeth saturate.
//!
//! What it is: from a moment on (a shorted stack, a lamination that has come loose) the iron carries less flux at high
//! current: the torque constant falls with it.
//! What can go wrong: from the start of the run a static fit absorbs it whole.
//! Units: A, s.
//! Reference: saturation of the teeth, Hendershot & Miller 2010, chapter 3. Not in the library of `ident`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StatorSaturation {
    /// Winding current at which 29 % of the torque constant is gone, A.
    pub current_a: f64,
}

impl Effect for StatorSaturation {
    const ID: &'static str = "stator_saturation";
    const EQUATION: &'static str = "K = K0 / sqrt(1 + (I/current)^2)";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { current_a: stream.log_between(15.0, 40.0) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.plant.flux.saturation_a = self.current_a;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("current", self.current_a, "A")]
    }
}
