//! What changed, and when.
//!
//! What it is: all measures together ask whether the runs have one value each, or two, split at a gap, or a drift. Every gap and every measure
//! that could have changed takes its share of the prior, so that many questions do not make one of them come true by chance.
//! What can go wrong: measures of one run are not independent (a dense day lifts thrust and torque alike). Whether something changed therefore
//! stands on measures one at a time; where it changed, on all that moved. Runs are split one gap at a time: two like steps the same way among few
//! runs are neither one step nor a line, and hide each other.
//! Units: evidence in nats.
//! Reference: Barry & Hartigan 1993, JASA 88:309; binary segmentation, Scott & Knott 1974, Biometrics 30:507.

use super::counts::{self, log_mean};
use super::evidence::{Departure, Series};
use super::measure::{Scale, Value};
use super::{FEWEST, History};
use crate::history::name::Name;
use crate::log::SPEED;
use serde::Serialize;
use std::collections::BTreeMap;

/// Probability from which on a change is told; before the runs are seen a change and none are as likely.
const TOLD: f64 = 0.98;
/// Prior share of the measures that a change moves.
const MOVED: f64 = 0.1;
/// Most nats that one measure brings to the place of a gap: what is beyond may be a course of its own.
const LOUDEST: f64 = 40.0;
/// Evidence from which on a measure is told to have moved, nats.
const SHOWN: f64 = 5.0;
/// Probability that the gaps of an interval hold together.
const HELD: f64 = 0.95;
/// Scatter that the logarithm of a size has from day to day at the least.
const LEAST_LOG: f64 = 0.02;

/// How it changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// From one run to the next.
    Step,
    /// A little from run to run.
    Drift,
}

/// A measure that moved.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moved {
    /// Place of the measure.
    #[serde(skip)]
    pub measure: usize,
    /// Its name.
    pub name: String,
    /// In words.
    pub words: String,
    /// Unit of what follows; `x` where the quotient is told.
    pub unit: String,
    /// By how much: the difference, of a size the quotient; of a drift for each week, or for each run where runs have no dates.
    pub by: f64,
    /// Its 95 % interval.
    pub ci95: [f64; 2],
    /// Evidence for it alone, nats.
    pub evidence: f64,
}

/// One change.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Change {
    /// How.
    pub kind: Kind,
    /// First run after the gap; of a drift the first run that it is seen over.
    pub first: usize,
    /// Range of runs that it was found in, `[from, to)`.
    pub among: [usize; 2],
    /// First runs after the earliest and the latest gap that hold it with 95 %.
    pub between: [usize; 2],
    /// Probability that something changed.
    pub probability: f64,
    /// Probability of the gap, given that.
    pub gap_probability: f64,
    /// Measures that moved, the surest first.
    pub moved: Vec<Moved>,
    /// Each channel's evidence that one of its measures moved, nats; the sensors of one speed are one.
    #[serde(skip)]
    pub channels: Vec<(String, f64)>,
    /// Names, the likeliest first; empty where it was not asked for or nothing fits.
    pub names: Vec<Name>,
}

/// All changes of a history, oldest first.
pub(super) fn changes(history: &History) -> Vec<Change> {
    let mut out = Vec::new();
    split(history, [0, history.runs.len()], [false; 2], &mut out);
    out.sort_by_key(|c: &Change| c.first);
    out
}

/// Splits some runs; `cut` says at which of their ends a change was found already.
fn split(history: &History, among: [usize; 2], cut: [bool; 2], out: &mut Vec<Change>) {
    let Some(change) = sought(history, among, cut) else { return };
    let (kind, first) = (change.kind, change.first);
    out.push(change);
    // what drifts has no level that a further split could stand on
    if kind == Kind::Step {
        split(history, [among[0], first], [cut[0], true], out);
        split(history, [first, among[1]], [true, cut[1]], out);
    }
}

/// A measure's series among some runs.
struct Asked {
    measure: usize,
    series: Series,
    /// Of what was counted, the evidence for a step at each gap.
    counted: Option<Vec<f64>>,
}

impl Asked {
    /// Steps at every gap, then other forms.
    fn departures(&self, forms: &[Vec<f64>]) -> Vec<Departure> {
        let mut out = self.series.departures(forms);
        for (departure, evidence) in out.iter_mut().zip(self.counted.iter().flatten()) {
            departure.evidence = *evidence;
        }
        out
    }
}

/// The days that explain others: each column over the runs, where every run tells it.
fn days(history: &History, [from, to]: [usize; 2]) -> Vec<Vec<f64>> {
    let of = |m: usize| history.runs[from..to].iter().map(|r| r.values[m].map(|v| v.value)).collect::<Option<Vec<f64>>>();
    let all: Vec<Vec<f64>> = (0..history.measures.len()).filter(|m| history.measures[*m].of_day).filter_map(of).collect();
    all
}

