//! `hard_iron`: something magnetised is stuck to the board during the run.
//!
//! What it is: a dipole that travels with the magnetometer.
//! What can go wrong: closer than a centimetre it is no dipole any more.
//! Units: A.m^2, m in body axes, s.
//! Reference: Jackson, *Classical Electrodynamics*, section 5.6.

use super::{ImuEffect, ImuLevers, Instant, dipole, direction};
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HardIron {
    /// Magnetic moment, A.m^2.
    pub moment_am2: [f64; 3],
    /// The magnetometer, seen from it, m.
    pub away_m: [f64; 3],
    /// When it is stuck on, s.
    pub t0_s: f64,
}

impl HardIron {
    /// Its field at the magnetometer, gauss.
    fn field(&self) -> [f64; 3] {
        dipole(self.moment_am2, self.away_m)
    }
}

impl ImuEffect for HardIron {
    const ID: &'static str = "hard_iron";
    const EQUATION: &'static str = "m += dipole(moment, away), body axes, from t0";

    fn draw(stream: &mut Stream, run_s: f64) -> Self {
        let (axis, away) = (direction(stream), direction(stream));
        let distance = stream.between(0.03, 0.08);
        // between 1.5 and 6 uT at its pole
        let moment = stream.log_between(0.015, 0.06) * distance.powi(3) / 2e-3;
        Self {
            moment_am2: axis.map(|x| x * moment),
            away_m: away.map(|x| x * distance),
            t0_s: run_s * stream.between(0.3, 0.7),
        }
    }

    fn act(&self, at: &Instant, levers: &mut ImuLevers) {
        if at.run_s >= self.t0_s {
            for (sum, own) in levers.body_field.iter_mut().zip(self.field()) {
                *sum += own;
            }
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        let [x, y, z] = self.field().map(|gauss| gauss * 100.0);
        vec![("offset_x", x, "uT"), ("offset_y", y, "uT"), ("offset_z", z, "uT"), ("t0", self.t0_s, "s")]
    }
}
