//! `channel_delay`: a channel is late.
//!
//! What it is: the reading is the truth some time ago.
//! What can go wrong: a filter looks alike on coarse samples.
//! Units: s, positive is late.
//! Reference: pure transport delay of a logger.

use crate::channel::Context;
use crate::effects::design::TargetDesign;
use crate::effects::{
    About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, every_speed, meters, operator,
    reads_meter, through_meter,
};

/// See the module.
pub(crate) struct ChannelDelay;

impl Effect for ChannelDelay {
    fn id(&self) -> &'static str {
        "channel_delay"
    }

    fn about(&self) -> About {
        About {
            title: "A channel is late",
            equation: "reading(t) = truth(t - delay)",
            source: "transport delay of a logger",
            depends_on: &["t_s", "time_since_step"],
            signature: "rectangular spikes of the residual at every change of the load, as long as the delay",
            look_alikes: &["channel_filter", "clock_drift"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(found.meter(), found.tell("delay", |v| format!("answers {v} late"), "answers late"))
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Output
    }

    fn runs_on(&self, _: &Instance) -> [bool; 2] {
        [false, false]
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        meters(context)
            .iter()
            .chain(&every_speed(context))
            .flat_map(|s| {
                operator::courses(context).iter().map(|jumps| Instance::new(s, if *jumps { operator::OF_STEPS } else { "" }))
            })
            .collect()
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        let most = (15.0 * context.step()).max(5.0);
        // fractions of a row move single samples only: no point of a coarse grid sees them
        let rows = [-2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 3.5].map(|k| k * context.step());
        let coarse = (-6..=24).map(|k| most * f64::from(k) / 24.0).filter(|d| d.abs() > 4.0 * context.step());
        let starts = rows.into_iter().chain(coarse).collect();
        let delay = Shape { name: "delay", unit: "s", range: (-0.5 * most, 1.2 * most), starts };
        if instance.form == operator::OF_STEPS { vec![delay, operator::phase()] } else { vec![delay] }
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        Vec::new()
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], _: usize, design: &mut TargetDesign) {
        let [delay, phase @ ..] = shape else { return };
        let course = operator::course(&instance.form, phase);
        let own = if reads_meter(instance, design.relation) { -delay } else { *delay };
        let late = operator::Late::new(&context.t, course, |_| own);
        through_meter(context, design, |columns| columns.iter().map(|c| late.of(c)).collect());
    }

    fn plausible(&self, _: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        // no meter shows a change before there is one
        fitted.iter().all(|e| e.name != "delay" || e.value > 0.0)
    }

    fn is_within_a_row(&self, context: &Context, fitted: &[Estimate]) -> bool {
        fitted.iter().any(|e| e.name == "delay" && operator::is_within_a_row(context, e.value))
    }

    fn report(&self, context: &Context, _: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        // where the load jumps within rows, a delay is known to a row only: even over one interval
        if operator::abrupt(context) {
            for e in fitted.iter_mut().filter(|e| e.name == "delay") {
                e.se = e.se.hypot(context.step() / 12.0_f64.sqrt());
            }
        }
        fitted
    }
}
