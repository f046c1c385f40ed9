//! Effects of supply, ESC, motor and propeller.
//!
//! What it is: the state of the power train stepped through time on a fine grid, with every effect as a change of the balance.
//! What can go wrong: supply current and voltage depend on each other; three rounds of substitution settle that.
//! Units: SI, rev/min, us, degC, hPa.
//! Reference: Ohm's law for the supply; first-order heating by I^2; ideal gas for the air; LiPo discharge curve as a straight line with
//! a knee; propeller coefficients as functions of speed.

use super::Effect;
use crate::blind::rig::{Drive, Rig, poly};

/// Surroundings at one instant.
#[derive(Debug, Clone, Copy)]
pub struct Air {
    /// degC.
    pub temperature: f64,
    /// hPa.
    pub pressure: f64,
    /// Relative humidity, percent.
    pub humidity: f64,
}

/// Surroundings of the declared state.
pub const REFERENCE: Air = Air { temperature: 22.0, pressure: 1010.0, humidity: 45.0 };

/// What the power train gives at one instant.
#[derive(Debug, Clone, Copy, Default)]
pub struct Output {
    /// Speed, rev/min.
    pub speed: f64,
    /// Aerodynamic thrust, N.
    pub thrust: f64,
    /// Torque on the arm, N.m.
    pub torque: f64,
    /// Supply current, A.
    pub current: f64,
    /// Supply voltage, V.
    pub voltage: f64,
}

/// The power train in motion.
#[derive(Debug)]
pub struct Train<'a> {
    rig: &'a Rig,
    effects: &'a [Effect],
    heat: f64,
    charge: f64,
    shunt: f64,
    speed: f64,
    current: f64,
}

/// Current limit, A.
#[must_use]
pub fn limit(e: &Effect, rig: &Rig) -> f64 {
    poly(&rig.current, rig.top / 1000.0) * (1.0 - e.strength)
}

/// Density over its declared value.
#[must_use]
pub fn density_ratio(air: Air) -> f64 {
    (air.pressure / REFERENCE.pressure) * (REFERENCE.temperature + 273.15) / (air.temperature + 273.15)
}

impl<'a> Train<'a> {
    /// At rest and cold.
    #[must_use]
    pub fn new(rig: &'a Rig, effects: &'a [Effect]) -> Self {
        Self { rig, effects, heat: 0.0, charge: 0.0, shunt: 0.0, speed: 0.0, current: rig.idle }
    }

    fn voltage(&self, amps: f64) -> f64 {
        let mut v = self.rig.volt + self.rig.day.volt;
        for e in self.effects {
            match e.id {
                "supply_sag" => v -= e.strength * amps,
                "battery_discharge" => {
                    let s = self.charge * e.strength / e.b.max(1e-9);
                    v -= self.rig.volt * (0.13 * s + 0.10 * s.powi(6).min(2.0));
                }
                _ => {}
            }
        }
        v.max(3.0)
    }

    /// What drives a rotor that is to turn at a speed, whatever it did before.
    fn drive(&self, t: f64, air: Air, amps: f64, speed: f64) -> Drive {
        let mut d = Drive { volt: self.voltage(amps), ..self.rig.declared() };
        for e in self.effects {
            let late = t >= e.t0;
            match e.id {
                "thermal_derate" => d.resistance += e.strength * self.heat,
                "bearing_friction" if late => d.drag += friction(e, speed.max(TURNING)),
                "encoder_drag" => d.drag += friction(e, speed.max(TURNING)),
                "air_density" => d.load *= density_ratio(air),
                "blade_damage" if late => d.load *= 1.0 + e.b * e.strength,
                _ => {}
            }
        }
        d
    }

    fn pulse(&self, pulse: f64) -> f64 {
        self.effects
            .iter()
            .filter(|e| e.id == "throttle_quantisation")
            .fold(pulse, |p, e| 1000.0 + ((p - 1000.0) / e.strength).round() * e.strength)
    }

