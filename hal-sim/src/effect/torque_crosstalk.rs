//! `torque_crosstalk`: the load cell feels the torque arm.
//!
//! What it is: part of the torque bends the thrust beam, from a moment on.
//! What can go wrong: torque and thrust are both square in speed: without an onset the fit of thrust absorbs it.
//! Units: N/(N.m), s.
//! Reference: specification `closing-the-loop.md`, `torque_crosstalk`.

use super::{Effect, Levers};
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TorqueCrosstalk {
    /// Lift read per torque, N/(N.m).
    pub coefficient_n_per_nm: f64,
    /// Onset, s into the run.
    #[serde(default)]
    pub t0_s: f64,
}

impl Effect for TorqueCrosstalk {
    const ID: &'static str = "torque_crosstalk";
    const EQUATION: &'static str = "thrust_n += coefficient * torque_nm from t0";

    fn draw(stream: &mut Stream, run_s: f64) -> Self {
        Self { coefficient_n_per_nm: stream.sign() * stream.log_between(1.0, 3.0), t0_s: run_s * stream.between(0.2, 0.7) }
    }

    fn act(&self, run_s: f64, levers: &mut Levers) {
        if run_s >= self.t0_s {
            levers.torque_to_lift += self.coefficient_n_per_nm;
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("coefficient", self.coefficient_n_per_nm, "N/(N.m)"), ("t0", self.t0_s, "s")]
    }
}
