//! `supply_sag`: the supply gives way under load.
//!
//! What it is: voltage_v -= resistance * current_a: leads, connectors, the source itself.
//! What can go wrong: without a measured voltage it cannot be told from a lower KV, and is not offered; without a measured
//! current the resistance is as uncertain as the efficiency that the current is estimated with.
//! Units: ohm.
//! Reference: Ohm's law; errata to Beharie 2013, Eq. 5.11 (rpm = KV (V - I R)).

use super::{About, Amplitude, Effect, Estimate, Instance, Shape, Stage, present};
use crate::context::Context;
use crate::design::TargetDesign;

/// See the module.
pub(crate) struct SupplySag;

impl Effect for SupplySag {
    fn id(&self) -> &'static str {
        "supply_sag"
    }

    fn about(&self) -> About {
        About {
            title: "Supply voltage sags with the current",
            equation: "voltage_v = V0 - resistance * current_a",
            source: "Ohm's law; Beharie 2013, Eq. 5.11 as corrected",
            depends_on: &["current_a"],
            signature: "the voltage residual mirrors the current; thrust(rpm) and torque(rpm) hold",
            look_alikes: &["battery_discharge"],
        }
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        if context.draw().is_none() || present(context, &["voltage_v"]).is_empty() {
            Vec::new()
        } else {
            vec![Instance::new(&["voltage_v"], "")]
        }
    }

    fn shapes(&self, _: &Context, _: &Instance) -> Vec<Shape> {
        Vec::new()
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "resistance", unit: "ohm" }]
    }

    fn apply(&self, context: &Context, _: &Instance, _: &[f64], position: usize, design: &mut TargetDesign) {
        let Some((current, _)) = context.draw() else { return };
        design.add(position, 0, current.iter().map(|i| -i).collect());
    }

    /// A current that was only estimated is known to a seventh.
    fn report(&self, context: &Context, _: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        if context.draw().is_some_and(|(_, measured)| !measured) {
            for e in &mut fitted {
                e.se = e.se.hypot(e.value / 7.0);
            }
        }
        fitted
    }

    fn plausible(&self, _: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        fitted.iter().all(|e| e.value > 0.0 && e.value < 5.0)
    }
}
