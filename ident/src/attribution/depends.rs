//! What a residual goes with.
//!
//! What it is: for each channel and variable the share of the residual's variance that a polynomial of the variable predicts on
//! blocks of the run that took no part in its fit.
//! What can go wrong: variables that rise together on this schedule cannot be told apart; which those are is computed and said.
//! Units: shares of variance.
//! Reference: blocked validation, Roberts et al. 2017.

use crate::channel::Context;
use crate::effects::unknown::{variable, variables};
use crate::numeric::solve::Normal;

/// Order of the polynomial.
pub(crate) const ORDER: usize = 6;
/// Blocks of the run: each is left out once, and the permutations reorder them.
pub(crate) const BLOCKS: usize = 12;

/// Samples that a share needs.
pub(crate) const FEWEST: usize = 2 * BLOCKS * (ORDER + 1) / 3;
/// Samples of a channel that are looked at, evenly thinned.
const MOST: usize = 1500;

/// Every variable that a residual may depend on, scaled to -1..1.
pub(crate) fn all_variables(context: &Context) -> Vec<(String, Vec<f64>)> {
    let mut out: Vec<(String, Vec<f64>)> =
        variables(context).into_iter().filter_map(|n| Some((n.clone(), variable(context, &n)?))).collect();
    out.extend(context.torque.iter().map(|t| ("torque_nm".to_owned(), t.clone())));
    if !context.time_is_row && !context.rpm.is_empty() {
        let rate =
            |i: usize| if i == 0 { 0.0 } else { (context.rpm[i] - context.rpm[i - 1]) / (context.t[i] - context.t[i - 1]) };
        out.push(("rpm_rate".into(), (0..context.len()).map(rate).collect()));
        out.push(("heat".into(), lagged_square(context)));
    }
    if let Some(pulse) = &context.pulse {
        let (mut direction, mut since, mut last) = (Vec::new(), Vec::new(), context.t[0]);
        let mut sign = 0.0;
        for i in 0..pulse.len() {
            if i > 0 && (pulse[i] - pulse[i - 1]).abs() > 0.5 {
                sign = (pulse[i] - pulse[i - 1]).signum();
                last = context.t[i];
            }
            direction.push(sign);
            since.push(context.t[i] - last);
        }
        out.push(("direction".into(), direction));
        out.push(("time_since_step".into(), since));
    }
    for (_, values) in &mut out {
        let (lo, hi) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
        let half = (0.5 * (hi - lo)).max(1e-12);
        values.iter_mut().for_each(|v| *v = (*v - lo) / half - 1.0);
    }
    out.retain(|(_, v)| v.iter().any(|x| (x - v[0]).abs() > 1e-9));
    out
}

/// Heat that a load leaves behind: the cube of the speed through a lag of a fifth of the run.
fn lagged_square(context: &Context) -> Vec<f64> {
    let tau = (0.2 * context.duration()).max(1e-9);
    let mut state = 0.0;
    (0..context.len())
        .map(|i| {
            let dt = if i == 0 { 0.0 } else { context.t[i] - context.t[i - 1] };
            state += (1.0 - (-dt / tau).exp()) * ((context.rpm[i] / 1000.0).powi(3) - state);
            state
        })
        .collect()
}

pub(crate) fn powers(x: f64) -> [f64; ORDER + 1] {
    let mut out = [1.0; ORDER + 1];
    for k in 1..=ORDER {
        out[k] = out[k - 1] * x;
    }
    out
}

/// Share of the variance of `y` that `x` predicts on blocks that its fit did not see.
pub(crate) fn share(x: &[f64], y: &[f64]) -> f64 {
    let n = y.len();
    let block = |i: usize| (i * BLOCKS / n).min(BLOCKS - 1);
    let (mut left, mut total) = (0.0, 0.0);
    for out in 0..BLOCKS {
        let (mut normal, mut sum, mut count) = (Normal::new(ORDER + 1), 0.0, 0.0);
        for i in (0..n).filter(|i| block(*i) != out) {
            normal.add(&powers(x[i]), y[i], 1.0);
            sum += y[i];
            count += 1.0;
        }
        let solution = normal.solve();
        for i in (0..n).filter(|i| block(*i) == out) {
            let mean = sum / count;
            let fitted = solution.as_ref().map_or(mean, |s| powers(x[i]).iter().zip(&s.coefficients).map(|(p, c)| p * c).sum());
            left += (y[i] - fitted).powi(2);
            total += (y[i] - mean).powi(2);
        }
    }
    1.0 - left / total.max(f64::MIN_POSITIVE)
}

