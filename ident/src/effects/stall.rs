//! `stall`: the blades stall above an onset speed.
//!
//! What it is: above the onset thrust grows less than the square law, or not at all, while torque grows more; current follows.
//! What can go wrong: thrust alone looks like a saturated amplifier; a torque that falls as well is blade flex.
//! Units: rev/min; internally N/krpm2, N.m/krpm2, A/krpm2.
//! Reference: blade-element theory beyond the angle of greatest lift, Leishman 2006, *Principles of Helicopter Aerodynamics*, 7.1.

use super::blade_flex::upper_speeds;
use super::speed_channel::expected;
use super::{About, Amplitude, Effect, Estimate, Instance, Shape, Stage};
use crate::context::{Context, Relation};
use crate::design::TargetDesign;

/// See the module.
pub(crate) struct Stall;

impl Effect for Stall {
    fn id(&self) -> &'static str {
        "stall"
    }

    fn about(&self) -> About {
        About {
            title: "Blades stall at high speed",
            equation: "thrust_n += thrust_loss (rpm^2 - onset^2), torque_nm += torque_rise (rpm^2 - onset^2), current_a likewise, above onset",
            source: "Leishman 2006, Principles of Helicopter Aerodynamics, section 7.1",
            depends_on: &["rpm"],
            signature: "above one speed thrust stops growing while torque grows faster",
            look_alikes: &["blade_flex", "amplifier_saturation"],
        }
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        super::blade_flex::with_and_without_load(context).into_iter().filter(|i| i.touches("torque_nm")).collect()
    }

    fn shapes(&self, context: &Context, _: &Instance) -> Vec<Shape> {
        vec![upper_speeds(context, 20)]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![
            Amplitude { name: "thrust_loss", unit: "N/krpm2" },
            Amplitude { name: "torque_rise", unit: "N.m/krpm2" },
            Amplitude { name: "current_rise", unit: "A/krpm2" },
            Amplitude { name: "current_rise_loss", unit: "A/krpm3" },
            Amplitude { name: "speed_loss", unit: "rev/min/krpm2" },
        ]
    }

    fn apply(&self, context: &Context, _: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let [onset] = shape else { return };
        let beyond = |speed: &[f64]| -> Vec<f64> { speed.iter().map(|r| (r * r - onset * onset).max(0.0) * 1e-6).collect() };
        match design.relation {
            Relation::Thrust => design.add(position, 0, beyond(&context.rpm)),
            Relation::Torque => design.add(position, 1, beyond(&context.rpm)),
            Relation::Current => {
                let column = beyond(&context.rpm);
                design.add(position, 3, column.iter().zip(&context.rpm).map(|(v, r)| v * r / 1000.0).collect());
                design.add(position, 2, column);
            }
            _ => design.add(position, 4, beyond(expected(context)).iter().map(|v| -v).collect()),
        }
    }

    fn plausible(&self, _: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        let beyond = |name: &str, sign: f64| fitted.iter().any(|e| e.name == name && sign * e.value > 3.0 * e.se);
        beyond("thrust_loss", -1.0) && beyond("torque_rise", 1.0)
    }
}
