//! Which rows of a run are alike: held, without a jump, approaching a level.
//!
//! What it is: row ranges read off the command, or off the speed where there is none.
//! What can go wrong: a slow ramp logged quickly changes little from row to row and counts as held.
//! Units: us a row; row ranges `[from, to)`.
//! Reference: specification `closing-the-loop.md`, step 2 (noise within plateaus).

use super::settle;
use crate::numeric::order::median;

/// Change of the command from row to row, us, below which it holds still.
pub(crate) const STILL_US: f64 = 0.5;
/// Change of the command from row to row, us, below which it does not jump: a ramp from end to end in two seconds at 50 Hz.
pub(crate) const CALM_US: f64 = 10.0;

/// Row ranges in which the command changes by at most `most` us a row (or, without a command, the speed holds still).
pub(crate) fn steady(t: &[f64], pulse: Option<&[f64]>, rpm: &[f64], most: f64) -> Vec<(usize, usize)> {
    let n = t.len();
    let (signal, tolerance): (&[f64], f64) = match pulse {
        Some(p) => (p, most),
        None if !rpm.is_empty() => (rpm, 0.01 * rpm.iter().copied().fold(0.0, f64::max)),
        None => return vec![(0, n)],
    };
    let mut out = Vec::new();
    let mut from = 0;
    for i in 1..=n {
        let ends = i == n
            || (signal[i] - signal[i - 1]).abs() > tolerance
            || (pulse.is_none() && (signal[i] - signal[from]).abs() > 2.0 * tolerance);
        if ends {
            if i - from >= 6 {
                out.push((from, i));
            }
            from = i;
        }
    }
    out
}

/// Fewest samples after jumps, and between them, that show how well either is predicted.
pub(crate) const FEWEST_OF_A_KIND: usize = 10;

/// Time steps that are a gap.
pub(crate) const GAP: f64 = 5.0;

/// Rows before which a log says nothing of the rotor, with the speed there: those after gaps in time, and the first where it is on its way
/// already. One that has arrived stood as its command says.
pub(crate) fn starts(t: &[f64], rpm: &[f64], on_its_way: bool) -> Vec<(usize, f64)> {
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    let usual = median(&mut steps);
    let begins = |i: &usize| t[*i] - t[*i - 1] > GAP * usual && rpm[*i].is_finite();
    let first = rpm.first().filter(|v| on_its_way && v.is_finite()).map(|v| (0, *v));
    first.into_iter().chain((1..rpm.len()).filter(begins).map(|i| (i, rpm[i]))).collect()
}

/// Rows at the head of each steady stretch in which the speed has not arrived yet.
pub(crate) fn settling(t: &[f64], rpm: &[f64], steady: &[(usize, usize)]) -> Vec<bool> {
    if rpm.is_empty() {
        return Vec::new();
    }
    let mut out = vec![false; t.len()];
    for (from, to) in steady {
        out[*from..from + settle::rows(t, rpm, *from, *to)].fill(true);
    }
    out
}

/// Linear bridge over missing samples, constant at the ends.
#[must_use]
pub fn bridge(t: &[f64], values: &[f64]) -> Vec<f64> {
    let mut out = values.to_vec();
    let mut last: Option<usize> = None;
    for i in 0..out.len() {
        if !values[i].is_finite() {
            continue;
        }
        match last {
            None => out[..i].fill(values[i]),
            Some(j) => {
                for k in j + 1..i {
                    let u = (t[k] - t[j]) / (t[i] - t[j]);
                    out[k] = values[j] + u * (values[i] - values[j]);
                }
            }
        }
        last = Some(i);
    }
    if let Some(j) = last {
        let v = values[j];
        out[j + 1..].fill(v);
    }
    out
}
