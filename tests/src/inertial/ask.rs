//! Asks the command line for its verdict on a log's text.
//!
//! What it is: writes the text, runs `quadrig close-loop --json`, reads what a table needs.
//! What can go wrong: a refusal or an answer that is no verdict is a panic with what was said: these are tests.
//! Units: as the verdict's.
//! Reference: specification `formats.md`, "Verdict".

use crate::quadrig;
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// A verdict.
#[derive(Debug, Clone)]
pub struct Answer {
    /// The whole of it.
    pub json: Value,
    /// `attributed`, `unattributed`, `ambiguous` or `none`.
    pub verdict: String,
    /// Its effects, the first one counting.
    pub ids: Vec<String>,
}

/// The verdict on a log, which is left as `NAME.csv` in the folder; `output` receives the files of the loop.
///
/// # Panics
/// When the command refuses or answers with something else.
#[must_use]
pub fn ask(folder: &Path, name: &str, csv: &str, output: Option<&str>) -> Answer {
    let file = format!("{name}.csv");
    std::fs::write(folder.join(&file), csv).expect("the folder can be written");
    let mut words = vec!["close-loop", &file, "--json"];
    if let Some(out) = output {
        words.extend(["-o", out]);
    }
    let done = Command::new(quadrig()).args(&words).current_dir(folder).output().expect("it starts");
    assert!(done.status.success(), "{name}: {}", String::from_utf8_lossy(&done.stderr));
    let json: Value = serde_json::from_slice(&done.stdout).expect("a verdict");
    let word = |v: &Value| v.as_str().unwrap_or_default().to_owned();
    let ids = json["effects"].as_array().map(|e| e.iter().map(|e| word(&e["id"])).collect()).unwrap_or_default();
    Answer { verdict: word(&json["verdict"]), ids, json }
}

impl Answer {
    /// A parameter of an effect and its interval.
    #[must_use]
    pub fn parameter(&self, id: &str, name: &str) -> Option<(f64, [f64; 2])> {
        let effect = self.json["effects"].as_array()?.iter().find(|e| e["id"] == id)?;
        let p = effect["parameters"].as_array()?.iter().find(|p| p["name"] == name)?;
        Some((p["value"].as_f64()?, [p["ci95"][0].as_f64()?, p["ci95"][1].as_f64()?]))
    }

    /// Root mean square over three channels of a held-out error: `before` or `after`.
    #[must_use]
    pub fn heldout(&self, channels: [&str; 3], when: &str) -> Option<f64> {
        let one = |c: &str| self.json["channels"][c][when]["heldout_rms"].as_f64();
        let [x, y, z] = channels.map(one);
        Some(((x?.powi(2) + y?.powi(2) + z?.powi(2)) / 3.0).sqrt())
    }
}
