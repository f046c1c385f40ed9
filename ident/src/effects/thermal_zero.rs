//! `thermal_zero`: the load cell's zero moves with temperature.
//!
//! What it is: thrust_n += coefficient * (T - 20 degC): gauge and bridge do not compensate each other fully.
//! What can go wrong: where temperature only rises with time it looks like `zero_drift`; noise of the thermometer is averaged away first.
//! Units: N/K.
//! Reference: Beharie 2013, Table 6 (temperature coefficients of gauge and beam).

use super::{About, Amplitude, Effect, Instance, Shape, Stage, present};
use crate::context::Context;
use crate::design::TargetDesign;

/// See the module.
pub(crate) struct ThermalZero;

/// The temperature at which the zero is counted as zero, degC.
const REFERENCE: f64 = 20.0;

impl Effect for ThermalZero {
    fn id(&self) -> &'static str {
        "thermal_zero"
    }

    fn about(&self) -> About {
        About {
            title: "Zero of the load cell moves with temperature",
            equation: "thrust_n += coefficient * (temp_c - 20)",
            source: "Beharie 2013, Table 6",
            depends_on: &["temp_c"],
            signature: "the thrust residual follows temp_c, at every level alike",
            look_alikes: &["zero_drift", "air_density"],
        }
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let moves = context.temperature.as_ref().is_some_and(|t| {
            let (lo, hi) = t.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
            hi - lo > 0.05
        });
        if moves && !present(context, &["thrust_n"]).is_empty() { vec![Instance::new(&["thrust_n"], "")] } else { Vec::new() }
    }

    fn shapes(&self, _: &Context, _: &Instance) -> Vec<Shape> {
        Vec::new()
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "coefficient", unit: "N/K" }]
    }

    fn apply(&self, context: &Context, _: &Instance, _: &[f64], position: usize, design: &mut TargetDesign) {
        let Some(temperature) = &context.temperature else { return };
        design.add(position, 0, smoothed(temperature).iter().map(|t| t - REFERENCE).collect());
    }
}

/// Centred mean of 21 rows: a housing is slow, a thermometer is noisy.
pub(super) fn smoothed(x: &[f64]) -> Vec<f64> {
    let mut prefix = Vec::with_capacity(x.len() + 1);
    prefix.push(0.0);
    for v in x {
        prefix.push(prefix[prefix.len() - 1] + v);
    }
    (0..x.len())
        .map(|i| {
            let half = 10.min(i).min(x.len() - 1 - i);
            (prefix[i + half + 1] - prefix[i - half]) / (2 * half + 1) as f64
        })
        .collect()
}
