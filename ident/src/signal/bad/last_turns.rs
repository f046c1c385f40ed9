//! A speed sensor that loses a rotor which coasts.
//!
//! What it is: a sensor that listens to the windings hears nothing once the rotor is slow and nobody drives it; one that times its marks keeps its
//! last reading until it gives up. Then it reads nothing at once, while the rotor still turns.
//! What can go wrong: a sensor that is lost in the very row in which the motor is switched off is not told from a rotor that is braked, unless other
//! stops of the log show that it coasts.
//! Units: rows, s, rev/min.
//! Reference: a rotor that nothing drives slows down less and less: dw/dt = -(kQ w^2 + Q_f)/J, Beharie 2013, Eq. 2.21 as corrected.

use super::excursion::Event;
use super::first_turns::stands;
use super::witness::Witnesses;
use crate::numeric::order::median;
use std::ops::Range;

/// How many times as fast as just before a reading falls that no rotor follows, and the times that a rotor takes to stand which one does that
/// slows down as it did last.
const FASTER: f64 = 3.0;
/// Share of the highest reading below which nothing is lost.
const SLOW: f64 = 0.02;
/// Share of a reading within which the next ones are the same one, kept.
const SAME: f64 = 0.01;

/// Stops of a log that show how its rotor coasts: one alone may be chance.
const SHOW: usize = 2;

/// The rows in which a sensor kept its last reading, and those in which it had given up while the rotor may still have turned.
pub(super) fn found(witnesses: &Witnesses<'_>, name: &'static str) -> Vec<Event> {
    let Some(read) = witnesses.clean(name) else { return Vec::new() };
    let top = read.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
    let off = stands(witnesses, read);
    let t = &witnesses.t;
    let measured: Vec<usize> = (0..read.len()).filter(|i| read[*i].is_finite()).collect();
    let given_up = |k: &usize| off(measured[*k]) && read[measured[*k]] <= 0.0 && read[measured[*k - 1]] > 0.0;
    let of_stop = |k: usize| {
        // the rows of the switched-off motor that still read something
        let from = (0..k).rev().take_while(|j| off(measured[*j]) && read[measured[*j]] > 0.0).last().unwrap_or(k);
        let end = (k..measured.len()).take_while(|j| off(measured[*j]) && read[measured[*j]] <= 0.0).last()? + 1;
        let fall = Fall { t, read, rows: &measured[from..k] };
        let lost = fall.lost(measured[k]).filter(|lost| read[lost.last] > SLOW * top);
        Some(Stop { off: measured[from.max(1) - 1], at_once: from == k, lost, zeros: k..end })
    };
    let mut stops: Vec<Stop> = (1..measured.len()).filter(given_up).filter_map(of_stop).collect();
    // a rotor that coasts at every other stop coasts at one in whose very row the sensor is lost, too
    let mut coasting: Vec<f64> = stops.iter().filter_map(|s| Some(s.lost.as_ref()?.stands_s - t[s.off])).collect();
    if coasting.len() >= SHOW {
        let takes = median(&mut coasting);
        for stop in stops.iter_mut().filter(|s| s.at_once && read[s.off] > SLOW * top) {
            stop.lost = Some(Lost { last: stop.off, stands_s: t[stop.off] + takes });
        }
    }
    let silent = |stop: Stop| {
        let (lost, first) = (stop.lost?, measured[stop.zeros.start]);
        let zeros = measured[stop.zeros].iter().take_while(|row| t[**row] <= lost.stands_s);
        let last = zeros.last().copied().unwrap_or(first);
        Some(lost.events(read, first..last + 1))
    };
    stops.into_iter().filter_map(silent).flatten().collect()
}

/// A motor that is switched off.
struct Stop {
    /// The last row in which it was on.
    off: usize,
    /// Whether no row of the switched-off motor reads anything.
    at_once: bool,
    /// Where the sensor lost the rotor, if it did.
    lost: Option<Lost>,
    /// Places of the readings of nothing.
    zeros: Range<usize>,
}

/// Readings of a rotor that nobody drives.
struct Fall<'f> {
    t: &'f [f64],
    read: &'f [f64],
    rows: &'f [usize],
}

/// Where the sensor still saw the rotor.
struct Lost {
    /// The last row of a reading that was its own.
    last: usize,
    /// When the rotor stands at the latest, s.
    stands_s: f64,
}

impl Fall<'_> {
    /// Rows of readings that are new: those in which the sensor kept one are not among them.
    fn of_their_own(&self) -> Vec<usize> {
        let mut out: Vec<usize> = Vec::new();
        for row in self.rows {
            if out.last().is_none_or(|last| self.read[*row] < (1.0 - SAME) * self.read[*last]) {
                out.push(*row);
            }
        }
        out
    }

    /// How fast the reading falls between two rows, rev/min a second.
    fn rate(&self, from: usize, to: usize) -> f64 {
        (self.read[from] - self.read[to].max(0.0)) / (self.t[to] - self.t[from])
    }

    /// Where it falls faster than a rotor can that fell as it did just before: into nothing, or into a mean of something and nothing.
    fn lost(&self, zero: usize) -> Option<Lost> {
        let own = self.of_their_own();
        let (mean, before_it) = own.split_last()?;
        [(*mean, before_it), (zero, own.as_slice())].into_iter().find_map(|(next, own)| {
            let [.., before, _, last] = *own else { return None };
            let kept = *self.rows.iter().take_while(|row| **row < next).last()?;
            let (slow, fast) =
                (self.rate(before, last), (self.read[last] - self.read[next].max(0.0)) / (self.t[next] - self.t[kept]));
            let stands_s = self.t[last] + FASTER * self.read[last] / slow.max(f64::MIN_POSITIVE);
            (slow > 0.0 && fast > FASTER * slow).then_some(Lost { last, stands_s })
        })
    }
}

