//! `blade_twist`: the light beam over-reads at high speed.
//!
//! What it is: above an onset speed rpm_beam reads too high: the blade twists, and the beam is cut at another place.
//! What can go wrong: an onset below the slowest speed of the run is a scale error, not a twist.
//! Units: rev/min, 1.
//! Reference: Beharie 2013, section 5.7.1, Fig. 5.54-5.55.

use super::blade_flex::upper_speeds;
use super::speed_channel::{HINGE, LEAST, add_hinge, hinge_at_top, instance};
use super::{About, Amplitude, Effect, Estimate, Instance, Shape, Stage};
use crate::context::Context;
use crate::design::TargetDesign;

/// See the module.
pub(crate) struct BladeTwist;

impl Effect for BladeTwist {
    fn id(&self) -> &'static str {
        "blade_twist"
    }

    fn about(&self) -> About {
        About {
            title: "The light beam over-reads at high speed",
            equation: "rpm_beam += slope (rpm - onset) + bend (rpm - onset)^2 / onset above onset",
            source: "Beharie 2013, section 5.7.1, Fig. 5.54-5.55",
            depends_on: &["rpm"],
            signature: "rpm_beam leaves the other speed channels upwards above one speed",
            look_alikes: &["double_pulses"],
        }
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        instance(context, "rpm_beam", "").into_iter().collect()
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

    fn plausible(&self, context: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        hinge_at_top(context, fitted) > LEAST
    }
}
