//! `stationary_magnet`: a magnet lies in the room in which the board is carried about.
//!
//! What it is: a dipole at a place; the board meets its field where it is.
//! What can go wrong: a board that is not carried about (`walk_m`) sees a constant field, which is one with the earth's.
//! Units: A.m^2, m, earth NED.
//! Reference: Jackson, *Classical Electrodynamics*, section 5.6.

use super::{ImuEffect, ImuLevers, Instant, dipole, direction};
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StationaryMagnet {
    /// Magnetic moment, A.m^2.
    pub moment_am2: [f64; 3],
    /// Where it is, from the middle of the walk, m.
    pub place_m: [f64; 3],
}

impl ImuEffect for StationaryMagnet {
    const ID: &'static str = "stationary_magnet";
    const EQUATION: &'static str = "m += R^T dipole(moment, place of the board - place)";

    fn draw(stream: &mut Stream, _: f64) -> Self {
        let moment = stream.log_between(10.0, 40.0);
        let (s, c) = libm::sincos(stream.between(0.0, core::f64::consts::TAU));
        Self {
            moment_am2: direction(stream).map(|x| x * moment),
            place_m: [0.6 * c, 0.6 * s, stream.between(0.5, 0.8)],
        }
    }

    fn act(&self, at: &Instant, levers: &mut ImuLevers) {
        let away = core::array::from_fn(|i| at.place_m[i] - self.place_m[i]);
        for (sum, own) in levers.room_field.iter_mut().zip(dipole(self.moment_am2, away)) {
            *sum += own;
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        Vec::new()
    }
}
