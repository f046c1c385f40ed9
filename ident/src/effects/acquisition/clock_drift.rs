//! `clock_drift`: thrust and torque come from a logger whose own clock runs slow.
//!
//! What it is: they fall behind by rate * t: what stands at t was true at t - rate * t.
//! What can go wrong: needs load changes late in the run; one constant delay fits as well where they are all at one time.
//! Units: 1 (seconds late a second), positive falls behind.
//! Reference: frequency tolerance of two free-running oscillators.

use crate::channel::Context;
use crate::effects::design::TargetDesign;
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, operator, present};

/// See the module.
pub(crate) struct ClockDrift;

impl Effect for ClockDrift {
    fn id(&self) -> &'static str {
        "clock_drift"
    }

    fn about(&self) -> About {
        About {
            title: "Thrust and torque come from a slow clock",
            equation: "reading(t) = truth(t - rate t), t from the first row",
            source: "tolerance of two free-running oscillators",
            depends_on: &["t_s", "time_since_step"],
            signature: "spikes of the thrust and torque residual at every change of the load, wider and wider with time",
            look_alikes: &["channel_delay", "channel_filter"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            "thrust and torque",
            found.tell_in("rate", "%", |v| format!("come from a clock that is off by {v}"), "come from a clock that is off"),
        )
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Output
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let channels = present(context, &["thrust_n", "torque_nm"]);
        if context.time_is_row || channels.is_empty() {
            return Vec::new();
        }
        operator::courses(context)
            .iter()
            .map(|jumps| Instance::new(&channels, if *jumps { operator::OF_STEPS } else { "" }))
            .collect()
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        // lateness at the end of the run, in rows
        let late = [0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 11.0, 15.0, 20.0, 30.0, 45.0, 70.0];
        let early = [0.06, 0.12, 0.25, 0.5, 1.0, 3.0, 8.0, 20.0].map(|r: f64| -r);
        let rows: Vec<f64> = late.into_iter().chain(early).collect();
        let unit = context.step() / context.duration().max(1e-9);
        let rate = Shape {
            name: "rate",
            unit: "1",
            range: (-40.0 * unit, 150.0 * unit),
            starts: rows.iter().map(|r| r * unit).collect(),
        };
        if instance.form == operator::OF_STEPS { vec![rate, operator::phase()] } else { vec![rate] }
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        Vec::new()
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], _: usize, design: &mut TargetDesign) {
        let [rate, phase @ ..] = shape else { return };
        let course = operator::course(&instance.form, phase);
        let t0 = context.t.first().copied().unwrap_or(0.0);
        let late = operator::Late::new(&context.t, course, |t| rate * (t - t0));
        design.map_columns(|column| late.of(column));
    }

    fn is_within_a_row(&self, context: &Context, fitted: &[Estimate]) -> bool {
        // on average over the run
        let late = |rate: f64| 0.5 * rate.abs() * context.duration();
        fitted.iter().any(|e| e.name == "rate" && operator::is_within_a_row(context, late(e.value)))
    }

    fn report(&self, context: &Context, _: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        // where the load jumps within rows, lateness is known to a row only
        if operator::abrupt(context) {
            for e in fitted.iter_mut().filter(|e| e.name == "rate") {
                e.se = e.se.hypot(context.step() / 12.0_f64.sqrt() / context.duration().max(1e-9));
            }
        }
        fitted
    }
}
