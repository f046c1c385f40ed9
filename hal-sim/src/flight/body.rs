//! A rigid body in time.
//!
//! What it is: mass and inertia tensor under forces in earth axes and moments in body axes, with the spin of its rotors; classical
//! Runge-Kutta of fourth order with the quaternion as attitude, so that no attitude is singular.
//! What can go wrong: nothing fails. The error of a step of h is of order h^5, that of a flight of order h^4 (tests).
//! Units: SI; earth NED for place and velocity, body FRD for rate and moments.
//! Reference: errata 2.12, 2.46-2.54 (Euler's equations corrected), 2.19-2.20 (moment of the rotors' spin: -rate x H); Hairer, Norsett
//! & Wanner 1993, II.1.

use super::{Matrix, Rotation, Vector, attitude};
use nalgebra::{Quaternion, Unit};

/// Mass and its distribution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidBody {
    mass_kg: f64,
    inertia: Matrix,
    inverse: Matrix,
}

/// Where a body is and how it moves: the twelve states of the thesis, with a quaternion for the three angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Place, earth NED, m.
    pub place: Vector,
    /// Velocity over ground, earth NED, m/s.
    pub velocity: Vector,
    /// Attitude, body to earth.
    pub attitude: Rotation,
    /// Angular rate, body FRD, rad/s.
    pub rate: Vector,
}

impl Default for Motion {
    /// At rest at the origin, level, nose to the north.
    fn default() -> Self {
        Self { place: Vector::zeros(), velocity: Vector::zeros(), attitude: Rotation::identity(), rate: Vector::zeros() }
    }
}

/// What acts on the body at one instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Acting {
    /// Force, earth NED, N, weight included.
    pub force: Vector,
    /// Moment, body FRD, N.m, reaction of the rotors included.
    pub moment: Vector,
    /// Spin of the rotors along body z, N.m.s.
    pub spin: f64,
}

/// Rates of change of a motion.
#[derive(Clone, Copy)]
struct Change {
    velocity: Vector,
    acceleration: Vector,
    turning: Quaternion<f64>,
    angular: Vector,
}

impl RigidBody {
    /// A body of `mass_kg` and `inertia` (kg.m^2, about its centre of gravity); `None` where the mass or a principal moment is not
    /// above zero, or the tensor is not symmetric.
    #[must_use]
    pub fn new(mass_kg: f64, inertia: Matrix) -> Option<Self> {
        let sound = mass_kg.is_finite() && mass_kg > 0.0 && inertia == inertia.transpose();
        let inverse = inertia.cholesky().filter(|_| sound)?.inverse();
        Some(Self { mass_kg, inertia, inverse })
    }

    /// Mass, kg.
    #[must_use]
    pub fn mass_kg(&self) -> f64 {
        self.mass_kg
    }

    /// Inertia tensor about the centre of gravity, kg.m^2.
    #[must_use]
    pub fn inertia(&self) -> &Matrix {
        &self.inertia
    }

    /// Angular momentum in earth axes with a rotor spin of `spin` along body z, N.m.s.
    #[must_use]
    pub fn angular_momentum(&self, motion: &Motion, spin: f64) -> Vector {
        motion.attitude * (self.inertia * motion.rate + Vector::z() * spin)
    }

    /// Energy of motion, J, that of the rotors' spin left out.
    #[must_use]
    pub fn kinetic_energy(&self, motion: &Motion) -> f64 {
        0.5 * (self.mass_kg * motion.velocity.norm_squared() + motion.rate.dot(&(self.inertia * motion.rate)))
    }

    /// Angular acceleration, body axes, rad/s^2.
    #[must_use]
    pub fn angular_acceleration(&self, rate: &Vector, acting: &Acting) -> Vector {
        let momentum = self.inertia * rate + Vector::z() * acting.spin;
        self.inverse * (acting.moment - rate.cross(&momentum))
    }

    fn change(&self, at: &Motion, raw: &Quaternion<f64>, acting: &Acting) -> Change {
        Change {
            velocity: at.velocity,
            acceleration: acting.force / self.mass_kg,
            turning: attitude::derivative(raw, &at.rate),
            angular: self.angular_acceleration(&at.rate, acting),
        }
    }

    /// The motion after `dt_s`; `acting` tells what acts at a share of the step (0, 0.5 or 1) in a given motion.
    #[must_use]
    pub fn step(&self, from: &Motion, dt_s: f64, acting: impl Fn(f64, &Motion) -> Acting) -> Motion {
        let slope = |share: f64, at: &(Motion, Quaternion<f64>)| self.change(&at.0, &at.1, &acting(share, &at.0));
        let first = slope(0.0, &(*from, *from.attitude.quaternion()));
        let second = slope(0.5, &moved(from, &first, 0.5 * dt_s));
        let third = slope(0.5, &moved(from, &second, 0.5 * dt_s));
        let last = slope(1.0, &moved(from, &third, dt_s));
        moved(from, &mean([first, second, third, last]), dt_s).0
    }
}

/// `from` after `dt_s` of a steady change: the motion, and its quaternion before it is brought back to length one, on which the
/// further slopes hang (or the order would be lost).
fn moved(from: &Motion, change: &Change, dt_s: f64) -> (Motion, Quaternion<f64>) {
    let raw = from.attitude.quaternion() + change.turning * dt_s;
    let there = Motion {
        place: from.place + change.velocity * dt_s,
        velocity: from.velocity + change.acceleration * dt_s,
        attitude: Unit::new_normalize(raw),
        rate: from.rate + change.angular * dt_s,
    };
    (there, raw)
}

/// The four slopes weighed 1, 2, 2, 1.
fn mean([a, b, c, d]: [Change; 4]) -> Change {
    let sixth = 1.0 / 6.0;
    Change {
        velocity: (a.velocity + 2.0 * (b.velocity + c.velocity) + d.velocity) * sixth,
        acceleration: (a.acceleration + 2.0 * (b.acceleration + c.acceleration) + d.acceleration) * sixth,
        turning: (a.turning + (b.turning + c.turning) * 2.0 + d.turning) * sixth,
        angular: (a.angular + 2.0 * (b.angular + c.angular) + d.angular) * sixth,
    }
}
