//! `arm_friction`: the torque arm's bearing sticks.
//!
//! What it is: dry friction holds back the last part of each change of torque, so that the reading on the way up is low and
//! on the way down high.
//! What can go wrong: below the friction nothing is read at all.
//! Units: N.m.
//! Reference: Jenkins element; the thrust beam's own is `hysteresis`. Not in the library of `ident`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArmFriction {
    /// Moment that it holds back, N.m.
    pub friction_nm: f64,
}

impl Effect for ArmFriction {
    const ID: &'static str = "arm_friction";
    const EQUATION: &'static str = "torque_nm read = torque - held, |held| <= friction";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { friction_nm: stream.log_between(1.5e-3, 6.0e-3) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.mount.arm_friction_nm = self.friction_nm;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("friction", self.friction_nm, "N.m")]
    }
}
