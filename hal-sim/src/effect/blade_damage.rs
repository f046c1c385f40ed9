//! `blade_damage`: a blade loses part of its tip at a moment of the run.
//!
//! What it is: a step in the thrust and torque coefficients.
//! What can go wrong: the unbalance that real damage brings is an effect of the beam and not part of this one.
//! Units: relative change, s.
//! Reference: specification `closing-the-loop.md`, `blade_damage`.

use super::{Effect, Levers};
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BladeDamage {
    /// Relative change of the thrust coefficient; negative is a loss.
    pub thrust_change: f64,
    /// Relative change of the torque coefficient.
    pub torque_change: f64,
    /// Onset, s into the run.
    pub t0_s: f64,
}

impl Effect for BladeDamage {
    const ID: &'static str = "blade_damage";
    const EQUATION: &'static str = "thrust_n *= 1 + thrust_change and torque_nm *= 1 + torque_change from t0";

    fn draw(stream: &mut Stream, run_s: f64) -> Self {
        let thrust_change = -stream.log_between(0.02, 0.06);
        Self { thrust_change, torque_change: thrust_change * stream.between(0.4, 0.8), t0_s: run_s * stream.between(0.2, 0.7) }
    }

    fn act(&self, run_s: f64, levers: &mut Levers) {
        if run_s >= self.t0_s {
            levers.plant.thrust_factor *= 1.0 + self.thrust_change;
            levers.plant.torque_factor *= 1.0 + self.torque_change;
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![
            ("thrust_change", self.thrust_change, "1"),
            ("torque_change", self.torque_change, "1"),
            ("t0", self.t0_s, "s"),
        ]
    }
}
