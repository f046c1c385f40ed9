//! The pulse at which the motor starts.
//!
//! What it is: the declared speed curve is a cubic above this pulse and zero below it; where the boundary lies is read off the log.
//! What can go wrong: a log whose motor never stands says nothing of the boundary (that of any speed controller is taken, so that
//! another run may go lower); of one whose motor never turns it is out of reach.
//! Units: us.
//! Reference: specification `formats.md`, "Verdict" (declared baseline).

use crate::signal::stretches::{CALM_US, FEWEST_OF_A_KIND};

/// Pulse at which every speed controller keeps its motor still, us.
const IDLE_US: f64 = 1000.0;

/// Time after a jump of the command, s, and rows, for which the rotor may still stand or coast.
const COASTS: (f64, usize) = (1.0, 5);

/// Share of the log's highest speed above which a rotor turns.
pub(crate) const TURNS: f64 = 0.01;

/// Pulse that parts standing from turning with the fewest exceptions, us: midway between the pulses on its two sides. Rows right
/// after a jump of the command do not count, where enough others do: the rotor comes later than the command. A rotor that stands at the end of
/// rows of one pulse only coasted in those before. A row without a speed says nothing.
pub(crate) fn start_pulse(t: &[f64], pulse: Option<&[f64]>, rpm: &[f64]) -> f64 {
    let Some(pulse) = pulse.filter(|_| !rpm.is_empty()) else { return 1000.0 };
    let top = rpm.iter().copied().fold(0.0, f64::max);
    let mut since = (f64::NEG_INFINITY, 0);
    let settled: Vec<bool> = (0..pulse.len())
        .map(|i| {
            if i > 0 && (pulse[i] - pulse[i - 1]).abs() > CALM_US {
                since = (t[i], i);
            }
            t[i] - since.0 > COASTS.0 && i >= since.1 + COASTS.1
        })
        .collect();
    let turns = kept_turning(pulse, rpm, TURNS * top);
    let rows = |only_settled: bool| -> Vec<(f64, bool)> {
        let chosen = (0..pulse.len()).filter(|i| rpm[*i].is_finite() && (!only_settled || settled[*i]));
        chosen.map(|i| (pulse[i], turns[i])).collect()
    };
    let mut sorted = rows(true);
    let turn = sorted.iter().filter(|r| r.1).count();
    if turn < FEWEST_OF_A_KIND || sorted.len() - turn < FEWEST_OF_A_KIND {
        sorted = rows(false);
    }
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let all_standing = sorted.iter().filter(|r| !r.1).count();
    if all_standing == sorted.len() {
        return 2500.0;
    }
    // a cut before row k calls what turns below it, and what stands from it on, an exception
    let (mut turning, mut standing, mut best) = (0, 0, (all_standing, 0));
    for k in 0..sorted.len() {
        let exceptions = turning + all_standing - standing;
        if (k == 0 || sorted[k].0 > sorted[k - 1].0) && exceptions < best.0 {
            best = (exceptions, k);
        }
        if sorted[k].1 { turning += 1 } else { standing += 1 }
    }
    match best.1 {
        0 => f64::min(sorted[0].0 - 0.5, IDLE_US),
        k => 0.5 * (sorted[k - 1].0 + sorted[k].0),
    }
}

/// Whether the pulse of each row keeps the rotor turning: it does not where the rotor stands at the end of the rows of that very pulse. A row without
/// a speed is no standing rotor.
fn kept_turning(pulse: &[f64], rpm: &[f64], least: f64) -> Vec<bool> {
    let mut out: Vec<bool> = rpm.iter().map(|v| !v.is_finite() || *v > least).collect();
    for i in (1..out.len()).rev() {
        out[i - 1] &= pulse[i - 1] != pulse[i] || out[i];
    }
    out
}

