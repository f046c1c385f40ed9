//! An identified model as the rotors of a vehicle.
//!
//! What it is: what the model says of the powerplant, without what it says of the rig's meters and without the zeros of the day, along the
//! pulses of a flight or settled at one.
//! What can go wrong: a model that predicts no speed or no thrust from a command cannot fly. What happened to the rotor in the run that the
//! model was identified from (a damaged blade, a bearing) has happened before the flight.
//! Units: us, rev/min, N, N.m, A, V; densities as shares of that of the model's own run.
//! Reference: specification `formats.md`, "Scope"; `flight.md`, "The body"; errata 2.21 (J dw/dt is part of the torque).

use crate::run_log::along;
use hal_sim::mission::RotorCurves;
use hal_sim::plant::PlantLevers;
use hal_sim::plant::air::SEA_LEVEL_DENSITY;
use hal_sim::plant::rig_plant::RPM_PER_RAD_S;
use hal_sim::{PlantState, Powerplant};
use ident::log::{Column, Log};
use ident::model::{AddedEffect, Model};
use ident::verdict::Scope;
use std::sync::Arc;

/// Effects that belong to the rotor, its motor, its ESC or its supply, and fly.
const FLIES: [&str; 14] = [
    "supply_sag",
    "supply_voltage",
    "battery_discharge",
    "battery_relaxation",
    "spinup_lag",
    "rotor_inertia",
    "blade_damage",
    "bearing_friction",
    "blade_flex",
    "reynolds_thrust",
    "stall",
    "current_limit",
    "thermal_derate",
    "throttle_quantisation",
];

/// Of these, those that grow with what the rotor has done: the charge that it has drawn, its heat.
const GATHERS: [&str; 2] = ["battery_discharge", "thermal_derate"];

/// Density of ISO 2533 air at 20 degC, of which a model's density is a share, kg/m^3.
const DENSITY_20_C: f64 = 1.2041;
/// Interval at which a flight's pulses are given to the model, s.
const ROW_S: f64 = 0.01;
/// What a rotor is given before a flight to settle, s.
const BEFORE_S: f64 = 3.0;

/// The rotors of a model.
#[derive(Clone)]
pub(crate) struct ModelRotor {
    model: Model,
    /// Inertia about the shaft where the model does not hold it, kg.m^2.
    inertia_kgm2: f64,
    /// Settled states at equal steps of the pulse, with the supply and the motor as the model's run began.
    settled: Vec<PlantState>,
}

/// Steps of the settled states, us.
const LEVEL_US: f64 = 5.0;
/// First step at which a rotor is looked at, s, with what arithmetic adds.
const FIRST_S: f64 = 1.5e-3;
/// Where the lag of a rotor that follows is taken, us.
const MIDDLE_US: f64 = 1500.0;
/// Forms of a rotor between winding and air; its last shape is the latency.
const ROTORS: [&str; 2] = ["coasting", "braked"];
/// How such a form ends that was seen through rows between which the command jumps.
const OF_STEPS: &str = "_of_steps";
/// Rows and time that each level is held.
const LEVEL_ROWS: usize = 20;
/// Rows at the end of a level that the next one reaches into: a change of speed is told by the rows on both sides.
const BESIDE: usize = 3;
const LEVEL_ROW_S: f64 = 0.1;

/// Whether what an effect says holds for the rotor in flight: an empirical correction does where it is no drift of one run.
fn flies(added: &AddedEffect) -> bool {
    let effect = added.placed.effect;
    FLIES.contains(&effect.id()) || effect.id() == "unknown" && effect.scope(&added.placed.instance) == Scope::Rig
}

/// Whether an effect grows with what the rotor has done so far, so that the settled states are without it.
pub(crate) fn gathers(added: &AddedEffect) -> bool {
    GATHERS.contains(&added.placed.effect.id())
}

/// Whether an effect is a rotor between winding and air.
fn is_rotor(added: &AddedEffect) -> bool {
    added.placed.effect.id() == "spinup_lag" && ROTORS.iter().any(|form| added.placed.instance.form.starts_with(form))
}

/// The same of one that was seen through rows between which the command jumps.
fn is_of_steps(added: &AddedEffect) -> bool {
    is_rotor(added) && added.placed.instance.form.ends_with(OF_STEPS)
}

