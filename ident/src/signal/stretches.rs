//! Which rows of a run are alike: held, without a jump, approaching a level.
//!
//! What it is: row ranges read off the command, or off the speed where there is none.
//! What can go wrong: a slow ramp logged quickly changes little from row to row and counts as held.
//! Units: us a row; row ranges `[from, to)`.
//! Reference: specification `closing-the-loop.md`, step 2 (noise within plateaus).

use super::settle;
use crate::numeric::order::usual_step;

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

/// Part of the higher one by which two speeds are far apart: halfway between them a line may be off by half of it, and a load by all of it.
const FAR: f64 = 0.1;

/// Whether two speeds are far apart.
pub(crate) fn far(a: f64, b: f64) -> bool {
    (a - b).abs() > FAR * a.max(b)
}

/// Rows in which a rotor that follows its command has gone a good part of its way.
const ON_ITS_WAY: usize = 20;
/// Part of that way within which a rotor has not set out yet.
const RESTS: f64 = 0.05;

/// What meters and a command that is let go slowly add to the latency of a rotor, s.
pub(crate) const LATE_S: f64 = 0.05;
/// Rows by which a command's instant and a reading's may be off.
const LATE_ROWS: f64 = 3.0;

/// Longest time by which a rotor may follow every command late, s.
pub(crate) fn latest(t: &[f64]) -> f64 {
    LATE_ROWS * usual_step(t) + LATE_S
}

/// Longest programme by which a controller starts a motor, s: aligning the rotor and speeding it up blindly takes up to a second or two.
const PROGRAMME_S: f64 = 3.0;

/// Rows before which a log says nothing of the rotor, with the speed there: those after gaps in time, and the first where it is on its way
/// already. One that has arrived stood as its command says.
pub(crate) fn blocks(t: &[f64], rpm: &[f64], on_its_way: bool) -> Vec<(usize, f64)> {
    let usual = usual_step(t);
    let begins = |i: &usize| t[*i] - t[*i - 1] > GAP * usual && rpm[*i].is_finite();
    let first = (on_its_way && rpm.first().is_some_and(|v| v.is_finite())).then_some(0);
    first.into_iter().chain((1..rpm.len()).filter(begins)).map(|i| (i, rpm[i])).collect()
}

/// The same, and the rows behind each until a rotor that has not set out yet does: when the command reached it lies in the gap.
pub(crate) fn starts(t: &[f64], rpm: &[f64], on_its_way: bool) -> Vec<(usize, f64)> {
    let mut out: Vec<(usize, f64)> = Vec::new();
    for (row, speed) in blocks(t, rpm, on_its_way) {
        let ahead = &rpm[row..(row + ON_ITS_WAY).min(rpm.len())];
        let way = ahead.iter().map(|v| (v - speed).abs()).filter(|v| v.is_finite()).fold(0.0, f64::max);
        let rests = ahead.iter().skip(1).take_while(|v| way > 0.0 && (*v - speed).abs() <= RESTS * way).count();
        let from = out.last().map_or(row, |last| row.max(last.0 + 1));
        out.extend((from..=row + rests).map(|i| (i, rpm[i])));
    }
    out
}

/// Rows in which a rotor still stands although it is told to turn, and then does: when it sets out is the programme of its controller, which
/// no command tells. `driven` and `stands` are of rows. What sets out within `latest` s is only late, as on every step.
pub(crate) fn held_back(t: &[f64], latest: f64, driven: impl Fn(usize) -> bool, stands: impl Fn(usize) -> bool) -> Vec<usize> {
    let gap = GAP * usual_step(t);
    let rested = |i: usize| i == 0 || t[i] - t[i - 1] > gap || !driven(i - 1) && stands(i - 1);
    let told = (0..t.len()).filter(|i| driven(*i) && stands(*i) && rested(*i));
    let programme = latest..=PROGRAMME_S;
    told.flat_map(|first| {
        let sets_out = (first..t.len()).find(|i| !stands(*i)).filter(|i| (first..=*i).all(&driven));
        first..sets_out.filter(|i| programme.contains(&(t[*i] - t[first]))).unwrap_or(first)
    })
    .collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Twenty rows a second with a gap before row 40; the rotor sets out six rows after it.
    #[test]
    fn a_rotor_that_has_not_set_out_after_a_gap_is_known_until_it_does() {
        let t: Vec<f64> = (0..80).map(|i| 0.05 * f64::from(i) + if i < 40 { 0.0 } else { 5.0 }).collect();
        let rpm: Vec<f64> = (0..80).map(|i| if i <= 46 { 1600.0 } else { 5000.0 - 3400.0 * 0.5_f64.powi(i - 46) }).collect();
        assert_eq!(starts(&t, &rpm, false), (40..=46).map(|row| (row, 1600.0)).collect::<Vec<_>>());
        // one that is on its way is known at the first row only
        let on: Vec<f64> = (0..80).map(|i| if i < 40 { 1600.0 } else { 5000.0 - 3400.0 * 0.5_f64.powi(i - 40) }).collect();
        assert_eq!(starts(&t, &on, false), vec![(40, 1600.0)]);
    }

    #[test]
    fn a_programme_of_the_controller_is_told_from_a_latency() {
        let t: Vec<f64> = (0..100).map(|i| 0.02 * f64::from(i)).collect();
        let rows = |sets_out: usize| held_back(&t, latest(&t), |i| i >= 20, |i| i < sets_out);
        assert_eq!(rows(50), (20..50).collect::<Vec<_>>());
        // within three rows and 0.05 s it is as late as on every step
        assert_eq!(rows(24), Vec::<usize>::new());
        // one that never sets out is no programme
        assert_eq!(rows(100), Vec::<usize>::new());
    }
}
