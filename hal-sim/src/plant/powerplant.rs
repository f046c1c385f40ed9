//! The powerplant: pulse in, motion, force and current out.
//!
//! What it is: the trait behind which an identified model can take the place of the simulated one ([`super::RigPlant`]), and what it
//! gives: a state, or those of a millisecond at once.
//! What can go wrong: a model that gives a negative speed or a NaN; the bench clamps it to a resting rotor.
//! Units: SI; rev/min for rotor speed, us for the pulse.
//! Reference: specification `closing-the-loop.md`, step 9.

use super::parts::Parts;
use super::shaft::{Begun, Turns};

/// What the powerplant does at one instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PlantState {
    /// Rotor speed, rev/min.
    pub rpm: f64,
    /// Lift on the beam, N.
    pub thrust_n: f64,
    /// Torque on the arm that carries the motor, N.m.
    pub torque_nm: f64,
    /// Supply current, A.
    pub current_a: f64,
    /// Voltage at the ESC, V.
    pub voltage_v: f64,
    /// Temperature of the rig, degC.
    pub temp_c: f64,
}

/// What the windings give at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BackEmf {
    /// Amplitude of the voltage between two windings, V: the back-EMF constant 60/(2 pi KV) times the speed in rad/s.
    pub amplitude_v: f64,
    /// Electrical turns in a turn of the rotor.
    pub pole_pairs: u32,
}

/// Steps of the bench in a millisecond.
pub const STEPS_PER_MS: usize = 10;

/// What the powerplant did in each step of one millisecond.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PlantBlock {
    /// Rotor speed at the end of each step, rev/min.
    pub rpm: [f64; STEPS_PER_MS],
    /// Lift on the beam, N.
    pub thrust_n: [f64; STEPS_PER_MS],
    /// Torque on the arm, N.m.
    pub torque_nm: [f64; STEPS_PER_MS],
    /// Temperature of the rig, degC.
    pub temp_c: [f64; STEPS_PER_MS],
    /// Everything at the end of the last step.
    pub last: PlantState,
}

/// What turns a pulse into motion, force and current.
pub trait Powerplant: Send {
    /// Steps by `dt_s` with the ESC following a pulse of `pulse_us` (1000 is off).
    fn advance(&mut self, dt_s: f64, pulse_us: f64) -> PlantState;

    /// Ten steps of `dt_s` at one pulse: the same numbers as ten times [`Powerplant::advance`].
    /// `meanwhile` is work that needs nothing of them, done once: beside steps that wait for one another it takes next to no time.
    fn advance_block(&mut self, dt_s: f64, pulse_us: f64, out: &mut PlantBlock, meanwhile: &mut dyn FnMut()) {
        if let Some(begun) = self.begin(dt_s, pulse_us) {
            let mut turns = Turns::default();
            begun.turn(&mut turns, meanwhile);
            return self.end(&begun, &turns, out);
        }
        for i in 0..STEPS_PER_MS {
            out.put(i, self.advance(dt_s, pulse_us));
        }
        meanwhile();
    }

    /// Begins such a block where nothing but the shaft moves in it, so that its steps can be taken beside those of others; `None`, and
    /// nothing has moved, where more does. [`Powerplant::end`] is due next.
    fn begin(&mut self, dt_s: f64, pulse_us: f64) -> Option<Begun> {
        let _ = (dt_s, pulse_us);
        None
    }

    /// Ends the block with the steps that its shaft has taken.
    fn end(&mut self, begun: &Begun, turns: &Turns, out: &mut PlantBlock) {
        let _ = (begun, turns, out);
    }

    /// Takes what the effects make of the plant at this moment. A model that is not made of parts ignores it.
    fn adjust(&mut self, levers: &PlantLevers) {
        let _ = levers;
    }

    /// Takes changed parts in the midst of a run; what turns, flows and glows goes on. A model that is not made of parts
    /// ignores it.
    fn refit(&mut self, parts: &Parts) {
        let _ = parts;
    }

    /// What a back-EMF meter finds at the windings now; `None` of a model that has no windings.
    fn back_emf(&self) -> Option<BackEmf> {
        None
    }
}

impl PlantBlock {
    /// Puts the state after step `i` in its place.
    #[inline]
    pub fn put(&mut self, i: usize, state: PlantState) {
        self.rpm[i] = state.rpm;
        self.thrust_n[i] = state.thrust_n;
        self.torque_nm[i] = state.torque_nm;
        self.temp_c[i] = state.temp_c;
        self.last = state;
    }
}

/// Parameters of the plant that effects move during a run. The default is a healthy rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlantLevers {
    /// Seconds since run start; negative before.
    pub run_s: f64,
    /// Resistance between source and ESC on top of the supply's own, ohm.
    pub resistance_ohm: f64,
    /// Constant drag on the shaft, N.m.
    pub drag_nm: f64,
    /// Drag in proportion to speed, N.m.s/rad.
    pub drag_nms: f64,
    /// Share of that drag whose reaction does not go through the torque arm's motor, 0..1.
    pub drag_share: f64,
    /// Factor on the thrust coefficient.
    pub thrust_factor: f64,
    /// Factor on the torque coefficient.
    pub torque_factor: f64,
    /// Inertia on top of rotor's and propeller's own, kg.m^2.
    pub inertia_kgm2: f64,
}

impl Default for PlantLevers {
    fn default() -> Self {
        Self {
            run_s: 0.0,
            resistance_ohm: 0.0,
            drag_nm: 0.0,
            drag_nms: 0.0,
            drag_share: 0.0,
            thrust_factor: 1.0,
            torque_factor: 1.0,
            inertia_kgm2: 0.0,
        }
    }
}
