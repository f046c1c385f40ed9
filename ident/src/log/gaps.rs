//! Time that a log lacks: holes between its rows, with the likely reason.
//!
//! What it is: how much of the run's time has no row, where the longest hole is, and whether the motor stood still on both sides of it. A recorder
//! that is stopped between two blocks of a run leaves such holes, and that is no fault; rows that are lost while the motor turns are one.
//! What can go wrong: uneven sampling is allowed, so that of a log without `sample_hz` holes are told, and refused only where single rows of an even
//! clock are missing, and many. A clock that is coarser than the rows looks like rows that are missing: then the head says the rate, or vouches for the time.
//! Units: s.
//! Reference: specification `formats.md`, "Rig log"; docs/book/reference/log.md.

use super::{Log, SPEED, trimmed};
use crate::numeric::order::median;
use std::fmt;

/// Usual steps from which on a step is a hole in time, as everywhere in the program.
const HOLE: f64 = 5.0;
/// Share of the time, or of the rows, that is worth a line: half of the fifth from which on a run is no longer what it seems.
const TOLD: f64 = 0.1;
/// Share of the time from which on dropped rows are no accident: a fifth, less what chance makes of one that is drawn
/// at random from two hundred rows.
const DROPPED: f64 = 0.17;
/// Share of steps that are whole multiples of the shortest where that is refused: more than the 94 % of a stand that logs a mean of each level, whose
/// levels take one, two or three times as long.
const STRICT: f64 = 0.98;
/// Share of the steps that are no longer than a tick of the clock.
const SHORTEST: f64 = 0.25;
/// Share of missing rows up to which that holds of rows that are dropped here and there. Beyond it the clock is only finer than its rows.
const MOST_MISSING: f64 = 1.0 - SHORTEST;
/// Share of steps that are whole multiples of the shortest, and by how much of it they may be off, of a clock that ticks evenly.
const EVEN: [f64; 2] = [0.95, 0.15];
/// Steps below which nothing is judged.
const ENOUGH: usize = 20;
/// Share of the highest load at which a motor stands.
const STANDS: f64 = 0.02;

/// What is missing.
#[derive(Debug, Clone, PartialEq)]
pub struct Gaps {
    /// Time without a row, s.
    pub missing_s: f64,
    /// Length of the run, s.
    pub whole_s: f64,
    /// Number of holes.
    pub holes: usize,
    /// Longest hole: its beginning and its length, s.
    pub longest: [f64; 2],
    /// Of how many holes the motor stood still on both sides; nothing where the log does not tell.
    pub standing: Option<usize>,
    /// Whether they are single rows of an even clock.
    pub single: bool,
    /// Whether those single rows are so many that the run is no longer what it seems.
    pub dropped: bool,
    /// Tick of that clock, s, where the rows follow each other as evenly as it can tell: its times may be coarse, and no row missing.
    pub coarse: Option<f64>,
}

impl Gaps {
    /// Of a log; nothing where it is not worth a line.
    #[must_use]
    pub fn of(log: &Log) -> Option<Self> {
        if log.time_is_row() || log.len() <= ENOUGH {
            return None;
        }
        let steps: Vec<f64> = log.t.windows(2).map(|w| w[1] - w[0]).collect();
        let usual = median(&mut steps.clone());
        let in_blocks = Self::among(log, &steps, usual, HOLE);
        let mut sorted = steps.clone();
        sorted.sort_by(f64::total_cmp);
        let tick = sorted[(SHORTEST * sorted.len() as f64) as usize];
        let off = |step: f64| (step / tick - (step / tick).round()).abs();
        let even = steps.iter().filter(|s| off(**s) <= EVEN[1]).count() as f64 / steps.len() as f64;
        let coarse = is_even(&log.t, tick).then_some(tick);
        let single = Self { single: true, coarse, ..Self::among(log, &steps, tick, 1.5) };
        // what pauses take of the time is no row that was dropped
        let scattered = (single.missing_s - in_blocks.missing_s) / (single.whole_s - in_blocks.missing_s);
        if even >= STRICT && (DROPPED..=MOST_MISSING).contains(&scattered) {
            return Some(Self { dropped: true, ..single });
        }
        if in_blocks.missing_s >= TOLD * in_blocks.whole_s {
            return Some(in_blocks);
        }
        let told = (TOLD..=MOST_MISSING).contains(&(single.missing_s / single.whole_s));
        (even >= EVEN[0] && told).then_some(single)
    }

    /// The holes that are longer than so many steps.
    fn among(log: &Log, steps: &[f64], step: f64, longer: f64) -> Self {
        let stands = standing(log);
        let mut out = Self {
            missing_s: 0.0,
            whole_s: steps.iter().sum(),
            holes: 0,
            longest: [0.0; 2],
            standing: stands.as_ref().map(|_| 0),
            single: false,
            dropped: false,
            coarse: None,
        };
        for (i, hole) in steps.iter().enumerate().filter(|(_, s)| **s > longer * step) {
            out.missing_s += hole - step;
            out.holes += 1;
            if *hole > out.longest[1] {
                out.longest = [log.t[i], *hole];
            }
            if let Some(stands) = &stands {
                out.standing = out.standing.map(|n| n + usize::from(stands[i] && stands[i + 1]));
            }
        }
        out
    }
}

