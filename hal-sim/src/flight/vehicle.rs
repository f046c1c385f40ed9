//! A vehicle in flight.
//!
//! What it is: one millisecond at a time, the powerplants advance by their ten steps, the wind moves on, and the body by one
//! Runge-Kutta step that sees thrust, reaction and spin of the rotors at the beginning, the middle and the end of the millisecond.
//! What can go wrong: an airframe without mass ([`Vehicle::new`] gives nothing); a rotor that gives a NaN or a negative speed rests.
//! Units: SI; us for pulses, rev/min for rotor speed.
//! Reference: specification `flight.md`, "The body"; errata 2.15-2.30 (moments), 2.37 (drag), ISO 2533 (density with altitude).

use super::wind::{Blowing, Wind};
use super::{Acting, Airframe, G, Ground, Motion, RigidBody, Vector};
use crate::plant::powerplant::STEPS_PER_MS;
use crate::plant::rig_plant::RPM_PER_RAD_S;
use crate::plant::{Air, PlantBlock, PlantLevers, PlantState, Powerplant};

/// Step of the body, s.
const STEP_S: f64 = 1.0e-3;
/// What rounding leaves of the height of a point on the ground, m.
const SURFACE_M: f64 = 1.0e-9;
/// Step of the powerplants, s.
const ROTOR_STEP_S: f64 = STEP_S / STEPS_PER_MS as f64;

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

/// What a rotor does to the body at one instant.
#[derive(Debug, Clone, Copy, Default)]
struct Push {
    thrust_n: f64,
    torque_nm: f64,
    speed: f64,
}

/// Sum of the rotors: lift along -z, moment, spin.
#[derive(Debug, Clone, Copy, Default)]
struct Lift {
    thrust_n: f64,
    moment: Vector,
    spin: f64,
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
    /// Density at which the powerplants were set up.
    reference_density: f64,
    plants: Vec<Box<dyn Powerplant>>,
    states: Vec<PlantState>,
    pulses_us: Vec<f64>,
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
        Some(Self {
            body: airframe.body()?,
            ground: Ground::under(airframe.mass_kg, airframe.rotors.len()),
            states: vec![PlantState::default(); plants.len()],
            pulses_us: vec![1000.0; plants.len()],
            wind: Wind::new(&around.blowing, around.seed),
            blows: Vector::from(around.blowing.steady),
            lift: Lift::default(),
            motion: start,
            milliseconds: 0,
            airframe,
            around,
            reference_density,
            plants,
        })
    }

    /// The rotors run at `pulses_us` for `seconds` while the body is held: a flight that begins in the air.
    pub fn spin_up(&mut self, pulses_us: &[f64], seconds: f64) {
        let steps = (seconds / STEP_S) as u64;
        for left in (1..=steps).rev() {
            self.turn_rotors(pulses_us, -(left as f64) * STEP_S);
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
        let begins = self.lift;
        let [middle, ends] = self.turn_rotors(pulses_us, self.milliseconds as f64 * STEP_S);
        self.blows = self.wind.advance();
        let density = self.around.density(-self.motion.place.z);
        let lifts = [begins, middle, ends];
        let from = self.motion;
        self.motion = self.body.step(&from, STEP_S, |share, at| self.acting(&lifts[(2.0 * share) as usize], at, density));
        self.milliseconds += 1;
    }

    /// What acts in a motion: weight, thrust, drag, ground.
    fn acting(&self, lift: &Lift, at: &Motion, density: f64) -> Acting {
        let (air, floor) = self.outside(at, density);
        let thrust = at.attitude * Vector::new(0.0, 0.0, -lift.thrust_n);
        let weight = Vector::new(0.0, 0.0, self.airframe.mass_kg * G);
        let (push, moment) = floor;
        Acting { force: weight + thrust + air + push, moment: lift.moment + moment, spin: lift.spin }
    }

    /// Drag, and push and moment of the ground.
    fn outside(&self, at: &Motion, density: f64) -> (Vector, (Vector, Vector)) {
        let through = at.velocity - self.blows;
        let air = through * (-0.5 * density * self.airframe.drag_area_m2 * through.norm());
        let mut floor = (Vector::zeros(), Vector::zeros());
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

    /// Rotors for a millisecond; their sum at its middle and its end.
    fn turn_rotors(&mut self, pulses_us: &[f64], run_s: f64) -> [Lift; 2] {
        let thinner = self.around.density(-self.motion.place.z) / self.reference_density;
        let levers = PlantLevers { run_s, thrust_factor: thinner, torque_factor: thinner, ..PlantLevers::default() };
        let mut sums = [Lift::default(); 2];
        let mut block = PlantBlock::default();
        for (i, plant) in self.plants.iter_mut().enumerate() {
            let pulse = pulses_us.get(i).copied().filter(|p| p.is_finite()).unwrap_or(1000.0);
            self.pulses_us[i] = pulse;
            plant.adjust(&levers);
            plant.advance_block(ROTOR_STEP_S, pulse, &mut block, &mut || ());
            for (sum, at) in sums.iter_mut().zip([STEPS_PER_MS / 2 - 1, STEPS_PER_MS - 1]) {
                let push = Push { thrust_n: block.thrust_n[at], torque_nm: block.torque_nm[at], speed: block.rpm[at] };
                self.airframe.rotors[i].add(push, self.airframe.rotor_inertia_kgm2, sum);
            }
            self.states[i] = block.last;
        }
        self.lift = sums[1];
        sums
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
        self.airframe.rotors.iter().any(|r| m.place.z + (m.attitude * Vector::from(r.place)).z > 0.0)
    }

    /// The airframe.
    #[must_use]
    pub fn airframe(&self) -> &Airframe {
        &self.airframe
    }

    /// What each rotor does.
    #[must_use]
    pub fn rotors(&self) -> &[PlantState] {
        &self.states
    }

    /// Specific force at the centre of gravity, m/s^2, and angular acceleration, rad/s^2, in body axes.
    #[must_use]
    pub fn felt(&self) -> (Vector, Vector) {
        let acting = self.acting(&self.lift, &self.motion, self.around.density(-self.motion.place.z));
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
            pulses_us: self.pulses_us.clone(),
            rotors: self.states.clone(),
            wind: self.blows,
        }
    }
}

impl super::Rotor {
    /// Adds what it does: lift, its moment about the middle (-y T, x T), its reaction against its turning, its spin.
    fn add(&self, push: Push, inertia_kgm2: f64, sum: &mut Lift) {
        let Push { thrust_n, torque_nm, speed } = push;
        if !(speed >= 0.0 && thrust_n.is_finite() && torque_nm.is_finite()) {
            return;
        }
        sum.thrust_n += thrust_n;
        sum.moment += Vector::new(-self.place[1] * thrust_n, self.place[0] * thrust_n, -self.turns * torque_nm);
        sum.spin += self.turns * inertia_kgm2 * speed / RPM_PER_RAD_S;
    }
}