fn asked(history: &History, [from, to]: [usize; 2]) -> Vec<Asked> {
    let beside = days(history, [from, to]);
    let of = |m: usize| {
        let measure = &history.measures[m];
        let compared = |v: &Option<Value>| v.map(|v| v.compared(measure.scale));
        let values: Vec<Option<Value>> = history.runs[from..to].iter().map(|r| compared(&r.values[m])).collect();
        // each takes a run's worth of knowledge: few runs do not pay for them
        let most = values.iter().flatten().count().saturating_sub(FEWEST + 2) / 2;
        let beside = &beside[..most.min(beside.len())];
        let least = if measure.scale == Scale::Log { LEAST_LOG } else { 0.0 };
        let own: Vec<Option<Value>> = history.runs[from..to].iter().map(|r| r.values[m]).collect();
        let counted = if measure.scale == Scale::Count { counts::steps(&own) } else { None };
        Some(Asked { measure: m, series: Series::of(&values, beside, least)?, counted })
    };
    (0..history.measures.len()).filter(|m| history.measures[*m].asked).filter_map(of).collect()
}

/// The likeliest change among some runs, if one is likely enough.
fn sought(history: &History, [from, to]: [usize; 2], cut: [bool; 2]) -> Option<Change> {
    let n = to - from;
    if n < FEWEST {
        return None;
    }
    let asked = asked(history, [from, to]);
    if asked.is_empty() {
        return None;
    }
    let steps: Vec<Vec<f64>> = (1..n).map(|gap| (0..n).map(|k| f64::from(u8::from(k >= gap))).collect()).collect();
    let forms: Vec<Vec<f64>> = steps.into_iter().chain([times(history, [from, to])]).collect();
    let all: Vec<Vec<Departure>> = asked.iter().map(|a| a.departures(&forms)).collect();
    let gaps = n - 1;
    // one run between two changes is an odd day
    let alone = |gap: usize| gap == 0 && cut[0] || gap + 1 == gaps && cut[1];
    // a change moves a share of the measures, and no less than one: any one of them is as likely as that to be among them
    let moved_share = (MOVED * asked.len() as f64).max(1.0).ln();
    let mean = |form: usize| log_mean(all.iter().map(|d| d[form].evidence)) + moved_share;
    let step = log_mean((0..gaps).map(|gap| if alone(gap) { f64::NEG_INFINITY } else { mean(gap) }));
    let drift = if n > FEWEST { mean(gaps) } else { f64::NEG_INFINITY };
    // either is as likely before
    let whole = log_mean([step, drift].into_iter());
    let probability = 1.0 / (1.0 + (-whole).exp());
    if probability < TOLD {
        return None;
    }
    let moved_at = |form: usize| moved(history, &asked, &all, form, form == gaps);
    let channels_at = |form: usize| channels(history, &asked, &all, form);
    if drift > step {
        let moved = moved_at(gaps);
        let between = [from, to];
        return Some(Change {
            kind: Kind::Drift,
            first: from,
            among: [from, to],
            between,
            probability,
            gap_probability: 1.0,
            moved,
            channels: channels_at(gaps),
            names: Vec::new(),
        });
    }
    let weight = |gap: usize| {
        if alone(gap) {
            return f64::NEG_INFINITY;
        }
        let of = |d: &Vec<Departure>| (1.0 - MOVED + MOVED * d[gap].evidence.min(LOUDEST).exp()).ln();
        all.iter().map(of).sum::<f64>()
    };
    let weights: Vec<f64> = (0..gaps).map(weight).collect();
    let top = weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let shares: Vec<f64> = weights.iter().map(|w| (w - top).exp()).collect();
    let sum: f64 = shares.iter().sum();
    let best = (0..gaps).max_by(|a, b| shares[*a].total_cmp(&shares[*b]).then(b.cmp(a)))?;
    let between = held(&shares, sum, best).map(|gap| from + gap + 1);
    Some(Change {
        kind: Kind::Step,
        first: from + best + 1,
        among: [from, to],
        between,
        probability,
        gap_probability: shares[best] / sum,
        moved: moved_at(best),
        channels: channels_at(best),
        names: Vec::new(),
    })
}

/// Time of the runs, less its mean: weeks where all are dated, else their numbers.
fn times(history: &History, [from, to]: [usize; 2]) -> Vec<f64> {
    let of = |k: usize| if history.dated { history.runs[k].day.unwrap_or(0.0) / 7.0 } else { k as f64 };
    let all: Vec<f64> = (from..to).map(of).collect();
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    all.into_iter().map(|t| t - mean).collect()
}

/// Gaps around the best that hold [`HELD`] of the probability.
fn held(shares: &[f64], sum: f64, best: usize) -> [usize; 2] {
    let (mut from, mut to, mut inside) = (best, best, shares[best]);
    while inside < HELD * sum && (from > 0 || to + 1 < shares.len()) {
        let before = if from > 0 { shares[from - 1] } else { -1.0 };
        let after = shares.get(to + 1).copied().unwrap_or(-1.0);
        if before >= after {
            from -= 1;
            inside += before;
        } else {
            to += 1;
            inside += after;
        }
    }
    [from, to]
}

