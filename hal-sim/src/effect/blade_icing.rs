//! `blade_icing`: ice (or dirt) grows on the blades.
//!
//! What it is: a layer grows from a moment on: its mass adds inertia and, growing unevenly, unbalance; its roughness costs
//! lift and adds drag.
//! What can go wrong: the layer stops growing at the cap.
//! Units: g/s, g, s.
//! Reference: roughness of an iced section, Bragg, Broeren & Blumenthal 2005, *Iced-airfoil aerodynamics*: lift -10 to -30 %,
//! drag doubled. Not in the library of `ident`.

use super::{Effect, Levers};
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Radius of an 11 inch propeller, m.
const RADIUS_M: f64 = 0.1397;

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BladeIcing {
    /// Growth of both blades together, g/s.
    pub rate_g_per_s: f64,
    /// Mass at which it breaks off and stays, g.
    pub cap_g: f64,
    /// Onset, s into the run.
    #[serde(default)]
    pub t0_s: f64,
}

impl Effect for BladeIcing {
    const ID: &'static str = "blade_icing";
    const EQUATION: &'static str = "m' = rate from t0; thrust_n *= 1 - 0.15 m, torque_nm *= 1 + 0.3 m, J += m R^2/2, unbalance += 0.05 m R/2 (m in g)";

    fn draw(stream: &mut Stream, run_s: f64) -> Self {
        let cap_g = stream.between(0.3, 1.0);
        Self { rate_g_per_s: cap_g / (run_s * stream.between(0.2, 0.5)), cap_g, t0_s: run_s * stream.between(0.1, 0.4) }
    }

    fn act(&self, run_s: f64, levers: &mut Levers) {
        let grams = (self.rate_g_per_s * (run_s - self.t0_s)).clamp(0.0, self.cap_g);
        levers.plant.thrust_factor *= (1.0 - 0.15 * grams).max(0.2);
        levers.plant.torque_factor *= 1.0 + 0.3 * grams;
        levers.plant.inertia_kgm2 += 0.5e-3 * grams * RADIUS_M * RADIUS_M;
        levers.unbalance_kgm += 0.05e-3 * grams * 0.5 * RADIUS_M;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("rate", self.rate_g_per_s, "g/s"), ("cap", self.cap_g, "g"), ("t0", self.t0_s, "s")]
    }
}
