//! `battery_relaxation`: a battery gives way further for some seconds after a load has come, and recovers as slowly.
//!
//! What it is: voltage_v -= resistance * (current_a lagged by `tau`): ions that have to move.
//! What can go wrong: where the load only rises slowly, it is part of the lead's resistance. A slow voltmeter beside a lead looks alike, but shows
//! nothing at once.
//! Units: ohm, s.
//! Reference: resistor-capacitor pair of a battery, Chen & Rincon-Mora 2006, IEEE Trans. Energy Conversion 21:504.

use crate::channel::Context;
use crate::effects::design::TargetDesign;
use crate::effects::operator::{Course, Lag};
use crate::effects::{
    About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, is_too_quick, present,
};

/// See the module.
pub(crate) struct BatteryRelaxation;

/// What is known of the time constant before any run, s: its middle, and the standard deviation of its logarithm. The twelve recorded runs that
/// show it (`docs/measured.md`) have 3.3 to 14 s, nine of them up to 5.4 s, and scatter by as much. So their figures have seen it.
const TAU: (f64, f64) = (4.0, 0.45);
/// Range of the time constant, s: four standard deviations either way.
const TAUS: (f64, f64) = (0.66, 24.0);

impl Effect for BatteryRelaxation {
    fn id(&self) -> &'static str {
        "battery_relaxation"
    }

    fn about(&self) -> About {
        About {
            title: "Battery gives way and recovers slowly",
            equation: "voltage_v = V0 - resistance i, tau d(i)/dt = current_a - i",
            source: "resistor-capacitor pair of a battery, Chen & Rincon-Mora 2006",
            depends_on: &["current_a", "t_s"],
            signature: "the voltage goes on falling for seconds after a load has come, and climbs back for seconds after it has gone",
            look_alikes: &["battery_discharge", "supply_sag", "channel_filter"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        let slowly = found.tell("tau", |v| format!("gives way and recovers within {v}"), "gives way and recovers slowly");
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
        let is_seen = measured && !context.time_is_row && !context.is_table() && context.step() < TAUS.0;
        if is_seen { vec![Instance::new(&["voltage_v"], "")] } else { Vec::new() }
    }

    fn shapes(&self, _: &Context, _: &Instance) -> Vec<Shape> {
        vec![Shape { name: "tau", unit: "s", range: TAUS, starts: [0.5, 1.0, 2.0].map(|k| k * TAU.0).to_vec() }]
    }

    fn prior(&self, _: &Context, _: &Instance, shape: &[f64]) -> f64 {
        shape.first().map_or(0.0, |tau| -0.5 * ((tau / TAU.0).ln() / TAU.1).powi(2))
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "resistance", unit: "ohm" }]
    }

    fn apply(&self, context: &Context, _: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let ([tau], Some(current)) = (shape, &context.current) else { return };
        let late = Lag::new(&context.t, *tau, Course::Line).of(&[current.as_slice()]).concat();
        design.add(position, 0, late.into_iter().map(|i| -i).collect());
    }

    /// One on the lower end of its range is a slow voltmeter.
    fn plausible(&self, context: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        let known = fitted.iter().all(|e| e.name != "resistance" || e.value > 3.0 * e.se);
        known && !is_too_quick(&self.shapes(context, instance), fitted)
    }
}
