//! `linear_acceleration`: a hand swings the board to and fro.
//!
//! What it is: each swing starts and ends at rest where it began, place = reach (1 - cos)/2 along a line; whole swings only.
//! What can go wrong: slower than the attitude's average of the force it hides in the attitude.
//! Units: m, Hz, s; earth NED.
//! Reference: acceleration as the second derivative of the place.

use super::{ImuEffect, ImuLevers, Instant, direction};
use crate::noise::Stream;
use core::f64::consts::TAU;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinearAcceleration {
    /// From one end of the swing to the other, m.
    pub reach_m: [f64; 3],
    /// Swings in a second, Hz.
    pub swing_hz: f64,
    /// When the first begins, s.
    pub t0_s: f64,
    /// How many there are.
    pub swings: u32,
}

impl ImuEffect for LinearAcceleration {
    const ID: &'static str = "linear_acceleration";
    const EQUATION: &'static str = "f += R^T reach/2 (2 pi f)^2 cos(2 pi f (t - t0)), whole swings from t0";

    fn draw(stream: &mut Stream, run_s: f64) -> Self {
        let swing_hz = stream.between(0.6, 1.8);
        let amplitude = stream.log_between(0.5, 2.0); // m/s^2
        let line = direction(stream);
        let t0_s = run_s * stream.between(0.15, 0.3);
        let w = TAU * swing_hz;
        Self {
            reach_m: line.map(|x| 2.0 * x * amplitude / (w * w)),
            swing_hz,
            t0_s,
            swings: (run_s * stream.between(0.4, 0.6) * swing_hz) as u32,
        }
    }

    fn act(&self, at: &Instant, levers: &mut ImuLevers) {
        let turns = (at.run_s - self.t0_s) * self.swing_hz;
        if (0.0..f64::from(self.swings)).contains(&turns) {
            let w = TAU * self.swing_hz;
            let now = 0.5 * w * w * libm::cos(TAU * turns);
            for (sum, reach) in levers.carried.iter_mut().zip(self.reach_m) {
                *sum += reach * now;
            }
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        Vec::new()
    }
}
