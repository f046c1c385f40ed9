//! A flight as it really happens.
//!
//! What it is: pilot, rotors, supply and body, a millisecond at a time, with what is hidden in them.
//! What can go wrong: a vehicle that is lost (upside down, or far off its route) ends the flight: the scenario is drawn again.
//! Units: SI.
//! Reference: see `body`, `rotor`.

use super::body::{Load, State, angular, step, to_body};
use super::cause::Cause;
use super::pilot::Pilot;
use super::rotor::Blades;
use super::route::Route;
use super::vehicle::Vehicle;
use super::{V, add, length, times};
use crate::blind::chance::Chance;

/// Step, s.
pub const STEP_S: f64 = 1e-3;
/// Steps between two commands.
const EVERY: usize = 2;
/// Farther off its route than this it is lost, m.
const LOST_M: f64 = 6.0;
/// Share of a battery's power that reaches the shaft.
const EFFICIENCY: f64 = 0.7;
/// Lift that inflow takes, where only the ground is asked for.
const INFLOW: f64 = 1.0;
/// Time constant of what comes and goes, s.
const GUST_S: f64 = 0.6;

/// What happened, a millisecond a row.
#[derive(Debug, Clone, Default)]
pub struct Track {
    /// States.
    pub states: Vec<State>,
    /// Speed of each rotor, rad/s.
    pub speeds: Vec<Vec<f64>>,
    /// Command of each.
    pub commands: Vec<Vec<f64>>,
    /// Specific force at the centre of gravity, m/s^2.
    pub force: Vec<V>,
    /// Angular acceleration, rad/s^2.
    pub turning: Vec<V>,
    /// Voltage, V.
    pub voltage: Vec<f64>,
    /// Current, A.
    pub current: Vec<f64>,
}

/// Everything that moves beside the body.
struct World<'w> {
    vehicle: &'w Vehicle,
    causes: &'w [Cause],
    t: f64,
    speeds: Vec<f64>,
    change: Vec<f64>,
    gust: V,
    wash: V,
    swing: [[f64; 2]; 2],
    voltage: f64,
    current: f64,
    charge: f64,
}

