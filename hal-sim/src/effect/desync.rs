//! `desync`: the ESC loses the rotor's angle on a surge.
//!
//! What it is: a step of the throttle drives a surge of current beyond what the zero-crossing detection follows; the motor
//! coasts for a while and is then driven again.
//! What can go wrong: a surge below the steps of the schedule never happens; one below the noise stutters.
//! Units: A, s.
//! Reference: sensorless commutation, Hendershot & Miller 2010, 9.5. Not in the library of `ident`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Desync {
    /// Surge above the mean of the last tenth of a second, A.
    pub surge_a: f64,
    /// How long the motor coasts, s.
    pub coast_s: f64,
}

impl Effect for Desync {
    const ID: &'static str = "desync";
    const EQUATION: &'static str = "no drive for coast after a rise of the winding current by surge";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { surge_a: stream.between(1.5, 2.8), coast_s: stream.log_between(0.1, 0.5) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.plant.commutation.surge_a = self.surge_a;
        parts.plant.commutation.coast_s = self.coast_s;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("surge", self.surge_a, "A"), ("coast", self.coast_s, "s")]
    }
}
