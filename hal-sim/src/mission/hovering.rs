//! Where a vehicle hovers and how it answers there.
//!
//! What it is: the pulse at which thrust carries the weight, and the motion about it in closed form: in calm air drag is quadratic and gives
//! no damping, so what is left is the rotors' lag, the spin of rotors that do not cancel, and the thinning of the air with height.
//! What can go wrong: a vehicle too heavy to hover has no such point.
//! Units: us, rev/min, N, A, s, rad/s.
//! Reference: specification `flight.md`, "The body"; errata 2.15-2.30 (moments), 2.19-2.20 (spin); ISO 2533 (density with height).

use super::AirframeFile;
use crate::flight::vehicle::Surroundings;
use crate::flight::{Airframe, G};
use crate::plant::rig_plant::RPM_PER_RAD_S;
use crate::plant::{PlantLevers, PlantState, Powerplant, RigPlant};

/// What one rotor of a vehicle does, whatever its powerplant is made of.
pub trait RotorCurves {
    /// Where it settles at a pulse, at a share of the density for which it was set up.
    fn settled(&self, pulse_us: f64, density: f64) -> PlantState;
    /// Its thrust, N, each millisecond after the pulse steps from one to another at which it had settled, at such a share.
    fn stepped(&self, from_us: f64, to_us: f64, density: f64) -> Vec<f64>;
}

/// A rotor of the catalogue.
pub struct Catalogue<'a>(pub &'a AirframeFile);

/// Time in which a rotor of the catalogue settles, some fifty of its time constants, ms.
const SETTLED_MS: usize = 3000;
/// Time over which a step is watched, ms.
const WATCHED_MS: usize = 1000;

impl Catalogue<'_> {
    fn plant(&self, density: f64) -> RigPlant {
        let mut plant = RigPlant::new(self.0.parts(), 1);
        plant.adjust(&PlantLevers { thrust_factor: density, torque_factor: density, ..PlantLevers::default() });
        plant
    }
}

fn millisecond(plant: &mut RigPlant, pulse_us: f64) -> PlantState {
    (0..10).map(|_| plant.advance(1.0e-4, pulse_us)).last().unwrap_or_default()
}

impl RotorCurves for Catalogue<'_> {
    fn settled(&self, pulse_us: f64, density: f64) -> PlantState {
        let mut plant = self.plant(density);
        (0..SETTLED_MS).map(|_| millisecond(&mut plant, pulse_us)).last().unwrap_or_default()
    }

    fn stepped(&self, from_us: f64, to_us: f64, density: f64) -> Vec<f64> {
        let mut plant = self.plant(density);
        for _ in 0..SETTLED_MS {
            millisecond(&mut plant, from_us);
        }
        (0..WATCHED_MS).map(|_| millisecond(&mut plant, to_us).thrust_n).collect()
    }
}

/// Where thrust carries the weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoverPoint {
    /// Pulse, us.
    pub pulse_us: f64,
    /// A rotor there.
    pub rotor: PlantState,
    /// A rotor at full throttle.
    pub full: PlantState,
    /// Thrust of all rotors at full throttle over the weight.
    pub thrust_to_weight: f64,
    /// Density for which all this holds, as a share of that for which the rotors were set up.
    pub density: f64,
}

impl HoverPoint {
    /// Time for which a battery of `charge_ah` carries `rotors` of them, min, at a current of one rotor (Beharie 2013, Eq. 5.59).
    #[must_use]
    pub fn minutes(charge_ah: f64, rotors: usize, current_a: f64) -> f64 {
        60.0 * charge_ah / (rotors as f64 * current_a)
    }
}

