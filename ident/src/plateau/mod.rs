//! Plateaus: stretches in which the rig stands still at one level.
//!
//! What it is: change points from the command and the data together cut the run; the settling of every step is measured and
//! dropped; every channel is averaged robustly with a standard error that accounts for the colour of its noise.
//! What can go wrong: a ramp has no plateaus, and none are invented; a level shorter than [`SHORTEST`] settled rows is left out.
//! Units: as the columns; seconds.
//! Reference: specification `identification.md`, item 2; Beharie 2013, section 5.7.3; Killick, Fearnhead & Eckley 2012 (change
//! points); Geyer 1992 (error of a coloured mean).

mod change;
mod mean;
pub mod score;
pub mod shift;
pub mod study;

use crate::channel::Context;
use crate::log::{Log, SPEED};
use crate::numeric::order::median;
use crate::signal::settle;
use mean::{Colour, Residual, mean_of, residual};

/// Fewest settled rows of a plateau.
pub const SHORTEST: usize = 5;
/// Largest change within a held command after its settling, as a share of the highest value.
const MOVING: f64 = 0.05;
/// Channels that must have settled, the speeds apart: what a fit takes from a plateau.
const FOLLOWERS: [&str; 3] = ["thrust_n", "torque_nm", "current_a"];

/// One plateau.
#[derive(Debug, Clone, PartialEq)]
pub struct Plateau {
    /// First settled instant, s.
    pub from_s: f64,
    /// Last instant, s.
    pub to_s: f64,
    /// First settled row.
    pub first: usize,
    /// Rows that were averaged.
    pub rows: usize,
    /// Time that the step took to settle, s.
    pub settling_s: f64,
    /// Mean and standard error of each column of the log, `None` where the plateau holds no sample of it.
    pub means: Vec<Option<(f64, f64)>>,
}

impl Plateau {
    /// Middle of its time, s.
    #[must_use]
    pub fn middle_s(&self) -> f64 {
        0.5 * (self.from_s + self.to_s)
    }

    /// Mean and standard error of a column.
    #[must_use]
    pub fn of(&self, log: &Log, column: &str) -> Option<(f64, f64)> {
        self.means.get(log.columns.iter().position(|c| c.name == column)?).copied().flatten()
    }
}

/// Finds the plateaus of a log.
#[must_use]
pub fn plateaus(context: &Context, log: &Log) -> Vec<Plateau> {
    detect(log, &context.rpm)
}

/// Finds the plateaus of a log whose consensus speed is known (empty when no speed was measured).
#[must_use]
pub fn detect(log: &Log, speed: &[f64]) -> Vec<Plateau> {
    let guide = guide(log, speed);
    if guide.is_empty() {
        return Vec::new();
    }
    let stretches = change::stretches(log.column("pulse_us"), guide);
    let top = guide.iter().copied().filter(|v| v.is_finite()).fold(0.0_f64, |m, v| m.max(v.abs()));
    // what still moves after its settling was cut off (a motor that started late, a rotor that coasts) is no level
    let stands =
        |from: usize, to: usize, piece: bool| drift(&guide[from..to]).abs() <= top * if piece { change::DRIFT } else { MOVING };
    let followers: Vec<&[f64]> = FOLLOWERS.iter().filter_map(|n| log.column(n)).collect();
    let settled: Vec<(usize, usize, usize)> = stretches
        .iter()
        .map(|change::Stretch { from, to, piece }| {
            let rows = settle::rows(&log.t, guide, *from, *to);
            let rows = followers.iter().map(|f| settle::rows(&log.t, f, *from, *to)).fold(rows, usize::max);
            (*from, from + rows, *to, *piece)
        })
        .filter(|(_, start, to, piece)| to - start >= SHORTEST && stands(*start, *to, *piece))
        .map(|(from, start, to, _)| (from, start, to))
        .collect();
    let ranges: Vec<(usize, usize)> = settled.iter().map(|(_, start, to)| (*start, *to)).collect();
    let mut plateaus: Vec<Plateau> = settled
        .iter()
        .map(|(from, start, to)| Plateau {
            from_s: log.t[*start],
            to_s: log.t[to - 1],
            first: *start,
            rows: to - start,
            settling_s: log.t[*start] - log.t[*from],
            means: Vec::with_capacity(log.columns.len()),
        })
        .collect();
    for column in &log.columns {
        for (p, mean) in plateaus.iter_mut().zip(means_over(&column.values, &ranges)) {
            p.means.push(mean);
        }
    }
    plateaus
}