/// Time by which the rows of a model's log follow a command that jumps between two of them, s. When it came there, and the mean over a row,
/// are in it: a rotor that is told its commands does not have it.
pub(crate) fn latency_of_rows_s(model: &Model) -> Option<f64> {
    let lag = model.effects.iter().find(|e| is_of_steps(e))?;
    lag.placed.shape.last().copied().filter(|s| *s > 0.0)
}

impl ModelRotor {
    /// The rotors of `model`; `inertia_kgm2` is that of one about its shaft.
    ///
    /// # Errors
    /// What the model does not predict.
    pub(crate) fn new(model: &Model, inertia_kgm2: f64) -> Result<Self, &'static str> {
        let mut flying = Model { effects: model.effects.iter().filter(|e| flies(e)).cloned().collect(), ..model.clone() };
        for added in flying.effects.iter_mut().filter(|e| e.placed.effect.scope(&e.placed.instance) == Scope::Event) {
            // its only shape is the instant
            added.placed.shape.iter_mut().for_each(|t0| *t0 = f64::MIN);
        }
        // a command that jumps between two rows of a log seems as late as its instant is unknown; a flight knows when its commands come
        for lag in flying.effects.iter_mut().filter(|e| is_of_steps(e)) {
            lag.placed.shape.last_mut().into_iter().for_each(|latency| *latency = 0.0);
        }
        // where the run saw the rotor stand still, what its force and torque read then is the zero of the day
        for p in &mut flying.polynomials {
            if model.stood && ["thrust_n", "torque_nm"].contains(&p.channel.as_str()) {
                p.coefficients[0] = 0.0;
            }
        }
        if !flying.polynomials.iter().any(|p| p.channel == "thrust_n") {
            return Err("no thrust; expected one identified from a log with thrust_n");
        }
        // one that is on the current alone says nothing of the torque
        let holds_inertia =
            flying.effects.iter().any(|e| e.placed.effect.id() == "rotor_inertia" && e.placed.instance.touches("torque_nm"));
        let mut rotor = Self { model: flying, inertia_kgm2: if holds_inertia { 0.0 } else { inertia_kgm2 }, settled: Vec::new() };
        let levels = (1000.0 / LEVEL_US) as usize + 1;
        let pulses = (0..levels * LEVEL_ROWS).map(|i| 1000.0 + LEVEL_US * (i / LEVEL_ROWS) as f64).collect();
        let turns = |rows: &Vec<PlantState>| rows.first().zip(rows.last()).is_some_and(|(a, b)| b.rpm > a.rpm);
        // a sweep of minutes would draw a charge and heat a motor as no run did
        let mut fresh = rotor.clone();
        fresh.model.effects.retain(|e| !gathers(e));
        let rows = fresh.rows(LEVEL_ROW_S, pulses).filter(turns);
        let rows = rows.ok_or("no speed from a command; expected one identified from a log with pulse_us")?;
        // the rows beside the next level see its speed come
        rotor.settled = rows.chunks(LEVEL_ROWS).filter_map(|level| level.iter().rev().nth(BESIDE).copied()).collect();
        Ok(rotor)
    }

    /// The names of the effects that fly, and of those that are the rig's meters' and stay on the ground.
    pub(crate) fn effects<'m>(&self, model: &'m Model) -> [Vec<&'m str>; 2] {
        let (fly, stay): (Vec<&AddedEffect>, Vec<&AddedEffect>) = model.effects.iter().partition(|e| flies(e));
        [fly, stay].map(|list| list.iter().map(|e| e.placed.effect.id()).collect())
    }

    /// What the model does not predict and a flight does without, in words.
    pub(crate) fn lacks(&self) -> Vec<&'static str> {
        let absent = |name: &str| !self.model.polynomials.iter().any(|p| p.channel == name);
        let all = [("torque_nm", "no torque, so no yaw by drag"), ("current_a", "no current, so no time aloft")];
        all.into_iter().filter(|(name, _)| absent(name)).map(|(_, words)| words).collect()
    }

    /// Density at which the model's thrust holds, kg/m^3, and whether its own run tells it.
    pub(crate) fn density(&self) -> (f64, bool) {
        self.model.air.map_or((SEA_LEVEL_DENSITY, false), |ratio| (ratio * DENSITY_20_C, true))
    }

    /// What the model says along pulses that are `dt_s` apart.
    fn rows(&self, dt_s: f64, pulses: Vec<f64>) -> Option<Vec<PlantState>> {
        let log = Log {
            t: (0..pulses.len()).map(|i| i as f64 * dt_s).collect(),
            columns: vec![Column { name: "pulse_us".into(), values: pulses }],
            ..Log::default()
        };
        let mut rows = along(&self.model, &log)?.0;
        let mut before = rows.first().map_or(0.0, |r| r.rpm);
        for r in &mut rows {
            if r.rpm <= 0.0 {
                (r.thrust_n, r.torque_nm) = (0.0, 0.0);
            }
            r.torque_nm += self.inertia_kgm2 * (r.rpm - before) / RPM_PER_RAD_S / dt_s;
            before = r.rpm;
        }
        Some(rows)
    }

    /// A rotor that will be given the pulses that `pulse` tells for each instant of a flight of `seconds`; `spun_up`, it runs at the first of
    /// them when the flight begins, else it stands.
    pub(crate) fn planned(&self, pulse: impl Fn(f64) -> f64, seconds: f64, spun_up: bool) -> Option<Planned> {
        let before = (BEFORE_S / ROW_S) as usize;
        let first = if spun_up { pulse(0.0) } else { 1000.0 };
        let flight = (0..=(seconds / ROW_S).ceil() as usize).map(|i| pulse(i as f64 * ROW_S));
        let rows = self.rows(ROW_S, std::iter::repeat_n(first, before).chain(flight).collect())?;
        Some(Planned { rows: rows.into(), before, run_s: 0.0, density: 1.0 })
    }
}

