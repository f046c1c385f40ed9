//! When a held channel takes new values.
//!
//! What it is: all its changes are whole periods apart, whether or not each update changes the reading: the rate at which the changes have one
//! phase is that of the updates.
//! What can go wrong: too few changes, or changes on rows that are next to each other, tell no rate.
//! Units: s.
//! Reference: Rayleigh's test of a common phase, Mardia & Jupp 2000, *Directional Statistics*, sections 3.5.7 and 6.3.

use super::{phase, slope, spacing, updates};
use crate::channel::{Context, STANDSTILL, Target};

/// Fewest changes.
const FEWEST_CHANGES: usize = 8;
/// Length of the changes' common phase, and evidence for it in nats beyond the number of rates that were tried.
const ONE_PHASE: (f64, f64) = (0.8, 10.0);
/// Time from the first change within which the rate is first looked for, s.
const LOOK: f64 = 300.0;
/// The same in changes.
const LOOKED_AT: usize = 200;
/// Fewest rows of a period whose updates repeat values: the next row is up to one late, and phases that fill half a turn are hardly one.
const FEWEST_ROWS: f64 = 2.5;

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
    /// For the first row at or after each update how long before it the update was, as a share of the interval that ends there.
    pub(super) fn before(&self, t: &[f64]) -> Vec<Option<f64>> {
        let count = |t: f64| ((t - self.first) / self.period).floor();
        let of_row = |w: &[f64]| {
            let last = self.first + count(w[1]) * self.period;
            (count(w[1]) > count(w[0])).then(|| (w[1] - last) / (w[1] - w[0]))
        };
        t.first().map(|_| Some(0.0)).into_iter().chain(t.windows(2).map(of_row)).collect()
    }

    /// Of changes on some rows, at least so many readings of `dt` seconds apart.
    pub(super) fn of_changes(context: &Context, rows: &[usize], (fewest_rows, dt): (f64, f64)) -> Option<Self> {
        let times: Vec<f64> = rows.iter().map(|row| context.t[*row]).collect();
        let mut gaps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
        gaps.sort_unstable_by(f64::total_cmp);
        let least = *gaps.get(gaps.len() / 20)?;
        if gaps.len() < FEWEST_CHANGES || least < (fewest_rows - 0.5) * dt {
            return None;
        }
        let known = &times[..times.partition_point(|t| *t - times[0] <= LOOK).min(LOOKED_AT)];
        let step = 0.2 / (known.last()? - known[0]).max(1.0);
        let (from, to) = (1.0 / (least + 2.0 * dt), 1.0 / (fewest_rows * dt));
        let rates: Vec<f64> = (0..).map(|k| from + f64::from(k) * step).take_while(|f| *f < to).collect();
        // a rate that fits fits with every multiple, less closely for the length of a row, and with those that the schedule adds: its own is the one
        // for which most speaks
        let asked = rates.iter().map(|rate| {
            let length = phase(known, *rate).1;
            (*rate, length, of_one_phase(known.len(), length, rate * dt))
        });
        let (rate, length, speaks) = asked.max_by(|a, b| a.2.total_cmp(&b.2))?;
        if length < ONE_PHASE.0 || speaks < (rates.len() as f64).ln() + ONE_PHASE.1 {
            return None;
        }
        let (period, error) = slope(context, rows, &|_| true, 1.0 / rate);
        let (turn, _) = phase(&times, 1.0 / period);
        Some(Self { period, error, first: turn * period - 0.5 * dt })
    }

    /// Of a channel that repeats its values and does not change with every update, as a coarse display does.
    pub(super) fn of_updates(context: &Context, target: &Target) -> Option<Self> {
        let of = |t: &Target| Self::of_changes(context, &changes(context, t), (FEWEST_ROWS, spacing(context, t)));
        let of_all = || context.targets.iter().map(|t| of(t).map(Self::parts)).collect();
        let place = context.targets.iter().position(|t| t.name == target.name)?;
        context.facts.clocks.get_or_init(of_all).get(place).copied().flatten().map(Self::of_parts)
    }

    /// Period, its standard error and the instant of an update, s: as facts keep a clock.
    pub(super) fn parts(self) -> [f64; 3] {
        [self.period, self.error, self.first]
    }

    /// The clock of such parts.
    pub(super) fn of_parts([period, error, first]: [f64; 3]) -> Self {
        Self { period, error, first }
    }
}

