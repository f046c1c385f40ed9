//! `missed_pulses`: a speed channel misses pulses.
//!
//! What it is: the channel reads a share `probability` too low on the whole (counting over many pulses), or grossly too low in
//! scattered samples, in which case the probability of a pulse is what is lost on average (pulses counted over a window), or the share of
//! such samples (single periods timed).
//! What can go wrong: scattered samples are recognised by their own reading; the primary relation makes no claim about them.
//! Units: 1.
//! Reference: Beharie 2013, section 5.7.1 (blade that the beam does not see).

use crate::channel::Context;
use crate::effects::design::TargetDesign;
use crate::effects::tachometer::pulses::{
    apply_pulses, is_of_single_readings, plausible_pulses, pulse_amplitudes, pulse_instances, report_pulses,
};
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage};

/// See the module.
pub(crate) struct MissedPulses;

/// Direction of the error.
const SIGN: f64 = -1.0;

impl Effect for MissedPulses {
    fn id(&self) -> &'static str {
        "missed_pulses"
    }

    fn about(&self) -> About {
        About {
            title: "A speed channel misses pulses",
            equation: "rpm_x = (1 - probability) rpm, or (1 - depth) rpm in scattered samples",
            source: "Beharie 2013, section 5.7.1",
            depends_on: &["rpm"],
            signature: "one speed channel reads low against the others, by one share of the speed or in scattered samples",
            look_alikes: &["coupling_slip", "dead_rotor_speed", "alternating_period"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(found.meter(), found.tell_in("probability", "%", |v| format!("misses {v} of its pulses"), "misses pulses"))
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

    fn is_of_moments(&self, instance: &Instance) -> bool {
        is_of_single_readings(instance)
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        pulse_instances(context, SIGN)
    }

    fn shapes(&self, _: &Context, _: &Instance) -> Vec<Shape> {
        Vec::new()
    }

    fn amplitudes(&self, instance: &Instance) -> Vec<Amplitude> {
        pulse_amplitudes(instance)
    }

    fn apply(&self, context: &Context, instance: &Instance, _: &[f64], position: usize, design: &mut TargetDesign) {
        apply_pulses(context, instance, SIGN, position, design);
    }

    fn report(&self, context: &Context, instance: &Instance, fitted: Vec<Estimate>) -> Vec<Estimate> {
        report_pulses(context, instance, SIGN, fitted)
    }

    fn plausible(&self, _: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        plausible_pulses(instance, fitted)
    }
}