/// Whether times lie within a tick of a straight line over the number of the row: rows that come evenly, each told by the tick before it. Of rows
/// that are dropped here and there the line leaves more and more.
fn is_even(t: &[f64], tick: f64) -> bool {
    let (Some(first), Some(last)) = (t.first(), t.last()) else { return false };
    let step = (last - first) / (t.len() - 1).max(1) as f64;
    let off = t.iter().enumerate().map(|(i, t)| t - first - step * i as f64);
    let (low, high) = off.fold((0.0_f64, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
    // the line through both ends may itself be off by a tick
    high - low <= 2.0 * tick
}

/// Rows on which the motor stands, by the first load that the log has.
pub(super) fn standing(log: &Log) -> Option<Vec<bool>> {
    let of = |name: &str| log.column(name);
    let load = SPEED.into_iter().chain(["thrust_n", "current_a"]).find_map(of)?;
    let top = load.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
    (top > 0.0).then(|| load.iter().map(|v| *v <= STANDS * top).collect())
}

impl fmt::Display for Gaps {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { missing_s, whole_s, holes, longest: [at, longest], standing, single, coarse, .. } = self;
        let share = 100.0 * missing_s / whole_s;
        let [missing, whole, longest, at] = [missing_s, whole_s, longest, at].map(|v| trimmed(*v, 2));
        let plural = if *holes == 1 { "one hole".to_owned() } else { format!("{holes} holes") };
        write!(
            f,
            "{share:.0} % of the time has no row ({missing} of {whole} s, in {plural}, the longest {longest} s from {at} s on): "
        )?;
        match (coarse, standing) {
            (Some(tick), _) => {
                write!(
                    f,
                    "at even places: every so many rows one was dropped (a filter, a thinned export), or the clock's ticks of {} s are coarser than its rows",
                    trimmed(*tick, 6)
                )
            }
            (None, _) if *single => {
                write!(
                    f,
                    "single rows of an even clock are missing at uneven places: dropped by a filter, a bad line or a thinned export"
                )
            }
            (None, Some(n)) if n == holes => {
                write!(f, "the motor stood still on both sides, as where a recorder is stopped between blocks")
            }
            (None, Some(n)) => {
                let of =
                    if *n == 0 { "the motor turned".to_owned() } else { format!("in {} of them the motor turned", holes - n) };
                write!(
                    f,
                    "{of}, so that rows were lost, dropped by a filter, or the recorder was stopped under load; what happened meanwhile is not known"
                )
            }
            (None, None) => write!(f, "the recorder was stopped, or rows were dropped"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Column;

    /// Two minutes at ten rows a second; the motor turns from 20 s to 100 s.
    fn log(keep: impl Fn(usize) -> bool) -> Log {
        let rows: Vec<usize> = (0..1200).filter(|n| keep(*n)).collect();
        let rpm = rows.iter().map(|n| if (200..1000).contains(n) { 4000.0 } else { 0.0 }).collect();
        let t = rows.iter().map(|n| 0.1 * *n as f64).collect();
        Log { t, columns: vec![Column { name: "rpm".into(), values: rpm }], ..Log::default() }
    }

    #[test]
    fn holes_of_seconds_are_told_with_their_reason() {
        assert_eq!(Gaps::of(&log(|_| true)), None);
        let running = Gaps::of(&log(|n| !(200..1000).contains(&n) || n % 250 >= 50)).expect("a fifth is gone").to_string();
        assert!(
            running.starts_with("13 % of the time has no row (15 of 119.9 s, in 3 holes") && running.contains("the motor turned"),
            "{running}"
        );
        let paused = Gaps::of(&log(|n| !(20..180).contains(&n))).expect("a pause").to_string();
        assert!(paused.contains("in one hole, the longest 16.1 s from 1.9 s on"), "{paused}");
        assert!(paused.contains("as where a recorder is stopped between blocks"), "{paused}");
        assert_eq!(Gaps::of(&log(|n| !(300..340).contains(&n))), None, "a few seconds of two minutes");
    }

    #[test]
    fn single_rows_that_are_missing_are_told() {
        let single = Gaps::of(&log(|n| n % 5 != 3)).expect("every fifth is gone");
        assert!(single.single && single.to_string().starts_with("20 % of the time has no row"), "{single}");
        assert!(
            single
                .to_string()
                .contains("every so many rows one was dropped (a filter, a thinned export), or the clock's ticks of 0.1 s"),
            "{single}"
        );
        // here and there
        let scattered = Gaps::of(&log(|n| (n * n + n / 7) % 5 != 3)).expect("rows are gone");
        assert!(scattered.single && scattered.coarse.is_none() && scattered.dropped, "{scattered}");
        assert!(single.dropped, "every fifth is gone");
        let few = Gaps::of(&log(|n| n % 8 != 3)).expect("every eighth is gone");
        assert!(few.single && !few.dropped, "{few}");
        // a pause of a third of the run beside them hides nothing, and alone is no row that was dropped
        let both = Gaps::of(&log(|n| n % 5 != 3 && !(500..900).contains(&n))).expect("both");
        assert!(both.dropped, "{both}");
        assert!(!Gaps::of(&log(|n| !(500..900).contains(&n))).expect("a pause").dropped);
        assert!(scattered.to_string().contains("at uneven places: dropped by a filter"), "{scattered}");
        // rows that come when they like, by a clock that is finer than they are
        let mut fine = log(|_| true);
        let steps = (0..fine.len()).map(|n| [1.0, 4.0, 25.0, 1.0, 30.0, 3.0, 17.0][n % 7] + (n % 11) as f64 * (n % 3) as f64);
        fine.t = steps.scan(0.0, |t, step| Some(std::mem::replace(t, *t + 0.001 * step))).collect();
        assert_eq!(Gaps::of(&fine), None);
        // steps of any length are uneven sampling, not holes
        let mut uneven = log(|_| true);
        uneven.t.iter_mut().enumerate().for_each(|(i, t)| *t += 0.04 * (i as f64 * 2.4).sin());
        assert_eq!(Gaps::of(&uneven), None);
    }
}
