//! One channel of one run beside the curve of all runs.
//!
//! What it is: a least-squares fit of the columns to the samples, with errors that allow for the residual's size and colour; the noise floor;
//! the scatter about the fit low, in the middle and high; the share of bad and of repeated samples.
//! What can go wrong: a channel with few samples tells nothing.
//! Units: as the measures state.
//! Reference: effective sample size of an autoregressive residual, Bayley & Hammersley 1946.

use super::columns::{Of, columns};
use super::curve::{Curve, SAMPLES, usable};
use super::measure::{Measure, Scale, Value};
use crate::context::{Context, Relation, Target, unit_of};
use crate::noise::quantum;
use crate::solve::Normal;
use crate::words;

/// A measure and its value.
pub(super) type Told = (Measure, Value);
/// Fewest samples of a scatter.
const FEW: usize = 20;
/// Error from which on a run tells nothing of a column, over the channel's full value: another column does the same there.
const UNTOLD: f64 = 1.0;
/// Error of a step of the last digit, over the step.
const STEP_ERROR: f64 = 0.05;

/// A measure of a channel.
pub(super) fn measure(channel: &str, what: &str, words: String, unit: &str, scale: Scale) -> Measure {
    Measure {
        name: format!("{channel} {what}"),
        words,
        unit: unit.to_owned(),
        scale,
        channel: channel.to_owned(),
        asked: true,
        of_day: false,
    }
}

/// What a run tells of a channel.
pub(super) fn told(context: &Context, curve: &Curve) -> Option<Vec<Told>> {
    let target = &context.targets[context.target(curve.channel)?];
    let x = context.regressor(target.relation)?;
    let places: Vec<usize> = usable(context, target).collect();
    if places.len() < SAMPLES || target.relation != curve.relation {
        return None;
    }
    let picked = |v: &[f64]| -> Vec<f64> { places.iter().map(|k| v[target.rows[*k]]).collect() };
    let y: Vec<f64> = places.iter().map(|k| target.y[*k]).collect();
    let weights: Vec<f64> = places.iter().map(|k| 1.0 / target.levelled[*k]).collect();
    let mut of = Vec::new();
    let mut design = Vec::new();
    for (what, column) in columns(context, curve, &x) {
        let column = picked(&column);
        let first = column[0];
        if what == Of::Zero || column.iter().any(|v| (v - first).abs() > 1e-9 * curve.full.abs()) {
            of.push(what);
            design.push(column);
        }
    }
    let solution = Normal::of_columns(&design, &y, &weights).solve()?;
    let mut residual = y.clone();
    for (column, c) in design.iter().zip(&solution.coefficients) {
        residual.iter_mut().zip(column).for_each(|(r, v)| *r -= c * v);
    }
    let freedom = (y.len() - design.len()).max(1) as f64;
    let inflation = (solution.rss / freedom).max(0.25) * coloured(&residual);
    let mut out: Vec<Told> = of
        .iter()
        .enumerate()
        .filter_map(|(j, what)| {
            let se = (solution.inverse[(j, j)] * inflation).sqrt();
            let full = if what.is_share() { 1.0 } else { curve.full.abs() };
            (se < UNTOLD * full).then(|| of_column(*what, curve, solution.coefficients[j], se))
        })
        .collect();
    out.extend(scatter(curve, target, &places, &picked(&x), &residual));
    out.extend(samples(context, target));
    Some(out)
}

fn of_column(what: Of, curve: &Curve, c: f64, se: f64) -> Told {
    let (channel, unit) = (curve.channel, unit_of(curve.channel));
    let name = quantity(curve);
    let of = |id: &str, words: String, unit: &str, value: f64, se: f64| {
        (measure(channel, id, words, unit, Scale::Linear), Value { value, se })
    };
    match what {
        Of::Zero => of("zero", format!("zero of {name}"), unit, c, se),
        Of::Gain => of("gain", format!("gain of {name}"), "%", 100.0 * (c - 1.0), 100.0 * se),
        Of::Bend => of("bend", format!("bend of {name} halfway up"), "%", 100.0 * c, 100.0 * se),
        // a lag that is longer than the column's has more than its whole share in it: what is known is the delay that the share makes
        Of::Late(k, tau) => {
            let words = format!("delay of {name}, {} part", ["fast", "middle", "slow"][k]);
            of(["late fast", "late", "late slow"][k], words, "s", tau * c, tau * se)
        }
        Of::Hysteresis => of("hysteresis", format!("{name} on the way up less down, half"), unit, c, se),
        Of::Drift => of("drift", format!("drift of {name} within a run"), unit, c, se),
        Of::Warmth => of("warmth", format!("{name} with the temperature"), &format!("{unit}/K"), c, se),
    }
}

