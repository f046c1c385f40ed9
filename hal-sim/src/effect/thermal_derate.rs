//! `thermal_derate`: the ESC gives less when it is hot.
//!
//! What it is: a first-order heat state driven by the square of the current reduces the duty cycle.
//! What can go wrong: the output never falls below 35 % (protection C).
//! Units: s, share of the output at 7 A.
//! Reference: Beharie 2013 Appendix C, protection C; lumped-capacitance heating.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThermalDerate {
    /// Time constant of the heat, s.
    pub tau_s: f64,
    /// Share of the output that is lost in the long run at 7 A.
    pub loss_at_7a: f64,
}

impl Effect for ThermalDerate {
    const ID: &'static str = "thermal_derate";
    const EQUATION: &'static str = "duty *= 1 - loss * heat / 49 A^2, tau * d(heat)/dt + heat = current_a^2";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { tau_s: stream.between(20.0, 60.0), loss_at_7a: stream.log_between(0.01, 0.05) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.plant.limiter.derate_tau_s = self.tau_s;
        parts.plant.limiter.derate_per_a2 = self.loss_at_7a / 49.0;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("tau", self.tau_s, "s"), ("loss_at_7a", self.loss_at_7a, "1")]
    }
}
