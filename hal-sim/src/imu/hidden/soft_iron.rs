//! `soft_iron`: a lump of iron beside the magnetometer.
//!
//! What it is: a ball that the field magnetises: a uniform field B makes of it a dipole with the field k (R/r)^3 (3 (B.u) u - B) at
//! distance r, with k = (mu - 1)/(mu + 2).
//! What can go wrong: the ball must be farther than its radius.
//! Units: m, body axes; 1.
//! Reference: Jackson, *Classical Electrodynamics*, section 5.11 (sphere in a uniform field).

use super::{ImuEffect, ImuLevers, Instant, direction, dot};
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SoftIron {
    /// Radius, m.
    pub radius_m: f64,
    /// Relative permeability.
    pub permeability: f64,
    /// The magnetometer, seen from its centre, m.
    pub away_m: [f64; 3],
}

impl SoftIron {
    /// What it adds of the field.
    fn matrix(&self) -> [[f64; 3]; 3] {
        let r = libm::sqrt(dot(self.away_m, self.away_m)).max(self.radius_m);
        let u = self.away_m.map(|x| x / r);
        let size = (self.permeability - 1.0) / (self.permeability + 2.0) * (self.radius_m / r).powi(3);
        core::array::from_fn(|i| core::array::from_fn(|j| size * (3.0 * u[i] * u[j] - f64::from(u8::from(i == j)))))
    }
}

impl ImuEffect for SoftIron {
    const ID: &'static str = "soft_iron";
    const EQUATION: &'static str = "m += k (R/r)^3 (3 (m.u) u - m), body axes";

    fn draw(stream: &mut Stream, _: f64) -> Self {
        let away = direction(stream);
        let distance = stream.between(0.03, 0.06);
        let share = stream.log_between(0.03, 0.12);
        Self {
            radius_m: distance * libm::cbrt(share),
            permeability: stream.log_between(100.0, 2000.0),
            away_m: away.map(|x| x * distance),
        }
    }

    fn act(&self, _: &Instant, levers: &mut ImuLevers) {
        for (row, own) in levers.iron.iter_mut().flatten().zip(self.matrix().into_iter().flatten()) {
            *row += own;
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        let [[xx, xy, xz], [yx, yy, yz], [zx, zy, _]] = self.matrix();
        let names = ["s_xy", "s_xz", "s_yx", "s_yz", "s_zx", "s_zy", "s_xx", "s_yy"];
        names.into_iter().zip([xy, xz, yx, yz, zx, zy, xx, yy]).map(|(name, value)| (name, value, "1")).collect()
    }
}
