//! The history of a rig: its constants run by run, and what changed when.
//!
//! What it is: each run's own constants with their errors; how days differ, estimated from the runs themselves; whether one value for all runs
//! or two, split at a gap, or a drift is the better account of them; and the library's name for what changed.
//! What can go wrong: too few runs show nothing; runs of different rigs are refused; a change within how days differ stays unseen.
//! Units: as each measure states.
//! Reference: change points by marginal likelihood, Barry & Hartigan 1993, JASA 88:309; control charts, Shewhart 1931.

mod channel;
mod columns;
mod constants;
mod counts;
mod curve;
mod differ;
mod evidence;
mod find;
mod limits;
mod measure;
mod name;
mod same;
mod words;

use crate::log::Log;
use crate::log::date;
use serde::Serialize;

pub use find::{Change, Kind, Moved};
pub use limits::{Chart, fewest_judged};
pub use measure::{Measure, Scale, Value};
pub use name::{Name, named};
pub use same::in_doubt;
pub(crate) use words::by;
pub use words::{gap, sentence, summary};

/// Fewest runs that can show a change: one on each side of a gap, and one more that says how days differ.
pub const FEWEST: usize = 3;

/// One run of the history.
#[derive(Debug, Clone, Serialize)]
pub struct Entry {
    /// Name of the log.
    pub run: String,
    /// Its day, days since 1970-01-01, where the log tells it.
    pub day: Option<f64>,
    /// Digest of the log.
    pub sha256: String,
    /// One value a measure; nothing where the run cannot tell it.
    #[serde(skip)]
    pub values: Vec<Option<Value>>,
}

/// Runs of one rig.
#[derive(Debug, Clone)]
pub struct History {
    /// The runs, oldest first where all are dated, else in the order in which they were given.
    pub runs: Vec<Entry>,
    /// Whether every run is dated.
    pub dated: bool,
    /// What is known of each run.
    pub measures: Vec<Measure>,
    /// What changed, oldest first.
    pub changes: Vec<Change>,
}

/// Why runs make no history.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HistoryError {
    /// Too few.
    #[error("{count} run{}; expected at least {FEWEST} runs of one rig: a change needs runs before and after it", if *count == 1 { "" } else { "s" })]
    Few {
        /// How many there are.
        count: usize,
    },
    /// The same log twice.
    #[error("{first} and {second} are the same log; expected different runs of one rig: leave one out")]
    Twice {
        /// Name of the one.
        first: String,
        /// Name of the other.
        second: String,
    },
    /// Not one rig.
    #[error("{first} and {second} are of different rigs: {why}; expected runs of one rig: give each rig a folder of its own")]
    Rigs {
        /// Name of the one.
        first: String,
        /// Name of the other.
        second: String,
        /// What tells them apart.
        why: String,
    },
    /// No channel that can be predicted from another.
    #[error(
        "no channel of these runs can be predicted from another; expected a speed or a command beside thrust, torque or current"
    )]
    Nothing,
}

impl History {
    /// The history of runs; `progress` hears the share that is done. Changes carry no names yet: see [`named`].
    ///
    /// # Errors
    /// [`HistoryError`] where the runs make no history.
    pub fn of(logs: &[Log], progress: &(dyn Fn(f64) + Sync)) -> Result<(Self, Vec<usize>), HistoryError> {
        if logs.len() < FEWEST {
            return Err(HistoryError::Few { count: logs.len() });
        }
        let digests: Vec<String> = logs.iter().map(Log::digest).collect();
        for (i, own) in digests.iter().enumerate() {
            if let Some(j) = digests[..i].iter().position(|d| d == own) {
                return Err(HistoryError::Twice { first: logs[j].name.clone(), second: logs[i].name.clone() });
            }
        }
        same::named_alike(logs)?;
        let days: Vec<Option<f64>> = logs.iter().map(date::of_log).collect();
        let dated = days.iter().all(Option::is_some);
        let mut order: Vec<usize> = (0..logs.len()).collect();
        if dated {
            order.sort_by(|a, b| days[*a].unwrap_or(0.0).total_cmp(&days[*b].unwrap_or(0.0)));
        }
        let ordered: Vec<&Log> = order.iter().map(|k| &logs[*k]).collect();
        let (measures, values) = constants::of(&ordered, progress).ok_or(HistoryError::Nothing)?;
        let runs: Vec<Entry> = order
            .iter()
            .zip(values)
            .map(|(k, values)| Entry { run: logs[*k].name.clone(), day: days[*k], sha256: digests[*k].clone(), values })
            .collect();
        same::behaves_alike(&measures, &runs)?;
        let mut history = Self { runs, dated, measures, changes: Vec::new() };
        history.changes = find::changes(&history);
        Ok((history, order))
    }

    /// The values of one measure, run by run.
    #[must_use]
    pub fn series(&self, measure: usize) -> Vec<Option<Value>> {
        self.runs.iter().map(|r| r.values[measure]).collect()
    }

    /// What a run is called where a gap is named: its day where runs are dated, else its number.
    #[must_use]
    pub fn label(&self, run: usize) -> String {
        match self.runs[run].day {
            Some(day) if self.dated => date::text(day.floor() as i64),
            _ => format!("run {}", run + 1),
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Runs of four measures that scatter from day to day; the first departs as asked. Nothing is sought yet.
    pub(crate) fn departing(runs: usize, dated: bool, departs: impl Fn(usize) -> f64) -> History {
        let wave = |k: usize, m: usize| ((k * k * 7 + m * 13) as f64 * 0.7).sin();
        let measure = |m: usize| Measure {
            name: format!("thrust_n {m}"),
            words: format!("measure {m}"),
            unit: "N".into(),
            scale: Scale::Linear,
            channel: "thrust_n".into(),
            of_two: false,
            asked: true,
            of_day: false,
        };
        let value = |k: usize, m: usize| {
            let departed = if m == 0 { departs(k) } else { 0.0 };
            Some(Value { value: 5.0 + wave(k, m) + departed, se: 0.05 })
        };
        let run = |k: usize| Entry {
            run: format!("{k}.csv"),
            day: dated.then_some(7.0 * k as f64),
            sha256: String::new(),
            values: (0..4).map(|m| value(k, m)).collect(),
        };
        History { runs: (0..runs).map(run).collect(), dated, measures: (0..4).map(measure).collect(), changes: Vec::new() }
    }

    /// The same with a step of the first measure before a run, found.
    pub(crate) fn stepped(runs: usize, first: usize) -> History {
        let mut history = departing(runs, false, |k| if k >= first { 9.0 } else { 0.0 });
        history.changes = find::changes(&history);
        history
    }
}
