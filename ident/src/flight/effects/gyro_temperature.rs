//! `gyro_temperature`: the gyro's offset follows the temperature.
//!
//! What it is: a vector for each kelvin of the column `temp_c` from its first reading.
//! What can go wrong: without that column, or at one temperature, it is not asked.
//! Units: rad/s/K.
//! Reference: PS-ITG-3200A rev 1.4, table 3.1 (zero-rate output over temperature).

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope, Sink, by_axis, single};
use crate::attribution::columns::Prior;
use crate::flight::channels::Target;
use crate::flight::columns::Flight;
use crate::verdict::Parameter;

pub(super) struct GyroTemperature;

/// Usual size, rad/s/K.
const USUAL: f64 = 3e-3;
/// Temperatures that differ less tell nothing, K.
const LEAST_K: f64 = 0.5;
const NAMES: [&str; 3] = by_axis!("per_kelvin");

impl AirframeEffect for GyroTemperature {
    fn id(&self) -> &'static str {
        "gyro_temperature"
    }

    fn about(&self) -> About {
        About {
            title: "The gyro's offset follows the temperature",
            equation: "w += per_kelvin * (temp_c - first temp_c)",
            source: "PS-ITG-3200A rev 1.4, table 3.1.",
            depends_on: &["temp_c"],
            signature: "the gyro drifts against the attitude as the board warms",
            look_alikes: &["gyro_bias"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            "the gyro's offset",
            found.tell_length("per_kelvin", "rad/s", |v| format!("moves by {v} per kelvin"), "follows the temperature"),
        )
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Rig
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        let known = flight.record.temperature.iter().flatten().copied().filter(|c| c.is_finite());
        let (lo, hi) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), c| (a.min(c), b.max(c)));
        single(hi - lo >= LEAST_K && flight.channels.position(Target::Rate(0)).is_some())
    }

    fn columns(&self, _: &Form, _: &[f64], sink: &mut Sink<'_>) {
        let Some(warm) = &sink.flight.record.temperature else { return };
        let first = warm.iter().copied().find(|c| c.is_finite()).unwrap_or(0.0);
        let values: Vec<f64> = warm.iter().map(|c| if c.is_finite() { c - first } else { 0.0 }).collect();
        for (axis, name) in NAMES.into_iter().enumerate() {
            sink.column(name, Prior::about_zero(USUAL)).part(Target::Rate(axis), &values);
        }
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        NAMES.iter().map(|n| found.plain(n, "rad/s/K")).collect()
    }
}
