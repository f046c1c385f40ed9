//! Steps 4 and 7: what does the residual depend on, and the correction without a name.
//!
//! What it is: for each channel and variable the share of the residual's variance that a polynomial of the variable predicts on
//! blocks of the run that took no part in its fit, tested against the same residual with its blocks in another order.
//! What can go wrong: variables that rise together on this schedule cannot be told apart; which those are is computed and said.
//! Units: shares of variance; p-values.
//! Reference: blocked permutation, Politis & Romano 1994; blocked validation, Roberts et al. 2017.

use super::{Content, Start};
use crate::attribution::depends::{BLOCKS, FEWEST, ORDER, all_variables, powers, share, square, thinned};
use crate::numeric::solve::Normal;

/// Permutations.
const SHUFFLES: usize = 99;
/// Squared correlation at which two variables are confounded.
const CONFOUNDED: f64 = 0.9;

/// p-value of a share: how often the residual with its blocks in another order is predicted as well.
fn chance(x: &[f64], y: &[f64], seen: f64) -> f64 {
    let n = y.len();
    let mut state = 0x2545_F491_4F6C_DD1D_u64;
    let mut better = 0;
    for _ in 0..SHUFFLES {
        let mut order: Vec<usize> = (0..BLOCKS).collect();
        for i in (1..BLOCKS).rev() {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            order.swap(i, (state % (i as u64 + 1)) as usize);
        }
        let shuffled: Vec<f64> = order.iter().flat_map(|b| y[b * n / BLOCKS..(b + 1) * n / BLOCKS].iter().copied()).collect();
        better += usize::from(share(x, &shuffled) >= seen);
    }
    (better + 1) as f64 / (SHUFFLES + 1) as f64
}

/// Each channel with each variable: name of the channel, of the variable, and the share.
fn shares(start: &Start) -> Vec<(usize, usize, f64)> {
    let variables = all_variables(&start.context);
    let mut out = Vec::new();
    for (c, target) in start.context.targets.iter().enumerate() {
        // a channel says nothing of itself
        for (v, (_, values)) in variables.iter().enumerate().filter(|(_, (name, _))| name != target.name) {
            let (x, y) = pair(start, c, values);
            if y.len() > FEWEST {
                out.push((c, v, share(&x, &y)));
            }
        }
    }
    out
}

fn pair(start: &Start, channel: usize, values: &[f64]) -> (Vec<f64>, Vec<f64>) {
    thinned(&start.context.targets[channel].rows, &start.residuals[channel], values)
}

/// Variables that go together with one on this run.
fn confounded(all: &[(String, Vec<f64>)], v: usize) -> String {
    let list: Vec<&str> =
        (0..all.len()).filter(|o| *o != v && square(&all[v].1, &all[*o].1) > CONFOUNDED).map(|o| all[o].0.as_str()).collect();
    if list.is_empty() { "-".to_owned() } else { list.join(" ") }
}

/// Step 4.
pub(super) fn depends(start: &Start, progress: &mut dyn FnMut(f64)) -> Content {
    let all = all_variables(&start.context);
    let mut found = shares(start);
    found.retain(|f| f.2 > 0.01);
    found.sort_by(|a, b| a.0.cmp(&b.0).then(b.2.total_cmp(&a.2)));
    let count = found.len().max(1) as f64;
    let rows = found
        .iter()
        .enumerate()
        .map(|(k, (c, v, seen))| {
            progress(k as f64 / count);
            let (x, y) = pair(start, *c, &all[*v].1);
            let p = chance(&x, &y, *seen);
            vec![
                start.context.targets[*c].name.to_owned(),
                all[*v].0.clone(),
                format!("{seen:.3}"),
                format!("{p:.2}"),
                confounded(&all, *v),
            ]
        })
        .collect();
    let note = format!(
        "share of the residual's variance that a polynomial of the variable predicts on blocks left out; p by {SHUFFLES} orders of {BLOCKS} blocks; pairs below 0.01 are left out; confounded: squared correlation above {CONFOUNDED}"
    );
    (vec!["channel", "variable", "share", "p", "confounded with"], rows, note)
}

/// Step 7: for each channel the variable that predicts best, and the correction as an equation.
pub(super) fn nameless(start: &Start) -> Content {
    let all = all_variables(&start.context);
    let found = shares(start);
    let mut rows = Vec::new();
    for (c, target) in start.context.targets.iter().enumerate() {
        let Some((_, v, seen)) = found.iter().filter(|f| f.0 == c && f.2 > 0.01).max_by(|a, b| a.2.total_cmp(&b.2)) else {
            continue;
        };
        let (x, y) = pair(start, c, &all[*v].1);
        let mut normal = Normal::new(ORDER + 1);
        x.iter().zip(&y).for_each(|(x, y)| normal.add(&powers(*x), *y, 1.0));
        let Some(solution) = normal.solve() else { continue };
        let terms: Vec<String> = solution
            .coefficients
            .iter()
            .enumerate()
            .map(|(k, c)| if k == 0 { format!("{c:.3e}") } else { format!("{c:+.3e} v^{k}") })
            .collect();
        rows.push(vec![target.name.to_owned(), all[*v].0.clone(), format!("{seen:.3}"), terms.join(" ")]);
    }
    let note = "v is the variable scaled to -1..1 over the run; the correction has the channel's unit; a verdict uses it only where no name does as well".to_owned();
    (vec!["channel", "variable", "share predicted", "correction"], rows, note)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dependence_is_predicted_and_an_unrelated_variable_is_not() {
        let n = 1200;
        let x: Vec<f64> = (0..n).map(|i| (i as f64 * 0.37).sin()).collect();
        let other: Vec<f64> = (0..n).map(|i| (i as f64 * 0.011).cos()).collect();
        let y: Vec<f64> = x.iter().enumerate().map(|(i, x)| x * x + 0.3 * (i as f64 * 12.9898).sin()).collect();
        let (right, wrong) = (share(&x, &y), share(&other, &y));
        assert!(right > 0.6 && wrong < 0.05, "{right} {wrong}");
        assert!(chance(&x, &y, right) <= 0.011 && chance(&other, &y, wrong) > 0.011);
    }
}
