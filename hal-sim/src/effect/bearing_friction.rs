//! `bearing_friction`: extra drag on the shaft from a moment on.
//!
//! What it is: a constant and a viscous torque against the rotor: more current and less speed at the same pulse.
//! What can go wrong: the torque arm shows it only where the dragging part is not carried by the arm (`share`).
//! Units: N.m, N.m.s/rad, s, 0..1.
//! Reference: errata 2.22-2.24 (bearing friction is internal to the motor).

use super::{Effect, Levers};
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BearingFriction {
    /// Constant torque, N.m.
    pub constant_nm: f64,
    /// Torque per speed, N.m.s/rad.
    #[serde(default)]
    pub viscous_nms: f64,
    /// Onset, s into the run.
    #[serde(default)]
    pub t0_s: f64,
    /// Share that the torque arm sees, 0..1.
    #[serde(default)]
    pub share: f64,
}

impl Effect for BearingFriction {
    const ID: &'static str = "bearing_friction";
    const EQUATION: &'static str = "motor torque += constant + viscous * w from t0; torque_nm += share of it";

    fn draw(stream: &mut Stream, run_s: f64) -> Self {
        Self {
            constant_nm: stream.log_between(2.0e-3, 6.0e-3),
            viscous_nms: stream.between(0.0, 5.0e-6),
            t0_s: run_s * stream.between(0.2, 0.7),
            share: 0.0,
        }
    }

    fn act(&self, run_s: f64, levers: &mut Levers) {
        if run_s >= self.t0_s {
            levers.plant.drag_nm += self.constant_nm;
            levers.plant.drag_nms += self.viscous_nms;
            levers.plant.drag_share = self.share;
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![
            ("constant", self.constant_nm, "N.m"),
            ("viscous", self.viscous_nms, "N.m.s/rad"),
            ("t0", self.t0_s, "s"),
            ("share", self.share, "1"),
        ]
    }
}
