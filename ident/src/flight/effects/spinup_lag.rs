//! `spinup_lag`: the rotors follow their pulses with a lag.
//!
//! What it is: first order, with one time constant on the way up and another down. The pulse jumps somewhere between two rows: where, is a
//! parameter. Where no speed was measured, thrust and moments lag.
//! What can go wrong: pulses that hardly move show no lag.
//! Units: s.
//! Reference: Beharie 2013, section 5.3; Eschmann, Albani & Loianno, 2024 (motor delays of the Crazyflie).

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope};
use crate::attribution::columns::Shape;
use crate::flight::columns::Flight;
use crate::flight::scene::{Lag, Scene, followed};
use crate::verdict::Parameter;

pub(super) struct SpinupLag;

/// Time constants, s: range and starts.
const RANGE: (f64, f64) = (1e-3, 0.5);
const STARTS: [f64; 3] = [0.02, 0.05, 0.12];
/// Share of the time between two rows at which a pulse is first taken to jump.
const MIDDLE: f64 = 0.5;

impl AirframeEffect for SpinupLag {
    fn id(&self) -> &'static str {
        "spinup_lag"
    }

    fn about(&self) -> About {
        About {
            title: "Rotors follow their pulses with a lag",
            equation: "tau dw/dt = w_settled(pulse) - w, tau = tau_up or tau_down",
            source: "Beharie 2013, section 5.3; Eschmann, Albani & Loianno 2024.",
            depends_on: &["pulse_us"],
            signature: "after every change of a pulse forces and moments come late",
            look_alikes: &["channel_delay"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            "the rotors",
            found.tell("tau_up", |v| format!("take {v} to follow their pulses"), "take time to follow their pulses"),
        )
    }

    fn is_of_every_vehicle(&self) -> bool {
        true
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Rig
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        if flight.record.command.is_empty() {
            return Vec::new();
        }
        let along = |name| Shape { name, unit: "s", range: RANGE, closed: false };
        let phase = Shape { name: "phase", unit: "1", range: (0.0, 1.0), closed: true };
        let starts = STARTS.map(|s| vec![s, s, MIDDLE]).to_vec();
        vec![Form { shapes: vec![along("tau_up"), along("tau_down"), phase], starts, ..Form::default() }]
    }

    fn alters(&self) -> bool {
        true
    }

    fn alter(&self, flight: &Flight, _: &Form, shape: &[f64], scene: &mut Scene<'_>) {
        let [up, down, ref phase @ ..] = *shape else { return };
        // a model file without a phase was fitted with the middle
        let lag = Lag { up, down, phase: phase.first().copied().unwrap_or(MIDDLE) };
        scene.lag = Some(lag);
        if flight.record.speed.is_empty() {
            scene.drive = flight.record.command.iter().map(|c| followed(&flight.record.t, c, &lag)).collect();
        }
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        vec![found.plain("tau_up", "s"), found.plain("tau_down", "s")]
    }
}
