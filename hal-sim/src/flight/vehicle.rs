//! A vehicle in flight.
//!
//! What it is: one millisecond at a time, the powerplants advance by their ten steps, the wind moves on, and the body by one
//! Runge-Kutta step that sees thrust, reaction and spin of the rotors at the beginning, the middle and the end of the millisecond.
//! What can go wrong: an airframe without mass ([`Vehicle::new`] gives nothing).
//! Units: SI; us for pulses, rev/min for rotor speed.
//! Reference: specification `flight.md`, "The body"; errata 2.37 (drag), ISO 2533 (density with altitude).

use super::rotors::{Lift, Rotors};
use super::wind::{Blowing, Wind};
use super::{Acting, Airframe, G, Ground, Motion, RigidBody, Vector};
use crate::plant::{Air, PlantLevers, PlantState, Powerplant};

/// Step of the body, s.
const STEP_S: f64 = 1.0e-3;
/// What rounding leaves of the height of a point on the ground, m.
const SURFACE_M: f64 = 1.0e-9;

/// Surroundings of a flight.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Surroundings {
    /// Height of the ground above sea level, m.
    pub ground_altitude_m: f64,
    /// Departure of the temperature from the standard atmosphere, K.
    pub temperature_offset_k: f64,
    /// Wind.
    pub blowing: Blowing,
    /// Seed of the gusts.
    pub seed: u64,
}

impl Surroundings {
    /// Density at height `up_m` above the ground, kg/m^3.
    #[must_use]
    pub fn density(&self, up_m: f64) -> f64 {
        let standard = Air::standard(self.ground_altitude_m + up_m);
        Air { temperature_c: standard.temperature_c + self.temperature_offset_k, ..standard }.density()
    }
}

/// Density in a layer of one metre, linear in height: less than one part in 1e8 off, and no power to take each millisecond.
#[derive(Debug, Clone, Copy)]
struct Layer {
    floor_m: f64,
    at_floor: f64,
    per_m: f64,
}

impl Layer {
    const UNKNOWN: Self = Self { floor_m: f64::NAN, at_floor: f64::NAN, per_m: f64::NAN };

    /// Density at `up_m`, kg/m^3, in the layer that it lies in.
    fn density(&mut self, around: &Surroundings, up_m: f64) -> f64 {
        let floor_m = up_m.floor();
        if floor_m != self.floor_m {
            let at_floor = around.density(floor_m);
            *self = Self { floor_m, at_floor, per_m: around.density(floor_m + 1.0) - at_floor };
        }
        self.at_floor + (up_m - floor_m) * self.per_m
    }
}

/// What is really there at one instant of a flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Flying {
    /// Time since the start, s.
    pub t_s: f64,
    /// Place, velocity, attitude, rate.
    pub motion: Motion,
    /// Specific force at the centre of gravity, body axes, m/s^2.
    pub specific_force: Vector,
    /// Angular acceleration, body axes, rad/s^2.
    pub angular_acceleration: Vector,
    /// Pulses, us.
    pub pulses_us: Vec<f64>,
    /// Rotors.
    pub rotors: Vec<PlantState>,
    /// Wind, earth axes, m/s.
    pub wind: Vector,
}

/// A vehicle.
pub struct Vehicle {
    airframe: Airframe,
    body: RigidBody,
    ground: Ground,
    around: Surroundings,
    layer: Layer,
    /// Density where it is, kg/m^3.
    density: f64,
    /// Density at which the powerplants were set up.
    reference_density: f64,
    rotors: Rotors,
    /// No rotor lies further from the centre of gravity, m.
    reach_m: f64,
    lift: Lift,
    wind: Wind,
    blows: Vector,
    motion: Motion,
    milliseconds: u64,
}

impl Vehicle {
    /// `airframe` with one powerplant a rotor, each set up for `reference_density` kg/m^3, in motion as `start`.
    #[must_use]
    pub fn new(
        airframe: Airframe,
        plants: Vec<Box<dyn Powerplant>>,
        reference_density: f64,
        around: Surroundings,
        start: Motion,
    ) -> Option<Self> {
        if plants.len() != airframe.rotors.len() {
            return None;
        }
        let mut layer = Layer::UNKNOWN;
        Some(Self {
            density: layer.density(&around, -start.place.z),
            layer,
            body: airframe.body()?,
            ground: Ground::under(airframe.mass_kg, airframe.rotors.len()),
            rotors: Rotors::new(plants),
            reach_m: airframe.rotors.iter().map(|r| Vector::from(r.place).norm()).fold(0.0, f64::max) + SURFACE_M,
            wind: Wind::new(&around.blowing, around.seed),
            blows: Vector::from(around.blowing.steady),
            lift: Lift::default(),
            motion: start,
            milliseconds: 0,
            airframe,
            around,
            reference_density,
        })
    }

    /// The rotors run at `pulses_us` for `seconds` while the body is held: a flight that begins in the air.
    pub fn spin_up(&mut self, pulses_us: &[f64], seconds: f64) {
        let steps = (seconds / STEP_S) as u64;
        for left in (1..=steps).rev() {
            let levers = self.levers(-(left as f64) * STEP_S);
            [_, self.lift] = self.rotors.millisecond(&self.airframe, pulses_us, &levers);
        }
    }

