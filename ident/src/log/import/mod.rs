//! Other people's exports become rig logs, and everything that was repaired on the way is counted.
//!
//! What it is: bytes to text, text to a table, a table to columns, columns to a log: one file each, with a report of every step.
//! What can go wrong: real loggers repeat and step back time stamps and leave blanks; each repair has a stated rule and a count. What no rule
//! repairs, and what no rig can do, is refused with its place and the likely reason.
//! Units: converted to the contract's on the way in; the factor stands in the report.
//! Reference: specification `formats.md`, `quadrig import`; RCbenchmark and Tyto CSV headers carry their units in parentheses.

mod blackbox;
mod clock;
mod findings;
mod flight;
mod header;
mod layout;
mod number;
mod repair;
mod rotor;
mod settle;
mod streams;
mod table;
mod text;
mod ulog;
mod uneven;
mod unit;

pub use flight::{flight, flight_from};
pub use rotor::{is_recording, rotor};

use crate::log::plausible::{VOUCHED, doubts, is_thinned};
use crate::log::{Log, Place, ReadError};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Whether a file begins with these bytes.
fn begins(path: &Path, magic: &[u8]) -> std::io::Result<bool> {
    let mut head = Vec::with_capacity(magic.len());
    File::open(path)?.take(magic.len() as u64).read_to_end(&mut head)?;
    Ok(head == magic)
}

/// One line of the import report.
#[derive(Debug, Clone, PartialEq)]
pub struct Note {
    /// Column, or `(file)`.
    pub column: String,
    /// What was found, and by which rule it was handled.
    pub what: String,
    /// How many samples or rows.
    pub count: usize,
}

/// What was found in a file while it was imported.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Report {
    /// Findings in the order of discovery.
    pub notes: Vec<Note>,
}

impl Report {
    pub(crate) fn add(&mut self, column: &str, what: impl Into<String>, count: usize) {
        if count > 0 {
            self.notes.push(Note { column: column.to_owned(), what: what.into(), count });
        }
    }

    /// The report as an aligned table.
    #[must_use]
    pub fn table(&self) -> String {
        let width = self.notes.iter().map(|n| n.column.len()).max().unwrap_or(6).max(6);
        let mut out = format!("{:<width$}  {:>7}  finding\n", "column", "count");
        for n in &self.notes {
            out += &format!("{:<width$}  {:>7}  {}\n", n.column, n.count, n.what);
        }
        out
    }
}

/// A user's own mapping of one column: `target = source * factor + offset`.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapping {
    /// Column of the contract.
    pub target: String,
    /// Header cell of the file.
    pub source: String,
    /// Multiplied in.
    pub factor: f64,
    /// Added after that.
    pub offset: f64,
    /// Whether the factor was written, be it 1: the user answers for the unit.
    pub stated: bool,
}

/// Factors between two units of a quantity, their signs apart.
const FACTORS: std::ops::RangeInclusive<f64> = 1e-12..=1e12;

impl std::str::FromStr for Mapping {
    type Err = String;

    /// `target=source`, `target=source*factor` or `target=source*factor+offset`.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let wanted =
            "expected TARGET=SOURCE, TARGET=SOURCE*FACTOR or TARGET=SOURCE*FACTOR+OFFSET, such as thrust_n=Load*0.00980665";
        let (target, rest) = text.split_once('=').ok_or(wanted)?;
        let number = |text: &str| text.trim().parse::<f64>().map_err(|_| wanted);
        let (rest, offset) = match rest.rsplit_once('+') {
            Some((s, o)) if s.contains('*') => (s, number(o)?),
            _ => (rest, 0.0),
        };
        let (source, factor, stated) = match rest.rsplit_once('*') {
            Some((s, f)) => (s, number(f)?, true),
            None => (rest, 1.0, false),
        };
        if !FACTORS.contains(&factor.abs()) || offset.is_nan() || offset.abs() > *FACTORS.end() {
            let expected = "expected a FACTOR from 1e-12 to 1e12 (or the same below 0) and an OFFSET of 1e12 at most";
            return Err(format!("{expected}, such as thrust_n=Load*0.00980665"));
        }
        Ok(Self { target: target.trim().to_owned(), source: source.trim().to_owned(), factor, offset, stated })
    }
}

/// What a user adds to what a file says of itself.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Options {
    /// Columns by the user's own word.
    pub mappings: Vec<Mapping>,
    /// The motor's name.
    pub motor: Option<String>,
    /// The propeller's name.
    pub propeller: Option<String>,
    /// What fed it, in the user's words.
    pub supply: Option<String>,
    /// The day of the run, as `YYYY-MM-DD`, with a time behind it where it is known.
    pub date: Option<String>,
    /// Pole pairs of the motor: electrical turns to one of the shaft.
    pub pole_pairs: Option<f64>,
    /// Which of several powertrains of a stand is the rig, 1 for A.
    pub side: Option<u32>,
}

impl Options {
    /// What is known of the rig, into a log's head; what the file itself says gives way to the user.
    pub fn name(&self, log: &mut Log) {
        let told = [("motor", &self.motor), ("propeller", &self.propeller), ("supply", &self.supply), ("date", &self.date)];
        for (key, value) in told {
            if let Some(text) = value {
                log.meta.insert(key.to_owned(), toml::Value::String(text.clone()));
            }
        }
        if let Some(pairs) = self.pole_pairs {
            let whole = if pairs.fract() == 0.0 { toml::Value::Integer(pairs as i64) } else { toml::Value::Float(pairs) };
            log.meta.insert("pole_pairs".to_owned(), whole);
        }
    }
}

