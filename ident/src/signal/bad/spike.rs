//! One or two readings that stand out from those before and after them alike.
//!
//! What it is: a reading beyond the medians of three before and of three after it, on the same side; a step or a rotor on its way is
//! beyond one of them only, so that edges and extremes are judged like any other row.
//! What can go wrong: a current's own peak at a step stands out too; what the other steps show is allowed for.
//! Units: rows, the channel's own.
//! Reference: Tukey 1977 (running medians); Pearson 2002 (Hampel identifier).

use super::excursion::{Event, left_out, since, without_recurring};
use super::scale::Scale;
use super::witness::Witnesses;
use crate::numeric::order::median;

/// Readings on either side.
const BESIDE: usize = 3;
/// Classes of age after a step in which a channel may have a peak of its own: half a second.
const PEAKS: usize = 3;
/// What is allowed after a step over what the other steps show.
const SLACK: f64 = 1.5;

/// The spikes of a channel.
pub(super) fn found(witnesses: &Witnesses<'_>, name: &'static str) -> Vec<Event> {
    let Some(case) = witnesses.case(name, false) else { return Vec::new() };
    let n = case.y.len();
    let scale = Scale::of(&case.r, &case.y);
    let off: Vec<f64> = (0..n).map(|k| stands_out(&case.y, k)).collect();
    let since = since(&case, &witnesses.t);
    let mut peaks: Vec<f64> = Vec::new();
    let mut k = 0;
    while k < n {
        let end = k + since[k..].iter().take_while(|s| s.number == since[k].number).count();
        let of_step = (k..end).filter(|j| since[*j].class < PEAKS).map(|j| off[j].abs());
        peaks.extend(of_step.reduce(f64::max));
        k = end;
    }
    peaks.sort_unstable_by(|a, b| b.total_cmp(a));
    let usual = peaks.get(left_out(peaks.len())).copied().unwrap_or(0.0);
    let far = |k: usize| {
        let allowed = if since[k].class < PEAKS { SLACK * usual } else { 0.0 };
        let limit = (scale.times * scale.at(k) + allowed).max(scale.least);
        // what the witness shows as well is no spike
        off[k].abs() > limit && stands_out(&case.r, k) * off[k].signum() > 0.5 * off[k].abs()
    };
    let event = |k: usize| {
        let row = case.rows[k];
        Event { rows: row..row + 1, worst: row, expected: case.y[k] - off[k], at_step: since[k].class <= PEAKS, silent: false }
    };
    let mut out: Vec<Event> = Vec::new();
    for k in without_recurring((0..n).filter(|k| far(*k)).collect(), &since, |k| *k) {
        match out.last_mut() {
            Some(last) if k > 0 && last.rows.end == case.rows[k - 1] + 1 => last.rows.end = case.rows[k] + 1,
            _ => out.push(event(k)),
        }
    }
    out
}

/// How far a reading is beyond those before and after it; 0 where it is between them. The first and the last have one side only: by what those beside
/// them move towards it, as on a rotor that starts with the log, the reading may have moved on.
fn stands_out(y: &[f64], k: usize) -> f64 {
    let beyond = |off: f64, (nearest, farthest): (f64, f64)| {
        let moved = (off.signum() * (nearest - farthest)).max(0.0);
        off.signum() * (off.abs() - moved).max(0.0)
    };
    let of = |from: usize, to: usize| (to > from).then(|| y[k] - median(&mut y[from..to].to_vec()));
    let before = of(k.saturating_sub(BESIDE), k);
    let after = of(k + 1, (k + 1 + BESIDE).min(y.len()));
    match (before, after) {
        (Some(a), Some(b)) if a * b > 0.0 => {
            if a.abs() < b.abs() {
                a
            } else {
                b
            }
        }
        (Some(_), Some(_)) => 0.0,
        (Some(off), None) => beyond(off, (y[k - 1], y[k.saturating_sub(BESIDE)])),
        (None, Some(off)) => beyond(off, (y[k + 1], y[(k + BESIDE).min(y.len() - 1)])),
        (None, None) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_does_not_stand_out_and_a_spike_on_it_does() {
        let y = [1.0, 1.0, 1.0, 5.0, 5.0, 5.0, 5.0];
        assert!((0..7).all(|k| stands_out(&y, k) == 0.0 || k == 0));
        assert_eq!(stands_out(&[1.0, 1.0, 1.0, 9.0, 5.0, 5.0, 5.0], 3), 4.0);
        assert_eq!(stands_out(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.0], 6), -5.0);
    }

    /// A rotor of some inertia that is sped up twice and slowed down in smaller steps: the torque peaks after the two by more than the other
    /// steps show.
    #[test]
    fn the_torque_of_speeding_up_is_no_spike() {
        let mut text = String::from("# quadrig-log 1\nt_s,pulse_us,rpm,torque_nm\n");
        let (mut rpm, mut pulse) = (0.0, 1000.0);
        for row in 0..600_u32 {
            if row % 60 == 30 {
                pulse += if row % 300 == 30 { 90.0 } else { -20.0 };
            }
            let before: f64 = rpm;
            rpm += 0.7 * (5.0 * (pulse - 1000.0) - before);
            let torque = 1e-8 * rpm * rpm + 1e-4 * (rpm - before) + 2e-5 * f64::from(row * 7 % 5);
            text += &format!("{:.1},{pulse},{:.1},{torque:.6}\n", 0.1 * f64::from(row), rpm + f64::from(row * 3 % 5) * 0.2);
        }
        let aside = crate::signal::bad::found(&crate::log::Log::parse("run.csv", text.as_bytes()).expect("a log"));
        assert!(aside.iter().all(|a| a.channel != "torque_nm"), "{aside:?}");
    }

    /// A log that begins with the rotor's start, and one whose first reading is a spike; and both from the end.
    #[test]
    fn the_first_reading_of_a_rotor_that_starts_is_no_spike() {
        let (starts, spike) = ([0.0, 48.0, 518.0, 1672.0, 3111.0], [60_000.0, 5000.0, 5002.0, 4999.0, 5001.0]);
        assert_eq!(stands_out(&starts, 0), 0.0);
        assert!(stands_out(&spike, 0) > 54_000.0);
        let [stops, ends] = [starts, spike].map(|mut y| {
            y.reverse();
            y
        });
        assert_eq!(stands_out(&stops, 4), 0.0);
        assert!(stands_out(&ends, 4) > 54_000.0);
    }
}
