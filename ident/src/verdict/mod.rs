//! The verdict file, `quadrig-verdict 2`.
//!
//! What it is: the contract as types.
//! What can go wrong: nothing here; every number in it is finite by construction of the diagnosis.
//! Units: each channel and parameter states its own.
//! Reference: specification `formats.md`, "Verdict".

pub mod words;

use crate::log::sparse::LeftOut;
use crate::signal::bad::SetAside;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;
use std::ops::Deref;

/// What an effect belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scope {
    /// The rig: it is there on every run.
    Rig,
    /// One run: another run has a value of its own.
    Run,
    /// One instant of one run: it does not recur.
    Event,
}

impl Scope {
    /// As files have it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Rig => "rig",
            Self::Run => "run",
            Self::Event => "event",
        }
    }
}

/// Form of an effect that no residual shows and the board's account of the pattern does: it changes no prediction.
pub(crate) const TOLD_BY_THE_BOARD: &str = "told by the board, which times whole revolutions";
/// Form of a limit that the meters of voltage and current show ([`crate::close::supply_limit`]): it changes no prediction.
pub(crate) const OF_THE_SUPPLY: &str = "of the supply, read off its meters";
/// Form of what a channel's readings show by themselves.
pub(crate) const BY_READINGS: &str = "read off the values themselves";

/// First key of the format.
pub const FORMAT: &str = "quadrig-verdict 2";

/// What was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// At least one effect is named; something may be left beside it.
    Attributed,
    /// Something is there, and none of it could be named.
    Unattributed,
    /// No channel is left with more than its noise.
    None,
    /// Two or more effects explain it equally well.
    Ambiguous,
}

/// Error figures of one channel under one model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Figures {
    /// Over all rows, with the written model.
    pub rms: f64,
    /// Over rows that the fit did not see.
    pub heldout_rms: f64,
    /// Each of several runs predicted whole by a fit to the others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub across_runs_rms: Option<f64>,
    /// Ljung-Box.
    pub whiteness_p: f64,
}

/// One channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Channel {
    /// Unit of all figures.
    pub unit: String,
    /// Noise floor from within-plateau differences.
    pub noise_floor_rms: f64,
    /// Declared baseline.
    pub before: Figures,
    /// Corrected model.
    pub after: Figures,
}

/// The channels of a log by name.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Channels {
    /// Those that are predicted.
    pub predicted: BTreeMap<String, Channel>,
    /// Those that nothing predicts, each with the reason: inputs only.
    pub not_predicted: BTreeMap<String, String>,
}

/// How a channel that nothing predicts stands in the file.
#[derive(Serialize)]
struct NotPredicted<'r> {
    not_predicted: &'r str,
}

impl Serialize for Channels {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.predicted.len() + self.not_predicted.len()))?;
        for (name, channel) in &self.predicted {
            map.serialize_entry(name, channel)?;
        }
        for (name, reason) in &self.not_predicted {
            map.serialize_entry(name, &NotPredicted { not_predicted: reason })?;
        }
        map.end()
    }
}

impl Deref for Channels {
    type Target = BTreeMap<String, Channel>;

    fn deref(&self) -> &Self::Target {
        &self.predicted
    }
}

impl<'c> IntoIterator for &'c Channels {
    type Item = (&'c String, &'c Channel);
    type IntoIter = std::collections::btree_map::Iter<'c, String, Channel>;

    fn into_iter(self) -> Self::IntoIter {
        self.predicted.iter()
    }
}

/// Something that is left on a channel, or on what one speed sensor reads beyond the others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unexplained {
    /// Channel, or contrast.
    pub channel: String,
    /// Error that is left, in noise floors.
    pub over_floor: f64,
    /// Variables that it goes with, the closest first.
    pub depends_on: Vec<String>,
    /// What it looks like, for people.
    pub looks_like: String,
}

/// One parameter with its interval.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parameter {
    /// Name.
    pub name: String,
    /// Estimate.
    pub value: f64,
    /// Unit.
    pub unit: String,
    /// 95 % interval.
    pub ci95: [f64; 2],
}

/// Whose an effect is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kin {
    /// This rig's own.
    #[default]
    Own,
    /// Every rig's: a rotor has inertia and takes time.
    #[serde(rename = "every_rig")]
    OfEvery,
    /// Every logger's: where in its row a reading lies.
    WithinRow,
}

/// One effect of the best hypothesis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectEntry {
    /// Identifier.
    pub id: String,
    /// What it belongs to.
    pub scope: Scope,
    /// Whether every rig has the like: it is told apart from what this one has.
    pub kin: Kin,
    /// With several runs: the one that it is of, where it is of one alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run: Option<String>,
    /// Channels that it touches, the quoted one first.
    pub channels: Vec<String>,
    /// Variables that it depends on.
    pub depends_on: Vec<String>,
    /// Equation.
    pub equation: String,
    /// Probability of this effect being there: that of all hypotheses together that hold it.
    pub probability: f64,
    /// Parameters.
    pub parameters: Vec<Parameter>,
    /// 1 - (held-out error with all effects) / (without this one), on the first channel.
    pub heldout_error_reduction: f64,
    /// Why, in plain words.
    pub evidence: String,
}