impl ModelRotor {
    /// A rotor whose pulses nobody knows before the flight: it goes to where the model settles with the lag of a small step about the middle
    /// of the range, from rest. What a run has done to the model's rotor by then (charge drawn, heat) is not in it.
    pub(crate) fn following(&self) -> Following {
        let (from, to) = (MIDDLE_US, MIDDLE_US + 20.0);
        let thrust = self.stepped(from, to, 1.0);
        let ends = thrust.last().copied().unwrap_or(0.0);
        let starts = self.settled(from, 1.0).thrust_n;
        let there = starts + (1.0 - 1.0 / core::f64::consts::E) * (ends - starts);
        let lag_ms = thrust.iter().take_while(|t| **t < there).count() + 1;
        Following { rpm: 0.0, rotor: self.clone(), lag_s: lag_ms as f64 * 1.0e-3, density: 1.0 }
    }

    /// Time in which a rotor comes to 63 % of a small step about the middle of the range, s; nothing where the model holds no lag, so that it is
    /// there at the first step of a millisecond.
    pub(crate) fn lag_s(&self) -> Option<f64> {
        Some(self.following().lag_s).filter(|lag_s| *lag_s > FIRST_S)
    }

    /// Time by which the rotor answers a command late beside its lag, s; nothing where the model holds none.
    pub(crate) fn latency_s(&self) -> Option<f64> {
        let latency = self.model.effects.iter().find(|e| is_rotor(e))?.placed.shape.last()?;
        Some(*latency).filter(|s| *s > 0.0)
    }

    /// The settled state of a speed.
    fn turning(&self, rpm: f64) -> PlantState {
        let after = self.settled.partition_point(|s| s.rpm < rpm).clamp(1, self.settled.len() - 1);
        let (a, b) = (&self.settled[after - 1], &self.settled[after]);
        between(a, b, (rpm - a.rpm) / (b.rpm - a.rpm).max(1.0e-9))
    }
}

/// See [`ModelRotor::following`].
#[derive(Clone)]
pub(crate) struct Following {
    rotor: ModelRotor,
    lag_s: f64,
    rpm: f64,
    density: f64,
}

