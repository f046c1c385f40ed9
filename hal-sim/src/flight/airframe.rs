//! What flies: masses, inertia, where the rotors sit and which way they turn, and what the air holds back.
//!
//! What it is: the thesis' quadrotor by default, any number of rotors in any layout otherwise.
//! What can go wrong: [`Airframe::body`] gives nothing where the masses make no body.
//! Units: SI; body FRD from the centre of gravity.
//! Reference: Beharie 2013 Eq. 2.3, 2.4 and 2.94 and Appendix D as corrected in the errata (arms and battery count); the arm's length
//! and the hub's size are assumed; the drag area is fitted to the stated climb (errata, "Climb").

use super::{Matrix, RigidBody, Vector};

/// One rotor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rotor {
    /// Place in body axes, m.
    pub place: [f64; 3],
    /// +1 clockwise seen from above, -1 counter-clockwise.
    pub turns: f64,
}

/// An airframe.
#[derive(Debug, Clone, PartialEq)]
pub struct Airframe {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Moments of inertia about the body axes, kg.m^2.
    pub inertia_kgm2: [f64; 3],
    /// Rotors.
    pub rotors: Vec<Rotor>,
    /// Drag coefficient times area, m^2, in every direction.
    pub drag_area_m2: f64,
    /// Inertia of one rotor with its propeller about its shaft, kg.m^2.
    pub rotor_inertia_kgm2: f64,
}

/// Masses and sizes of which inertia follows: a sphere in the middle, rods as arms, points as motors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Build {
    /// Hub with battery, kg.
    pub hub_kg: f64,
    /// Radius of the hub, m.
    pub hub_radius_m: f64,
    /// One motor with its propeller, kg.
    pub motor_kg: f64,
    /// One arm, kg.
    pub arm_kg: f64,
}

impl Default for Build {
    /// Sphere 0.394 kg and battery 0.4 kg, motors 0.075 kg, arms 0.02 kg (Beharie 2013, after Eq. 2.94); radius assumed.
    fn default() -> Self {
        Self { hub_kg: 0.794, hub_radius_m: 0.08, motor_kg: 0.075, arm_kg: 0.02 }
    }
}

impl Build {
    /// Mass with `rotors` rotors, kg.
    #[must_use]
    pub fn mass_kg(&self, rotors: usize) -> f64 {
        self.hub_kg + rotors as f64 * (self.motor_kg + self.arm_kg)
    }

    /// Moments of inertia, kg.m^2: each arm is a rod from the middle to its rotor, which takes a third of its mass there.
    #[must_use]
    pub fn inertia(&self, rotors: &[Rotor]) -> [f64; 3] {
        let sphere = 0.4 * self.hub_kg * self.hub_radius_m * self.hub_radius_m;
        let outside = self.motor_kg + self.arm_kg / 3.0;
        let sum = |axes: [usize; 2]| -> f64 {
            rotors.iter().map(|r| axes.iter().map(|i| r.place[*i] * r.place[*i]).sum::<f64>()).sum::<f64>() * outside
        };
        [sphere + sum([1, 2]), sphere + sum([0, 2]), sphere + sum([0, 1])]
    }
}

/// Arm of the thesis' quadrotor, m (assumed).
pub const ARM_M: f64 = 0.30;
/// Drag area with which 8.5 % climbs 63 m in 20 s at 4.0 m/s, m^2 (errata, "Climb").
pub const DRAG_AREA_M2: f64 = 0.078;

impl Airframe {
    /// Four rotors in a plus: 1 left, 2 rear, 3 right, 4 front; 1 and 3 turn clockwise seen from above (errata, "1.4.1").
    #[must_use]
    pub fn plus(arm_m: f64) -> Vec<Rotor> {
        let rotor = |x: f64, y: f64, turns| Rotor { place: [x * arm_m, y * arm_m, 0.0], turns };
        vec![rotor(0.0, -1.0, 1.0), rotor(-1.0, 0.0, -1.0), rotor(0.0, 1.0, 1.0), rotor(1.0, 0.0, -1.0)]
    }

    /// The thesis' quadrotor with rotors of `rotor_inertia_kgm2`.
    #[must_use]
    pub fn thesis(rotor_inertia_kgm2: f64) -> Self {
        let (build, rotors) = (Build::default(), Self::plus(ARM_M));
        Self {
            mass_kg: build.mass_kg(rotors.len()),
            inertia_kgm2: build.inertia(&rotors),
            rotors,
            drag_area_m2: DRAG_AREA_M2,
            rotor_inertia_kgm2,
        }
    }

    /// The rigid body; nothing where mass or inertia is not above zero.
    #[must_use]
    pub fn body(&self) -> Option<RigidBody> {
        RigidBody::new(self.mass_kg, Matrix::from_diagonal(&Vector::from(self.inertia_kgm2)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errata: 1.174 kg; I_x = 2 m l^2 + 2 m_arm l^2/3 + 2/5 m_hub R^2, and twice the first two about z.
    #[test]
    fn the_thesis_quadrotor() {
        let a = Airframe::thesis(1.0e-4);
        assert!((a.mass_kg - 1.174).abs() < 1e-12);
        let (outside, sphere) = (2.0 * (0.075 + 0.02 / 3.0) * 0.09, 0.4 * 0.794 * 0.0064);
        let want = [outside + sphere, outside + sphere, 2.0 * outside + sphere];
        assert!(a.inertia_kgm2.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-15), "{:?} {want:?}", a.inertia_kgm2);
    }
}