impl World<'_> {
    fn cause(&self, id: &str) -> Option<&Cause> {
        self.causes.iter().find(|c| c.id == id && self.t >= c.t0)
    }

    /// Force without weight and moment in body axes.
    fn load(&self, s: &State) -> Load {
        let v = self.vehicle;
        let wind = self.cause("wind").map_or([0.0; 3], |c| {
            let level = length([c.along[0], c.along[1], 0.0]).max(1e-9);
            [c.strength * c.along[0] / level, c.strength * c.along[1] / level, 0.0]
        });
        let air = to_body(&s.turn, add(s.velocity, times(-1.0, wind)));
        let across = length([air[0], air[1], 0.0]);
        let offset = self.cause("mass_offset").map_or([0.0; 2], |c| {
            let level = length([c.along[0], c.along[1], 0.0]).max(1e-9);
            [c.strength * c.along[0] / level, c.strength * c.along[1] / level]
        });
        let (mut force, mut moment) = ([0.0; 3], [0.0; 3]);
        for (i, hub) in v.hubs.iter().enumerate() {
            let w = self.speeds[i];
            let (gain, drag) = self
                .cause("rotor_gain")
                .filter(|c| c.which == i)
                .map_or((1.0, 1.0), |c| (1.0 - c.strength, 1.0 - 0.85 * c.strength));
            let fade = self.cause("unknown_fade").map_or(1.0, |c| 1.0 - c.strength * (1.0 - (-self.t / c.other).exp()));
            let lift = gain * fade * self.thrust(w, across, -air[2], s);
            force[2] -= lift;
            moment[0] -= (hub.y - offset[1]) * lift;
            moment[1] += (hub.x - offset[0]) * lift;
            moment[2] -= hub.turns * (drag * v.kq * w * w + v.spin * self.change[i]);
            if let Some(c) = self.cause("rotor_drag").filter(|_| across > 1e-6) {
                let blades = Blades { radius: v.radius, kt: v.kt, inflow: 0.0 };
                let size = c.strength * v.mass / v.hubs.len() as f64 * blades.drag(w, across) / (0.5 * v.hover() * v.radius);
                force = add(force, [-size * air[0] / across, -size * air[1] / across, 0.0]);
            }
        }
        self.further(s, air, &mut force, &mut moment);
        (force, moment)
    }

    fn thrust(&self, w: f64, across: f64, up: f64, s: &State) -> f64 {
        let v = self.vehicle;
        let plain = v.kt * w * w;
        if let Some(c) = self.cause("translational_lift") {
            let blades = Blades { radius: v.radius, kt: v.kt, inflow: c.strength };
            return blades.thrust(w, across, up, 0.0, 0.0).0;
        }
        match self.cause("ground_effect") {
            Some(c) => {
                let height = (-s.place[2]).max(0.5 * v.radius);
                // four rotors share one image: two and a half times the single one's
                let near = (2.5 * c.strength * (v.radius / (4.0 * height)).powi(2)).min(0.6);
                let blades = Blades { radius: v.radius, kt: v.kt, inflow: INFLOW };
                blades.thrust(w, 0.0, 0.0, near, 0.0).0
            }
            None => plain,
        }
    }

    /// What acts on the body beside its rotors.
    fn further(&self, s: &State, air: V, force: &mut V, moment: &mut V) {
        let v = self.vehicle;
        let mass = v.mass;
        if let Some(c) = self.cause("body_drag") {
            let speed = length(air);
            let shape = [0.95, 1.05, 1.1];
            *force = add(*force, std::array::from_fn(|k| -c.strength * mass * shape[k] * speed * air[k]));
        }
        if let Some(c) = self.cause("hub_moment") {
            let advance = length([air[0], air[1], 0.0]) / (v.hover() * v.radius);
            let size = c.strength * v.inertia[0] / (1.0 - 0.5 * advance * advance);
            *moment = add(*moment, [-size * air[1], size * air[0], 0.0]);
        }
        let earth = |f: V| to_body(&s.turn, f);
        if let Some(c) = self.cause("unknown_tether") {
            let slack = 1.5 + 2.0 * v.arm;
            let out = length(s.place);
            let pull = c.strength * mass * (out - slack).max(0.0);
            *force = add(*force, earth(times(-pull / out.max(1e-6), s.place)));
        }
        if let Some(c) = self.cause("unknown_slung") {
            let pull = c.strength * mass * super::G;
            *force = add(*force, earth([pull * self.swing[0][0].sin(), pull * self.swing[1][0].sin(), 0.0]));
        }
        if self.cause("unknown_gusts").is_some() {
            *force = add(*force, earth(times(mass, self.gust)));
        }
        if let Some(c) = self.cause("unknown_sideslip") {
            *force = add(*force, [0.0, c.strength * mass * air[0] * s.rate[2], 0.0]);
        }
        if let Some(c) = self.cause("unknown_twist") {
            moment[2] += c.strength * v.inertia[2] * air[2] * air[2].abs().min(1.0);
        }
        if self.cause("unknown_wash").is_some() && s.velocity[2] > 0.25 {
            *moment = add(*moment, std::array::from_fn(|k| v.inertia[k] * self.wash[k]));
        }
    }

    /// Rotors and supply after a step, towards the speeds of the commands.
    fn turn_on(&mut self, commands: &[f64]) {
        let v = self.vehicle;
        let power: f64 = self.speeds.iter().map(|w| v.kq * w.powi(3)).sum::<f64>() / EFFICIENCY;
        self.current = power / self.voltage.max(0.3 * v.supply[0]) + 0.02 * v.supply[1];
        self.charge += self.current * STEP_S;
        let full = v.supply[0];
        let drained = self.cause("battery_discharge").map_or(0.0, |c| {
            let share = self.charge / (v.supply[1] * 35.0);
            c.strength * full * share * (1.0 + 0.15 * share)
        });
        let sag = self.cause("supply_sag").map_or(0.0, |c| c.strength * full / v.supply[1] * self.current);
        // the pack has some capacitance
        let aim = full - drained - sag;
        self.voltage += (aim - self.voltage) * (1.0 - (-STEP_S / 0.004f64).exp());
        let follows = if self.causes.iter().any(|c| matches!(c.id, "supply_sag" | "battery_discharge")) {
            self.voltage / full
        } else {
            1.0
        };
        for (i, command) in commands.iter().enumerate() {
            let aim = v.speed(i, *command) * follows;
            let before = self.speeds[i];
            self.speeds[i] = match self.cause("spinup_lag") {
                Some(c) => {
                    let tau = if aim > before { c.strength } else { c.strength * c.other };
                    aim + (before - aim) * (-STEP_S / tau).exp()
                }
                None => aim,
            };
            self.change[i] = (self.speeds[i] - before) / STEP_S;
        }
    }

    /// What comes and goes.
    fn stir(&mut self, pull: V, k: &mut Chance) {
        let keep = (-STEP_S / GUST_S).exp();
        let kick = (1.0 - keep * keep).sqrt();
        let (gusts, wash) =
            (self.cause("unknown_gusts").map_or(0.0, |c| c.strength), self.cause("unknown_wash").map_or(0.0, |c| c.strength));
        let fast = (-STEP_S / 0.08f64).exp();
        let kick_fast = (1.0 - fast * fast).sqrt();
        for axis in 0..3 {
            let (a, b) = (k.normal(), k.normal());
            self.gust[axis] = keep * self.gust[axis] + if axis < 2 { kick * gusts * a } else { 0.0 };
            self.wash[axis] = fast * self.wash[axis] + kick_fast * wash * b;
        }
        // a pendulum of 0.4 m below a point that is pulled
        for (axis, swing) in self.swing.iter_mut().enumerate() {
            let bend = -(super::G * swing[0].sin() + pull[axis] * swing[0].cos()) / 0.4 - 0.6 * swing[1];
            swing[1] += STEP_S * bend;
            swing[0] += STEP_S * swing[1];
        }
    }
}

