//! `air_density`: the air grows thinner as the room warms.
//!
//! What it is: room temperature drifts, the logged temperature with it, and thrust and torque follow the density of an ideal gas.
//! What can go wrong: a room that keeps its temperature shows nothing.
//! Units: K/s.
//! Reference: ideal gas law; ISO 2533.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AirDensity {
    /// Rate of the room temperature, K/s.
    pub room_rate_k_per_s: f64,
}

impl Effect for AirDensity {
    const ID: &'static str = "air_density";
    const EQUATION: &'static str = "thrust_n, torque_nm *= T0 / T(t), T in kelvin";

    fn draw(stream: &mut Stream, run_s: f64) -> Self {
        Self { room_rate_k_per_s: stream.sign() * stream.between(6.0, 15.0) / run_s }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.plant.air_follows_room = true;
        parts.plant.thermal.ambient_rate_k_per_s += self.room_rate_k_per_s;
        parts.plant.thermal.tau_s = parts.plant.thermal.tau_s.min(5.0);
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("room_rate", self.room_rate_k_per_s, "K/s"), ("exponent", 1.0, "1")]
    }
}