/// What a channel is of, in words.
pub(super) fn quantity(curve: &Curve) -> String {
    if curve.relation == Relation::SpeedFromPulse { "speed".to_owned() } else { words::channel(curve.channel) }
}

/// Variance of a mean over what white noise would leave it: (1 + rho)/(1 - rho).
fn coloured(residual: &[f64]) -> f64 {
    let square: f64 = residual.iter().map(|r| r * r).sum();
    let lagged: f64 = residual.windows(2).map(|w| w[0] * w[1]).sum();
    let rho = (lagged / square.max(f64::MIN_POSITIVE)).clamp(0.0, 0.97);
    (1.0 + rho) / (1.0 - rho)
}

/// Root mean square about the fit, low, in the middle and high, and the noise floor.
fn scatter(curve: &Curve, target: &Target, places: &[usize], x: &[f64], residual: &[f64]) -> Vec<Told> {
    let (channel, unit) = (curve.channel, unit_of(curve.channel));
    let name = quantity(curve);
    let mut out = Vec::new();
    let mut add = |id: &str, words: String, value: f64, n: usize| {
        let se = value / (2.0 * n as f64).sqrt();
        out.push((measure(channel, id, words, unit, Scale::Log), Value { value, se }));
    };
    if target.noise.rms > 0.0 {
        add("noise", format!("noise floor of {name}"), target.noise.rms, places.len());
    }
    for (k, (id, words)) in
        [("scatter low", "low"), ("scatter middle", "halfway"), ("scatter high", "high")].into_iter().enumerate()
    {
        let within = |x: f64| ((3.0 * x / curve.top).floor().clamp(0.0, 2.0) as usize) == k;
        let own: Vec<f64> = x.iter().zip(residual).filter(|(x, _)| within(**x)).map(|(_, r)| r * r).collect();
        let mean = own.iter().sum::<f64>() / own.len().max(1) as f64;
        if own.len() >= FEW && mean > 0.0 {
            add(id, format!("scatter of {name} {words}"), mean.sqrt(), own.len());
        }
    }
    out
}

/// Shares of bad and of repeated samples and of those at the highest reading, and the last digit.
pub(super) fn samples(context: &Context, target: &Target) -> Vec<Told> {
    let name = words::channel(target.name);
    let n = target.rows.len() as f64;
    let bad = (target.unclaimed.len() + target.aside.len()) as f64 + 0.5;
    let mut out = vec![(
        measure(target.name, "bad samples", format!("bad samples of {name}"), "%", Scale::Count),
        Value { value: 100.0 * bad / n, se: 100.0 * bad.sqrt() / n },
    )];
    let moved = |k: &usize| {
        let (a, b) = (target.rows[*k - 1], target.rows[*k]);
        b == a + 1 && (context.rpm.is_empty() || (context.rpm[b] - context.rpm[a]).abs() > 0.0)
    };
    let moving: Vec<usize> = (1..target.rows.len()).filter(moved).collect();
    if moving.len() >= SAMPLES {
        let held = moving.iter().filter(|k| target.y[**k] == target.y[**k - 1]).count() as f64 + 0.5;
        let n = moving.len() as f64;
        out.push((
            measure(target.name, "repeats", format!("repeated samples of {name}"), "%", Scale::Count),
            Value { value: 100.0 * held / n, se: 100.0 * held.sqrt() / n },
        ));
    }
    let highest = target.y.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let at_the_top = target.y.iter().filter(|y| **y == highest).count() as f64 + 0.5;
    out.push((
        measure(target.name, "at the top", format!("samples of {name} at its highest reading"), "%", Scale::Count),
        Value { value: 100.0 * at_the_top / n, se: 100.0 * at_the_top.sqrt() / n },
    ));
    let step = quantum(&target.y);
    if step > 0.0 {
        let step_of = measure(target.name, "step", format!("last digit of {name}"), unit_of(target.name), Scale::Log);
        out.push((step_of, Value { value: step, se: STEP_ERROR * step }));
    }
    out
}
