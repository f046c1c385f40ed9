//! `current_induced_field`: the field of the motors' leads.
//!
//! What it is: a vector in body axes for each ampere of the column `current_a`.
//! What can go wrong: without that column, or a magnetometer, it is not asked; at one current it is one with `hard_iron`.
//! Units: uT/A.
//! Reference: law of Biot and Savart: the field of a conductor is proportional to its current.

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope, Sink, by_axis, single};
use crate::attribution::columns::Prior;
use crate::flight::channels::Target;
use crate::flight::columns::Flight;
use crate::verdict::Parameter;

pub(super) struct CurrentInducedField;

/// Usual field at the usual current, uT.
const USUAL_UT: f64 = 10.0;
const NAMES: [&str; 3] = by_axis!("per_ampere");

impl AirframeEffect for CurrentInducedField {
    fn id(&self) -> &'static str {
        "current_induced_field"
    }

    fn about(&self) -> About {
        About {
            title: "The motors' current disturbs the field",
            equation: "m += per_ampere * current_a",
            source: "law of Biot and Savart.",
            depends_on: &["current_a"],
            signature: "the field in body axes goes with the current",
            look_alikes: &["hard_iron"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            "the motors' current",
            found.tell_length("per_ampere", "uT", |v| format!("bends the field by {v} per ampere"), "bends the field"),
        )
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Rig
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        single(flight.record.current.is_some() && flight.channels.position(Target::Field(0)).is_some())
    }

    fn columns(&self, _: &Form, _: &[f64], sink: &mut Sink<'_>) {
        let Some(current) = &sink.flight.record.current else { return };
        let usual = USUAL_UT / sink.flight.usual.supply[1];
        for (axis, name) in NAMES.into_iter().enumerate() {
            sink.column(name, Prior::about_zero(usual)).part(Target::Field(axis), current);
        }
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        NAMES.iter().map(|n| found.plain(n, "uT/A")).collect()
    }
}
