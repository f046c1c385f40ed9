//! A hold whose readings never repeat, because noise comes after it.
//!
//! What it is: a held channel changes at its updates only. Each change of the load is seen at the next update, late by anything up to a
//! period, and all changes are whole periods apart ([`Clock`]).
//! What can go wrong: a schedule whose levels last whole periods, or too few changes of the load, hide the updates; a channel that
//! follows the load shows changes on rows that are next to each other, and is none.
//! Units: s.
//! Reference: Rayleigh's test of a common phase, Mardia & Jupp 2000, *Directional Statistics*, sections 3.5.7 and 6.3.

use super::clock::Clock;
use crate::channel::{Context, Target};

/// Standard deviations of the noise by which two readings that follow each other differ where the held value changed.
const CHANGED: f64 = 8.0;
/// Fewest rows of a period.
const FEWEST_ROWS: f64 = 4.0;
/// Most rows of one change: a reading that is a mean over its row holds a part of the old value.
const LONGEST_CHANGE: usize = 2;
/// Largest share of the changes that may be longer.
const CLOSE: f64 = 0.1;
/// Mean and standard deviation of the lateness as shares of the period: a half and a twelfth's root for a hold. A delay is late by the same
/// every time, and what follows the load is hardly late.
const LATE: (f64, f64) = (0.25, 0.12);

/// The clock of a channel's updates, where its changes have one.
pub(super) fn clock(context: &Context, target: &Target) -> Option<Clock> {
    let of_all = || context.targets.iter().map(|t| of_changes(context, t).map(Clock::parts)).collect();
    let place = context.targets.iter().position(|t| t.name == target.name)?;
    context.facts.late_clocks.get_or_init(of_all).get(place).copied().flatten().map(Clock::of_parts)
}

fn of_changes(context: &Context, target: &Target) -> Option<Clock> {
    let runs = changes(context, target);
    let long = runs.iter().filter(|run| run.1 > LONGEST_CHANGE).count();
    if long as f64 > CLOSE * runs.len() as f64 {
        return None;
    }
    let rows: Vec<usize> = runs.iter().map(|run| run.0).collect();
    let clock = Clock::of_changes(context, &rows, (FEWEST_ROWS, context.step()))?;
    let times: Vec<f64> = rows.iter().map(|row| context.t[*row]).collect();
    is_late(&clock, context, &times).then_some(clock)
}

/// Runs of rows on which a channel reads clearly another value than on the row before: the first of them, and how many.
fn changes(context: &Context, target: &Target) -> Vec<(usize, usize)> {
    let speed = |row: usize| context.rpm.get(row).copied().unwrap_or(0.0);
    // what is held beyond a jump of the load counts as noise of the level that it reaches into: on a healthy day none was
    let healthy = if target.usual > 0.0 { target.usual } else { f64::INFINITY };
    let deviation = |row: &usize| target.noise.variance(speed(*row)).sqrt().min(healthy);
    let least = |rows: &[usize]| rows.iter().map(deviation).fold(0.0, f64::max) * CHANGED;
    let pairs = target.y.windows(2).zip(target.rows.windows(2));
    let changed = pairs.filter(|(y, rows)| rows[1] == rows[0] + 1 && (y[1] - y[0]).abs() > least(rows)).map(|(_, rows)| rows[1]);
    let mut out: Vec<(usize, usize)> = Vec::new();
    for row in changed {
        match out.last_mut() {
            Some((first, n)) if *first + *n == row => *n += 1,
            _ => out.push((row, 1)),
        }
    }
    out
}

/// Whether the first change after each jump of the load is late by now more, now less, and never by much more than a period.
fn is_late(clock: &Clock, context: &Context, changes: &[f64]) -> bool {
    let jumps = context.calm.iter().filter_map(|(_, to)| context.t.get(*to));
    let next = |jump: &f64| changes.get(changes.partition_point(|t| t < jump)).map(|t| t - jump);
    let late: Vec<f64> = jumps.filter_map(next).filter(|d| *d < 2.0 * clock.period).collect();
    let n = late.len().max(1) as f64;
    let mean = late.iter().sum::<f64>() / n;
    let spread = (late.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / n).sqrt();
    late.len() > 5 && mean > LATE.0 * clock.period && spread > LATE.1 * clock.period
}
