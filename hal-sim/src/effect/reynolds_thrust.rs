//! `reynolds_thrust`: the thrust coefficient varies with the Reynolds number.
//!
//! What it is: a power of the rotor speed on the coefficient, 1 at 4100 rev/min.
//! What can go wrong: over a narrow range of speed a square law hides it.
//! Units: 1.
//! Reference: Deters, Ananda & Selig 2014, small propellers.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReynoldsThrust {
    /// Exponent of the Reynolds number.
    pub exponent: f64,
}

impl Effect for ReynoldsThrust {
    const ID: &'static str = "reynolds_thrust";
    const EQUATION: &'static str = "thrust_n *= (rpm / 4100)^exponent";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { exponent: stream.log_between(0.04, 0.15) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.plant.blade.reynolds_exponent = self.exponent;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("exponent", self.exponent, "1")]
    }
}
