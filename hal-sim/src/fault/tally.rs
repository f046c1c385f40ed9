//! Many flights, and their table.
//!
//! What it is: [`fly_all`] flies seeds on all cores; [`Tally`] keeps a row for each kind and a few failures in full.
//! What can go wrong: nothing here fails; what went wrong in a flight is counted and kept.
//! Units: ms.
//! Reference: `docs/faults.md`.

use super::{Failure, Mishap, Plan, Survived, flight};
use std::fmt::Write;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

/// Failures that are kept in full.
const KEPT: usize = 40;
/// Seeds that a worker takes at once.
const PORTION: u64 = 16;

/// One kind of mishap.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Row {
    /// Flights.
    pub flown: u64,
    /// Flights that ended in minimum throttle.
    pub stopped: u64,
    /// Longest time to the last pulse above minimum, and the most that was allowed in that flight, ms.
    pub slowest: Option<(f64, f64)>,
    /// Flights that went wrong.
    pub wrong: u64,
}

/// What a campaign showed.
#[derive(Debug, Clone, PartialEq)]
pub struct Tally {
    /// A row for each kind, in the order of [`Mishap::all`].
    pub rows: Vec<Row>,
    /// Failures, those of the lowest seeds first.
    pub failures: Vec<Failure>,
}

/// Place of a kind in the list.
fn place(kinds: &[Mishap], mishap: Mishap) -> Option<usize> {
    let late = |kind: &Mishap| matches!((kind, mishap), (Mishap::LateTick { .. }, Mishap::LateTick { .. }));
    kinds.iter().position(|kind| *kind == mishap || late(kind))
}

/// The slower of two stops; of two as slow the one with less room.
fn slower(a: Option<(f64, f64)>, b: Option<(f64, f64)>) -> Option<(f64, f64)> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if (b.0, -b.1) > (a.0, -a.1) { b } else { a }),
        (a, b) => a.or(b),
    }
}

impl Tally {
    fn new() -> Self {
        Self { rows: vec![Row::default(); Mishap::all().len()], failures: Vec::new() }
    }

    fn take(&mut self, kinds: &[Mishap], flown: Result<Survived, Failure>) {
        let mishap = match &flown {
            Ok(survived) => survived.mishap,
            Err(failure) => failure.plan.mishap,
        };
        let Some(row) = place(kinds, mishap).and_then(|n| self.rows.get_mut(n)) else { return };
        row.flown += 1;
        match flown {
            Ok(Survived { stopped, last_live_ms, limit_ms, .. }) => {
                row.stopped += u64::from(stopped);
                let this = limit_ms.filter(|_| stopped).map(|limit| (last_live_ms, limit));
                row.slowest = slower(row.slowest, this);
            }
            Err(failure) => {
                row.wrong += 1;
                self.failures.push(failure);
            }
        }
    }

    fn join(&mut self, other: Self) {
        for (row, more) in self.rows.iter_mut().zip(other.rows) {
            row.flown += more.flown;
            row.stopped += more.stopped;
            row.wrong += more.wrong;
            row.slowest = slower(row.slowest, more.slowest);
        }
        self.failures.extend(other.failures);
    }

    /// Flights in all.
    #[must_use]
    pub fn flown(&self) -> u64 {
        self.rows.iter().map(|row| row.flown).sum()
    }

    /// Flights that went wrong.
    #[must_use]
    pub fn wrong(&self) -> u64 {
        self.rows.iter().map(|row| row.wrong).sum()
    }

    /// The table, a line for each kind.
    #[must_use]
    pub fn table(&self) -> String {
        let mut text = String::from(
            "| what goes wrong | flown | stopped | slowest stop, ms | its limit, ms | wrong |\n| --- | --- | --- | --- | --- | --- |\n",
        );
        for (mishap, row) in Mishap::all().iter().zip(&self.rows) {
            let (slowest, limit) =
                row.slowest.map_or(("".into(), "".into()), |(ms, limit)| (format!("{ms:.0}"), format!("{limit:.0}")));
            let Row { flown, stopped, wrong, .. } = row;
            let _ = writeln!(text, "| {} | {flown} | {stopped} | {slowest} | {limit} | {wrong} |", mishap.words());
        }
        text
    }
}

/// Flies the plans of `seeds` on all cores. `progress` hears how many are done, from one thread. The result is the same for any number of
/// cores.
pub fn fly_all(seeds: Range<u64>, mut progress: impl FnMut(u64)) -> Tally {
    let workers = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let (next, done) = (AtomicU64::new(seeds.start), AtomicU64::new(0));
    let mut tally = Tally::new();
    std::thread::scope(|scope| {
        let work = || {
            let (kinds, mut own) = (Mishap::all(), Tally::new());
            loop {
                let from = next.fetch_add(PORTION, Ordering::Relaxed);
                if from >= seeds.end {
                    return own;
                }
                for seed in from..(from + PORTION).min(seeds.end) {
                    own.take(&kinds, flight::fly(Plan::of(seed)));
                    done.fetch_add(1, Ordering::Relaxed);
                }
            }
        };
        let handles: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        while handles.iter().any(|handle| !handle.is_finished()) {
            progress(done.load(Ordering::Relaxed));
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
        for handle in handles {
            match handle.join() {
                Ok(own) => tally.join(own),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
    });
    tally.failures.sort_by_key(|failure| failure.plan.seed);
    tally.failures.truncate(KEPT);
    tally
}
