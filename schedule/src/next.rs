//! The next experiment of a verdict, as it is.
//!
//! What it is: `next_experiment.schedule` of a `quadrig-verdict 2` file: pulses and holds.
//! What can go wrong: a verdict that proposes none, or says that none would settle it, or one for the IMU board, is refused and says so.
//! Units: us, s.
//! Reference: specification `formats.md`, "Verdict".

use crate::error::ScheduleError;
use crate::part;
use crate::plan::Plan;
use crate::table;
use serde::de::Error;
use serde::{Deserialize, Deserializer};
use std::path::Path;

#[derive(Deserialize)]
struct Verdict {
    next_experiment: Option<Experiment>,
}

#[derive(Deserialize)]
struct Experiment {
    why: String,
    #[serde(default = "proposed")]
    separates: bool,
    schedule: Vec<Step>,
}

/// A verdict that does not say otherwise proposes its schedule.
fn proposed() -> bool {
    true
}

#[derive(Deserialize)]
struct Step {
    #[serde(deserialize_with = "pulse")]
    pulse_us: f64,
    #[serde(deserialize_with = "hold")]
    hold_s: f64,
}

fn within<'de, D: Deserializer<'de>>(d: D, low: f64, high: f64, what: &str) -> Result<f64, D::Error> {
    let value = f64::deserialize(d)?;
    if (low..=high).contains(&value) { Ok(value) } else { Err(D::Error::custom(format!("expected {what}, found {value}"))) }
}

fn pulse<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    within(d, 1000.0, 2000.0, "a pulse from 1000 to 2000 us")
}

fn hold<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    within(d, 0.001, 86_400.0, "a hold from 0.001 to 86400 s")
}

/// Reads a verdict.
pub(crate) fn parse(text: &str, path: &Path) -> Result<Plan, ScheduleError> {
    let refused =
        |line: usize, column: usize, reason: String| ScheduleError::Refused { file: path.to_owned(), line, column, reason };
    let verdict: Verdict = serde_json::from_str(text).map_err(|error| {
        let said = error.to_string();
        let reason = said.rsplit_once(" at line ").map_or(said.as_str(), |(reason, _)| reason).to_owned();
        refused(error.line().max(1), error.column().max(1), format!("no verdict that proposes pulses: {reason}"))
    })?;
    let Some(experiment) = verdict.next_experiment.filter(|e| !e.schedule.is_empty()) else {
        return Err(refused(
            1,
            1,
            "this verdict proposes no next experiment; expected one that leaves open what a run would settle".to_owned(),
        ));
    };
    if !experiment.separates {
        return Err(refused(
            1,
            1,
            format!(
                "this verdict proposes no next experiment: {}; expected one that leaves open what a run would settle",
                experiment.why
            ),
        ));
    }
    let levels: Vec<(part::Level, bool)> =
        experiment.schedule.iter().map(|s| ((table::pulse(s.pulse_us), table::ms(s.hold_s)), false)).collect();
    let mut steps = part::steps(&levels);
    steps.title = experiment.why;
    Ok(Plan::new("next experiment", vec![steps]))
}