/// Another hypothesis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Alternative {
    /// Its effects.
    pub ids: Vec<String>,
    /// Its probability.
    pub probability: f64,
    /// Where it differs from the best hypothesis in one place: which that is, and what it puts there. For people; the file has [`Self::ids`].
    #[serde(skip)]
    pub change: Option<Change>,
}

/// What another hypothesis puts in the place of one effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Position of that effect among those of the verdict.
    pub place: usize,
    /// Identifier of what stands there instead.
    pub id: String,
    /// The channels that it acts on.
    pub channels: Vec<String>,
    /// Its probability in that place where all else is as the verdict has it: to be held against that of the effect, 0 to 1.
    pub probability: f64,
}

/// One step of a schedule that the rig can run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ScheduleStep {
    /// Pulse, us.
    pub pulse_us: f64,
    /// How long, s.
    pub hold_s: f64,
}

/// The run that would tell the hypotheses apart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NextExperiment {
    /// Reason.
    pub why: String,
    /// Whether it would; where not, the reason says that no run at hand separates them, and the schedule is that on which they differ most all the
    /// same, which nothing proposes.
    pub separates: bool,
    /// Schedule.
    pub schedule: Vec<ScheduleStep>,
}

impl EffectEntry {
    /// Whether it says only that something is there: nothing that was tried predicts it, so that nothing was added.
    #[must_use]
    pub fn is_without_correction(&self) -> bool {
        self.id == "unknown" && self.depends_on.is_empty() && self.parameters.is_empty()
    }
}

impl NextExperiment {
    /// The steps that the schedule repeats, and how often.
    #[must_use]
    pub fn cycle(&self) -> (&[ScheduleStep], usize) {
        let all = &self.schedule;
        let repeats = |n: &usize| all.len().is_multiple_of(*n) && all.iter().enumerate().all(|(k, step)| *step == all[k % n]);
        match (1..=all.len()).find(repeats) {
            Some(n) => (&all[..n], all.len() / n),
            None => (all, 1),
        }
    }
}

impl Verdict {
    /// The run that is proposed: a next experiment that would settle something.
    #[must_use]
    pub fn proposed(&self) -> Option<&NextExperiment> {
        self.next_experiment.as_ref().filter(|n| n.separates)
    }
}

/// Before and after on another run of the rig.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Validation {
    /// Log.
    pub run: String,
    /// Root mean square errors by channel.
    pub channels: BTreeMap<String, BeforeAfter>,
}

/// A pair of errors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BeforeAfter {
    /// Declared baseline.
    pub before: f64,
    /// Corrected model.
    pub after: f64,
}

/// The verdict.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// [`FORMAT`].
    pub format: &'static str,
    /// Log.
    pub run: String,
    /// What was found.
    pub verdict: Kind,
    /// Channels by name.
    pub channels: Channels,
    /// The best hypothesis, what has no name last.
    pub effects: Vec<EffectEntry>,
    /// What is left beside it.
    pub unexplained: Vec<Unexplained>,
    /// The others.
    pub alternatives: Vec<Alternative>,
    /// Where two explain it equally well.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub next_experiment: Option<NextExperiment>,
    /// Channels about which nothing is said: too few samples.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOut>,
    /// Samples that nothing else in the log bears out, in stretches: they took no part.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub set_aside: Vec<SetAside>,
    /// Rows of a table with one row for each level: none has two to compare, so that the noise floors are guesses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub guessed_floors: Option<usize>,
    /// Share of what a lone speed sensor reads off the course of a level that is its own error; it was taken off.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor_share: Option<f64>,
    /// The motor never turned: nothing is seen of what a load brings about.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub at_rest: bool,
    /// The command stayed where it was: nothing is seen of how the powerplant follows it.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub held: bool,
    /// Other runs.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub validation: Vec<Validation>,
    /// Each of several runs of the rig, predicted whole by a fit to the others.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub runs: Vec<Validation>,
}

#[cfg(test)]
mod tests {
    use super::{NextExperiment, ScheduleStep};

    #[test]
    fn a_schedule_that_repeats_itself_is_one_cycle() {
        let of = |pulses: &[f64]| NextExperiment {
            why: String::new(),
            separates: true,
            schedule: pulses.iter().map(|p| ScheduleStep { pulse_us: *p, hold_s: 4.0 }).collect(),
        };
        let told = |pulses: &[f64]| of(pulses).cycle().1;
        assert_eq!(told(&[1200.0, 1900.0, 1200.0, 1900.0]), 2);
        assert_eq!(told(&[1200.0, 1900.0, 1200.0]), 1);
        assert_eq!(told(&[1500.0; 3]), 3);
        assert_eq!(of(&[]).cycle(), (&[] as &[ScheduleStep], 1));
    }
}