impl Powerplant for Following {
    fn advance(&mut self, dt_s: f64, pulse_us: f64) -> PlantState {
        let change = (self.rotor.settled(pulse_us, 1.0).rpm - self.rpm) * (dt_s / (dt_s + self.lag_s));
        self.rpm = (self.rpm + change).max(0.0);
        let state = self.rotor.turning(self.rpm).in_air(self.density);
        let spun_nm = self.rotor.inertia_kgm2 * change / RPM_PER_RAD_S / dt_s;
        PlantState { rpm: self.rpm, torque_nm: state.torque_nm + spun_nm, ..state }
    }

    fn adjust(&mut self, levers: &PlantLevers) {
        self.density = levers.thrust_factor;
    }
}

impl RotorCurves for ModelRotor {
    fn settled(&self, pulse_us: f64, density: f64) -> PlantState {
        let place = ((pulse_us - 1000.0) / LEVEL_US).clamp(0.0, (self.settled.len() - 1) as f64);
        let i = (place as usize).min(self.settled.len() - 2);
        between(&self.settled[i], &self.settled[i + 1], place - i as f64).in_air(density)
    }

    fn stepped(&self, from_us: f64, to_us: f64, density: f64) -> Vec<f64> {
        let dt_s = 1.0e-3;
        let pulses = (0..4000).map(|i| if i < 3000 { from_us } else { to_us }).collect();
        self.rows(dt_s, pulses).map_or_else(Vec::new, |rows| rows[3000..].iter().map(|r| density * r.thrust_n).collect())
    }
}

/// A rotor along the pulses that it was told before the flight.
#[derive(Clone)]
pub(crate) struct Planned {
    rows: Arc<[PlantState]>,
    /// Rows before the flight.
    before: usize,
    run_s: f64,
    density: f64,
}

impl Powerplant for Planned {
    fn advance(&mut self, dt_s: f64, _pulse_us: f64) -> PlantState {
        self.run_s += dt_s;
        let place = self.before as f64 + (self.run_s / ROW_S).max(-1.0);
        let i = (place as usize).min(self.rows.len() - 1);
        let next = &self.rows[(i + 1).min(self.rows.len() - 1)];
        between(&self.rows[i], next, place - i as f64).in_air(self.density)
    }

    fn adjust(&mut self, levers: &PlantLevers) {
        self.run_s = levers.run_s;
        self.density = levers.thrust_factor;
    }
}

/// A rotor in other air: thrust and torque go with the density, at the same speed.
trait InAir {
    fn in_air(self, density: f64) -> Self;
}

impl InAir for PlantState {
    fn in_air(self, density: f64) -> Self {
        Self { thrust_n: self.thrust_n * density, torque_nm: self.torque_nm * density, ..self }
    }
}

/// A state a share of the way between two.
fn between(a: &PlantState, b: &PlantState, share: f64) -> PlantState {
    let of = |a: f64, b: f64| a + share.clamp(0.0, 1.0) * (b - a);
    PlantState {
        rpm: of(a.rpm, b.rpm),
        thrust_n: of(a.thrust_n, b.thrust_n),
        torque_nm: of(a.torque_nm, b.torque_nm),
        current_a: of(a.current_a, b.current_a),
        voltage_v: of(a.voltage_v, b.voltage_v),
        temp_c: of(a.temp_c, b.temp_c),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Effects of meters, or of what a rig has and a vehicle has not (an encoder on the shaft; the air of a room).
    const STAYS: [&str; 23] = [
        "zero_drift",
        "thermal_zero",
        "tare_shift",
        "gain_change",
        "creep",
        "hysteresis",
        "beam_resonance",
        "channel_filter",
        "channel_delay",
        "encoder_drag",
        "air_density",
        "amplifier_saturation",
        "torque_crosstalk",
        "clock_drift",
        "sample_hold",
        "quantisation",
        "glitch_rows",
        "blade_twist",
        "coupling_slip",
        "missed_pulses",
        "double_pulses",
        "alternating_period",
        "dead_rotor_speed",
    ];

    /// A new effect of the library must be put on one side or the other.
    #[test]
    fn every_effect_flies_or_stays() {
        for effect in ident::effects::library() {
            let places = [FLIES.contains(&effect.id()), STAYS.contains(&effect.id())];
            assert_eq!(places.iter().filter(|p| **p).count(), 1, "{}", effect.id());
        }
        assert_eq!(FLIES.len() + STAYS.len(), ident::effects::library().len());
    }
}