/// Least share of a residual's variance that a variable must predict to be told, and most variables that are.
const TOLD: (f64, usize) = (0.1, 3);

/// The variables that predict the residual of a target, the best first.
pub(crate) fn goes_with(context: &Context, target: usize, residual: &[f64]) -> Vec<String> {
    let rows = &context.targets[target].rows;
    let all = all_variables(context);
    let mut found: Vec<(f64, &String)> = all
        .iter()
        .filter(|(name, _)| name != context.targets[target].name)
        .map(|(name, values)| (thinned(rows, residual, values), name))
        .filter(|((_, y), _)| y.len() > FEWEST)
        .map(|((x, y), name)| (share(&x, &y), name))
        .filter(|(share, _)| *share > TOLD.0)
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.into_iter().take(TOLD.1).map(|(_, name)| name.clone()).collect()
}

/// Of too few rows to leave blocks out: the variable that a residual follows most closely, as far as they show. A correlation counts from where
/// so many rows of noise reach it, with any of the variables, once in forty.
pub(crate) fn seems_to_go_with(context: &Context, target: usize, residual: &[f64]) -> Option<String> {
    let rows = &context.targets[target].rows;
    if rows.len() > FEWEST || rows.len() < 8 {
        return None;
    }
    let own = context.targets[target].name;
    // what the log itself has: so few rows tell nothing of what is made of them
    let mut measured = variables(context);
    measured.push("torque_nm".to_owned());
    measured.retain(|name| name != "charge" && name != "t_s");
    let all: Vec<(String, Vec<f64>)> = all_variables(context).into_iter().filter(|(name, _)| measured.contains(name)).collect();
    let of = |(name, values): &(String, Vec<f64>)| {
        let x: Vec<f64> = rows.iter().map(|i| values[*i]).collect();
        (square(&x, residual), name.clone())
    };
    let asked = all.iter().filter(|(name, _)| name != own);
    let (most, name) = asked.clone().map(of).max_by(|a, b| a.0.total_cmp(&b.0))?;
    // Fisher: atanh(r) of noise is normal with variance 1/(n - 3); all variables share the chance of one in forty
    let z = (2.0 * (40.0 * asked.count() as f64).ln()).sqrt();
    let least = (z / (rows.len() as f64 - 3.0).sqrt()).tanh().powi(2);
    (most > least).then_some(name)
}

/// The square of the correlation of two lists.
pub(crate) fn square(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len() as f64;
    let (ma, mb) = (a.iter().sum::<f64>() / n, b.iter().sum::<f64>() / n);
    let (mut aa, mut ab, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        aa += (x - ma).powi(2);
        ab += (x - ma) * (y - mb);
        bb += (y - mb).powi(2);
    }
    ab * ab / (aa * bb).max(f64::MIN_POSITIVE)
}

/// A variable and a residual on the same rows, evenly thinned.
pub(crate) fn thinned(rows: &[usize], residual: &[f64], values: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let stride = rows.len().div_ceil(MOST).max(1);
    let x = rows.iter().step_by(stride).map(|i| values[*i]).collect();
    (x, residual.iter().step_by(stride).copied().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Column, Log};

    /// A table of 36 levels: what follows the current is said to, noise goes with nothing.
    #[test]
    fn a_short_table_tells_as_far_as_it_can() {
        let rpm: Vec<f64> = (0..36).map(|i| 1000.0 + 100.0 * f64::from(i)).collect();
        let thrust: Vec<f64> = rpm.iter().map(|r| 1e-7 * r * r).collect();
        let current: Vec<f64> = (0..36).map(|i| 5.0 + 4.0 * (f64::from(i) * 0.9).sin()).collect();
        let voltage = vec![12.0; 36];
        let columns = [("rpm", rpm), ("thrust_n", thrust), ("current_a", current.clone()), ("voltage_v", voltage)];
        let columns = columns.into_iter().map(|(name, values)| Column { name: name.to_owned(), values }).collect();
        let log = Log { name: "table.csv".to_owned(), t: (0..36).map(f64::from).collect(), columns, ..Log::default() };
        let context = Context::new(&log, None);
        let target = context.target("voltage_v").expect("a channel");
        let noise = |i: usize| (0.7 * (i * i) as f64).sin();
        let following: Vec<f64> = current.iter().enumerate().map(|(i, a)| -0.02 * a + 0.03 * noise(i)).collect();
        assert_eq!(seems_to_go_with(&context, target, &following).as_deref(), Some("current_a"));
        let nothing: Vec<f64> = (0..36).map(noise).collect();
        assert_eq!(seems_to_go_with(&context, target, &nothing), None);
    }
}
