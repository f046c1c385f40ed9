//! `quadrig import STAND --with ESC`: several loggers of one run on the stand's clock.
//!
//! What it is: each further log is opened like any other, joined to the stand's by what both saw, and its channels go onto the stand's rows;
//! a page beside the output shows the joint.
//! What can go wrong: logs that cannot be joined for certain are refused, and nothing is written.
//! Units: s, ppm; the channels'.
//! Reference: specification `formats.md`, `quadrig import`; `ident/src/log/join`.

use crate::Failure;
use crate::open::{as_written, found, opened};
use ident::log::Log;
use ident::log::import::{Options, Report, is_recording};
use ident::log::join::{Joint, LABELS, align, merge};
use ident::report::joined::page;
use std::path::{Path, PathBuf};

/// A further logger's file and what it is called.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct With {
    label: String,
    file: PathBuf,
}

impl With {
    /// Its file.
    pub(crate) fn file(&self) -> &Path {
        &self.file
    }
}

impl std::str::FromStr for With {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=') {
            Some((label, file)) if LABELS.contains(&label) => Ok(Self { label: label.to_owned(), file: file.into() }),
            Some((label, _)) if !label.contains(['/', '.']) => Err(format!("{label}: expected one of {}", LABELS.join(", "))),
            _ => Ok(Self { label: LABELS[0].to_owned(), file: text.into() }),
        }
    }
}

/// A further log, and what was found in it: of a flight controller's own recording the rotor that is on the stand.
fn open_further(file: &Path, rotor: Option<u32>, options: &Options) -> Result<(Log, Vec<String>), Failure> {
    if !is_recording(file) {
        return opened(file, options);
    }
    let wanted = || format!("--with: {} records several rotors; expected --rotor N, the one on the stand", file.display());
    let n = rotor.ok_or_else(wanted)?;
    let (log, report) = ident::log::import::rotor(file, n as usize)?.ok_or_else(wanted)?;
    Ok((as_written(&log)?, found(file, &report)))
}

/// What came of a joint.
pub(crate) struct Joined {
    /// The page that shows it.
    pub(crate) page: String,
    /// What was joined, a report for each logger.
    pub(crate) reports: Vec<Report>,
    /// What was found in the further logs.
    pub(crate) remarks: Vec<String>,
}

/// Joins further logs to a stand's. Nothing is said before it is done: a refusal is one line.
pub(crate) fn join(
    stand: &mut Log,
    file: &Path,
    (with, rotor): (&[With], Option<u32>),
    options: &Options,
) -> Result<Joined, Failure> {
    let alone = stand.clone();
    let options =
        Options { mappings: Vec::new(), motor: None, propeller: None, supply: None, date: None, side: None, ..options.clone() };
    let mut logs: Vec<(Log, Joint)> = Vec::new();
    let (mut reports, mut remarks) = (Vec::new(), Vec::new());
    for (k, w) in with.iter().enumerate() {
        if with[..k].iter().any(|b| b.label == w.label) {
            return Err(format!(
                "--with: two loggers called {}; name them LABEL=FILE with one of {}",
                w.label,
                LABELS.join(", ")
            )
            .into());
        }
        let (log, said) = open_further(&w.file, rotor, &options)?;
        remarks.extend(said);
        if log.t == alone.t && log.columns == alone.columns {
            return Err(
                format!("{}: the same log as {}; expected another logger of the run", w.file.display(), file.display()).into()
            );
        }
        let joint = align(&alone, &log).map_err(|e| format!("{} and {}: {e}", file.display(), w.file.display()))?;
        reports.push(merge(stand, &log, &joint, &w.label));
        logs.push((log, joint));
    }
    let joined: Vec<(&Log, &Joint)> = logs.iter().map(|(log, joint)| (log, joint)).collect();
    Ok(Joined { page: page(&alone, &joined), reports, remarks })
}
