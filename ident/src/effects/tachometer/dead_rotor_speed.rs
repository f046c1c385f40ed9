//! `dead_rotor_speed`: one speed channel is stuck, or counts half or twice the turns.
//!
//! What it is: the channel reads a constant factor times the speed of the others: 0 dead, 0.5 half the pulses, 2 twice.
//! What can go wrong: a factor near 1 is a sensor that misses some pulses.
//! Units: 1.
//! Reference: sensor disagreement, specification `rig.md`; Beharie 2013, section 5.7.1.

use crate::channel::{Context, Relation};
use crate::effects::design::TargetDesign;
use crate::effects::tachometer::speed_channel::instances;
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage};

/// See the module.
pub(crate) struct DeadRotorSpeed;

impl Effect for DeadRotorSpeed {
    fn id(&self) -> &'static str {
        "dead_rotor_speed"
    }

    fn about(&self) -> About {
        About {
            title: "A speed channel is dead or counts by a wrong factor",
            equation: "rpm_x = factor rpm",
            source: "Beharie 2013, section 5.7.1",
            depends_on: &["rpm"],
            signature: "one speed channel reads a fixed, far-off multiple of what all others read",
            look_alikes: &["missed_pulses", "double_pulses"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            found.meter(),
            found.tell("factor", |v| format!("reads {v} times the speed"), "reads a wrong multiple of the speed"),
        )
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn shows_beside_others_alone(&self) -> bool {
        true
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        instances(context, "")
    }

    fn shapes(&self, _: &Context, _: &Instance) -> Vec<Shape> {
        Vec::new()
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "excess", unit: "1" }]
    }

    fn apply(&self, context: &Context, _: &Instance, _: &[f64], position: usize, design: &mut TargetDesign) {
        if design.relation == Relation::SpeedDifference {
            design.add(position, 0, context.rpm.clone());
        }
    }

    fn report(&self, _: &Context, _: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        for e in fitted.iter_mut().filter(|e| e.name == "excess") {
            e.name = "factor".into();
            e.value += 1.0;
        }
        fitted
    }

    fn plausible(&self, _: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        fitted.iter().all(|e| e.value.abs() > 0.3)
    }
}
