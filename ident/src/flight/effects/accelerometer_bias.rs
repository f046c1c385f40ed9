//! `accelerometer_bias`: a constant in the specific force.
//!
//! What it is: an offset along each body axis, this day's own.
//! What can go wrong: along z it is one with the thrust coefficient while the thrust hardly changes.
//! Units: m/s^2.
//! Reference: IEEE Std 1293, accelerometer bias.

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope, Sink, by_axis, single};
use crate::attribution::columns::Prior;
use crate::flight::channels::Target;
use crate::flight::columns::Flight;
use crate::verdict::Parameter;

pub(super) struct AccelerometerBias;

/// Usual offset, m/s^2: some 30 mg.
const USUAL: f64 = 0.3;
const NAMES: [&str; 3] = by_axis!("bias");

impl AirframeEffect for AccelerometerBias {
    fn id(&self) -> &'static str {
        "accelerometer_bias"
    }

    fn about(&self) -> About {
        About {
            title: "The accelerometer has an offset",
            equation: "f += bias",
            source: "IEEE Std 1293.",
            depends_on: &[],
            signature: "a constant in the specific force, whatever the motion",
            look_alikes: &["wind", "vibration_rectification"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new("the accelerometer", found.tell_length("bias", "m/s^2", |v| format!("is off by {v}"), "has an offset"))
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Run
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        single(flight.record.force.is_some())
    }

    fn columns(&self, _: &Form, _: &[f64], sink: &mut Sink<'_>) {
        for (axis, name) in NAMES.into_iter().enumerate() {
            sink.column(name, Prior::about_zero(USUAL)).constant(Target::Force(axis));
        }
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        NAMES.iter().map(|n| found.plain(n, "m/s^2")).collect()
    }
}