/// Imports a file with nothing known but mappings.
///
/// # Errors
/// [`ReadError`] with file, line and column.
pub fn import(path: &Path, mappings: &[Mapping]) -> Result<(Log, Report), ReadError> {
    import_as(path, &Options { mappings: mappings.to_vec(), ..Options::default() })
}

/// Imports a file.
///
/// # Errors
/// [`ReadError`] with file, line and column.
pub fn import_as(path: &Path, options: &Options) -> Result<(Log, Report), ReadError> {
    let file = path.display().to_string();
    let handle = File::open(path).map_err(|source| ReadError::Io { file: file.clone(), source })?;
    let (mut log, report) = import_from(&file, handle, options)?;
    log.name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or(file);
    log.meta.entry("source".into()).or_insert_with(|| toml::Value::String(log.name.clone()));
    Ok((log, report))
}

/// Imports from any source; `file` is the name for messages.
///
/// # Errors
/// As [`import_as`].
pub fn import_from(file: &str, source: impl Read, options: &Options) -> Result<(Log, Report), ReadError> {
    let mut report = Report::default();
    let text = text::read(file, source)?;
    if let Some(note) = &text.note {
        report.add("(file)", note.clone(), 1);
    }
    let layout = layout::find(file, &text, options, &mut report)?;
    let place = Place { file, line: layout.line as usize };
    let (route, mut fields) = table::plan(file, &layout, options, &mut report)?;
    let lines = table::read_rows(file, &layout, &route, &mut fields, &mut report)?;
    if fields.first().is_none_or(|f| f.values.is_empty()) {
        return Err(place.refuse(None, "no data rows", "at least one line of numbers under the header"));
    }
    let said = layout.meta.get("pole_pairs").and_then(|v| v.as_float().or_else(|| v.as_integer().map(|i| i as f64)));
    settle::settle(&place, &mut fields, options.pole_pairs.or(said), &mut report)?;
    let mapped: Vec<String> = fields.iter().filter(|f| f.mapped).map(|f| f.name.clone()).collect();
    let (names, columns) = fields.into_iter().map(|f| (f.name, f.values)).unzip();
    let mut log = repair::assemble(&place, names, columns, &lines, &mut report)?;
    let related = log.measured().count() + usize::from(log.column("pulse_us").is_some());
    if related < 2 {
        return Err(place.refuse(
            None,
            format!("{related} known channel(s)"),
            "at least two of pulse, rpm, thrust, torque, current, voltage (name them with --map TARGET=SOURCE*FACTOR)",
        ));
    }
    // a rate that the file states is its word for the clock
    log.meta.extend(layout.meta.get_key_value("sample_hz").map(|(key, rate)| (key.clone(), rate.clone())));
    let vouched = judge(&place, &log, &mapped, &mut report)?;
    let row = log.time_is_row();
    log.meta.extend(layout.meta.into_iter().filter(|(key, _)| key != "time" || row));
    if !vouched.is_empty() {
        log.meta.insert(VOUCHED.into(), toml::Value::Array(vouched));
    }
    log.events = layout.events;
    options.name(&mut log);
    Ok((log, report))
}

/// Refuses what no rig does, unless the user mapped the column; tells what is odd. The columns that only the mapping vouches for.
fn judge(place: &Place<'_>, log: &Log, mapped: &[String], report: &mut Report) -> Result<Vec<toml::Value>, ReadError> {
    let mut vouched = Vec::new();
    for doubt in doubts(log) {
        if doubt.never && !mapped.iter().any(|m| m == doubt.column) {
            let expected = match doubt.column {
                "t_s" if is_thinned(log) => {
                    "a row at every tick: use the whole export; --map 't_s=COLUMN*1' keeps what is left as it is".to_owned()
                }
                "t_s" => "seconds: --map 't_s=COLUMN*0.001' reads milliseconds, *0.000001 microseconds, and *1 keeps it as it is"
                    .to_owned(),
                column => format!("what a rig can do; --map {column}=COLUMN*FACTOR converts it, and *1 keeps it as it is"),
            };
            return Err(place.refuse(Some(doubt.column), doubt.what, expected));
        }
        if doubt.never {
            vouched.push(toml::Value::String(doubt.column.to_owned()));
        }
        report.add(doubt.column, format!("in doubt: {}", doubt.what), 1);
    }
    Ok(vouched)
}

#[cfg(test)]
mod tests {
    use super::Mapping;

    #[test]
    fn a_factor_is_a_number_between_two_units() {
        let mapping: Mapping = "thrust_n = Load (g) * -0.00980665 + 2".parse().expect("a mapping");
        assert_eq!((mapping.target.as_str(), mapping.source.as_str()), ("thrust_n", "Load (g)"));
        assert_eq!((mapping.factor, mapping.offset), (-0.009_806_65, 2.0));
        for wrong in ["nan", "inf", "1e999", "0", "1e-13", "-1e13", "2+inf", "2+nan", "2+1e13", "heavy", ""] {
            let said = format!("thrust_n=Thrust (N)*{wrong}").parse::<Mapping>().expect_err("no factor");
            assert!(said.starts_with("expected ") && said.contains("thrust_n=Load*0.00980665"), "{wrong}: {said}");
        }
    }
}