    /// One step of length `h` at time `t`.
    pub fn step(&mut self, t: f64, h: f64, pulse: f64, air: Air, wander: f64) -> Output {
        let rig = self.rig;
        let pulse = self.pulse(pulse);
        let mut amps = self.current;
        let (mut wanted, mut d) = (self.speed, rig.declared());
        // supply and rotor settle at once: half steps, because a weak supply and a strong motor chase each other
        for round in 0..ROUNDS {
            d = self.drive(t, air, amps, wanted);
            wanted = rig.speed_at(pulse, d);
            let drawn = rig.current_at(wanted, d);
            let settled = (drawn - amps).abs() < 1e-9 * drawn.abs();
            amps = if round == 0 { drawn } else { 0.5 * (amps + drawn) };
            if settled && round > 0 {
                break;
            }
        }
        for e in self.effects {
            match e.id {
                "current_limit" if amps > limit(e, rig) => wanted = slowed(rig, d, wanted, limit(e, rig)),
                "unknown_esc_band" => {
                    let x = (pulse - e.b) / 60.0;
                    wanted *= 1.0 - e.strength * (-x * x).exp();
                }
                "unknown_hunting" => wanted *= 1.0 + e.strength * (std::f64::consts::TAU * t / e.b).sin() * wanted / rig.top,
                _ => {}
            }
        }
        // the lag shows the speed that was reached by now; without one the speed follows at once
        let lag = self.effects.iter().find(|e| e.id == "spinup_lag");
        let reached = if lag.is_some() { self.speed } else { wanted };
        self.speed = match lag {
            Some(e) => {
                let tau = if wanted > self.speed { e.strength } else { e.strength * e.b };
                wanted + (self.speed - wanted) * (-h / tau.max(1e-4)).exp()
            }
            None => wanted,
        };
        let n = reached * (1.0 + wander);
        // friction brakes at the speed that the rotor has
        self.current = rig.current_at(n, Drive { drag: self.drive(t, air, amps, n).drag, ..d });
        let full = poly(&rig.current, rig.top / 1000.0);
        for e in self.effects.iter().filter(|e| e.id == "rotor_inertia") {
            // what speeds the rotor up is drawn from the supply at the duty that it has; no current flows back
            let alpha = (self.speed - reached) / h * std::f64::consts::TAU / 60.0;
            let duty = (n / (rig.kv * rig.volt)).clamp(0.0, 1.0);
            let torque_per_ampere = 60.0 / (std::f64::consts::TAU * rig.kv);
            self.current = (self.current + duty * e.strength * alpha / torque_per_ampere).max(rig.idle);
        }
        let i2 = (self.current / full).powi(2);
        for e in self.effects {
            match e.id {
                "thermal_derate" => self.heat += (i2 - self.heat) * (h / e.b).min(1.0),
                "unknown_shunt_heat" => self.shunt += (i2 - self.shunt) * (h / e.b).min(1.0),
                _ => {}
            }
        }
        self.charge += self.current * h / 3600.0;
        self.output(t, n, air)
    }

    fn output(&self, t: f64, n: f64, air: Air) -> Output {
        let rig = self.rig;
        let (mut thrust, mut torque) = (poly(&rig.thrust, n / 1000.0), poly(&rig.torque, n / 1000.0));
        let mut carried = 0.0;
        let mut reading = self.current;
        for e in self.effects {
            let late = t >= e.t0;
            match e.id {
                "reynolds_thrust" => thrust *= (n / (0.6 * rig.top)).max(0.02).powf(e.strength),
                "air_density" => {
                    thrust *= density_ratio(air);
                    torque *= density_ratio(air);
                }
                "blade_damage" if late => {
                    thrust *= 1.0 - e.strength;
                    torque *= 1.0 + e.b * e.strength;
                }
                "blade_flex" if n > e.b => {
                    // the square law holds up to the onset; beyond it the blade unloads
                    let k = if e.form == 0 {
                        (n / e.b).powf(-e.strength)
                    } else {
                        1.0 - e.strength * ((n - e.b) / rig.top).powi(2) * 4.0
                    };
                    thrust *= k;
                    torque *= k;
                }
                "stall" if n > e.b => {
                    let x = 1.0 - (-(n - e.b) / (0.05 * rig.top)).exp();
                    thrust *= 1.0 - e.strength * x;
                    torque *= 1.0 + 0.4 * e.strength * x;
                }
                "bearing_friction" if late => carried += e.c * friction(e, n),
                "encoder_drag" => carried += e.c * friction(e, n),
                "unknown_torque_band" if (n - e.b).abs() < 0.08 * rig.top => torque += e.signed(),
                "unknown_humidity" => thrust *= 1.0 + e.signed() * (air.humidity.max(0.0).sqrt() - REFERENCE.humidity.sqrt()),
                "unknown_shunt_heat" => reading *= 1.0 + e.signed() * self.shunt,
                _ => {}
            }
        }
        Output { speed: n, thrust, torque: torque + carried, current: reading, voltage: self.voltage(self.current) }
    }
}

/// Most rounds in which supply, current and speed are brought into balance.
const ROUNDS: usize = 60;

/// Speed at which friction holds a rotor that has just been asked to turn, rev/min.
const TURNING: f64 = 2.0;

/// Friction torque of a turning rotor, N.m.
fn friction(e: &Effect, n: f64) -> f64 {
    if n > 1.0 { e.strength * (1.0 + e.b * n * std::f64::consts::TAU / 60.0) } else { 0.0 }
}

/// Speed at which the current stands at its limit: bisection below the wanted one.
fn slowed(rig: &Rig, d: Drive, wanted: f64, limit: f64) -> f64 {
    let (mut lo, mut hi) = (0.0, wanted);
    for _ in 0..30 {
        let mid = 0.5 * (lo + hi);
        if rig.current_at(mid, d) > limit { hi = mid } else { lo = mid }
    }
    0.5 * (lo + hi)
}
