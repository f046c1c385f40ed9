//! `hard_iron`: a magnet that flies along.
//!
//! What it is: a constant vector in body axes.
//! What can go wrong: without turning it is one with the earth's field.
//! Units: uT.
//! Reference: Gebre-Egziabher et al., Journal of Aerospace Engineering 19(2), 2006.

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope, Sink, by_axis, single};
use crate::attribution::columns::Prior;
use crate::flight::channels::Target;
use crate::flight::columns::Flight;
use crate::verdict::Parameter;

pub(super) struct HardIron;

/// Usual size, uT.
const USUAL_UT: f64 = 20.0;
const NAMES: [&str; 3] = by_axis!("offset");

impl AirframeEffect for HardIron {
    fn id(&self) -> &'static str {
        "hard_iron"
    }

    fn about(&self) -> About {
        About {
            title: "A magnet flies along",
            equation: "m += offset, constant in body axes",
            source: "Gebre-Egziabher et al. 2006.",
            depends_on: &["attitude"],
            signature: "a constant in the field that turns with the body",
            look_alikes: &["current_induced_field", "soft_iron"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        let on = if found.parameter("t1").is_some() { "" } else { " on" };
        let since = found.tell("t0", |v| format!(" from {v}{on}"), "") + &found.tell("t1", |v| format!(" until {v}"), "");
        let does = found.tell_length("offset", "uT", |v| format!("adds {v} to the field"), "shifts the field");
        Clause::new("a magnet on board", format!("{does}{since}"))
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Rig
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        single(flight.channels.position(Target::Field(0)).is_some())
    }

    fn columns(&self, _: &Form, _: &[f64], sink: &mut Sink<'_>) {
        for (axis, name) in NAMES.into_iter().enumerate() {
            sink.column(name, Prior::about_zero(USUAL_UT)).constant(Target::Field(axis));
        }
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        NAMES.iter().map(|n| found.plain(n, "uT")).collect()
    }
}