/// Flies a route; nothing where the vehicle is lost.
#[must_use]
pub fn flown(vehicle: &Vehicle, route: &Route, causes: &[Cause], seed: u64, stream: u64) -> Option<Track> {
    let mut chance = Chance::new(seed, stream);
    let (place, heading) = route.begins();
    let mut s = State::still(place);
    s.turn = super::body::rotation([0.0, 0.0, heading]);
    let mut pilot = Pilot::new(vehicle);
    let mut commands = vec![vehicle.command(vehicle.hover()); vehicle.hubs.len()];
    let speeds: Vec<f64> = (0..vehicle.hubs.len()).map(|i| vehicle.speed(i, commands[i])).collect();
    let mut world = World {
        vehicle,
        causes,
        t: 0.0,
        change: vec![0.0; speeds.len()],
        speeds,
        gust: [0.0; 3],
        wash: [0.0; 3],
        swing: [[0.0; 2]; 2],
        voltage: vehicle.supply[0],
        current: vehicle.supply[1],
        charge: 0.0,
    };
    let mut track = Track::default();
    let jitter = 0.01;
    for k in 0..(route.seconds() / STEP_S) as usize {
        world.t = k as f64 * STEP_S;
        let wanted = route.at(world.t);
        if k % EVERY == 0 {
            let felt = add(s.rate, [jitter * chance.normal(), jitter * chance.normal(), jitter * chance.normal()]);
            commands.copy_from_slice(pilot.fly(vehicle, &s, felt, &wanted, EVERY as f64 * STEP_S));
            // as a pulse carries them: hundredths of a microsecond
            commands.iter_mut().for_each(|c| *c = (*c * 1e5).round() / 1e5);
        }
        world.turn_on(&commands);
        let inner: f64 = vehicle.hubs.iter().zip(&world.speeds).map(|(h, w)| h.turns * vehicle.spin * w).sum();
        let (force, moment) = world.load(&s);
        track.states.push(s);
        track.speeds.push(world.speeds.clone());
        track.commands.push(commands.clone());
        track.force.push(times(1.0 / vehicle.mass, force));
        track.turning.push(angular(vehicle.inertia, s.rate, moment, inner));
        track.voltage.push(world.voltage);
        track.current.push(world.current);
        let pull = add(times(1.0 / vehicle.mass, super::body::to_earth(&s.turn, force)), [0.0, 0.0, super::G]);
        world.stir(pull, &mut chance);
        s = step(&s, STEP_S, vehicle.mass, vehicle.inertia, inner, &mut |at| world.load(at));
        let off = length(add(s.place, times(-1.0, wanted.place)));
        if off > LOST_M || s.turn[2][2] < 0.2 || s.place[2] > -0.2 * vehicle.radius {
            return None;
        }
    }
    Some(track)
}
