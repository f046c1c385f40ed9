//! How a vehicle shakes: rotors whose mass is not on their axis, and blades that pass the arms.
//!
//! What it is: for each rotor a force that turns with it, in its plane, and one along its axis at the pass of the blades; what they make of
//! the body's specific force and rate at the board.
//! What can go wrong: nothing; rotors that stand still shake nothing.
//! Units: SI; g.mm for the imbalance.
//! Reference: F = m e w^2 (ISO 21940-11); the share of the thrust at the blade pass is assumed. Integrals over a turn in closed form.

use super::{Airframe, Vector};
use crate::noise::{Source, Stream};
use crate::plant::PlantState;
use core::f64::consts::TAU;

/// How much shakes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shaking {
    /// Imbalance of each rotor, g.mm.
    pub imbalance_gmm: f64,
    /// Amplitude of the thrust at the blade pass, as a share of it.
    pub blade_pass: f64,
    /// Blades of a rotor.
    pub blades: u32,
}

/// The vibration of a vehicle.
#[derive(Debug, Clone)]
pub struct Vibration {
    shaking: Shaking,
    places: Vec<(Vector, f64)>,
    mass_kg: f64,
    inertia: Vector,
    turned_rev: Vec<f64>,
}

impl Vibration {
    /// Of `airframe`, whose rotors stand at angles drawn from `seed`.
    #[must_use]
    pub fn new(airframe: &Airframe, shaking: Shaking, seed: u64) -> Self {
        let mut stream = Stream::new(seed, Source::Phase, 9);
        Self {
            shaking,
            places: airframe.rotors.iter().map(|r| (Vector::from(r.place), r.turns)).collect(),
            mass_kg: airframe.mass_kg,
            inertia: Vector::from(airframe.inertia_kgm2),
            turned_rev: airframe.rotors.iter().map(|_| stream.uniform()).collect(),
        }
    }

    /// Goes on by `dt_s`; what is added to the specific force, m/s^2, and to the rate, rad/s, in body axes.
    pub fn step(&mut self, rotors: &[PlantState], dt_s: f64) -> (Vector, Vector) {
        let (mut force, mut turning) = (Vector::zeros(), Vector::zeros());
        for ((rotor, (place, turns)), turned) in rotors.iter().zip(&self.places).zip(&mut self.turned_rev) {
            let rev_s = rotor.rpm / 60.0;
            if rev_s.is_nan() || rev_s <= 0.0 {
                continue;
            }
            *turned = (*turned + rev_s * dt_s).fract();
            let speed = TAU * rev_s;
            let (sin, cos) = libm::sincos(TAU * *turned);
            let swing = 1.0e-6 * self.shaking.imbalance_gmm * speed * speed;
            let passes = f64::from(self.shaking.blades.max(1));
            let (pass_sin, pass_cos) = libm::sincos(passes * TAU * *turned);
            let beat = self.shaking.blade_pass * rotor.thrust_n;
            // the force, and what it has been over the turn: its integral without a mean
            let now = Vector::new(swing * cos, turns * swing * sin, -beat * pass_cos);
            let summed = Vector::new(swing * sin, -turns * swing * cos, -beat * pass_sin / passes) / speed;
            force += now / self.mass_kg;
            turning += place.cross(&summed).component_div(&self.inertia);
        }
        (force, turning)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One rotor at 4200 rev/min: the amplitudes of the textbook, and a rate that is the integral of the moment.
    #[test]
    fn amplitudes_and_the_integral_of_the_moment() {
        let airframe = Airframe { rotors: Airframe::plus(0.3)[3..].to_vec(), ..Airframe::thesis(1e-4) };
        let shaking = Shaking { imbalance_gmm: 1.0, blade_pass: 0.02, blades: 2 };
        let mut vibration = Vibration::new(&airframe, shaking, 1);
        let rotor = [PlantState { rpm: 4200.0, thrust_n: 3.0, ..PlantState::default() }];
        let dt = 1e-5;
        let steps: Vec<_> = (0..100_000).map(|_| vibration.step(&rotor, dt)).collect();
        let most = |axis: usize| steps.iter().map(|s| s.0[axis]).fold(0.0, f64::max);
        let speed = TAU * 70.0;
        assert!((most(0) / (1e-6 * speed * speed / 1.174) - 1.0).abs() < 1e-3 && (most(1) - most(0)).abs() < 1e-3 * most(0));
        assert!((most(2) / (0.06 / 1.174) - 1.0).abs() < 1e-3);
        let inertia = Vector::from(airframe.inertia_kgm2);
        for pair in steps.windows(3).step_by(97) {
            let change = (pair[2].1 - pair[0].1) / (2.0 * dt);
            let moment = Vector::new(0.3, 0.0, 0.0).cross(&(pair[1].0 * 1.174)).component_div(&inertia);
            assert!((change - moment).norm() < 1e-3 * (1.0 + moment.norm()), "{change:?} {moment:?}");
        }
        let still = vibration.step(&[PlantState::default()], 1e-3);
        assert_eq!(still, (Vector::zeros(), Vector::zeros()));
    }
}
