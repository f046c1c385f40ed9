//! Control charts: where a measure lies while nothing changes.
//!
//! What it is: centre and limits of a measure from the runs before the first change, three standard deviations of a run to either side.
//! What can go wrong: fewer than three runs before the change say nothing of how days differ; the limits then have the runs' own errors alone.
//! Units: the measure's.
//! Reference: Shewhart 1931, "Economic Control of Quality of Manufactured Product"; Montgomery, individuals chart.

use super::measure::Value;
use super::{FEWEST, History};
use serde::Serialize;

/// Standard deviations from the centre to a limit.
const WIDE: f64 = 3.0;

/// Centre and limits of a measure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Chart {
    /// Centre.
    pub centre: f64,
    /// Lower limit.
    pub low: f64,
    /// Upper limit.
    pub high: f64,
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
        Some(Self { centre, low, high, runs: own.len() })
    }

    /// Whether a value lies outside.
    #[must_use]
    pub fn is_outside(&self, value: f64) -> bool {
        value < self.low || value > self.high
    }
}
