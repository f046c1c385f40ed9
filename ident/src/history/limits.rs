//! Control charts: where a measure lies while nothing changes.
//!
//! What it is: centre and limits of a measure from the runs before the first change, three standard deviations of a run to either side.
//! What can go wrong: fewer than three runs before the change say nothing of how days differ; the limits then have the runs' own errors alone. Where
//! nothing changed the limits are of the very runs that they would judge, and none of a few can lie outside: there are none then.
//! Units: the measure's.
//! Reference: Shewhart 1931, "Economic Control of Quality of Manufactured Product"; Montgomery, individuals chart.

use super::measure::Value;
use super::{FEWEST, History};
use serde::Serialize;

/// Standard deviations from the centre to a limit.
const WIDE: f64 = 3.0;

/// Fewest runs of which one can lie outside the limits that all of them make. Of n values one departs from their mean by at most
/// (n - 1)/sqrt(n) of their standard deviations: when all others are the same.
#[must_use]
pub fn fewest_judged() -> usize {
    (2_usize..).find(|n| (*n - 1) as f64 / (*n as f64).sqrt() > WIDE).unwrap_or(usize::MAX)
}

/// Centre and limits of a measure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Chart {
    /// Centre.
    pub centre: f64,
    /// Lower limit; none where no run that is shown can lie outside.
    pub low: Option<f64>,
    /// Upper limit.
    pub high: Option<f64>,
    /// Runs that they come from.
    pub runs: usize,
}

impl Chart {
    /// Of a measure of a history; nothing where no run before the change tells it.
    #[must_use]
    pub fn of(history: &History, measure: usize) -> Option<Self> {
        let until = history.changes.iter().map(|c| c.first).find(|first| *first > 0).unwrap_or(history.runs.len());
        let scale = history.measures[measure].scale;
        let own: Vec<Value> = history.runs[..until].iter().filter_map(|r| r.values[measure]).map(|v| v.compared(scale)).collect();
        let n = own.len() as f64;
        if own.is_empty() {
            return None;
        }
        let centre = own.iter().map(|v| v.value).sum::<f64>() / n;
        let errors = (own.iter().map(|v| v.se * v.se).sum::<f64>() / n).sqrt();
        let days = (own.iter().map(|v| (v.value - centre).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        let sd = if own.len() < FEWEST { errors } else { days.max(errors) };
        let ends = [centre, centre - WIDE * sd, centre + WIDE * sd];
        let [centre, low, high] = ends.map(|v| scale.back(v));
        let judges = own.len() >= fewest_judged() || until < history.runs.len();
        Some(Self { centre, low: judges.then_some(low), high: judges.then_some(high), runs: own.len() })
    }

    /// Whether a value lies outside.
    #[must_use]
    pub fn is_outside(&self, value: f64) -> bool {
        self.low.is_some_and(|low| value < low) || self.high.is_some_and(|high| value > high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::tests::{departing, stepped};

    /// The runs that one can lie outside of are as many as it says: the farthest of ten lies within, that of eleven without.
    #[test]
    fn a_few_runs_have_no_limits_of_their_own() {
        let farthest = |n: usize| {
            let values: Vec<f64> = (0..n).map(|k| f64::from(u8::from(k == 0))).collect();
            let mean = 1.0 / n as f64;
            let sd = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1) as f64).sqrt();
            (1.0 - mean) / sd
        };
        assert!(fewest_judged() == 11 && farthest(10) < WIDE && farthest(11) > WIDE);
        let limits = |n| Chart::of(&departing(n, false, |_| 0.0), 0).unwrap();
        assert!(limits(10).low.is_none() && limits(10).high.is_none() && !limits(10).is_outside(1e9));
        assert!(limits(11).low.is_some() && limits(11).is_outside(1e9));
        // runs after a change are no part of the limits, and can lie outside
        assert!(Chart::of(&stepped(9, 5), 0).unwrap().high.is_some());
    }
}
