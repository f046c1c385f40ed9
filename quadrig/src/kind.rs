//! What a file is that a command does not take.
//!
//! What it is: the two files of the IMU board, known by the names of their columns, and what is no table at all: a model, another TOML file, a
//! verdict, a page; and which of the descriptions in TOML one is that another command takes. Each with what takes or makes it instead.
//! What can go wrong: nothing; any other file is left to its reader's own words.
//! Units: none.
//! Reference: specification `formats.md`, "Attitude log"; docs/scenario.md.

use crate::Failure;
use crate::run_log::SIMULATED;
use hal_sim::mission::Mission;
use hal_sim::scenario::AnyScenario;
use ident::log::digest;
use schedule::Plan;
use std::borrow::Cow;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// What is said of the board's own log, which holds the attitude and no readings.
pub(crate) const ATTITUDE_ALONE: &str = "an attitude without the readings behind it; expected gx,gy,gz,ax,ay,az: `quadrig sim SCENARIO -o LOG --readings READINGS` writes them";

/// Names of a table's columns: its first line that is no comment.
pub(crate) fn columns(path: &Path) -> Vec<String> {
    let Ok(file) = std::fs::File::open(path) else { return Vec::new() };
    let lines = BufReader::new(file).lines().map_while(Result::ok);
    let header = lines.into_iter().find(|l| !l.starts_with('#') && !l.trim().is_empty()).unwrap_or_default();
    header.split(',').map(|name| name.trim().to_owned()).collect()
}

/// Whether columns are those of a gyro.
pub(crate) fn has_readings(columns: &[String]) -> bool {
    ["gx", "gy", "gz"].iter().all(|n| columns.iter().any(|c| c == n))
}

/// Whether columns are an attitude and nothing that it was made from.
pub(crate) fn is_attitude_alone<S: AsRef<str>>(columns: &[S]) -> bool {
    let has = |name: &str| columns.iter().any(|c| c.as_ref() == name);
    ["qw", "qx", "qy", "qz"].into_iter().all(has) && !has("gx") && !has("gyro_x")
}

/// Refuses a file that is of another kind than a file of settings in TOML, in the words of its kind; what is TOML is left to its reader.
pub(crate) fn refuse_other(path: &Path, expected: &str) -> Result<(), Failure> {
    let what = head(path).as_deref().and_then(kind_of);
    what.map_or(Ok(()), |what| Err(format!("{}:1:1: {what}; expected {expected}", path.display()).into()))
}

/// Refuses a file that is of another kind than a model, in the words of its kind.
pub(crate) fn refuse_no_model(path: &Path) -> Result<(), Failure> {
    let expected = "expected a model written by `quadrig identify` or `close-loop`";
    let what = head(path).as_deref().and_then(kind_of).filter(|what| *what != MODEL);
    what.map_or(Ok(()), |what| Err(format!("{}:1:1: {what}; {expected}", path.display()).into()))
}

/// A scenario, as a command that takes one calls it.
pub(crate) const SCENARIO: &str = "a scenario, such as examples/thin-lead.toml: docs/scenario.md lists its keys";

/// Why a description in TOML is not the one that a command takes: what it is, where one other command takes it, and else its reader's own words.
pub(crate) fn instead(path: &Path, expected: &str, why: impl Into<Failure>) -> Failure {
    let file = path.display();
    let scenario = match AnyScenario::load(path) {
        Ok(AnyScenario::Rig(_)) => Some("a scenario"),
        Ok(AnyScenario::Imu(_)) => Some("a scenario of the IMU board"),
        Err(_) => None,
    };
    let kinds = [
        crate::rig::file::read(path)
            .is_ok()
            .then(|| "the configuration of a board (`quadrig rig configure` takes it)".to_owned()),
        Mission::load(path).is_ok().then(|| format!("a mission, which `quadrig fly {file}` flies")),
        scenario.map(|what| format!("{what}, which `quadrig sim {file} -o LOG` runs")),
        Plan::read(path).is_ok().then(|| format!("a schedule, which `quadrig rig run {file} -o LOG` plays")),
    ];
    // a few keys are those of several
    match &kinds.into_iter().flatten().collect::<Vec<_>>()[..] {
        [what] => format!("{file}:1:1: {what}; expected {expected}").into(),
        _ => why.into(),
    }
}

