//! A run from whatever file holds it: a rig log, or another program's export.
//!
//! What it is: the one door of the commands that take exports directly. What is no rig log goes through the importer, every conversion is
//! said on stderr, and what comes out is what `quadrig import` would have written.
//! What can go wrong: what reader or importer refuse; a mapping for a file that needs none.
//! Units: the contract's.
//! Reference: specification `formats.md`, "Command line".

use crate::Failure;
use crate::trouble::unread;
use ident::log::import::{Mapping, Options, Report, import_as};
use ident::log::{Gaps, Log};
use ident::model::{Model, beside};
use ident::report::wrapped;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Endings of files that may be runs.
const ENDINGS: [&str; 4] = ["csv", "txt", "tsv", "log"];

/// Whether a file of a folder may be a run, by its ending.
pub(crate) fn may_be_a_run(path: &Path) -> bool {
    path.extension().is_some_and(|e| ENDINGS.contains(&e.to_string_lossy().to_lowercase().as_str()))
}

/// Refusal of a folder without such a file.
pub(crate) fn no_run_in(folder: &Path) -> Failure {
    format!("{}: no file ends in .{}; expected rig logs or exports", folder.display(), ENDINGS.join(", .")).into()
}

/// How the columns of an export are to be read.
#[derive(clap::Args, Clone, Default)]
pub(crate) struct Columns {
    /// A column of an export, TARGET=SOURCE, TARGET=SOURCE*FACTOR or TARGET=SOURCE*FACTOR+OFFSET; may be given more than once.
    #[arg(long = "map", value_name = "TARGET=SOURCE*FACTOR")]
    mappings: Vec<Mapping>,
    /// Pole pairs of the motor (half its magnets), for speeds in electrical turns.
    #[arg(long, value_name = "N", value_parser = crate::number::whole::<u32>(1, 60, "pole pairs"))]
    pole_pairs: Option<u32>,
    /// Which powertrain of a stand with two is the rig: 1 or A, 2 or B.
    #[arg(long, value_name = "A|B", value_parser = side)]
    side: Option<u32>,
}

/// What the rig is made of; it travels with the log.
#[derive(clap::Args, Clone, Default)]
pub(crate) struct Names {
    /// Name of the motor; travels with the log.
    #[arg(long)]
    motor: Option<String>,
    /// Name of the propeller; travels with the log.
    #[arg(long)]
    propeller: Option<String>,
    /// What feeds it, such as "3S 2200 mAh" or "bench supply, 12 V"; travels with the log.
    #[arg(long)]
    supply: Option<String>,
    /// Day of the run, YYYY-MM-DD, with THH:MM:SS behind it where the time is known; travels with the log.
    #[arg(long, value_parser = day_of_run)]
    date: Option<String>,
}

/// A day, with a time of day behind it or none.
pub(crate) fn day_of_run(text: &str) -> Result<String, String> {
    let clock = |time: &str| {
        let digits = time.strip_prefix(['T', ' ', '-']);
        time.is_empty() || digits.is_some_and(|of| of.len() >= 4 && of.chars().all(|c| c.is_ascii_digit() || c == ':'))
    };
    let parts = text.get(..10).zip(text.get(10..));
    if parts.is_some_and(|(day, time)| ident::log::date::day(day).is_some() && clock(time)) {
        Ok(text.to_owned())
    } else {
        Err("expected a day such as 2026-03-12 or 2026-03-12T14:30:00".to_owned())
    }
}

fn side(text: &str) -> Result<u32, String> {
    match text.to_ascii_uppercase().as_str() {
        "1" | "A" => Ok(1),
        "2" | "B" => Ok(2),
        _ => Err("expected A, B, 1 or 2".to_owned()),
    }
}

impl Columns {
    /// With the rig's names, what the importer is told.
    pub(crate) fn options(&self, names: &Names) -> Options {
        let Names { motor, propeller, supply, date } = names.clone();
        Options { supply, date, ..self.named(motor, propeller) }
    }

