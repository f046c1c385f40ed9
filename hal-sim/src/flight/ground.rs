//! The ground.
//!
//! What it is: a plane at z = 0 that pushes a point below it upwards, with a spring and a damper, and never pulls; without friction.
//! What can go wrong: a point far below the plane is thrown out of it; a fall at 10 m/s sinks in by less than 0.2 m.
//! Units: SI; earth NED, so that below ground z is positive.
//! Reference: specification `flight.md`, "The body"; stiffness and damping such that the body rests [`SINK_M`] deep and does not bounce.

use super::{G, Vector};

/// How deep a body at rest sinks in, m. With gravity it gives the frequency of the contact, sqrt(g/SINK_M) = 70 rad/s, of which a step
/// of 1 ms is a fourteenth.
const SINK_M: f64 = 2.0e-3;
/// Damping ratio of the contact: little bounce is left from 0.7 on.
const DAMPING: f64 = 0.7;

/// Spring and damper of one point of contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ground {
    stiffness_n_m: f64,
    damping_ns_m: f64,
}

impl Ground {
    /// For a body of `mass_kg` that stands on `points` of them.
    #[must_use]
    pub fn under(mass_kg: f64, points: usize) -> Self {
        let share = mass_kg / points.max(1) as f64;
        let frequency = (G / SINK_M).sqrt();
        Self { stiffness_n_m: share * frequency * frequency, damping_ns_m: 2.0 * DAMPING * share * frequency }
    }

    /// How deep the points lie at rest when the ground carries this share of the weight, m.
    #[must_use]
    pub fn rest_m(carried: f64) -> f64 {
        SINK_M * carried.clamp(0.0, 1.0)
    }

    /// Upward push on a point at depth `z` that moves down at `w`, N.
    #[must_use]
    pub fn push_n(&self, z: f64, w: f64) -> f64 {
        if z <= 0.0 { 0.0 } else { (self.stiffness_n_m * z + self.damping_ns_m * w).max(0.0) }
    }

    /// The same as a force in earth axes.
    #[must_use]
    pub fn push(&self, place: &Vector, velocity: &Vector) -> Vector {
        Vector::new(0.0, 0.0, -self.push_n(place.z, velocity.z))
    }
}