/// Whether what lies at `path` was computed, and is of the kind of what comes now (all of it, or how it begins): it can be computed again. A recording
/// cannot, and what somebody wrote by hand cannot, nor what somebody added.
pub(crate) fn is_computed(path: &Path, now: &str) -> bool {
    let Some(text) = head(path) else { return false };
    let kind = kind_of(&text);
    let begins_alike = || text.lines().next() == now.lines().next();
    kind == kind_of(now)
        && match kind {
            Some(MODEL | PAGE) => std::fs::read_to_string(path).is_ok_and(|whole| is_as_written(&whole)),
            Some(PINS) => true,
            Some(LOG | FLIGHT) => text.lines().any(|line| line == format!("# date = {SIMULATED:?}")),
            // values over time may be a recording, whoever computes some of the same columns
            Some(TABLE) => {
                let mut fields = text.lines().map(|line| line.matches(',').count());
                let first = fields.next();
                begins_alike() && !now.starts_with("t_s,") && !now.starts_with('#') && fields.all(|n| Some(n) == first)
            }
            _ => false,
        }
}

/// How a comment begins and ends in the files that tell whether somebody changed them.
fn comment(kind: &str) -> Option<[&'static str; 2]> {
    match kind {
        MODEL => Some(["# ", ""]),
        PAGE => Some(["<!-- ", " -->"]),
        _ => None,
    }
}

/// What the last line of such a file says.
const STAMP: &str = "as it was written: SHA-256 of all above ";

/// A model or a page with a last line that tells whether somebody changed it; any other text as it is.
pub(crate) fn stamped(text: &str) -> Cow<'_, str> {
    let comment = kind_of(text).and_then(comment);
    comment.map_or(Cow::Borrowed(text), |[begin, end]| format!("{text}{begin}{STAMP}{}{end}\n", digest(text.as_bytes())).into())
}

/// Whether such a file is as it was written: nobody changed a figure in it, nor added to it.
fn is_as_written(text: &str) -> bool {
    let Some([begin, _]) = kind_of(text).and_then(comment) else { return false };
    text.rfind(&format!("{begin}{STAMP}")).is_some_and(|at| stamped(&text[..at]) == text)
}

/// A file of settings that this program wrote from a run.
const MODEL: &str = "a model";
/// A page that speaks of this program.
const PAGE: &str = "a page";
const LOG: &str = "a log";
const FLIGHT: &str = "a flight's log";
const TABLE: &str = "a table of values, such as a log";
/// A record of a simulated board's pins, by its first words.
pub(crate) const PINS: &str = "quadrig pins";

/// The beginning of a file.
fn head(path: &Path) -> Option<String> {
    let mut bytes = Vec::new();
    std::fs::File::open(path).ok()?.take(LOOKED_AT).read_to_end(&mut bytes).ok()?;
    Some(String::from_utf8_lossy(&bytes).into_owned())
}

/// What a text is that is no file of settings.
fn kind_of(text: &str) -> Option<&'static str> {
    let text = text.trim_start_matches('\u{feff}').trim_start();
    if text.starts_with('<') {
        return Some(if is_ours(text) { PAGE } else { "a web page" });
    }
    if text.starts_with('{') && text.contains("\"quadrig-verdict") {
        return Some("a verdict");
    }
    // its head alone would be an empty file of settings
    if text.starts_with("# quadrig-flight") {
        return Some(FLIGHT);
    }
    if text.starts_with("# quadrig-log") {
        return Some(LOG);
    }
    // a long table is no TOML, and costs much to be told so
    let first = text.lines().find(|line| !line.starts_with('#') && !line.trim().is_empty());
    let may_be_settings = first.is_none_or(|line| line.trim_start().starts_with('[') || line.contains('='));
    if may_be_settings && let Ok(table) = toml::from_str::<toml::Table>(text) {
        let format = table.get("format").and_then(toml::Value::as_str).unwrap_or_default();
        return format.starts_with("quadrig-").then_some(MODEL);
    }
    if text.starts_with(PINS) {
        return Some(PINS);
    }
    if text.starts_with("# quadrig-") {
        return Some(LOG);
    }
    let first = first?;
    (first.matches([',', ';', '\t']).count() >= 2 && !first.contains('=')).then_some(TABLE)
}

