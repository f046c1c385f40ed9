//! `gyro_temperature`: a regulator heats the board, and the gyro's zero follows.
//!
//! What it is: Newton's law of cooling under a constant power from an instant on; the zero moves with the temperature of the chip, whatever
//! warms it, and the chip measures that temperature as well.
//! What can go wrong: nothing.
//! Units: rad/s/K, K, s; body axes.
//! Reference: PS-ITG-3200A rev 1.4, table 3.1 (zero-rate output over temperature).

use super::{ImuEffect, ImuLevers, Instant, direction};
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GyroTemperature {
    /// Change of the zero, rad/s/K.
    pub per_kelvin_rad_s: [f64; 3],
    /// Temperature that is gained in the end, K.
    pub rise_k: f64,
    /// Time constant, s.
    pub tau_s: f64,
    /// When the regulator is switched on, s.
    pub t0_s: f64,
}

impl ImuEffect for GyroTemperature {
    const ID: &'static str = "gyro_temperature";
    const EQUATION: &'static str = "w += per_kelvin (temperature - 25 degC); temperature += rise (1 - exp(-(t - t0)/tau)) from t0";

    fn draw(stream: &mut Stream, run_s: f64) -> Self {
        let size = stream.log_between(2e-4, 1.8e-3);
        Self {
            per_kelvin_rad_s: direction(stream).map(|x| x * size),
            rise_k: stream.between(10.0, 20.0),
            tau_s: stream.between(20.0, 40.0),
            t0_s: run_s * stream.between(0.0, 0.2),
        }
    }

    fn act(&self, at: &Instant, levers: &mut ImuLevers) {
        let since = (at.run_s - self.t0_s).max(0.0);
        levers.warm_k += self.rise_k * (1.0 - libm::exp(-since / self.tau_s));
        for (sum, own) in levers.rate_per_k.iter_mut().zip(self.per_kelvin_rad_s) {
            *sum += own;
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        let [x, y, z] = self.per_kelvin_rad_s;
        vec![("per_kelvin_x", x, "rad/s/K"), ("per_kelvin_y", y, "rad/s/K"), ("per_kelvin_z", z, "rad/s/K")]
    }
}
