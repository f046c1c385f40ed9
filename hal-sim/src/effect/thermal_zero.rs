//! `thermal_zero`: the bridge's zero moves with temperature.
//!
//! What it is: an uncompensated bridge on a rig that the motor warms and whose room drifts; the temperature is logged.
//! What can go wrong: with a run much shorter than the warm-up time it looks like a drift in time.
//! Units: N/K, K/W, K/s, s.
//! Reference: Beharie 2013 section 5.3 and Table 6 (gauge temperature coefficient 10.8 or 11.7 ppm/K, errata "App. B").

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThermalZero {
    /// Zero shift per kelvin, N/K.
    pub coefficient_n_per_k: f64,
    /// Rise of the rig per watt of motor loss, K/W.
    pub rise_k_per_w: f64,
    /// Time constant of the warm-up, s.
    pub tau_s: f64,
    /// Rate of the room temperature, K/s.
    #[serde(default)]
    pub ambient_rate_k_per_s: f64,
}

impl Effect for ThermalZero {
    const ID: &'static str = "thermal_zero";
    const EQUATION: &'static str = "thrust_n += coefficient * (temp_c - start)";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self {
            coefficient_n_per_k: stream.sign() * stream.log_between(0.004, 0.012),
            rise_k_per_w: stream.between(2.5, 4.0),
            tau_s: stream.between(50.0, 120.0),
            ambient_rate_k_per_s: stream.between(-0.005, 0.005),
        }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.bridge.zero_n_per_k = self.coefficient_n_per_k;
        parts.bridge.zero_temperature_c = parts.plant.thermal.ambient_c;
        parts.plant.thermal.rise_k_per_w = self.rise_k_per_w;
        parts.plant.thermal.tau_s = self.tau_s;
        parts.plant.thermal.ambient_rate_k_per_s = self.ambient_rate_k_per_s;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![
            ("coefficient", self.coefficient_n_per_k, "N/K"),
            ("rise", self.rise_k_per_w, "K/W"),
            ("tau", self.tau_s, "s"),
            ("ambient_rate", self.ambient_rate_k_per_s, "K/s"),
        ]
    }
}