/// What a file is that is no run, where it is one that this program knows.
pub(crate) fn another(path: &Path) -> Option<String> {
    of_the_imu(path).or_else(|| of_a_flight(path)).or_else(|| no_table(path))
}

/// Whether a page in HTML is one of this program's.
fn is_ours(page: &str) -> bool {
    page.contains("quadrig")
}

/// Bytes of the longest file that is looked at as a whole.
const LOOKED_AT: u64 = 1 << 20;

/// What a file is that holds no table.
fn no_table(path: &Path) -> Option<String> {
    let mut text = String::new();
    std::fs::File::open(path).ok()?.take(LOOKED_AT).read_to_string(&mut text).ok()?;
    let what = match text.trim_start().chars().next()? {
        '<' if is_ours(&text) => "a page; expected the log that it tells of, which its part \"Where this comes from\" names",
        '<' => "a web page, or another file in tags; expected a log or an export: was a link saved, and not the file behind it?",
        '{' if text.contains("\"quadrig-verdict") => "a verdict; expected the log that it is of: `run` in it names that",
        _ => {
            let table = toml::from_str::<toml::Table>(&text).ok().filter(|t| !t.is_empty())?;
            let format = table.get("format").and_then(toml::Value::as_str).unwrap_or_default();
            if format.starts_with("quadrig-model") {
                "a model; expected a log or an export: `--model` of close-loop, sim and fly takes a model, and so do predict and export"
            } else {
                "a TOML file; expected a log or an export: `quadrig sim SCENARIO.toml -o LOG` makes a log of a scenario"
            }
        }
    };
    Some(format!("{}:1:1: {what}", path.display()))
}

/// What a file is that is no rig's log, where it is one of the IMU board's.
fn of_the_imu(path: &Path) -> Option<String> {
    let columns = columns(path);
    let file = path.display();
    if is_attitude_alone(&columns) {
        Some(format!("{file}:1:1: {ATTITUDE_ALONE}"))
    } else if has_readings(&columns) {
        Some(format!("{file}:1:1: readings of an IMU; expected a rig's log: `quadrig close-loop` and `quadrig ahrs` take these"))
    } else {
        None
    }
}

/// What a file is that is no rig's log, where it is a flight's of another program.
fn of_a_flight(path: &Path) -> Option<String> {
    let file = path.display();
    let flight = ident::log::import::flight(path).ok()?.is_some();
    flight.then(|| format!("{file}:1:1: a flight; expected a rig's log: `quadrig import {file} -o LOG` makes a flight log, which close-loop takes"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_known_by_its_beginning() {
        for (text, kind) in [
            ("# quadrig-log 1\nt_s,rpm\n", Some("a log")),
            ("# quadrig-log 1\n", Some("a log")),
            ("# quadrig-flight 1\nt_s,rpm_1\n", Some("a flight's log")),
            ("\u{feff}<!doctype html>", Some("a web page")),
            ("<!doctype html><title>a run</title><p>by quadrig", Some("a page")),
            ("{\n \"format\": \"quadrig-verdict 2\"\n}", Some("a verdict")),
            ("format = \"quadrig-model 1\"\n", Some("a model")),
            ("Time (s),Thrust (N),Speed\n0,1,2\n", Some("a table of values, such as a log")),
            ("# quadrig-calibration 1\n[calibrated.current]\nper_count = 0.016\n", None),
            ("rate_hz = 10\n[esc]\n", None),
            ("rate_hz = [1, 2, 3\n", None),
        ] {
            assert_eq!(kind_of(text), kind, "{text}");
        }
    }
}
