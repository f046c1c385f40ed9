//! `gyro_bias`: the gyro's zero jumps.
//!
//! What it is: a knock lets a stress in the package go; from then on the zero is another one.
//! What can go wrong: without rest before and after nobody sees it.
//! Units: rad/s, body axes; s.
//! Reference: IEEE Std 952, in-run bias.

use super::{ImuEffect, ImuLevers, Instant, direction};
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GyroBias {
    /// Jump, rad/s.
    pub step_rad_s: [f64; 3],
    /// When, s.
    pub t0_s: f64,
}

impl ImuEffect for GyroBias {
    const ID: &'static str = "gyro_bias";
    const EQUATION: &'static str = "w += step from t0";

    fn draw(stream: &mut Stream, run_s: f64) -> Self {
        let size = stream.log_between(0.002, 0.018);
        Self { step_rad_s: direction(stream).map(|x| x * size), t0_s: run_s * stream.between(0.3, 0.7) }
    }

    fn act(&self, at: &Instant, levers: &mut ImuLevers) {
        if at.run_s >= self.t0_s {
            for (sum, own) in levers.rate.iter_mut().zip(self.step_rad_s) {
                *sum += own;
            }
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        let [x, y, z] = self.step_rad_s;
        vec![("step_x", x, "rad/s"), ("step_y", y, "rad/s"), ("step_z", z, "rad/s"), ("t0", self.t0_s, "s")]
    }
}
