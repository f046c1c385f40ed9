//! One channel of one run beside the curve of all runs.
//!
//! What it is: a least-squares fit of the columns to the samples, with errors that allow for the residual's size and colour; the noise floor;
//! the scatter about the fit low, in the middle and high; the share of bad and of repeated samples.
//! What can go wrong: a channel with few samples tells nothing.
//! Units: as the measures state.
//! Reference: effective sample size of an autoregressive residual, Bayley & Hammersley 1946.

use super::columns::{Column, Of, columns};
use super::curve::{Curve, SAMPLES, usable};
use super::measure::{Measure, Scale, Value};
use crate::channel::{Context, Relation, Target, unit_of};
use crate::numeric::order::quantum;
use crate::numeric::solve::Normal;
use crate::verdict::words;

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
        of_two: false,
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
    let all: Vec<Column> = columns(context, curve, &x).into_iter().map(|(of, column)| (of, picked(&column))).collect();
    let full = fitted(&all, curve, &y, &weights)?;
    let mut out = full.told.clone();
    // a day that warms steadily does so over its time: each of the two is told without the other, where the run shows none of that
    for (asked, other) in [(Of::Drift, Of::Warmth), (Of::Warmth, Of::Drift)] {
        let has = |of: Of| all.iter().any(|(own, _)| *own == of);
        let shown = full.told.iter().any(|(of, (_, v))| *of == other && v.value.abs() > v.half());
        if has(asked) && has(other) && !shown {
            let alone: Vec<Column> = all.iter().filter(|(of, _)| *of != other).cloned().collect();
            out.retain(|(of, _)| *of != asked);
            out.extend(fitted(&alone, curve, &y, &weights)?.told.into_iter().filter(|(of, _)| *of == asked));
        }
    }
    let mut out: Vec<Told> = out.into_iter().map(|(_, told)| told).collect();
    out.extend(scatter(curve, target, &places, &picked(&x), &full.residual));
    out.extend(samples(context, target));
    Some(out)
}

/// Columns fitted to a run.
struct Fitted {
    /// What each column tells.
    told: Vec<(Of, Told)>,
    /// What is left.
    residual: Vec<f64>,
}

fn fitted(columns: &[Column], curve: &Curve, y: &[f64], weights: &[f64]) -> Option<Fitted> {
    let varies = |column: &[f64]| column.iter().any(|v| (v - column[0]).abs() > 1e-9 * curve.full.abs());
    let told = columns.iter().filter(|(what, column)| *what == Of::Zero || varies(column));
    let (of, design): (Vec<Of>, Vec<Vec<f64>>) = told.cloned().unzip();
    let solution = Normal::of_columns(&design, y, weights).solve()?;
    let mut residual = y.to_vec();
    for (column, c) in design.iter().zip(&solution.coefficients) {
        residual.iter_mut().zip(column).for_each(|(r, v)| *r -= c * v);
    }
    let freedom = (y.len() - design.len()).max(1) as f64;
    let inflation = (solution.rss / freedom).max(0.25) * coloured(&residual);
    let told = of.into_iter().enumerate().filter_map(|(j, what)| {
        let se = (solution.inverse[(j, j)] * inflation).sqrt();
        let full = if what.is_share() { 1.0 } else { curve.full.abs() };
        (se < UNTOLD * full).then(|| (what, of_column(what, curve, solution.coefficients[j], se)))
    });
    Some(Fitted { told: told.collect(), residual })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::curve::curves;
    use crate::log::{Column as Channel, Log};

    /// A run that warms steadily, whose thrust goes with the temperature or with time.
    fn run(by_kelvin: f64, over_time: f64) -> Log {
        let n = 2400;
        let noise = |i: usize, k: usize| ((i * i * (7 + k)) as f64 * 0.37).sin();
        let share = |i: usize| i as f64 / n as f64;
        let rpm: Vec<f64> = (0..n).map(|i| 3000.0 + 2000.0 * (0.004 * i as f64).sin() + noise(i, 1)).collect();
        let temperature: Vec<f64> = (0..n).map(|i| 20.0 + 2.0 * share(i) + 0.1 * (9.0 * share(i)).sin()).collect();
        let of = |i: usize| 2e-7 * rpm[i] * rpm[i] + by_kelvin * temperature[i] + over_time * share(i) + 0.02 * noise(i, 4);
        let thrust = (0..n).map(of).collect();
        let columns = [("rpm", rpm), ("thrust_n", thrust), ("temp_c", temperature)];
        let columns = columns.into_iter().map(|(name, values)| Channel { name: name.into(), values }).collect();
        Log { name: "warm.csv".into(), t: (0..n).map(|i| 0.05 * i as f64).collect(), columns, ..Log::default() }
    }

    /// Time and temperature run together: what the run does not show of the one does not blur the other.
    #[test]
    fn a_warming_zero_is_told_sharply_where_nothing_drifts() {
        let of = |by_kelvin: f64, over_time: f64, what: &str| {
            let contexts: Vec<Context> = (0..3).map(|_| Context::new(&run(by_kelvin, over_time), None)).collect();
            let told = told(&contexts[0], &curves(&contexts)[0]).expect("a channel");
            told.into_iter().find(|(m, _)| m.name == what).map(|(_, v)| v).expect(what)
        };
        let warm = of(0.1, 0.0, "thrust_n warmth");
        assert!((warm.value - 0.1).abs() < 0.01 && warm.se < 0.004, "{warm:?}");
        let drift = of(0.0, 0.2, "thrust_n drift");
        assert!((drift.value - 0.2).abs() < 0.02 && drift.se < 0.01, "{drift:?}");
        let other = of(0.0, 0.2, "thrust_n warmth");
        assert!(other.value.abs() < 3.0 * other.se + 0.02, "{other:?}");
    }
}
