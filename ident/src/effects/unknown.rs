//! `unknown`: something is there that no known effect explains.
//!
//! What it is: an empirical correction: a polynomial of low degree in the one variable that predicts the residual best.
//! What can go wrong: it predicts inside the range that it was fitted on; outside, the variable is held at the end of that range.
//! Units: the channel's unit; the variable is scaled to -1..1 over its fitted range.
//! Reference: discrepancy modelling, Ebers et al. 2022 (arXiv 2203.05164).

use super::{About, Amplitude, Effect, Instance, Shape, Stage};
use crate::context::Context;
use crate::design::TargetDesign;

/// See the module.
pub(crate) struct Unknown;

/// Names of the polynomial's coefficients: Legendre polynomials of order 1 to 6.
const TERMS: [Amplitude; 6] = [
    Amplitude { name: "p1", unit: "channel" },
    Amplitude { name: "p2", unit: "channel" },
    Amplitude { name: "p3", unit: "channel" },
    Amplitude { name: "p4", unit: "channel" },
    Amplitude { name: "p5", unit: "channel" },
    Amplitude { name: "p6", unit: "channel" },
];

impl Effect for Unknown {
    fn id(&self) -> &'static str {
        "unknown"
    }

    fn about(&self) -> About {
        About {
            title: "Unexplained dependence, corrected empirically",
            equation: "reading += sum of p_k P_k(v), v the variable scaled to -1..1 between `from` and `to`, P_k Legendre polynomials",
            source: "Ebers et al. 2022, arXiv 2203.05164",
            depends_on: &[],
            signature: "a residual that a smooth function of one variable predicts on held-out blocks",
            look_alikes: &[],
        }
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, _: &Context) -> Vec<Instance> {
        Vec::new() // never offered as a name; the diagnosis proposes it itself
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        let (lo, hi) = range(&variable(context, &instance.form).unwrap_or_default());
        vec![
            Shape { name: "from", unit: "variable", range: (lo, lo), starts: vec![lo] },
            Shape { name: "to", unit: "variable", range: (hi, hi), starts: vec![hi] },
        ]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        TERMS.to_vec()
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let ([lo, hi], Some(values)) = (shape, variable(context, &instance.form)) else { return };
        let half = (0.5 * (hi - lo)).max(1e-12);
        let x: Vec<f64> = values.iter().map(|v| ((v - lo) / half - 1.0).clamp(-1.0, 1.0)).collect();
        // orders that the declared polynomial of the same variable holds already are left to it
        let held = if ["rpm", "pulse_us"].contains(&instance.form.as_str()) { design.relation.degree() } else { 0 };
        for (k, _) in TERMS.iter().enumerate().skip(held) {
            design.add(position, k, x.iter().map(|x| legendre(k + 1, *x)).collect());
        }
    }
}

fn legendre(order: usize, x: f64) -> f64 {
    let (mut a, mut b) = (1.0, x);
    for k in 1..order {
        let k = k as f64;
        (a, b) = (b, ((2.0 * k + 1.0) * x * b - k * a) / (k + 1.0));
    }
    b
}

fn range(values: &[f64]) -> (f64, f64) {
    let (lo, hi) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    if lo.is_finite() && hi > lo { (lo, hi) } else { (0.0, 1.0) }
}

/// Variables that a residual may depend on, by name.
pub(crate) fn variables(context: &Context) -> Vec<String> {
    let mut out = Vec::new();
    if !context.time_is_row {
        out.push("t_s".to_owned());
    }
    if !context.rpm.is_empty() {
        out.push("rpm".to_owned());
    }
    for (name, present) in [
        ("pulse_us", context.pulse.is_some()),
        ("temp_c", context.temperature.is_some()),
        ("voltage_v", context.voltage.is_some()),
        ("current_a", context.current.is_some()),
    ] {
        if present {
            out.push(name.to_owned());
        }
    }
    if context.current.is_some() && !context.time_is_row {
        out.push("charge".to_owned());
    }
    out.extend(context.covariates.iter().map(|c| c.0.clone()));
    out
}

/// The values of a variable on every row.
pub(crate) fn variable(context: &Context, name: &str) -> Option<Vec<f64>> {
    match name {
        "t_s" => Some(context.t.iter().map(|t| t - context.t[0]).collect()),
        "rpm" => (!context.rpm.is_empty()).then(|| context.rpm.clone()),
        "pulse_us" => context.pulse.clone(),
        "temp_c" => context.temperature.clone(),
        "voltage_v" => context.voltage.clone(),
        "current_a" => context.current.clone(),
        "charge" => Some(super::battery_discharge::charge(context)),
        _ => context.covariates.iter().find(|c| c.0 == name).map(|c| c.1.clone()),
    }
}