/// Rows for which no command is known any more, in order: behind the last that was logged, by as much as none was logged for in between. A command
/// that is logged now and then holds until the next is due; a recorder that goes on when its program has ended says nothing of what the
/// motor was told. Before the first command it was told nothing yet.
pub(crate) fn uncommanded(pulse: &[f64]) -> Vec<usize> {
    let told: Vec<usize> = (0..pulse.len()).filter(|i| pulse[*i].is_finite()).collect();
    let Some(last) = told.last() else { return Vec::new() };
    let holds = told.windows(2).map(|w| w[1] - w[0]).max().unwrap_or(1);
    (last + holds..pulse.len()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rotor that comes a second late and coasts as long after the command has gone.
    fn late(levels: &[(f64, f64)]) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let pulse: Vec<f64> = levels.iter().flat_map(|(p, seconds)| vec![*p; (seconds * 10.0) as usize]).collect();
        let t = (0..pulse.len()).map(|i| i as f64 * 0.1).collect();
        let mut n = 0.0;
        let rpm = pulse
            .iter()
            .map(|p| {
                let wanted: f64 = if *p > 1080.0 { 8.0 * (p - 1000.0) } else { 0.0 };
                n += 0.3 * (wanted - n);
                if n < 1.0 { 0.0 } else { n }
            })
            .collect();
        (t, pulse, rpm)
    }

    #[test]
    fn a_rotor_that_coasts_does_not_move_the_start() {
        let (t, pulse, rpm) = late(&[(1000.0, 6.0), (1100.0, 6.0), (1400.0, 6.0), (1000.0, 6.0)]);
        assert!(rpm[190] > 0.01 * 3200.0 && pulse[190] == 1000.0, "the rotor coasts at the lowest pulse");
        assert_eq!(start_pulse(&t, Some(&pulse), &rpm), 1050.0);
    }

    /// A flight ends with the motors cut: more rows coast than stand, and yet no motor turns at that pulse.
    #[test]
    fn a_rotor_that_coasts_for_longer_than_it_stands_does_not_move_the_start() {
        let (t, pulse, mut rpm) = late(&[(1000.0, 0.1), (1100.0, 6.0), (1700.0, 20.0), (1000.0, 6.0)]);
        let cut = pulse.iter().rposition(|p| *p > 1000.0).unwrap() + 1;
        rpm[cut..].iter_mut().enumerate().for_each(|(k, v)| *v = (5600.0 - 130.0 * k as f64).max(0.0));
        assert!(rpm[cut..].iter().filter(|v| **v > 0.01 * 5600.0).count() > 40);
        assert_eq!(start_pulse(&t, Some(&pulse), &rpm), 1050.0);
    }

    /// The sensor is lost at the ends of the low levels, where the rotor did not stand; and after the run, where it did not turn.
    #[test]
    fn rows_without_a_speed_do_not_move_the_start() {
        let levels = [(1000.0, 6.0), (1100.0, 20.0), (1200.0, 20.0), (1400.0, 6.0), (1000.0, 20.0)];
        let (ends, after): (Vec<usize>, Vec<usize>) = ((255..262).chain(455..462).collect(), (530..720).collect());
        for lost in [ends, after] {
            let (t, pulse, mut rpm) = late(&levels);
            lost.iter().for_each(|row| rpm[*row] = f64::NAN);
            assert_eq!(start_pulse(&t, Some(&pulse), &rpm), 1050.0, "{lost:?}");
        }
    }

    #[test]
    fn commands_hold_until_the_next_is_due_and_no_longer() {
        let nan = f64::NAN;
        assert_eq!(uncommanded(&[nan, 1000.0, 1100.0, nan, nan]), [3, 4]);
        assert_eq!(uncommanded(&[1000.0, nan, nan, 1100.0, nan, nan]), [] as [usize; 0]);
        assert_eq!(uncommanded(&[1000.0, nan, 1100.0, nan, nan, nan]), [4, 5]);
        assert_eq!(uncommanded(&[nan; 3]), [] as [usize; 0]);
    }

    #[test]
    fn a_motor_that_never_turns_or_never_stands_has_no_start_of_its_own() {
        let (t, pulse) = ((0..40).map(f64::from).collect::<Vec<_>>(), vec![1200.0; 40]);
        assert_eq!(start_pulse(&t, Some(&pulse), &[0.0; 40]), 2500.0);
        assert_eq!(start_pulse(&t, Some(&pulse), &[900.0; 40]), 1000.0);
    }
}
