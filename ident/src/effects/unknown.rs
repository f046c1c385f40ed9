//! `unknown`: something is there that no known effect explains.
//!
//! What it is: an empirical correction: a polynomial of low degree in the one variable that predicts the residual best, or none.
//! What can go wrong: it predicts inside the range that it was fitted on; outside, the variable is held at the end of that range.
//! Units: each coefficient in the channel's unit; the variable is scaled to -1..1 over its fitted range, which is in its own unit.
//! Reference: discrepancy modelling, Ebers et al. 2022 (arXiv 2203.05164).

use super::{About, Amplitude, Effect, Estimate, Instance, Scope, Shape, Stage};
use crate::channel::{Context, unit_of};
use crate::effects::design::TargetDesign;
use crate::verdict::words::plain::{MOST_TERMS, parts};

/// See the module.
pub(crate) struct Unknown;

/// Names of the polynomial's coefficients: Legendre polynomials of order 1 to 6.
const TERMS: [Amplitude; MOST_TERMS] = [
    Amplitude { name: "p1", unit: "channel" },
    Amplitude { name: "p2", unit: "channel" },
    Amplitude { name: "p3", unit: "channel" },
    Amplitude { name: "p4", unit: "channel" },
    Amplitude { name: "p5", unit: "channel" },
    Amplitude { name: "p6", unit: "channel" },
];

/// What a verdict says of a correction.
pub(crate) struct Words {
    /// Variables that it stands on.
    pub(crate) depends_on: Vec<String>,
    /// Its equation.
    pub(crate) equation: String,
    /// Why it is there, or why none is.
    pub(crate) evidence: String,
}

impl Words {
    /// Of the correction of a form, which leaves so much (1: all of it) of the held-out error of a channel.
    pub(crate) fn of(form: &str, channel: &str, left: f64) -> Self {
        let (variable, terms) = parts(form);
        let tried = "a polynomial in one variable, one to six terms";
        if terms == 0 {
            return Self {
                depends_on: Vec::new(),
                equation: "no correction".to_owned(),
                evidence: format!(
                    "something is left over that no known effect explains; no correction: of all that was tried ({tried}) nothing predicts rows of {channel} that it has not seen better than the declared model does"
                ),
            };
        }
        let (plural, of_one) = if terms == 1 { ("", "s") } else { ("s", "") };
        Self {
            depends_on: vec![variable.to_owned()],
            equation: format!("{} [{form}]", Unknown.about().equation),
            evidence: format!(
                "no known effect explains it; of all that was tried ({tried}) {terms} term{plural} in {variable} predict{of_one} held-out rows best, plain ones first: of the held-out error of {channel} {left:.2} is left"
            ),
        }
    }
}

impl Effect for Unknown {
    fn id(&self) -> &'static str {
        "unknown"
    }

    fn about(&self) -> About {
        About {
            title: "Unexplained dependence, corrected empirically",
            equation: "reading += sum of p_k P_k(v), v the variable scaled to -1..1 between `from` and `to` and held at its end beyond, P_k Legendre polynomials",
            source: "Ebers et al. 2022, arXiv 2203.05164",
            depends_on: &[],
            signature: "a residual that a smooth function of one variable predicts on held-out blocks",
            look_alikes: &[],
        }
    }

    fn scope(&self, instance: &Instance) -> Scope {
        // what depends on the clock of a run belongs to that run
        if ["t_s", "charge"].contains(&parts(&instance.form).0) { Scope::Run } else { Scope::Rig }
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, _: &Context) -> Vec<Instance> {
        Vec::new() // never offered as a name; the diagnosis proposes it itself
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        let (name, terms) = parts(&instance.form);
        if terms == 0 {
            return Vec::new();
        }
        let (lo, hi) = range(variable(context, name).unwrap_or_default().into_iter());
        vec![
            Shape { name: "from", unit: "variable", range: (lo, lo), starts: vec![lo] },
            Shape { name: "to", unit: "variable", range: (hi, hi), starts: vec![hi] },
        ]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        TERMS.to_vec()
    }

    fn taught(&self, context: &Context, instance: &Instance, shape: &[f64], keep: &[bool]) -> Vec<f64> {
        let Some(values) = variable(context, parts(&instance.form).0).filter(|_| !shape.is_empty()) else {
            return shape.to_vec();
        };
        let (lo, hi) = range(values.into_iter().zip(keep).filter(|(_, k)| **k).map(|(v, _)| v));
        vec![lo, hi]
    }

    fn report(&self, _: &Context, instance: &Instance, fitted: Vec<Estimate>) -> Vec<Estimate> {
        let unit = |name: &str| unit_of(name).to_owned();
        let (variable, channel) = (parts(&instance.form).0, instance.channels.first().map_or("", String::as_str));
        let stated = |e: Estimate| match e.name.as_str() {
            "from" | "to" => Estimate { unit: unit(variable), ..e },
            _ => Estimate { unit: unit(channel), ..e },
        };
        fitted.into_iter().map(stated).collect()
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let (name, terms) = parts(&instance.form);
        let ([lo, hi], Some(values)) = (shape, variable(context, name)) else { return };
        let half = (0.5 * (hi - lo)).max(1e-12);
        let x: Vec<f64> = values.iter().map(|v| ((v - lo) / half - 1.0).clamp(-1.0, 1.0)).collect();
        // orders that the declared polynomial of the same variable holds already are left to it
        let held = if ["rpm", "pulse_us"].contains(&name) { design.relation.degree() } else { 0 };
        for (k, _) in TERMS.iter().enumerate().skip(held).take(terms) {
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

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (lo, hi) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
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
        "charge" => Some(crate::effects::supply::battery_discharge::charge(context)),
        _ => context.covariates.iter().find(|c| c.0 == name).map(|c| c.1.clone()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Column, Log};
    use crate::verdict::words::plain::form;

    #[test]
    fn forms_name_variable_and_terms() {
        assert_eq!(parts(&form("rpm", 3)), ("rpm", 3));
        assert_eq!(parts("rpm"), ("rpm", 6), "as files wrote it that knew six terms only");
        assert_eq!(parts(""), ("", 0));
    }

    /// A fold that lacks the end of the run knows nothing of the readings there, and holds its correction at the last one that it saw.
    #[test]
    fn a_fold_ranges_over_its_own_rows_and_is_held_beyond() {
        let ramp = |slope: f64| -> Vec<f64> { (0..100).map(|i| slope * f64::from(i)).collect() };
        let columns =
            vec![Column { name: "rpm".into(), values: ramp(50.0) }, Column { name: "thrust_n".into(), values: ramp(0.1) }];
        let log = Log { name: "ramp.csv".into(), t: ramp(0.1), columns, ..Log::default() };
        let context = Context::new(&log, None);
        let instance = Instance::new(&["thrust_n"], &form("t_s", 2));
        let whole: Vec<f64> = Unknown.shapes(&context, &instance).iter().map(|s| s.range.0).collect();
        let keep: Vec<bool> = (0..100).map(|i| i < 80).collect();
        let taught = Unknown.taught(&context, &instance, &whole, &keep);
        assert!((whole[1] - 9.9).abs() < 1e-9 && (taught[1] - 7.9).abs() < 1e-9, "{whole:?} {taught:?}");
        let mut design = TargetDesign::baseline(&context, "thrust_n", crate::channel::Relation::Thrust);
        let base = design.columns.len();
        Unknown.apply(&context, &instance, &taught, 0, &mut design);
        for column in &design.columns[base..] {
            assert!(column.values[80..].iter().all(|v| (v - column.values[79]).abs() < 1e-12));
        }
    }
}