    /// A level vehicle whose rotors lie on the surface of the ground stands there: as deep as what its rotors do not carry presses it in, so that
    /// nothing jolts at the start. Any other stays where it is.
    pub fn stand(&mut self) {
        let below = |r: &super::Rotor| (self.motion.attitude * Vector::from(r.place)).z;
        let (highest, lowest) = self
            .airframe
            .rotors
            .iter()
            .map(below)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(high, low), z| (high.min(z), low.max(z)));
        let flat = lowest - highest < SURFACE_M;
        if flat && (self.motion.place.z + lowest).abs() < SURFACE_M {
            let carried = 1.0 - self.lift.thrust_n / (self.airframe.mass_kg * G);
            self.motion.place.z = Ground::rest_m(carried) - lowest;
        }
    }

    /// One millisecond with a pulse for each rotor; a rotor without one gets the lowest.
    pub fn millisecond(&mut self, pulses_us: &[f64]) {
        let (begins, from) = (self.lift, self.motion);
        let levers = self.levers(self.t_s());
        let [middle, ends] = self.rotors.millisecond(&self.airframe, pulses_us, &levers);
        (self.lift, self.blows) = (ends, self.wind.advance());
        let lifts = [begins, middle, ends];
        self.motion = self.body.step(&from, STEP_S, |share, at| self.acting(&lifts[(2.0 * share) as usize], at));
        self.density = self.layer.density(&self.around, -self.motion.place.z);
        self.milliseconds += 1;
    }

    /// What acts in a motion: weight, thrust, drag, ground.
    fn acting(&self, lift: &Lift, at: &Motion) -> Acting {
        let (air, floor) = self.outside(at);
        let thrust = at.attitude * Vector::new(0.0, 0.0, -lift.thrust_n);
        let weight = Vector::new(0.0, 0.0, self.airframe.mass_kg * G);
        let (push, moment) = floor;
        Acting { force: weight + thrust + air + push, moment: lift.moment + moment, spin: lift.spin }
    }

    /// Drag, and push and moment of the ground.
    fn outside(&self, at: &Motion) -> (Vector, (Vector, Vector)) {
        let through = at.velocity - self.blows;
        let air = through * (-0.5 * self.density * self.airframe.drag_area_m2 * through.norm());
        let mut floor = (Vector::zeros(), Vector::zeros());
        if at.place.z < -self.reach_m {
            return (air, floor);
        }
        for rotor in &self.airframe.rotors {
            let arm = Vector::from(rotor.place);
            let turned = at.attitude * arm;
            if at.place.z + turned.z > 0.0 {
                let velocity = at.velocity + at.attitude * at.rate.cross(&arm);
                let push = self.ground.push(&(at.place + turned), &velocity);
                floor.0 += push;
                floor.1 += arm.cross(&(at.attitude.inverse() * push));
            }
        }
        (air, floor)
    }

    /// What the air does to the rotors, `run_s` after the start.
    fn levers(&self, run_s: f64) -> PlantLevers {
        let thinner = self.density / self.reference_density;
        PlantLevers { run_s, thrust_factor: thinner, torque_factor: thinner, ..PlantLevers::default() }
    }

    /// Where it is and how it moves.
    #[must_use]
    pub fn motion(&self) -> &Motion {
        &self.motion
    }

    /// Time since the start, s.
    #[must_use]
    pub fn t_s(&self) -> f64 {
        self.milliseconds as f64 * STEP_S
    }

    /// Whether a rotor touches the ground.
    #[must_use]
    pub fn on_ground(&self) -> bool {
        let m = &self.motion;
        m.place.z >= -self.reach_m
            && self.airframe.rotors.iter().any(|r| m.place.z + (m.attitude * Vector::from(r.place)).z > 0.0)
    }

    /// The airframe.
    #[must_use]
    pub fn airframe(&self) -> &Airframe {
        &self.airframe
    }

    /// What each rotor does.
    #[must_use]
    pub fn rotors(&self) -> &[PlantState] {
        self.rotors.states()
    }

    /// Specific force at the centre of gravity, m/s^2, and angular acceleration, rad/s^2, in body axes.
    #[must_use]
    pub fn felt(&self) -> (Vector, Vector) {
        let acting = self.acting(&self.lift, &self.motion);
        let felt = acting.force / self.airframe.mass_kg - Vector::new(0.0, 0.0, G);
        (self.motion.attitude.inverse() * felt, self.body.angular_acceleration(&self.motion.rate, &acting))
    }

    /// Everything at this instant.
    #[must_use]
    pub fn now(&self) -> Flying {
        let (specific_force, angular_acceleration) = self.felt();
        Flying {
            t_s: self.t_s(),
            motion: self.motion,
            specific_force,
            angular_acceleration,
            pulses_us: self.rotors.pulses_us().collect(),
            rotors: self.rotors.states().to_vec(),
            wind: self.blows,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Up and down through the layers, on a warm day above a high field.
    #[test]
    fn density_in_a_layer_is_that_of_the_atmosphere() {
        let around = Surroundings { ground_altitude_m: 1700.0, temperature_offset_k: 12.0, ..Surroundings::default() };
        let mut layer = Layer::UNKNOWN;
        for i in -200..2000 {
            let up_m = 40.0 * f64::sin(f64::from(i) * 0.37) + 0.013 * f64::from(i);
            let exact = around.density(up_m);
            assert!((layer.density(&around, up_m) / exact - 1.0).abs() < 1e-8, "{up_m} m");
        }
    }
}
