//! `battery_polarisation`: the battery gives way a little later than its current asks, and recovers as slowly.
//!
//! What it is: beside the resistance that answers at once a battery has one that answers through a first-order lag: ions that have to move. After
//! a load the voltage climbs back within seconds.
//! What can go wrong: a slow voltmeter beside a sag without a resistance that answers at once looks alike; the charge drawn does where the lag is
//! longer than the run.
//! Units: ohm, s.
//! Reference: Chen & Rincon-Mora 2006, IEEE Trans. Energy Conversion 21:504, the resistor-capacitor pair behind the series resistance.

use super::operator::{self, Course};
use super::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, geometric, present};
use crate::context::Context;
use crate::design::TargetDesign;

/// See the module.
pub(crate) struct BatteryPolarisation;

impl Effect for BatteryPolarisation {
    fn id(&self) -> &'static str {
        "battery_polarisation"
    }

    fn about(&self) -> About {
        About {
            title: "Battery recovers slowly from a load",
            equation: "voltage_v = V0 - resistance * i, tau d(i)/dt = current_a - i",
            source: "resistor-capacitor pair of a battery, Chen & Rincon-Mora 2006",
            depends_on: &["current_a", "t_s"],
            signature: "voltage goes on falling for seconds after a load has come, and climbs back for seconds after it has gone",
            look_alikes: &["battery_discharge", "supply_sag", "channel_filter"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        let slowly = found.tell("tau", |v| format!("gives way and recovers with a lag of {v}"), "recovers slowly from a load");
        Clause::new("the battery", slowly)
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let measured = context.current.is_some() && !present(context, &["voltage_v"]).is_empty();
        if context.time_is_row || context.is_table() || !measured {
            return Vec::new();
        }
        vec![Instance::new(&["voltage_v"], "")]
    }

    fn shapes(&self, context: &Context, _: &Instance) -> Vec<Shape> {
        // a lag within two rows answers at once, and one longer than a third of the run is a charge
        let (lo, hi) = (2.0 * context.step(), context.duration() / 3.0);
        vec![Shape { name: "tau", unit: "s", range: (lo, hi.max(2.0 * lo)), starts: geometric(1.5 * lo, 0.8 * hi, 10) }]
    }

    /// A battery that answers late answers at once too.
    fn part_of(&self) -> &'static [&'static str] {
        &["supply_sag"]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "resistance", unit: "ohm" }]
    }

    fn apply(&self, context: &Context, _: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let ([tau], Some(current)) = (shape, &context.current) else { return };
        let late = operator::Lag::new(&context.t, *tau, Course::Line).of(&[current.as_slice()]).concat();
        design.add(position, 0, late.into_iter().map(|i| -i).collect());
    }

    fn plausible(&self, _: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        fitted.iter().all(|e| e.name != "resistance" || e.value > 2.0 * e.se)
    }
}
