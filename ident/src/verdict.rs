//! The verdict file, `quadrig-verdict 1`.
//!
//! What it is: the contract as types.
//! What can go wrong: nothing here; every number in it is finite by construction of the diagnosis.
//! Units: each channel and parameter states its own.
//! Reference: specification `formats.md`, "Verdict".

use crate::sparse::LeftOut;
use serde::Serialize;
use std::collections::BTreeMap;

/// First key of the format.
pub const FORMAT: &str = "quadrig-verdict 1";

/// What was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// A known effect explains it.
    Attributed,
    /// Something is there that no known effect explains.
    Unattributed,
    /// Nothing significant above the noise floor.
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

/// One effect of the best hypothesis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectEntry {
    /// Identifier.
    pub id: String,
    /// Channels that it touches, the quoted one first.
    pub channels: Vec<String>,
    /// Variables that it depends on.
    pub depends_on: Vec<String>,
    /// Equation.
    pub equation: String,
    /// Probability of the whole hypothesis.
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
    /// Schedule.
    pub schedule: Vec<ScheduleStep>,
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
    pub channels: BTreeMap<String, Channel>,
    /// The best hypothesis.
    pub effects: Vec<EffectEntry>,
    /// The others.
    pub alternatives: Vec<Alternative>,
    /// Where two explain it equally well.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub next_experiment: Option<NextExperiment>,
    /// Channels about which nothing is said: too few samples.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOut>,
    /// Other runs.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub validation: Vec<Validation>,
}
