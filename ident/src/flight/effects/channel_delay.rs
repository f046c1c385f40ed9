//! `channel_delay`: one group of sensors is late.
//!
//! What it is: the accelerometer or the gyro reads what was a moment before, or the rotors' speeds do.
//! What can go wrong: all that are late by the same stay unnoticed, so a gyro with an attitude that was made from it; a slow flight shows no delay. A reading may be a row old, and what a controller
//! holds is seen up to a row late: what is below two rows says how the log was written, and is no finding.
//! Units: s, positive is late.
//! Reference: specification `closing-the-loop.md`, table.

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope};
use crate::attribution::columns::Shape;
use crate::flight::columns::Flight;
use crate::flight::scene::Scene;
use crate::numeric::order::usual_step;
use crate::verdict::Parameter;

pub(super) struct ChannelDelay;

/// Longest delay, s.
const LONGEST_S: f64 = 0.1;
/// Where it is looked for first, s; on a coarse log three rows.
const START_S: f64 = 0.01;
const GROUPS: [&str; 3] = ["acc", "gyro", "rpm"];

impl AirframeEffect for ChannelDelay {
    fn id(&self) -> &'static str {
        "channel_delay"
    }

    fn about(&self) -> About {
        About {
            title: "One group of sensors is late",
            equation: "reading(t) = truth(t - delay)",
            source: "specification, closing-the-loop.md.",
            depends_on: &["t_s"],
            signature: "the residual goes with the rate of change of what is predicted",
            look_alikes: &["spinup_lag", "lever_arm"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        let on = |name: &str| found.channels.iter().any(|c| c.starts_with(name));
        let (who, verb) = match () {
            () if on("rpm") => ("the speed channels", "answer"),
            () if on("ang_acc") || on("gyro") => ("the gyro", "answers"),
            () if ["mag", "mx", "my", "mz"].into_iter().any(on) => ("the magnetometer", "answers"),
            () => ("the accelerometer", "answers"),
        };
        Clause::new(who, found.tell("delay", |v| format!("{verb} {v} late"), &format!("{verb} late")))
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Rig
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        let record = &flight.record;
        let there =
            [record.force.is_some(), record.rate.is_some() && !record.vehicle.rotors.is_empty(), !record.speed.is_empty()];
        let rows = 2.0 * usual_step(&record.t);
        let shape = || Shape { name: "delay", unit: "s", range: (rows, LONGEST_S.max(2.0 * rows)), closed: false };
        let form = |index: usize| Form {
            name: GROUPS[index].to_owned(),
            index,
            shapes: vec![shape()],
            starts: vec![vec![START_S.max(1.5 * rows)]],
            ..Form::default()
        };
        (0..GROUPS.len()).filter(|i| there[*i]).map(form).collect()
    }

    fn alters(&self) -> bool {
        true
    }

    fn alter(&self, _: &Flight, form: &Form, shape: &[f64], scene: &mut Scene<'_>) {
        if let Some(late) = scene.late.get_mut(form.index) {
            *late += shape[0];
        }
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        vec![found.plain("delay", "s")]
    }
}
