//! `coupling_slip`: the encoder's coupling slips at high speed.
//!
//! What it is: above an onset speed rpm_encoder reads too low.
//! What can go wrong: lost encoder counts at high speed look alike.
//! Units: rev/min, 1.
//! Reference: Beharie 2013, section 5.7.1 (shaft encoder against the optical sensors).

use crate::channel::Context;
use crate::effects::design::TargetDesign;
use crate::effects::rotor::blade_flex::upper_speeds;
use crate::effects::tachometer::speed_channel::{HINGE, add_hinge, instance, leaves};
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage};

/// See the module.
pub(crate) struct CouplingSlip;

impl Effect for CouplingSlip {
    fn id(&self) -> &'static str {
        "coupling_slip"
    }

    fn about(&self) -> About {
        About {
            title: "The encoder's coupling slips",
            equation: "rpm_encoder += slope (rpm - onset) + bend (rpm - onset)^2 / onset above onset, downwards",
            source: "Beharie 2013, section 5.7.1",
            depends_on: &["rpm"],
            signature: "rpm_encoder leaves the other speed channels downwards above one speed",
            look_alikes: &["missed_pulses"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new("the encoder's coupling", found.tell("onset", |v| format!("slips above {v}"), "slips at high speed"))
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        instance(context, "rpm_encoder", "").into_iter().collect()
    }

    fn shapes(&self, context: &Context, _: &Instance) -> Vec<Shape> {
        vec![upper_speeds(context, 14)]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        HINGE.to_vec()
    }

    fn apply(&self, context: &Context, _: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let [onset] = shape else { return };
        add_hinge(context, *onset, position, design);
    }

    fn plausible(&self, context: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        leaves(context, instance, fitted, -1.0)
    }
}