/// Mean and standard error of a column over row ranges, the colour of its noise pooled over all of them.
#[must_use]
pub fn means_over(values: &[f64], ranges: &[(usize, usize)]) -> Vec<Option<(f64, f64)>> {
    let residuals: Vec<Option<Residual>> = ranges.iter().map(|(from, to)| residual(&values[*from..*to])).collect();
    let colour = Colour::pooled(values, ranges, &residuals);
    let mean = |(from, to): &(usize, usize), r: &Option<Residual>| Some(mean_of(&values[*from..*to], r.as_ref()?, &colour));
    ranges.iter().zip(&residuals).map(|(range, r)| mean(range, r)).collect()
}

/// Change from the first third of a stretch to the last; 0 where either is missing.
fn drift(z: &[f64]) -> f64 {
    let middle = |z: &[f64]| {
        let mut there: Vec<f64> = z.iter().copied().filter(|v| v.is_finite()).collect();
        median(&mut there)
    };
    let third = z.len().div_ceil(3);
    let change = middle(&z[z.len() - third..]) - middle(&z[..third]);
    if change.is_finite() { change } else { 0.0 }
}

/// What shows the steps: the speed, or where none was measured the first channel that follows the throttle.
fn guide<'l>(log: &'l Log, speed: &'l [f64]) -> &'l [f64] {
    if !speed.is_empty() {
        return speed;
    }
    SPEED.iter().chain(&FOLLOWERS).find_map(|n| log.column(n)).unwrap_or(&[])
}

/// So many plateaus, in words.
#[must_use]
pub fn so_many(count: usize) -> String {
    if count == 1 { "1 plateau".to_owned() } else { format!("{count} plateaus") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Column;

    fn staircase(command: bool) -> Log {
        let n = 1200;
        let t: Vec<f64> = (0..n).map(|i| f64::from(i) * 0.1).collect();
        let pulse: Vec<f64> = (0..n).map(|i| 1100.0 + 50.0 * f64::from(i / 200)).collect();
        let mut rpm = Vec::new();
        let mut s = 300.0;
        for (i, p) in pulse.iter().enumerate() {
            s += (3.0 * (p - 1000.0) - s) * 0.2;
            rpm.push(s + 0.2 * (i as f64 * 2.4).sin());
        }
        let mut columns = vec![Column { name: "rpm".into(), values: rpm }];
        if command {
            columns.push(Column { name: "pulse_us".into(), values: pulse });
        }
        Log { t, columns, ..Log::default() }
    }

    #[test]
    fn a_staircase_with_a_lag_gives_its_levels_with_and_without_its_command() {
        for command in [true, false] {
            let log = staircase(command);
            let found = plateaus(&Context::new(&log, None), &log);
            assert_eq!(found.len(), 6, "command {command}");
            for (k, p) in found.iter().enumerate() {
                let (mean, _) = p.of(&log, "rpm").unwrap();
                assert!((mean - 3.0 * (100.0 + 50.0 * k as f64)).abs() < 0.3, "{k}: {mean}");
                assert!(p.rows > 100);
            }
        }
    }

    /// The command falls to its end for a second or two, and the rotor coasts.
    #[test]
    fn a_rotor_that_coasts_is_no_level() {
        let mut log = staircase(true);
        log.t.extend((0..20).map(|i| 120.0 + 0.1 * f64::from(i)));
        log.columns[0].values.extend((0..20).map(|i| 1000.0 * (-0.15 * f64::from(i)).exp()));
        log.columns[1].values.extend([1000.0; 20]);
        assert_eq!(plateaus(&Context::new(&log, None), &log).len(), 6);
    }

    #[test]
    fn a_ramp_has_none() {
        let n = 600;
        let ramp: Vec<f64> = (0..n).map(|i| 1000.0 + 5.0 * f64::from(i) + 3.0 * (f64::from(i) * 2.4).sin()).collect();
        let log = Log {
            t: (0..n).map(|i| f64::from(i) * 0.1).collect(),
            columns: vec![Column { name: "rpm".into(), values: ramp }],
            ..Log::default()
        };
        assert!(plateaus(&Context::new(&log, None), &log).is_empty());
    }
}
