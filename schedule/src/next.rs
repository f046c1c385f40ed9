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
use serde_json::error::Category;
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

/// Why a text is no verdict, and what to try.
fn why(text: &str, error: &serde_json::Error) -> String {
    const WANTED: &str = "expected verdict.json of `quadrig close-loop LOG -o FOLDER`";
    if !text.trim_start_matches('\u{feff}').trim_start().starts_with('{') {
        return format!("no verdict, which is JSON and begins with a brace; {WANTED}");
    }
    let said = error.to_string();
    let said = said.rsplit_once(" at line ").map_or(said.as_str(), |(reason, _)| reason);
    match error.classify() {
        Category::Eof => format!("the file ends in the midst of its JSON; {WANTED}, whole: was it cut short?"),
        Category::Data if said.starts_with("expected ") => format!("no verdict that proposes pulses: {said}"),
        Category::Data => format!("no verdict that proposes pulses: {}", plain(said)),
        Category::Syntax | Category::Io => format!("no JSON from here on; {WANTED}, as it was written: was it changed by hand?"),
    }
}

/// What the parser says, without its names of types.
fn plain(said: &str) -> String {
    let kinds =
        [("f64", "a number"), ("a sequence", "a list in brackets"), ("a boolean", "true or false"), ("a string", "a text")];
    let Some((before, kind)) = said.rsplit_once("expected ") else {
        return format!("{said}; expected verdict.json as `quadrig close-loop` writes it");
    };
    let kind = kinds.iter().find(|(own, _)| *own == kind).map_or("a table in braces", |(_, plain)| plain);
    let found = before.trim_end_matches([',', ' ']).replace("invalid type: ", "");
    format!("{found}; expected {kind}")
}

/// Reads a verdict.
pub(crate) fn parse(text: &str, path: &Path) -> Result<Plan, ScheduleError> {
    let refused =
        |line: usize, column: usize, reason: String| ScheduleError::Refused { file: path.to_owned(), line, column, reason };
    let verdict: Verdict =
        serde_json::from_str(text).map_err(|error| refused(error.line().max(1), error.column().max(1), why(text, &error)))?;
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