impl Lost {
    /// What was kept, and what says nothing.
    fn events(&self, read: &[f64], zeros: Range<usize>) -> Vec<Event> {
        let event = |rows: Range<usize>, silent: bool| Event {
            worst: rows.start,
            rows,
            expected: read[self.last],
            at_step: true,
            silent,
        };
        let kept = self.last + 1..zeros.start;
        let kept = (!kept.is_empty()).then(|| event(kept, false));
        kept.into_iter().chain([event(zeros, true)]).collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::log::Log;
    use crate::signal::bad::found;
    use std::ops::Range;

    /// A rotor that is switched off at 30 s, ten rows a second, and what its sensor reads of the speed that it has; started again at 50 s.
    fn switched_off(reads: impl Fn(usize, f64) -> f64) -> Vec<Range<usize>> {
        let mut text = String::from("# quadrig-log 1\nt_s,pulse_us,rpm,thrust_n\n");
        let mut rpm: f64 = 0.0;
        for row in 0..800_usize {
            let on = (50..300).contains(&row) || row >= 500;
            rpm = if on { rpm + 0.4 * (8000.0 - rpm) } else { (rpm - 0.1 * (rpm * rpm / 8000.0 / 0.5 + 200.0)).max(0.0) };
            let (read, thrust) = (reads(row, rpm), 2e-7 * rpm * rpm + 1e-4 * (row % 5) as f64);
            text += &format!("{:.1},{},{read:.0},{thrust:.4}\n", 0.1 * row as f64, if on { 1700 } else { 1000 });
        }
        let log = Log::parse("off.csv", text.as_bytes()).expect("a log");
        found(&log).into_iter().filter(|a| a.channel == "rpm").map(|a| a.span()).collect()
    }

    #[test]
    fn zeros_of_a_rotor_that_still_turns_are_no_readings() {
        let lost = switched_off(|row, rpm| if (305..500).contains(&row) { 0.0 } else { rpm });
        assert_eq!(lost.len(), 1, "{lost:?}");
        // it had taken two seconds to stand
        assert!(lost[0].start == 305 && (315..340).contains(&lost[0].end), "{lost:?}");
    }

    #[test]
    fn a_reading_that_is_kept_until_the_sensor_gives_up_is_none() {
        let kept = switched_off(|row, rpm| {
            if (305..312).contains(&row) {
                3500.0
            } else if (312..500).contains(&row) {
                0.0
            } else {
                rpm
            }
        });
        assert_eq!(kept.first().map(|r| r.start), Some(305 + 1), "{kept:?}");
        assert!(kept.iter().any(|r| r.end > 315) && kept.iter().all(|r| r.end < 345), "{kept:?}");
    }

    /// Three stops of a rotor that is lost after half a second, the third in a row that was logged half a second late.
    #[test]
    fn a_stop_that_no_row_shows_is_like_the_others() {
        let mut text = String::from("# quadrig-log 1\nt_s,pulse_us,rpm,thrust_n\n");
        let (mut rpm, mut off_for) = (0.0_f64, 0_usize);
        for row in 0..900_usize {
            let on = row % 300 >= 50 && row % 300 < 200;
            // five rows that nobody wrote
            for _ in 0..if row == 800 { 6 } else { 1 } {
                rpm = if on { rpm + 0.4 * (8000.0 - rpm) } else { (rpm - 0.1 * (rpm * rpm / 8000.0 / 0.5 + 200.0)).max(0.0) };
                off_for = if on { 0 } else { off_for + 1 };
            }
            let (read, thrust) = (if off_for > 5 { 0.0 } else { rpm }, 2e-7 * rpm * rpm + 1e-4 * (row % 5) as f64);
            text += &format!("{:.1},{},{read:.0},{thrust:.4}\n", 0.1 * row as f64, if on { 1700 } else { 1000 });
        }
        let log = Log::parse("off.csv", text.as_bytes()).expect("a log");
        let lost: Vec<Range<usize>> = found(&log).into_iter().filter(|a| a.channel == "rpm").map(|a| a.span()).collect();
        assert_eq!(lost.iter().map(|l| l.start).collect::<Vec<_>>(), [205, 505, 800], "{lost:?}");
        assert!(lost.iter().all(|l| (8..40).contains(&l.len())), "{lost:?}");
    }

    #[test]
    fn a_rotor_that_is_seen_until_it_stands_loses_nothing() {
        assert_eq!(switched_off(|_, rpm| rpm), Vec::<Range<usize>>::new());
        // in coarse steps, and one that a brake stops at once
        assert_eq!(switched_off(|_, rpm| 65.0 * (rpm / 65.0).round()), Vec::<Range<usize>>::new());
        assert_eq!(switched_off(|row, rpm| if (300..500).contains(&row) { 0.0 } else { rpm }), Vec::<Range<usize>>::new());
    }
}
