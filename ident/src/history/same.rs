//! Whether runs are of one rig.
//!
//! What it is: motor and propeller as the logs' heads name them; and the gains of thrust, torque and speed, which no effect of the library
//! changes several times over.
//! What can go wrong: two rigs with alike motors and propellers and no names pass; they show as changes.
//! Units: gains in per cent of the curve of all runs.
//! Reference: `effects/`, plausible ranges of gain and blade damage (0.4 of the thrust).

use super::measure::Measure;
use super::{Entry, HistoryError};
use crate::log::{Log, OtherRig};

/// Times between the largest and the smallest gain from which on two runs are of different rigs.
const APART: f64 = 3.0;

/// Refuses logs whose heads name different motors or propellers.
pub(super) fn named_alike(logs: &[Log]) -> Result<(), HistoryError> {
    let different = |OtherRig { first, second, why }| HistoryError::Rigs { first, second, why };
    crate::log::named_alike(logs.iter().map(Log::names)).map_err(different)
}

/// Refuses runs that differ by more than any effect can make them.
pub(super) fn behaves_alike(measures: &[Measure], runs: &[Entry]) -> Result<(), HistoryError> {
    for (k, measure) in measures.iter().enumerate().filter(|(_, m)| m.name.ends_with(" gain")) {
        let gains = runs.iter().enumerate().filter_map(|(run, r)| Some((run, 1.0 + r.values[k]?.value / 100.0)));
        let gains: Vec<(usize, f64)> = gains.filter(|(_, g)| *g > 0.0).collect();
        let (Some(least), Some(most)) =
            (gains.iter().min_by(|a, b| a.1.total_cmp(&b.1)), gains.iter().max_by(|a, b| a.1.total_cmp(&b.1)))
        else {
            continue;
        };
        let times = most.1 / least.1;
        if times > APART {
            let why = format!("the {} differs {times:.1} times, more than any effect can", measure.words);
            return Err(HistoryError::Rigs { first: runs[least.0].run.clone(), second: runs[most.0].run.clone(), why });
        }
    }
    Ok(())
}
