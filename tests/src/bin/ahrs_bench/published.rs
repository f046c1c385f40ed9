//! What other filters reach, as published with the data.
//!
//! What it is: reads the table of a set; the errors of a filter trial by trial, and which of the filters that run while the body moves
//! are ahead of ours in a group, whatever their tuning.
//! What can go wrong: a trial without a row is a failure.
//! Units: degrees.
//! Reference: READMEs of the data; `ahrs/peers-shared.csv`, `ahrs-phones/peers.csv` (held input, alignment A).

use super::score::Score;
use crate::run::Failure;
use std::path::{Path, PathBuf};

/// VQF with its defaults.
pub(super) const VQF: &str = "vqf default";
/// VQF over the whole recording, forwards and backwards: nothing that runs while the body moves need reach it.
pub(super) const OFFLINE: &str = "vqf offline";

/// A filter on a trial.
struct Row {
    /// Variant of the trials, or whose gyro.
    input: String,
    trial: String,
    filter: String,
    score: Score,
}

/// A set's table.
pub(super) struct Published {
    file: PathBuf,
    rows: Vec<Row>,
}

impl Published {
    /// The table of BROAD.
    pub(super) fn broad(file: &Path) -> Result<Self, Failure> {
        Self::read(file, |f| {
            let &[input, trial, filter, tuning, .., total, heading, inclination] = f else { return None };
            let filter = if filter == "vqf-offline(acausal)" { OFFLINE.to_owned() } else { format!("{filter} {tuning}") };
            row(input, trial, filter, [total, heading, inclination])
        })
    }

    /// The table of the phones.
    pub(super) fn phones(file: &Path) -> Result<Self, Failure> {
        Self::read(file, |f| {
            let &[trial, _, _, _, filter, "held", gyro, total, heading, inclination, ..] = f else { return None };
            let filter = match filter {
                "vqf" => VQF,
                "vqf_offline" => OFFLINE,
                other => other,
            };
            row(gyro, trial, filter.to_owned(), [total, heading, inclination])
        })
    }

    fn read(file: &Path, parse: impl Fn(&[&str]) -> Option<Row>) -> Result<Self, Failure> {
        let text = std::fs::read_to_string(file).map_err(|e| Failure(format!("{}: {e}", file.display())))?;
        let rows = text.lines().filter_map(|line| parse(&line.split(',').collect::<Vec<_>>())).collect();
        Ok(Self { file: file.to_owned(), rows })
    }

    /// Whether there is anything of an input.
    pub(super) fn has(&self, input: &str) -> bool {
        self.rows.iter().any(|r| r.input == input)
    }

    /// A filter's errors of each trial.
    pub(super) fn scores(&self, filter: &str, input: &str, trials: &[&str]) -> Result<Vec<Score>, Failure> {
        let missing = |trial: &str| Failure(format!("{}: no row of {filter}, {input}, for {trial}", self.file.display()));
        trials.iter().map(|trial| self.find(filter, input, trial).ok_or_else(|| missing(trial))).collect()
    }

    fn find(&self, filter: &str, input: &str, trial: &str) -> Option<Score> {
        let mine = |r: &&Row| r.input == input && r.trial == trial && r.filter == filter;
        self.rows.iter().find(mine).map(|r| r.score)
    }

    /// The online filters that are ahead of `ours` in the mean over these trials, each with the error in which they are.
    pub(super) fn ahead(&self, input: &str, trials: &[&str], ours: &Score) -> Vec<String> {
        let mut filters: Vec<&str> = self.rows.iter().map(|r| r.filter.as_str()).filter(|f| *f != OFFLINE).collect();
        filters.sort_unstable();
        filters.dedup();
        let mean = |filter: &str| {
            let all: Option<Vec<Score>> = trials.iter().map(|t| self.find(filter, input, t)).collect();
            Some(Score::mean(all?.iter()))
        };
        let better = |filter: &str| {
            let theirs = mean(filter)?;
            let errors = [
                ("total", theirs.total, ours.total),
                ("heading", theirs.heading, ours.heading),
                ("inclination", theirs.inclination, ours.inclination),
            ];
            let won = errors.iter().filter(|(_, a, b)| a < b).map(|(what, a, b)| format!("{what} {a:.3} (ours {b:.3})"));
            let won: Vec<String> = won.collect();
            (!won.is_empty()).then(|| format!("{filter}: {}", won.join(", ")))
        };
        filters.into_iter().filter_map(better).collect()
    }
}

fn row(input: &str, trial: &str, filter: String, [total, heading, inclination]: [&str; 3]) -> Option<Row> {
    let score = Score { total: total.parse().ok()?, heading: heading.parse().ok()?, inclination: inclination.parse().ok()? };
    Some(Row { input: input.to_owned(), trial: trial.to_owned(), filter, score })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Published {
        let of = |filter: &str, total| Row {
            input: "own".into(),
            trial: "T".into(),
            filter: filter.into(),
            score: Score { total, heading: 1.0, inclination: 1.0 },
        };
        Published { file: "peers.csv".into(), rows: vec![of(VQF, 4.0), of("other", 2.0), of(OFFLINE, 1.0)] }
    }

    #[test]
    fn a_row_is_found_by_trial_filter_and_input() {
        let t = table();
        assert_eq!(t.find(VQF, "own", "T").map(|s| s.total), Some(4.0));
        for (filter, input, trial) in [(VQF, "raw", "T"), (VQF, "own", "U"), ("vqf", "own", "T")] {
            assert!(t.scores(filter, input, &[trial]).is_err());
        }
    }

    #[test]
    fn whoever_is_ahead_is_named_but_for_those_that_see_the_whole_recording() {
        let ours = Score { total: 3.0, heading: 1.0, inclination: 0.5 };
        assert_eq!(table().ahead("own", &["T"], &ours), ["other: total 2.000 (ours 3.000)"]);
    }
}
