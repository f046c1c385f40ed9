//! `magnet_heat`: the rotor's magnets heat up and lose flux.
//!
//! What it is: motor losses warm the magnets; their flux falls with temperature, and beyond a knee part of it does not come
//! back.
//! What can go wrong: nothing; the flux keeps a floor.
//! Units: K/W, s, degC, 1/K.
//! Reference: NdFeB loses 0.11 %/K reversibly; demagnetisation beyond the knee, Hendershot & Miller 2010, chapter 3. Not in
//! the library of `ident`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MagnetHeat {
    /// Rise of the magnets for each watt of loss, K/W.
    pub rise_k_per_w: f64,
    /// Time constant, s.
    pub tau_s: f64,
    /// Reversible loss, 1/K.
    #[serde(default = "ndfeb")]
    pub loss_per_k: f64,
    /// Temperature from which flux is lost for good, degC.
    #[serde(default = "knee")]
    pub knee_c: f64,
    /// Share lost for good for each kelvin beyond, 1/K.
    #[serde(default)]
    pub knee_loss_per_k: f64,
}

fn ndfeb() -> f64 {
    1.1e-3
}

fn knee() -> f64 {
    1.0e9
}

impl Effect for MagnetHeat {
    const ID: &'static str = "magnet_heat";
    const EQUATION: &'static str = "K = K0 (1 - loss (T - T0)) (1 - lost), T from the motor's losses";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { rise_k_per_w: stream.between(3.0, 8.0), tau_s: stream.log_between(15.0, 60.0), loss_per_k: ndfeb(), knee_c: 50.0, knee_loss_per_k: 2.0e-3 }
    }

    fn fit(&self, parts: &mut BenchParts) {
        let flux = &mut parts.plant.flux;
        (flux.rise_k_per_w, flux.tau_s, flux.loss_per_k) = (self.rise_k_per_w, self.tau_s, self.loss_per_k);
        (flux.knee_c, flux.knee_loss_per_k) = (self.knee_c, self.knee_loss_per_k);
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("rise", self.rise_k_per_w, "K/W"), ("tau", self.tau_s, "s"), ("loss", self.loss_per_k, "1/K"), ("knee", self.knee_c, "degC"), ("knee_loss", self.knee_loss_per_k, "1/K")]
    }
}
