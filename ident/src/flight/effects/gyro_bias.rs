//! `gyro_bias`: a constant in the rate.
//!
//! What it is: an offset along each body axis against the turning of the log's attitude.
//! What can go wrong: an attitude that was made from the same gyro without correcting it has the offset too, and nothing shows.
//! Units: rad/s.
//! Reference: IEEE Std 952, in-run bias.

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope, Sink, by_axis, single};
use crate::attribution::columns::Prior;
use crate::flight::channels::Target;
use crate::flight::columns::Flight;
use crate::verdict::Parameter;

pub(super) struct GyroBias;

/// Usual offset, rad/s: some 2 deg/s.
const USUAL: f64 = 0.03;
const NAMES: [&str; 3] = by_axis!("bias");

impl AirframeEffect for GyroBias {
    fn id(&self) -> &'static str {
        "gyro_bias"
    }

    fn about(&self) -> About {
        About {
            title: "The gyro has an offset",
            equation: "w += bias",
            source: "IEEE Std 952.",
            depends_on: &[],
            signature: "a constant between the gyro and the turning of the attitude",
            look_alikes: &["g_sensitivity", "gyro_temperature"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new("the gyro", found.tell_length("bias", "rad/s", |v| format!("is off by {v}"), "has an offset"))
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Run
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        single(flight.channels.position(Target::Rate(0)).is_some())
    }

    fn columns(&self, _: &Form, _: &[f64], sink: &mut Sink<'_>) {
        for (axis, name) in NAMES.into_iter().enumerate() {
            sink.column(name, Prior::about_zero(USUAL)).constant(Target::Rate(axis));
        }
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        NAMES.iter().map(|n| found.plain(n, "rad/s")).collect()
    }
}