fn moved(history: &History, asked: &[Asked], all: &[Vec<Departure>], form: usize, drifts: bool) -> Vec<Moved> {
    let mut out: Vec<Moved> = asked
        .iter()
        .zip(all)
        .filter(|(_, d)| d[form].evidence > SHOWN)
        .map(|(a, d)| {
            let (m, d) = (&history.measures[a.measure], d[form]);
            let ends = [d.size, d.size - 1.96 * d.se, d.size + 1.96 * d.se];
            let [by, low, high] = match m.scale {
                Scale::Linear => ends,
                Scale::Log => ends.map(f64::exp),
                // of squares the difference is the sum of the roots times that of the roots
                Scale::Count => ends.map(|v| 2.0 * a.series.level * v),
            };
            let per = match (drifts, history.dated) {
                (false, _) => "",
                (true, true) => " a week",
                (true, false) => " a run",
            };
            let unit = if m.scale == Scale::Log { "x".to_owned() } else { m.unit.clone() };
            let unit = format!("{unit}{per}");
            Moved {
                measure: a.measure,
                name: m.name.clone(),
                words: m.words.clone(),
                unit,
                by,
                ci95: [low, high],
                evidence: d.evidence,
            }
        })
        .collect();
    out.sort_by(|a, b| b.evidence.total_cmp(&a.evidence).then(a.measure.cmp(&b.measure)));
    out
}

/// What each channel says of a form: any one of its measures is as likely to have moved.
fn channels(history: &History, asked: &[Asked], all: &[Vec<Departure>], form: usize) -> Vec<(String, f64)> {
    let mut own: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for (a, d) in asked.iter().zip(all).filter(|(a, _)| !history.measures[a.measure].of_two) {
        own.entry(one_speed(&history.measures[a.measure].channel)).or_default().push(d[form].evidence);
    }
    own.into_iter().map(|(channel, evidence)| (channel.to_owned(), log_mean(evidence.into_iter()))).collect()
}

/// A channel's name; one for all sensors of the speed.
pub(super) fn one_speed(channel: &str) -> &str {
    if SPEED.contains(&channel) { "rpm" } else { channel }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::tests::departing;

    fn history(dated: bool, departs: impl Fn(usize) -> f64) -> History {
        departing(12, dated, departs)
    }

    #[test]
    fn a_step_is_found_in_its_gap_and_days_are_none() {
        assert_eq!(changes(&history(false, |_| 0.0)), []);
        let found = changes(&history(false, |k| if k >= 7 { 9.0 } else { 0.0 }));
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!((found[0].kind, found[0].first, found[0].between), (Kind::Step, 7, [7, 7]));
        assert_eq!(found[0].moved.len(), 1);
        let moved = &found[0].moved[0];
        assert!(moved.name == "thrust_n 0" && moved.ci95[0] < 9.0 && 9.0 < moved.ci95[1], "{moved:?}");
    }

    #[test]
    fn a_drift_is_told_by_the_week() {
        let found = changes(&history(true, |k| 2.0 * k as f64));
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!((found[0].kind, found[0].moved[0].unit.as_str()), (Kind::Drift, "N a week"));
        assert!((found[0].moved[0].by - 2.0).abs() < 0.3, "{:?}", found[0].moved[0]);
    }

    #[test]
    fn one_odd_run_between_two_changes_is_none() {
        let departs = |k: usize| match k {
            0..6 => 0.0,
            6 => 80.0,
            _ => 60.0,
        };
        let found = changes(&history(false, departs));
        assert_eq!(found.iter().map(|c| c.first).collect::<Vec<_>>(), [6], "{found:?}");
    }

    #[test]
    fn a_channel_speaks_for_a_change_by_any_one_of_its_measures() {
        let mut history = departing(12, false, |k| if k >= 7 { 9.0 } else { 0.0 });
        history.measures[1].channel = "torque_nm".into();
        history.measures[2].channel = "current_a".into();
        history.measures[2].of_two = true;
        let found = changes(&history);
        let of = |channel: &str| found[0].channels.iter().find(|c| c.0 == channel).expect(channel).1;
        assert!(of("thrust_n") > 5.0 && of("torque_nm") < 0.0, "{:?}", found[0].channels);
        // how two channels differ speaks for neither
        assert!(found[0].channels.iter().all(|c| c.0 != "current_a"));
        assert_eq!((one_speed("rpm_hall"), one_speed("thrust_n")), ("rpm", "thrust_n"));
    }

    #[test]
    fn two_steps_are_two_changes() {
        let found = changes(&history(false, |k| if k >= 8 { 60.0 } else { 12.0 * f64::from(u8::from(k >= 4)) }));
        assert_eq!(found.iter().map(|c| c.first).collect::<Vec<_>>(), [4, 8], "{found:?}");
    }
}