/// The hover of an airframe on such rotors at a share of the density for which they were set up; nothing where full throttle does not carry it.
pub fn hover(airframe: &Airframe, rotor: &dyn RotorCurves, density: f64) -> Option<HoverPoint> {
    let each_n = airframe.mass_kg * G / airframe.rotors.len() as f64;
    let settled = |pulse| rotor.settled(pulse, density);
    let full = settled(2000.0);
    if !full.thrust_n.is_finite() || full.thrust_n < each_n {
        return None;
    }
    // halves of 1000 us: 20 of them are a thousandth of one
    let (mut low, mut high) = (1000.0, 2000.0);
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        if settled(middle).thrust_n < each_n { low = middle } else { high = middle }
    }
    Some(HoverPoint { pulse_us: high, rotor: settled(high), full, thrust_to_weight: full.thrust_n / each_n, density })
}

/// Small motions about a hover in calm air, with equal pulses. Of the twelve states those that no entry names are chains of integrators:
/// place from speed from tilt from rate, heading from its rate. Their eigenvalues are zero: a vehicle that is left alone neither returns
/// nor swings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Modes {
    /// Thrust of one rotor for a pulse, N/us.
    pub thrust_per_us: f64,
    /// Angular acceleration in roll, pitch and yaw for 1 us more on the rotor that does most in that axis, rad/s^2 (yaw: settled).
    pub turning_per_us: [f64; 3],
    /// Time after which the thrust has followed 63 % of a small step of the pulse, s.
    pub rotor_lag_s: f64,
    /// The swing up and down of a vehicle at a steady pulse: air is denser below. Undamped, rad/s.
    pub heave_rad_s: f64,
    /// Coning of roll and pitch by rotors whose spins do not cancel, rad/s; zero where they do.
    pub coning_rad_s: f64,
}

/// Pulse by which the derivatives are taken, us.
const NUDGE_US: f64 = 4.0;
/// Share of the density and height, m, for the same.
const THINNER: f64 = 0.01;
const LIFTED_M: f64 = 10.0;

/// The modes about a hover, at its density.
#[must_use]
pub fn modes(airframe: &Airframe, at: &HoverPoint, rotor: &dyn RotorCurves, around: &Surroundings) -> Modes {
    let [less, more] = [-NUDGE_US, NUDGE_US].map(|d| rotor.settled(at.pulse_us + d, at.density));
    let thrust_per_us = (more.thrust_n - less.thrust_n) / (2.0 * NUDGE_US);
    let torque_per_us = (more.torque_nm - less.torque_nm) / (2.0 * NUDGE_US);
    let farthest = |axis: usize| airframe.rotors.iter().map(|r| r.place[axis].abs()).fold(0.0, f64::max);
    let [ix, iy, iz] = airframe.inertia_kgm2;
    let spin: f64 = airframe.rotors.iter().map(|r| r.turns * airframe.rotor_inertia_kgm2 * at.rotor.rpm / RPM_PER_RAD_S).sum();
    // share by which the thrust falls with the density at a steady pulse: the rotor turns faster in thinner air
    let thinner = rotor.settled(at.pulse_us, at.density * (1.0 - THINNER)).thrust_n;
    let share = (1.0 - thinner / at.rotor.thrust_n) / THINNER;
    let thinning_per_m = (1.0 - around.density(LIFTED_M) / around.density(0.0)) / LIFTED_M;
    Modes {
        thrust_per_us,
        turning_per_us: [farthest(1) * thrust_per_us / ix, farthest(0) * thrust_per_us / iy, torque_per_us / iz],
        rotor_lag_s: lag(&rotor.stepped(at.pulse_us, at.pulse_us + NUDGE_US, at.density), at.rotor.thrust_n),
        heave_rad_s: (G * share * thinning_per_m).max(0.0).sqrt(),
        coning_rad_s: spin.abs() / (ix * iy).sqrt(),
    }
}

/// When a rising thrust has come 63 % of its way, s.
fn lag(thrust: &[f64], from: f64) -> f64 {
    let to = thrust.last().copied().unwrap_or(from);
    let there = from + (1.0 - 1.0 / core::f64::consts::E) * (to - from);
    (thrust.iter().take_while(|t| **t < there).count() + 1) as f64 * 1.0e-3
}
