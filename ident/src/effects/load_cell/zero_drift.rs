//! `zero_drift`: the load cell's zero moves with time.
//!
//! What it is: thrust_n += rate * t, from bridge self-heating, amplifier drift or creep of the adhesive.
//! What can go wrong: on a plain upward staircase time and load rise together; the schedule should come back.
//! Units: N/s; time since the first row, s.
//! Reference: Beharie 2013, section 5.7.1 (drift of the strain channel).

use crate::channel::Context;
use crate::effects::design::TargetDesign;
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Instance, Scope, Shape, Stage, thrust_over_time};

/// See the module.
pub(crate) struct ZeroDrift;

impl Effect for ZeroDrift {
    fn id(&self) -> &'static str {
        "zero_drift"
    }

    fn about(&self) -> About {
        About {
            title: "Zero drift of the load cell with time",
            equation: "thrust_n += rate * t",
            source: "Beharie 2013, section 5.7.1",
            depends_on: &["t_s"],
            signature: "the thrust residual is a straight line over time and the same at every level",
            look_alikes: &["thermal_zero", "creep", "tare_shift"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            "the load cell's zero",
            found.tell_signed(
                "rate",
                (60.0, "N"),
                ["up", "down"],
                |word, v| format!("drifts {word} by {v} a minute"),
                "drifts with time",
            ),
        )
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Run
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        thrust_over_time(context)
    }

    fn shapes(&self, _: &Context, _: &Instance) -> Vec<Shape> {
        Vec::new()
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "rate", unit: "N/s" }]
    }

    fn apply(&self, context: &Context, _: &Instance, _: &[f64], position: usize, design: &mut TargetDesign) {
        let t0 = context.t.first().copied().unwrap_or(0.0);
        design.add(position, 0, context.t.iter().map(|t| t - t0).collect());
    }
}
