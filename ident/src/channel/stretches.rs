//! Which rows of a run are alike: held, without a jump, approaching a level.
//!
//! What it is: row ranges read off the command, or off the speed where there is none.
//! What can go wrong: a slow ramp logged quickly changes little from row to row and counts as held.
//! Units: us a row; row ranges `[from, to)`.
//! Reference: specification `closing-the-loop.md`, step 2 (noise within plateaus).

use crate::signal::noise::median;
use crate::plateau::settle;

/// Change of the command from row to row, us, below which it holds still.
pub(crate) const STILL_US: f64 = 0.5;
/// Change of the command from row to row, us, below which it does not jump: a ramp from end to end in two seconds at 50 Hz.
pub(crate) const CALM_US: f64 = 10.0;

/// Row ranges in which the command changes by at most `most` us a row (or, without a command, the speed holds still).
pub(super) fn steady(t: &[f64], pulse: Option<&[f64]>, rpm: &[f64], most: f64) -> Vec<(usize, usize)> {
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

/// Time steps that are a gap.
pub(crate) const GAP: f64 = 5.0;

/// Rows before which a log says nothing of the rotor, those after gaps in time, with the speed there.
pub(crate) fn starts(t: &[f64], rpm: &[f64]) -> Vec<(usize, f64)> {
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    let usual = median(&mut steps);
    let begins = |i: &usize| t[*i] - t[*i - 1] > GAP * usual && rpm[*i].is_finite();
    (1..rpm.len()).filter(begins).map(|i| (i, rpm[i])).collect()
}

/// Rows at the head of each steady stretch in which the speed has not arrived yet.
pub(super) fn settling(t: &[f64], rpm: &[f64], steady: &[(usize, usize)]) -> Vec<bool> {
    if rpm.is_empty() {
        return Vec::new();
    }
    let mut out = vec![false; t.len()];
    for (from, to) in steady {
        out[*from..from + settle::rows(t, rpm, *from, *to)].fill(true);
    }
    out
}
