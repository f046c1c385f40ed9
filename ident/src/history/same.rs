//! Whether runs are of one rig.
//!
//! What it is: motor and propeller as the logs' heads name them; and the gains of thrust, torque and speed, which no effect of the library
//! changes several times over.
//! What can go wrong: two rigs with alike motors and propellers and no names pass; they show as changes.
//! Units: gains in per cent of the curve of all runs.
//! Reference: `effects/`, plausible ranges of gain and blade damage (0.4 of the thrust).

use super::measure::Measure;
use super::{Entry, History, HistoryError};
use crate::log::{Log, OtherRig};
use crate::verdict::words::with_interval;

/// Times between the largest and the smallest gain from which on two runs are of different rigs.
const APART: f64 = 3.0;

/// Times by which the days change the k_T of a propeller at the most. It goes with the density of the air: from 0.9 kg/m^3 (warm, 2500 m up) to
/// 1.35 (freezing, at the sea). It does not go with the voltage.
const AIR: f64 = 1.5;

/// That two runs are hardly of the same propeller, and what to do. Intervals count for the runs: what they leave open is no doubt.
#[must_use]
pub fn in_doubt(history: &History) -> Option<String> {
    let k = history.measures.iter().position(|m| m.name == "k_T")?;
    let of = |e: &Entry| e.values[k].filter(|v| v.value > 0.0).map(|v| (e.run.clone(), v));
    let all: Vec<_> = history.runs.iter().filter_map(of).collect();
    let least = all.iter().min_by(|a, b| a.1.value.total_cmp(&b.1.value))?;
    let most = all.iter().max_by(|a, b| a.1.value.total_cmp(&b.1.value))?;
    if most.1.value - most.1.half() <= AIR * (least.1.value + least.1.half()) {
        return None;
    }
    let told = |v: super::Value| with_interval(v.value, [v.value - v.half(), v.value + v.half()])[0].clone();
    let (times, unit) = (most.1.value / least.1.value, &history.measures[k].unit);
    Some(format!(
        "hardly the same propeller: k_T is {} {unit} in {} and {} in {}, {times:.1} times as much. Air and voltage change it {AIR} times at the most. Check propeller and scale of thrust, and give each rig's runs alone",
        told(least.1),
        least.0,
        told(most.1),
        most.0,
    ))
}

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::Value;
    use crate::history::tests::departing;

    /// Runs of one rig whose k_T are these, each known to so much.
    fn runs(constants: [f64; 3], se: f64) -> History {
        let mut history = departing(3, false, |_| 0.0);
        (history.measures[0].name, history.measures[0].unit) = ("k_T".into(), "N.s2".into());
        for (run, value) in history.runs.iter_mut().zip(constants) {
            run.values[0] = Some(Value { value, se });
        }
        history
    }

    #[test]
    fn a_propeller_of_another_size_is_told_and_another_day_is_not() {
        let said = in_doubt(&runs([1.5e-5, 5.7e-5, 1.6e-5], 1e-8)).expect("a doubt");
        for told in
            ["1.5000e-5 N.s2 in 0.csv", "5.7000e-5 in 1.csv", "3.8 times as much", "1.5 times at the most", "Check propeller"]
        {
            assert!(said.contains(told), "{told}: {said}");
        }
        assert!(in_doubt(&runs([1.5e-5, 2.3e-5, 1.6e-5], 1e-8)).is_some());
        assert_eq!(in_doubt(&runs([1.5e-5, 2.2e-5, 1.6e-5], 1e-8)), None);
        // what its interval leaves open is no doubt
        assert_eq!(in_doubt(&runs([1.5e-5, 2.8e-5, 1.6e-5], 4e-6)), None);
    }
}
