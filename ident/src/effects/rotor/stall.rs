//! `stall`: the blades stall above an onset speed.
//!
//! What it is: above the onset thrust grows less than the square law, or not at all, while torque grows more; current follows.
//! What can go wrong: thrust alone looks like a saturated amplifier; a torque that falls as well is blade flex.
//! Units: rev/min; internally N/krpm2, N.m/krpm2, A/krpm2.
//! Reference: blade-element theory beyond the angle of greatest lift, Leishman 2006, *Principles of Helicopter Aerodynamics*, 7.1.

use crate::channel::{Context, Relation};
use crate::effects::design::TargetDesign;
use crate::effects::rotor::blade_flex::upper_speeds;
use crate::effects::tachometer::speed_channel::expected;
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage};

/// See the module.
pub(crate) struct Stall;

impl Effect for Stall {
    fn id(&self) -> &'static str {
        "stall"
    }

    fn about(&self) -> About {
        About {
            title: "Blades stall at high speed",
            equation: "thrust_n += thrust_loss (rpm^2 - onset^2), torque_nm += torque_rise (rpm^2 - onset^2), current_a likewise, above onset; form whole_blade: rpm^2 (1 - exp(-(rpm - onset) / spread))",
            source: "Leishman 2006, Principles of Helicopter Aerodynamics, section 7.1",
            depends_on: &["rpm"],
            signature: "above one speed thrust stops growing while torque grows faster",
            look_alikes: &["blade_flex", "amplifier_saturation"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new("the blades", found.tell("onset", |v| format!("stall above {v}"), "stall at high speed"))
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let mut out = crate::effects::rotor::blade_flex::with_and_without_load(context);
        let whole: Vec<Instance> = out.iter().map(|i| Instance { form: WHOLE_BLADE.into(), ..i.clone() }).collect();
        out.extend(whole);
        out
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        if instance.form != WHOLE_BLADE {
            return vec![upper_speeds(context, 20)];
        }
        let top = context.rpm.iter().copied().fold(1.0, f64::max);
        let spread = Shape { name: "spread", unit: "rpm", range: (0.005 * top, 0.4 * top), starts: vec![0.03 * top, 0.12 * top] };
        vec![upper_speeds(context, 14), spread]
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
        let [onset, spread @ ..] = shape else { return };
        let stalled = |r: f64| match spread {
            [spread] => r * r * (1.0 - (-(r - onset).max(0.0) / spread).exp()),
            _ => (r * r - onset * onset).max(0.0),
        };
        let beyond = |speed: &[f64]| -> Vec<f64> { speed.iter().map(|r| stalled(*r) * 1e-6).collect() };
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

    fn plausible(&self, _: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        let beyond = |name: &str, sign: f64| fitted.iter().any(|e| e.name == name && sign * e.value > 3.0 * e.se);
        // without a torque arm only the shape tells it from a blade that gives way
        beyond("thrust_loss", -1.0) && (!instance.touches("torque_nm") || beyond("torque_rise", 1.0))
    }
}

/// Form in which the stall runs over the blade within a few hundred revolutions and then takes a constant share of the lift.
const WHOLE_BLADE: &str = "whole_blade";
