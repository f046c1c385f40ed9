//! `g_sensitivity`: the gyro's offset follows the specific force.
//!
//! What it is: the gyro reads a matrix times the specific force.
//! What can go wrong: in gentle flight the specific force is constant in body axes, and it is one with the offset.
//! Units: rad/s per m/s^2.
//! Reference: IEEE Std 952, acceleration-sensitive drift.

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope, Sink, single};
use crate::attribution::columns::Prior;
use crate::flight::channels::Target;
use crate::flight::columns::Flight;
use crate::verdict::Parameter;

pub(super) struct GSensitivity;

/// Usual size, rad/s per m/s^2: some 3 deg/s/g. A good part has a tenth of it, one that hangs in soft foam ten times as much.
const USUAL: f64 = 5e-3;
const NAMES: [[&str; 3]; 3] = [["g_xx", "g_xy", "g_xz"], ["g_yx", "g_yy", "g_yz"], ["g_zx", "g_zy", "g_zz"]];

impl AirframeEffect for GSensitivity {
    fn id(&self) -> &'static str {
        "g_sensitivity"
    }

    fn about(&self) -> About {
        About {
            title: "The gyro feels the specific force",
            equation: "w += G f",
            source: "IEEE Std 952.",
            depends_on: &["acc"],
            signature: "the gyro departs from the attitude's turning with the specific force",
            look_alikes: &["gyro_bias"],
        }
    }

    fn said(&self, _: &EffectEntry) -> Clause {
        Clause::new("the gyro", "turns with the specific force")
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Rig
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        single(flight.record.force.is_some() && flight.channels.position(Target::Rate(0)).is_some())
    }

    fn columns(&self, _: &Form, _: &[f64], sink: &mut Sink<'_>) {
        let Some(force) = &sink.flight.record.force else { return };
        for (axis, names) in NAMES.into_iter().enumerate() {
            for (of, name) in names.into_iter().enumerate() {
                sink.column(name, Prior::about_zero(USUAL)).part(Target::Rate(axis), &force[of]);
            }
        }
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        NAMES.iter().flatten().map(|n| found.plain(n, "rad/s/(m/s^2)")).collect()
    }
}
