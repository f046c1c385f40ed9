//! What came of one run, as it is kept.
//!
//! What it is: the verdict in brief, the error of each channel before and after, the constants; a JSON file a run, with a key of what went in.
//! What can go wrong: a run that is refused and a fault of the program on it are results too, each with its line.
//! Units: as the verdict and the constants state.
//! Reference: specification `formats.md`, "Verdict".

use crate::Failure;
use crate::close_loop::results;
use crate::folder::Folder;
use ident::close::{Closed, close};
use ident::identify::identify;
use ident::log::Log;
use ident::report::Origin;
use serde::{Deserialize, Serialize};
use std::io::Read;
use std::path::Path;

/// Error of a channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Channel {
    /// Its name.
    pub(super) name: String,
    /// Noise floor, held-out error before and after.
    pub(super) figures: [f64; 3],
}

/// A constant with its standard error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Constant {
    /// Its name.
    pub(super) name: String,
    /// Value.
    pub(super) value: f64,
    /// Standard error.
    pub(super) se: f64,
}

/// A parameter of an effect; an effect without one stands once, without.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Parameter {
    /// Effect.
    pub(super) effect: String,
    /// Rig, run or event.
    pub(super) scope: String,
    /// Channels, parted by semicolons.
    pub(super) channels: String,
    /// Probability of its being there.
    pub(super) probability: f64,
    /// Share of the held-out error that it takes away.
    pub(super) reduction: f64,
    /// Name, value, unit and 95 % interval.
    pub(super) parameter: Option<(String, f64, String, [f64; 2])>,
}

/// What came of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Done {
    /// What went in: file, options, program.
    pub(super) key: String,
    /// Path from the folder.
    pub(super) file: String,
    /// `closed`, `refused` or `failed`.
    pub(super) state: String,
    /// Why it was not closed.
    pub(super) message: String,
    /// Digest of the log.
    pub(super) sha256: String,
    /// Rows.
    pub(super) rows: usize,
    /// Length, s.
    pub(super) seconds: Option<f64>,
    /// Motor and propeller, where the log names them.
    pub(super) named: [String; 2],
    /// The verdict's word.
    pub(super) verdict: String,
    /// Channels on which something is left.
    pub(super) unexplained: Vec<String>,
    /// Errors.
    pub(super) channels: Vec<Channel>,
    /// Constants.
    pub(super) constants: Vec<Constant>,
    /// Effects, parameter by parameter.
    pub(super) effects: Vec<Parameter>,
}

/// Key of what goes in: the file's bytes, the options, the program's version.
pub(super) fn key(path: &Path, options: &str) -> Result<String, Failure> {
    let failed = |e: std::io::Error| format!("{}: {e}", path.display());
    let mut bytes = Vec::new();
    // what cannot be read is refused by the reader, with its line
    if let Ok(mut file) = std::fs::File::open(path) {
        file.read_to_end(&mut bytes).map_err(failed)?;
    }
    Ok(format!("{} {options} {}", ident::log::digest(&bytes), env!("CARGO_PKG_VERSION")))
}

impl Done {
    /// A kept result; nothing where there is none, or none that can be read.
    pub(super) fn read(path: &Path) -> Option<Self> {
        serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()
    }

    /// As it is kept.
    pub(super) fn to_json(&self) -> Result<String, Failure> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    /// The line of a run that was not closed.
    pub(super) fn message(&self) -> Option<String> {
        (self.state != "closed").then(|| format!("{}: {}: {}", self.file, self.state, self.message))
    }
}

/// Closes the loop on one run; a panic is a result too.
pub(super) fn close_one(file: &str, key: String, folder: Option<&Path>, read: &dyn Fn() -> Result<Log, Failure>) -> Done {
    let blank = Done { key, file: file.to_owned(), ..Done::default() };
    let work = std::panic::AssertUnwindSafe(|| -> Result<Done, Failure> {
        let log = read()?;
        let closed = close(&log, None, &[], &mut |_| {})?;
        if let Some(folder) = folder {
            let mut own = Folder::new(folder, "batch")?;
            own.extend(results(&log, &closed, Origin::of(&log))?);
            own.write()?;
        }
        Ok(brief(&log, &closed))
    });
    match std::panic::catch_unwind(work) {
        Ok(Ok(done)) => Done { key: blank.key, file: blank.file, ..done },
        Ok(Err(e)) => {
            let message = e.to_string().replace('\n', " ");
            // the folder differs from desk to desk, the row must not
            let message = message.rfind(file).map_or(message.clone(), |at| message[at..].to_owned());
            Done { state: "refused".into(), message, ..blank }
        }
        Err(panic) => {
            let said = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
            let message = format!("a fault of this program ({}); please report it with the file", said.unwrap_or("no word"));
            Done { state: "failed".into(), message: message.replace('\n', " "), ..blank }
        }
    }
}

fn brief(log: &Log, closed: &Closed) -> Done {
    let v = &closed.verdict;
    let named = |key: &str| log.meta.get(key).and_then(|v| v.as_str()).unwrap_or_default().to_owned();
    let channels = v
        .channels
        .predicted
        .iter()
        .map(|(name, c)| Channel { name: name.clone(), figures: [c.noise_floor_rms, c.before.heldout_rms, c.after.heldout_rms] });
    let mut effects = Vec::new();
    for e in &v.effects {
        let blank = Parameter {
            effect: e.id.clone(),
            scope: word(&e.scope),
            channels: e.channels.join(";"),
            probability: e.probability,
            reduction: e.heldout_error_reduction,
            parameter: None,
        };
        let of = |p: &ident::verdict::Parameter| Parameter {
            parameter: Some((p.name.clone(), p.value, p.unit.clone(), p.ci95)),
            ..blank.clone()
        };
        effects.extend(e.parameters.iter().map(of));
        if e.parameters.is_empty() {
            effects.push(blank);
        }
    }
    let constants = identify(log).map(|found| found.constants).unwrap_or_default();
    Done {
        state: "closed".into(),
        sha256: log.digest(),
        rows: log.len(),
        seconds: (!log.time_is_row()).then(|| log.t[log.len() - 1] - log.t[0]),
        named: [named("motor"), named("propeller")],
        verdict: word(&v.verdict),
        unexplained: v.unexplained.iter().map(|u| u.channel.clone()).collect(),
        channels: channels.collect(),
        constants: constants.iter().map(|c| Constant { name: c.name.to_owned(), value: c.value, se: c.se }).collect(),
        effects,
        ..Done::default()
    }
}

/// A word of the verdict as its JSON has it.
fn word(value: &impl Serialize) -> String {
    serde_json::to_value(value).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
}
