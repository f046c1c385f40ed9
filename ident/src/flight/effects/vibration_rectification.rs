//! `vibration_rectification`: vibration becomes an offset.
//!
//! What it is: the accelerometer's offset (and the gyro's) goes with the mean square of the vibration, which the log shows from row to row.
//! What can go wrong: a vibration of one strength throughout is one with a constant offset; a log of slow rows holds only its image.
//! Units: m/s^2 and rad/s, each per (m/s^2)^2.
//! Reference: IEEE Std 1293, vibration rectification error.

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope, Sink, by_axis, single};
use crate::attribution::columns::Prior;
use crate::flight::channels::Target;
use crate::flight::columns::Flight;
use crate::flight::vibration::Shaking;
use crate::verdict::Parameter;

pub(super) struct VibrationRectification;

/// Usual offset at the usual vibration, m/s^2 and rad/s: near a resonance of the frame it is ten times that of a well mounted board.
const USUAL: (f64, f64) = (2.0, 0.2);
const FORCE: [&str; 3] = by_axis!("per_square");
const RATE: [&str; 3] = by_axis!("rate_per_square");

impl AirframeEffect for VibrationRectification {
    fn id(&self) -> &'static str {
        "vibration_rectification"
    }

    fn about(&self) -> About {
        About {
            title: "Vibration becomes an offset",
            equation: "f += per_square * vibration^2, w += rate_per_square * vibration^2, vibration the rms of the specific force from row to row, as a function of the rotors' speeds",
            source: "IEEE Std 1293.",
            depends_on: &["vibration"],
            signature: "the offset of specific force or rate grows with the vibration",
            look_alikes: &["accelerometer_bias", "gyro_bias"],
        }
    }

    fn said(&self, _: &EffectEntry) -> Clause {
        Clause::new("vibration", "shifts what the inertial sensors read")
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Rig
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        single(flight.shaking.is_some())
    }

    fn columns(&self, _: &Form, _: &[f64], sink: &mut Sink<'_>) {
        let Some(Shaking { square, usual }) = sink.flight.shaking.clone() else { return };
        for (axis, name) in FORCE.into_iter().enumerate() {
            sink.column(name, Prior::about_zero(USUAL.0 / usual)).window(Target::Force(axis), square.clone());
        }
        if sink.flight.channels.position(Target::Rate(0)).is_some() {
            for (axis, name) in RATE.into_iter().enumerate() {
                sink.column(name, Prior::about_zero(USUAL.1 / usual)).window(Target::Rate(axis), square.clone());
            }
        }
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        let force = FORCE.iter().map(|n| found.plain(n, "m/s^2/(m/s^2)^2"));
        let rate = RATE.iter().filter(|n| found.own.iter().any(|o| o.0 == **n)).map(|n| found.plain(n, "rad/s/(m/s^2)^2"));
        force.chain(rate).collect()
    }
}
