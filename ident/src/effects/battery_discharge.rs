//! `battery_discharge`: the battery empties during the run.
//!
//! What it is: voltage_v falls with the charge drawn, and the speed at a given pulse falls with the voltage.
//! What can go wrong: a short run draws little charge; with a bench supply it is not plausible.
//! Units: Ah; V/Ah and 1/Ah inside.
//! Reference: open-circuit voltage of a lithium-polymer cell, 4.2 V full to 3.5 V at the knee, taken as linear over the usable charge.

use super::{About, Amplitude, Effect, Estimate, Instance, Shape, Stage, present, speeds};
use crate::context::{Context, Relation};
use crate::design::TargetDesign;

/// See the module.
pub(crate) struct BatteryDischarge;

/// Fall of the open-circuit voltage of one cell over its usable charge, V.
const CELL_SWING: f64 = 0.7;
/// Mean open-circuit voltage of a cell near full charge, V.
const CELL_FULL: f64 = 4.15;

impl Effect for BatteryDischarge {
    fn id(&self) -> &'static str {
        "battery_discharge"
    }

    fn about(&self) -> About {
        About {
            title: "Battery discharges during the run",
            equation: "voltage_v = V0 - slope * charge, rpm *= 1 - speed_loss * charge, charge = integral of current_a",
            source: "open-circuit voltage of a LiPo cell against charge, linear over the usable part",
            depends_on: &["charge"],
            signature: "voltage and speed at the same pulse fall together, fastest at high current, and never come back",
            look_alikes: &["supply_sag", "thermal_derate"],
        }
    }

    fn stage(&self) -> Stage {
        Stage::Gain
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        if context.time_is_row || context.current.is_none() || present(context, &["voltage_v"]).is_empty() {
            return Vec::new();
        }
        let mut channels = vec!["voltage_v"];
        channels.extend(speeds(context));
        vec![Instance::new(&channels, "")]
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        if instance.channels.len() < 2 {
            return Vec::new();
        }
        let total = charge(context).last().copied().unwrap_or(0.0).max(1e-6);
        vec![Shape { name: "speed_loss", unit: "1/Ah", range: (0.0, 0.5 / total), starts: vec![0.02 / total] }]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "slope", unit: "V/Ah" }]
    }

    fn apply(&self, context: &Context, _: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let charge = charge(context);
        if design.relation == Relation::Voltage {
            design.add(position, 0, charge.iter().map(|q| -q).collect());
        } else if let [loss] = shape {
            design.map_columns(|column| column.iter_mut().zip(&charge).for_each(|(v, q)| *v *= 1.0 - loss * q));
        }
    }

    fn report(&self, context: &Context, _: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        if let Some(slope) = fitted.iter().find(|e| e.name == "slope").filter(|e| e.value > 0.0) {
            let full = context.voltage.as_ref().and_then(|v| v.first().copied()).unwrap_or(CELL_FULL);
            let cells = (full / CELL_FULL).round().max(1.0);
            let value = cells * CELL_SWING / slope.value;
            let capacity = Estimate { name: "capacity".into(), unit: "Ah".into(), value, se: value * slope.se / slope.value };
            fitted.insert(0, capacity);
        }
        fitted
    }

    fn plausible(&self, _: &Instance, fitted: &[Estimate]) -> bool {
        fitted.iter().any(|e| e.name == "slope" && e.value > 0.0)
    }
}

/// Charge drawn since the first row, Ah.
pub(crate) fn charge(context: &Context) -> Vec<f64> {
    let Some(current) = &context.current else { return vec![0.0; context.len()] };
    let mut sum = 0.0;
    let mut out = Vec::with_capacity(current.len());
    for i in 0..current.len() {
        if i > 0 {
            sum += 0.5 * (current[i] + current[i - 1]) * (context.t[i] - context.t[i - 1]) / 3600.0;
        }
        out.push(sum);
    }
    out
}