    /// The same where the names come from elsewhere.
    pub(crate) fn named(&self, motor: Option<String>, propeller: Option<String>) -> Options {
        let pole_pairs = self.pole_pairs.map(f64::from);
        let mappings = self.mappings.clone();
        Options { mappings, motor, propeller, pole_pairs, side: self.side, ..Options::default() }
    }
}

/// Whether a file calls itself one of this program's own logs.
pub(crate) fn is_own(path: &Path) -> Result<bool, Failure> {
    let file = std::fs::File::open(path).map_err(unread(path))?;
    let mut first = Vec::new();
    // what cannot be read the reader refuses in its own words
    let _ = BufReader::new(file.take(64)).read_until(b'\n', &mut first);
    let first = String::from_utf8_lossy(&first).into_owned();
    Ok(first.trim_start_matches('\u{feff}').strip_prefix('#').is_some_and(|l| l.trim_start().starts_with("quadrig-")))
}

/// Reads a run, and says what was found on the way.
pub(crate) fn open(path: &Path, options: &Options, quiet: bool) -> Result<Log, Failure> {
    let (log, remarks) = opened(path, options)?;
    remarks.iter().filter(|_| !quiet).for_each(|line| note!("{line}"));
    Ok(log)
}

/// Reads a run, with what was found on the way, a line each.
pub(crate) fn opened(path: &Path, options: &Options) -> Result<(Log, Vec<String>), Failure> {
    crate::apart::is_readable_again(path)?;
    if is_own(path)? {
        if let Some(m) = options.mappings.first() {
            let expected = "expected no --map: its columns have their names (an export takes one)";
            return Err(format!("--map {}=...: {} is a rig log, which needs none; {expected}", m.target, path.display()).into());
        }
        let mut log = Log::read(path)?;
        options.name(&mut log);
        log.refuse_absurd(path)?;
        // of rows that were dropped the log's own doubts speak
        let gaps = Gaps::of(&log).filter(|gaps| !gaps.dropped || log.meta.contains_key("sample_hz"));
        let gaps = gaps.map(|gaps| format!("t_s: {gaps}"));
        let remarks = gaps.into_iter().chain(log.in_doubt()).map(|what| format!("{}: {what}", path.display())).collect();
        return Ok((log, remarks));
    }
    let (log, report) = import_as(path, options).map_err(|why| crate::kind::another(path).map_or(why.into(), Failure::from))?;
    let log = as_written(&log)?;
    Ok((log, found(path, &report)))
}

/// What was found in an export: the file once, then one line each.
pub(crate) fn found(path: &Path, report: &Report) -> Vec<String> {
    let title = (!report.notes.is_empty()).then(|| format!("{}: read as an export; found on the way:", path.display()));
    let lines = report.notes.iter().map(|note| {
        let count = if note.count > 1 { format!(" ({})", note.count) } else { String::new() };
        wrapped(&format!("  {}: {}{count}", note.column, note.what), 4)
    });
    title.into_iter().chain(lines).collect()
}

/// The log as it reads once it is written: numbers to their digits, the digest of the file.
pub(crate) fn as_written(log: &Log) -> Result<Log, Failure> {
    let mut text = Vec::new();
    log.write_to(&mut text)?;
    let mut read = Log::parse(&log.name, text.as_slice())?;
    read.name.clone_from(&log.name);
    Ok(read)
}

/// A model of a rig; one that goes without the file beside it is said to.
pub(crate) fn read_model(path: &Path, quiet: bool) -> Result<Model, Failure> {
    crate::kind::refuse_no_model(path)?;
    let model = Model::read(path)?;
    if model.goes_without() && !quiet {
        note!(
            "{}: {} is not there: what the model was off by on its own run is not known and may pass for something new; it predicts as ever",
            path.display(),
            beside(path).display()
        );
    }
    Ok(model)
}