/// Rows on which a channel shows a new value while the rotor turns: a standing one reads zero again and again.
fn changes(context: &Context, target: &Target) -> Vec<usize> {
    let live = |row: &usize| context.rpm.get(*row).is_none_or(|r| *r > STANDSTILL);
    updates(target).into_iter().filter(live).collect()
}

/// Evidence, nats, that phases whose mean has a length are of one phase and not of any: that of a normal distribution of their width over a
/// uniform one, which is Rayleigh's where they lie apart. None is closer than a row, here as a share of the period.
fn of_one_phase(n: usize, length: f64, row: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    let variance = (-2.0 * length.ln()).max((turn * row).powi(2) / 12.0);
    let of_each = turn.ln() - 0.5 * (turn * std::f64::consts::E * variance).ln();
    n as f64 * f64::max(of_each, length * length)
}

#[cfg(test)]
mod tests {
    use super::{Clock, of_one_phase};
    use crate::channel::Context;
    use crate::log::{Column, Log};

    #[test]
    fn few_changes_that_lie_close_together_are_evidence_enough() {
        // Rayleigh's measure of the same changes is n times the squared length: less than the ten nats beyond the rates that were tried
        let (n, length, row) = (18, 0.9966, 0.25);
        let needed = 6416_f64.ln() + super::ONE_PHASE.1;
        assert!(n as f64 * length * length < needed && of_one_phase(n, length, row) > needed);
        assert!((of_one_phase(n, 0.3, row) - 18.0 * 0.09).abs() < 1e-9, "what lies apart is Rayleigh's");
    }

    /// A display of coarse steps skips updates that change nothing: the clock is found all the same, and of changes at any time none is.
    #[test]
    fn updates_that_change_nothing_are_counted() {
        let t: Vec<f64> = (0..6000).map(|i| 0.025 * f64::from(i)).collect();
        let held = |t: f64| (t / 0.4087 + 0.3).floor() * 0.4087;
        let wander = |t: f64| (0.7 * t).sin() + (0.31 * t).cos() + 0.5 * (1.3 * t).sin();
        let of = |reading: &dyn Fn(f64) -> f64| {
            let column = |name: &str, values: Vec<f64>| Column { name: name.to_owned(), values };
            let rpm = t.iter().map(|t| 5000.0 + 50.0 * reading(*t).round()).collect();
            let thrust = t.iter().map(|t| 8.0 + 0.1 * wander(*t)).collect();
            let log = Log { t: t.clone(), columns: vec![column("rpm", rpm), column("thrust_n", thrust)], ..Log::default() };
            let context = Context::new(&log, None);
            Clock::of_updates(&context, context.targets.iter().find(|t| t.name == "rpm").expect("a speed"))
        };
        let clock = of(&|t| 2.0 * wander(held(t))).expect("a clock");
        assert!((clock.period - 0.4087).abs() < 3.0 * clock.error + 1e-3, "{clock:?}");
        assert!(of(&|t| 2.0 * wander(t)).is_none());
    }

    /// A load that jumps every eight seconds, seen at the next update: the changes also have nearly one phase at a rate that is one less in eight seconds.
    #[test]
    fn an_even_schedule_does_not_pass_for_another_period() {
        let t: Vec<f64> = (0..3200).map(|i| 0.1 * f64::from(i)).collect();
        let column = |name: &str, value: f64| Column { name: name.to_owned(), values: vec![value; t.len()] };
        let log = Log { t: t.clone(), columns: vec![column("rpm", 5000.0), column("thrust_n", 8.0)], ..Log::default() };
        let context = Context::new(&log, None);
        for period in [1.06, 1.22, 0.83] {
            let seen = |k: i32| ((8.0 * f64::from(k) + 0.37) / period).ceil() * period - 0.37;
            let rows: Vec<usize> = (1..39).map(|k| t.partition_point(|t| *t < seen(k))).collect();
            let clock = Clock::of_changes(&context, &rows, (4.0, 0.1)).expect("a clock");
            assert!((clock.period - period).abs() < 2.0 * clock.error, "{period}: {clock:?}");
        }
    }
}
