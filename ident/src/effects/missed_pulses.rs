//! `missed_pulses`: a speed channel misses pulses.
//!
//! What it is: the channel reads a share `probability` too low on the whole (counting over many pulses), or grossly too low in
//! scattered samples, in which case the probability of a pulse is what is lost on average (pulses counted over a window), or the share of
//! such samples (single periods timed).
//! What can go wrong: scattered samples are recognised by their own reading; the primary relation makes no claim about them.
//! Units: 1.
//! Reference: Beharie 2013, section 5.7.1 (blade that the beam does not see).

use super::speed_channel::{LEAST, difference, gross, instances, is_scattered, pulse_probability};
use super::{About, Amplitude, Effect, Estimate, Instance, Shape, Stage};
use crate::context::{Context, Relation};
use crate::design::TargetDesign;

/// See the module.
pub(crate) struct MissedPulses;

/// Direction of the error.
const SIGN: f64 = -1.0;
/// Form in which single samples are off.
const SCATTERED: &str = "scattered";

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

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let mut out = instances(context, "");
        for instance in instances(context, SCATTERED) {
            let Some(target) = difference(context, &instance) else { continue };
            if is_scattered(context, target, SIGN) {
                out.retain(|i| i.channels != instance.channels);
                out.push(instance);
            }
        }
        out
    }

    fn shapes(&self, _: &Context, _: &Instance) -> Vec<Shape> {
        Vec::new()
    }

    fn amplitudes(&self, instance: &Instance) -> Vec<Amplitude> {
        let name = if instance.form == SCATTERED { "depth" } else { "probability" };
        vec![Amplitude { name, unit: "1" }]
    }

    fn apply(&self, context: &Context, instance: &Instance, _: &[f64], position: usize, design: &mut TargetDesign) {
        // the channel's own polynomial takes a constant share
        let (Relation::SpeedDifference, Some(target)) = (design.relation, difference(context, instance)) else { return };
        let on = if instance.form == SCATTERED { gross(context, target, SIGN) } else { vec![1.0; context.len()] };
        design.add(position, 0, on.iter().zip(&context.rpm).map(|(s, r)| SIGN * s * r).collect());
    }

    fn report(&self, context: &Context, instance: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        if let Some(target) = difference(context, instance).filter(|_| instance.form == SCATTERED) {
            fitted.insert(0, pulse_probability(context, target, SIGN));
        }
        fitted
    }

    fn plausible(&self, _: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        let most = if instance.form == SCATTERED { 3.0 } else { 0.3 };
        fitted.iter().all(|e| e.value > LEAST && e.value < most)
    }
}
