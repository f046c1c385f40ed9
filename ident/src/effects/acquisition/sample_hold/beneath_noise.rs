//! A hold whose readings never repeat, because noise comes after it.
//!
//! What it is: a held channel changes at its updates only. Each change of the load is seen at the next update, late by anything up to a
//! period, and all changes are whole periods apart: the rate at which they have one phase is that of the updates.
//! What can go wrong: a schedule whose levels last whole periods, or too few changes of the load, hide the updates; a channel that
//! follows the load shows changes on rows that are next to each other, and is none.
//! Units: s.
//! Reference: Rayleigh's test of a common phase, Mardia & Jupp 2000, *Directional Statistics*, sections 3.5.7 and 6.3.

use super::{phase, slope};
use crate::channel::{Context, Target};

/// Standard deviations of the noise by which two readings that follow each other differ where the held value changed.
const CHANGED: f64 = 8.0;
/// Fewest rows of a period.
const FEWEST_ROWS: f64 = 4.0;
/// Fewest changes.
const FEWEST_CHANGES: usize = 8;
/// Most rows of one change: a reading that is a mean over its row holds a part of the old value.
const LONGEST_CHANGE: usize = 2;
/// Largest share of the changes that may be longer.
const CLOSE: f64 = 0.1;
/// Length of the changes' common phase, and evidence for it in nats beyond the number of rates that were tried.
const ONE_PHASE: (f64, f64) = (0.8, 10.0);
/// Part of the best length at which a slower rate is taken: a rate that fits fits with every multiple.
const AS_GOOD: f64 = 0.95;
/// Time from the first change within which the rate is first looked for, s.
const LOOK: f64 = 300.0;
/// Mean and standard deviation of the lateness as shares of the period: a half and a twelfth's root for a hold. A delay is late by the same
/// every time, and what follows the load is hardly late.
const LATE: (f64, f64) = (0.25, 0.12);

/// When a held channel takes new values.
#[derive(Debug, Clone, Copy)]
pub(super) struct Clock {
    /// Time between two updates, s.
    pub(super) period: f64,
    /// Its standard error, s.
    pub(super) error: f64,
    /// Time of an update, s.
    first: f64,
}

impl Clock {
    /// Marks the first row at or after each update.
    pub(super) fn mark(&self, t: &[f64], fresh: &mut [bool]) {
        let count = |t: f64| ((t - self.first) / self.period).floor();
        for (k, fresh) in fresh.iter_mut().enumerate() {
            *fresh |= k == 0 || count(t[k]) > count(t[k - 1]);
        }
    }
}

/// The clock of a channel's updates, where its changes have one.
pub(super) fn clock(context: &Context, target: &Target) -> Option<Clock> {
    let dt = context.step();
    let runs = changes(context, target);
    let long = runs.iter().filter(|run| run.1 > LONGEST_CHANGE).count();
    let rows: Vec<usize> = runs.iter().map(|run| run.0).collect();
    let times: Vec<f64> = rows.iter().map(|row| context.t[*row]).collect();
    let mut gaps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    gaps.sort_unstable_by(f64::total_cmp);
    let least = *gaps.get(gaps.len() / 20)?;
    if gaps.len() < FEWEST_CHANGES || long as f64 > CLOSE * runs.len() as f64 || least < (FEWEST_ROWS - 0.5) * dt {
        return None;
    }
    let known = &times[..times.partition_point(|t| *t - times[0] <= LOOK)];
    let step = 0.2 / (known.last()? - known[0]).max(1.0);
    let (from, to) = (1.0 / (least + 2.0 * dt), 1.0 / (FEWEST_ROWS * dt));
    let rates: Vec<(f64, f64)> =
        (0..).map(|k| from + f64::from(k) * step).take_while(|f| *f < to).map(|f| (f, phase(known, f).1)).collect();
    let (at, best) = rates.iter().fold((to, 0.0), |a: (f64, f64), r| if r.1 > a.1 { *r } else { a });
    if best < ONE_PHASE.0 || of_one_phase(known.len(), best, at * dt) < (rates.len() as f64).ln() + ONE_PHASE.1 {
        return None;
    }
    let first = rates.iter().position(|r| r.1 > AS_GOOD * best)?;
    let rate = rates[first..].iter().take_while(|r| r.1 > AS_GOOD * best).max_by(|a, b| a.1.total_cmp(&b.1))?.0;
    let (period, error) = slope(context, &rows, &|_| true, 1.0 / rate);
    let (turn, _) = phase(&times, 1.0 / period);
    let clock = Clock { period, error, first: turn * period - 0.5 * dt };
    clock.is_late(context, &times).then_some(clock)
}

/// Evidence, nats, that phases whose mean has a length are of one phase and not of any: that of a normal distribution of their width over a
/// uniform one, which is Rayleigh's where they lie apart. None is closer than a row, here as a share of the period.
fn of_one_phase(n: usize, length: f64, row: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    let variance = (-2.0 * length.ln()).max((turn * row).powi(2) / 12.0);
    let of_each = turn.ln() - 0.5 * (turn * std::f64::consts::E * variance).ln();
    n as f64 * f64::max(of_each, length * length)
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

impl Clock {
    /// Whether the first change after each jump of the load is late by now more, now less, and never by much more than a period.
    fn is_late(&self, context: &Context, changes: &[f64]) -> bool {
        let jumps = context.calm.iter().filter_map(|(_, to)| context.t.get(*to));
        let next = |jump: &f64| changes.get(changes.partition_point(|t| t < jump)).map(|t| t - jump);
        let late: Vec<f64> = jumps.filter_map(next).filter(|d| *d < 2.0 * self.period).collect();
        let n = late.len().max(1) as f64;
        let mean = late.iter().sum::<f64>() / n;
        let spread = (late.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / n).sqrt();
        late.len() > 5 && mean > LATE.0 * self.period && spread > LATE.1 * self.period
    }
}

#[cfg(test)]
mod tests {
    use super::of_one_phase;

    #[test]
    fn few_changes_that_lie_close_together_are_evidence_enough() {
        // Rayleigh's measure of the same changes is n times the squared length: less than the ten nats beyond the rates that were tried
        let (n, length, row) = (18, 0.9966, 0.25);
        let needed = 6416_f64.ln() + super::ONE_PHASE.1;
        assert!(n as f64 * length * length < needed && of_one_phase(n, length, row) > needed);
        assert!((of_one_phase(n, 0.3, row) - 18.0 * 0.09).abs() < 1e-9, "what lies apart is Rayleigh's");
    }
}
