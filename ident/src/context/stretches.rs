//! Which rows of a run are alike: held, without a jump, on the way to another speed.
//!
//! What it is: row ranges read off the command, or off the speed where there is none.
//! What can go wrong: a slow ramp logged quickly changes little from row to row and counts as held.
//! Units: us a row; row ranges `[from, to)`.
//! Reference: specification `closing-the-loop.md`, step 2 (noise within plateaus).

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

/// Rows on which the rotor is on its way to another speed: after a jump, approaching a level, or running down with its motor off.
/// No lag of first order describes the way exactly: a speed controller limits its slope, a coasting rotor is braked by the air alone.
#[must_use]
pub(super) fn under_way(settling: &[bool], calm: &[(usize, usize)], runs_down: impl Fn(usize) -> bool) -> Vec<bool> {
    if settling.is_empty() {
        return Vec::new();
    }
    let mut out = vec![true; settling.len()];
    calm.iter().for_each(|(from, to)| out[*from..*to].fill(false));
    out.iter_mut().enumerate().for_each(|(row, o)| *o |= settling[row] || runs_down(row));
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotor_is_under_way_after_jumps_and_while_it_runs_down_and_nowhere_else() {
        // three levels of 100 rows; the speed approaches each with a time constant of 4 rows; the last is a motor switched off
        let pulse: Vec<f64> = (0..300).map(|i| [1300.0, 1600.0, 1000.0][i / 100]).collect();
        let target = |i: usize| [3000.0, 6000.0, 0.0][i / 100];
        let mut speed = 3000.0;
        let mut jitter = 0.0;
        let rpm: Vec<f64> = (0..300)
            .map(|i| {
                speed += (target(i) - speed) / 4.0;
                jitter = 1.0 - jitter;
                speed + jitter
            })
            .collect();
        let t: Vec<f64> = (0..300).map(|i| 0.05 * f64::from(i)).collect();
        let (held, calm) = (steady(&t, Some(&pulse), &rpm, STILL_US), steady(&t, Some(&pulse), &rpm, CALM_US));
        assert_eq!(held, [(0, 100), (100, 200), (200, 300)]);
        let late = under_way(&settling(&t, &rpm, &held), &calm, |row| pulse[row] < 1040.0 && rpm[row] > 100.0);
        let rows = |from: usize, to: usize| late[from..to].iter().filter(|l| **l).count();
        // 3000 rev/min decay to half a rev/min in 35 rows
        assert!(rows(0, 100) <= 4 && (25..=60).contains(&rows(100, 200)), "{} {}", rows(0, 100), rows(100, 200));
        assert!(late[100] && late[115] && late[205] && !late[199] && !late[50], "{late:?}");
        assert!(under_way(&[], &calm, |_| true).is_empty());
    }
}
