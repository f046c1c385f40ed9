//! The rig log, `quadrig-log 1`: reading, checking, writing.
//!
//! What it is: columns of numbers over strictly increasing time, with metadata in comment lines at the head.
//! What can go wrong: anything that is not the format is refused with file, line, column and what was expected; a line longer
//! than [`MAX_LINE`] is refused without being read to its end.
//! Units: carried by the column names (`thrust_n`, `pulse_us`, ...); a missing sample is NaN in memory, an empty field on disk.
//! Reference: specification `formats.md`, "Rig log".

pub mod board;
mod clock;
pub mod date;
mod disc;
pub mod flight_log;
mod gaps;
mod head;
pub mod import;
pub mod join;
pub(crate) mod plausible;
pub(crate) use plausible::STANDSTILL;
pub mod quantity;
mod rig;
pub mod sparse;
mod whole;

pub use disc::Disc;
pub use gaps::Gaps;
pub(crate) use head::{check as check_head, event, odd as odd_in_head};
pub use head::{event_line, meta_line};
pub use rig::{Named, OtherRig, named_alike};
pub use whole::{folder_of, no_regular_file, place_of, what_lies_at, write_whole};

use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;

/// First line of the format.
pub const FORMAT: &str = "quadrig-log 1";
/// Longest line that a reader takes, bytes.
pub const MAX_LINE: usize = 1 << 20;
/// Longest name of a column, characters.
const LONGEST_NAME: usize = 200;
/// The measured channels that a verdict speaks of, in the order of the questions that are asked of them.
pub const MODELLED: [&str; 9] =
    ["rpm_beam", "rpm_opto", "rpm_hall", "rpm_encoder", "rpm", "thrust_n", "torque_nm", "current_a", "voltage_v"];
/// The speed channels among [`MODELLED`].
pub const SPEED: [&str; 5] = ["rpm_beam", "rpm_opto", "rpm_hall", "rpm_encoder", "rpm"];

/// Why a file was refused: one line, with the place and the way out.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file could not be opened or read.
    #[error("{file}: cannot be read ({source}); expected a file: check name and folder")]
    Io {
        /// The file as it was named.
        file: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The content is not what the format asks for.
    #[error("{file}:{line}: {place}{found}; expected {expected}")]
    Content {
        /// The file as it was named.
        file: String,
        /// Line, counted from 1.
        line: usize,
        /// `column NAME: ` or empty.
        place: String,
        /// What stands there.
        found: String,
        /// What should stand there, and what to do.
        expected: String,
    },
}

/// A message under construction: where in which file.
#[derive(Debug, Clone)]
pub(crate) struct Place<'a> {
    pub(crate) file: &'a str,
    pub(crate) line: usize,
}

impl Place<'_> {
    pub(crate) fn refuse(&self, column: Option<&str>, found: impl Into<String>, expected: impl Into<String>) -> ReadError {
        ReadError::Content {
            file: self.file.to_owned(),
            line: self.line,
            place: column.map(|c| format!("column {}: ", short(c))).unwrap_or_default(),
            found: found.into(),
            expected: expected.into(),
        }
    }
}

/// One named column; NaN is a missing sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name, with its unit as suffix.
    pub name: String,
    /// One value a row.
    pub values: Vec<f64>,
}

/// A run in memory.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Log {
    /// File name without its folder, as verdicts quote it.
    pub name: String,
    /// `key = value` comment lines at the head.
    pub meta: BTreeMap<String, toml::Value>,
    /// What happened, one line each with its time (`12.340 s: sensor lost: rpm_beam`): the `event` lines of the file, wherever they stand.
    pub events: Vec<String>,
    /// Time, s, strictly increasing (row index where `time = "row"`).
    pub t: Vec<f64>,
    /// All other columns in the order of the file.
    pub columns: Vec<Column>,
    /// SHA-256 of the file that it was read from, in hexadecimal; `None` of a log that was made in memory.
    pub sha256: Option<String>,
}

impl Log {
    /// What tells this log from every other: the SHA-256 of its file, or of the file that it would be written as.
    #[must_use]
    pub fn digest(&self) -> String {
        let of_text = || {
            let mut text = Digesting(Sha256::new());
            // nothing that is kept in memory fails to take bytes
            let _ = self.write_to(&mut text);
            hexadecimal(text.0)
        };
        self.sha256.clone().unwrap_or_else(of_text)
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// Whether there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// The values of a column.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|c| c.name == name).map(|c| c.values.as_slice())
    }

    /// Whether time is a row index, so that no time-dependent effect may be offered.
    #[must_use]
    pub fn time_is_row(&self) -> bool {
        self.meta.get("time").and_then(toml::Value::as_str) == Some("row")
    }

    /// The modelled channels that hold at least one sample, in the order of [`MODELLED`].
    pub fn measured(&self) -> impl Iterator<Item = &'static str> + '_ {
        MODELLED.into_iter().filter(|m| self.column(m).is_some())
    }

    /// Reads a log.
    ///
    /// # Errors
    /// [`ReadError`] with file, line and column for anything that is not the format.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let file = path.display().to_string();
        let handle = File::open(path).map_err(|source| ReadError::Io { file: file.clone(), source })?;
        let mut log = Self::parse(&file, BufReader::new(handle))?;
        log.name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or(file);
        Ok(log)
    }

    /// Reads a log from any source; `file` is the name for messages.
    ///
    /// # Errors
    /// As [`Log::read`].
    pub fn parse(file: &str, source: impl BufRead) -> Result<Self, ReadError> {
        Self::parse_as(FORMAT, file, source)
    }

    /// The same for a log of another format with the same rules.
    pub(crate) fn parse_as(format: &str, file: &str, source: impl BufRead) -> Result<Self, ReadError> {
        let mut lines = Lines::new(file, source);
        let mut log = Self { name: file.to_owned(), ..Self::default() };
        let header = read_head(format, &mut lines, &mut log)?;
        for name in header.iter().skip(1) {
            log.columns.push(Column { name: name.clone(), values: Vec::new() });
        }
        let (mut line, mut row_lines) = (String::new(), Vec::new());
        while lines.read_into(&mut line)? {
            if line.is_empty() {
                continue;
            }
            if let Some(comment) = line.strip_prefix('#') {
                // a recorder that was cut short has left its events among the rows
                log.events.extend(event(comment.trim()));
                continue;
            }
            let place = lines.place();
            // of a row that is cut short the time may be, too, and of one field too many the first half of it
            let whole = header.len() == fields_of(&line);
            if let Some(t) = clock::first_field(&line).filter(|t| whole && log.t.last().is_some_and(|last| t < last)) {
                return Err(clock::stepped_back(t, &log, &row_lines, &place, &mut lines)?);
            }
            row_lines.push(place.line);
            read_row(&line, &header, &place, &mut log)?;
        }
        if log.is_empty() {
            return Err(lines.place().refuse(None, "no data rows", "at least one line of numbers under the header"));
        }
        if format == FORMAT {
            clock::check(&log, file, &row_lines)?;
        }
        log.sha256 = Some(hexadecimal(lines.digest));
        Ok(log)
    }

    /// Writes the log so that a reader never sees half of it: temporary file, sync, rename.
    ///
    /// # Errors
    /// What the system says.
    pub fn write(&self, path: &Path) -> std::io::Result<()> {
        write_whole(path, |out| self.write_to(out))
    }

    /// Writes the log to any sink.
    ///
    /// # Errors
    /// What the sink says.
    pub fn write_to(&self, out: &mut dyn Write) -> std::io::Result<()> {
        self.write_as(FORMAT, out)
    }

    pub(crate) fn write_as(&self, format: &str, out: &mut dyn Write) -> std::io::Result<()> {
        writeln!(out, "# {format}")?;
        for (key, value) in &self.meta {
            writeln!(out, "{}", meta_line(key, value))?;
        }
        for event in &self.events {
            writeln!(out, "{}", event_line(event))?;
        }
        write!(out, "t_s")?;
        for column in &self.columns {
            write!(out, ",{}", column.name)?;
        }
        writeln!(out)?;
        let digits: Vec<usize> = self.columns.iter().map(|c| decimals(&c.name)).collect();
        for (row, t) in self.t.iter().enumerate() {
            write!(out, "{}", trimmed(*t, 6))?;
            for (column, digits) in self.columns.iter().zip(&digits) {
                let v = column.values[row];
                if v.is_finite() { write!(out, ",{}", trimmed(v, *digits))? } else { write!(out, ",")? }
            }
            writeln!(out)?;
        }
        Ok(())
    }
}

fn decimals(name: &str) -> usize {
    match name {
        "torque_nm" => 6,
        "thrust_n" | "thrust_rms_n" => 5,
        "qw" | "qx" | "qy" | "qz" => 9,
        n if n.starts_with("gyro_") => 7,
        n if n.starts_with("acc_") => 5,
        n if n.starts_with("rpm") || n.starts_with("pulse_us") => 3,
        _ => 4,
    }
}

pub(crate) fn trimmed(value: f64, digits: usize) -> String {
    let mut s = format!("{value:.digits$}");
    if s.contains('.') {
        let keep = s.trim_end_matches('0').trim_end_matches('.').len();
        s.truncate(keep);
    }
    if s == "-0" { "0".to_owned() } else { s }
}

/// Bounded line reader that knows where it is.
pub(crate) struct Lines<'a, R> {
    file: &'a str,
    source: R,
    number: usize,
    /// Of every byte that was read.
    digest: Sha256,
}

/// A sink that keeps the digest of what is written to it.
struct Digesting(Sha256);

impl Write for Digesting {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// SHA-256 of bytes, as `sha256sum` prints it.
#[must_use]
pub fn digest(bytes: &[u8]) -> String {
    hexadecimal(Sha256::new_with_prefix(bytes))
}

/// SHA-256 of a text, as `sha256sum` prints it.
pub(crate) fn digest_of(text: &str) -> String {
    hexadecimal(Sha256::new_with_prefix(text))
}

fn hexadecimal(digest: Sha256) -> String {
    digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

impl<'a, R: BufRead> Lines<'a, R> {
    pub(crate) fn new(file: &'a str, source: R) -> Self {
        Self { file, source, number: 0, digest: Sha256::new() }
    }

    pub(crate) fn place(&self) -> Place<'a> {
        Place { file: self.file, line: self.number.max(1) }
    }

    /// The next line in a string of its own; `None` at the end.
    pub(crate) fn next_line(&mut self) -> Result<Option<String>, ReadError> {
        let mut text = String::new();
        Ok(self.read_into(&mut text)?.then_some(text))
    }

    /// The next line in place of what `text` held; false at the end.
    fn read_into(&mut self, text: &mut String) -> Result<bool, ReadError> {
        let mut bytes = std::mem::take(text).into_bytes();
        bytes.clear();
        let n = (&mut self.source)
            .take(MAX_LINE as u64 + 1)
            .read_until(b'\n', &mut bytes)
            .map_err(|source| ReadError::Io { file: self.file.to_owned(), source })?;
        if n == 0 {
            return Ok(false);
        }
        self.digest.update(&bytes);
        self.number += 1;
        if self.number == 1 && bytes.trim_ascii_end().contains(&b'\r') {
            let found = "lines that end with a carriage return alone";
            return Err(self.place().refuse(None, found, "lines that end with a line feed: save the file so in an editor"));
        }
        if n > MAX_LINE {
            return Err(self.place().refuse(
                None,
                format!("a line longer than {MAX_LINE} bytes"),
                "a text file with one short line a sample",
            ));
        }
        while matches!(bytes.last(), Some(b'\n' | b'\r')) {
            bytes.pop();
        }
        if self.number == 1 && bytes.starts_with(&[0xEF, 0xBB, 0xBF]) {
            bytes.drain(..3);
        }
        *text = String::from_utf8(bytes)
            .map_err(|_| self.place().refuse(None, "bytes that are not UTF-8", "a CSV text file in UTF-8"))?;
        Ok(true)
    }
}

fn read_head<R: BufRead>(format: &str, lines: &mut Lines<'_, R>, log: &mut Log) -> Result<Vec<String>, ReadError> {
    let mut format_seen = false;
    loop {
        let Some(line) = lines.next_line()? else {
            return Err(lines.place().refuse(
                None,
                "the file is empty or ends before its header",
                format!("'# {format}' and a header line that starts with t_s"),
            ));
        };
        let place = lines.place();
        if let Some(comment) = line.strip_prefix('#') {
            let comment = comment.trim();
            if !format_seen {
                if comment != format {
                    let found = format!("'{}'", short(&line));
                    return Err(match comment {
                        crate::log::flight_log::FORMAT => place.refuse(
                            None,
                            found,
                            format!("'# {format}' on the first line (a flight: `quadrig close-loop` takes it)"),
                        ),
                        _ => place.refuse(
                            None,
                            found,
                            format!("'# {format}' on the first line (use `quadrig import` for other formats)"),
                        ),
                    });
                }
                format_seen = true;
            } else if let Some(event) = event(comment) {
                log.events.push(event);
            } else if let Ok(table) = comment.parse::<toml::Table>() {
                if let Some(key) = table.keys().find(|key| log.meta.contains_key(*key)) {
                    return Err(place.refuse(
                        Some(key),
                        "it stands twice in the head",
                        "each key once: which of the two is right?",
                    ));
                }
                if format == FORMAT {
                    head::check(&table, &place)?;
                }
                log.meta.extend(table);
            } else if let Some((key, value)) = head::misread(comment) {
                let expected = format!("a value in TOML, a text in quotes: {key} = \"{}\"", value.trim_matches(['"', '\'']));
                return Err(place.refuse(Some(key), short(value), expected));
            }
            continue;
        }
        if line.trim().is_empty() {
            continue;
        }
        if !format_seen {
            return Err(place.refuse(
                None,
                "no format line",
                format!("'# {format}' on the first line (use `quadrig import` for other formats)"),
            ));
        }
        return check_header(&line, &place);
    }
}

fn check_header(line: &str, place: &Place<'_>) -> Result<Vec<String>, ReadError> {
    let names: Vec<String> = line.split(',').map(|n| n.trim().to_owned()).collect();
    if names.first().map(String::as_str) != Some("t_s") {
        if let Some((_, word)) = [(';', "semicolons"), ('\t', "tabs")].iter().find(|(c, _)| names.len() == 1 && line.contains(*c))
        {
            let expected = "commas (and points in the numbers); save it so, or use `quadrig import`";
            return Err(place.refuse(None, format!("{word} between the columns"), expected));
        }
        if names.len() > 1 && names.iter().all(|name| name.is_empty() || name.parse::<f64>().is_ok()) {
            let expected = "a header line above them that names the columns, such as t_s,pulse_us,rpm,thrust_n: put it back";
            return Err(place.refuse(None, "no header: the first line that is no comment holds numbers", expected));
        }
        return Err(place.refuse(names.first().map(String::as_str), "not the time column", "t_s (seconds) as the first column"));
    }
    for (i, name) in names.iter().enumerate() {
        if name.is_empty() {
            return Err(place.refuse(None, format!("column {} has no name", i + 1), "a name for every column"));
        }
        named_shortly(name, place)?;
        if names[..i].contains(name) {
            return Err(place.refuse(Some(name), "it stands twice", "each column once"));
        }
        if let Some(right) = other_letters(name) {
            let expected = format!("{right}: rename the column, or give another quantity a name of its own");
            return Err(place.refuse(Some(name), "a known column in other letters", expected));
        }
        if let Some(right) = wrong_unit(&name.to_lowercase()) {
            return Err(place.refuse(
                Some(name),
                "a known quantity in another unit",
                format!("{right}; convert the values and rename the column"),
            ));
        }
    }
    if names.len() < 3 {
        return Err(place.refuse(None, format!("{} column(s)", names.len()), "t_s and at least two measured columns"));
    }
    Ok(names)
}

/// Refuses a name that no line of an output can hold.
pub(crate) fn named_shortly(name: &str, place: &Place<'_>) -> Result<(), ReadError> {
    let length = name.chars().count();
    if length <= LONGEST_NAME {
        return Ok(());
    }
    let expected = format!("a name of {LONGEST_NAME} at most: is this the header, or a row of another file?");
    Err(place.refuse(Some(name), format!("a name of {length} characters"), expected))
}

/// The contract's name of a column that differs from it by small and capital letters alone.
fn other_letters(name: &str) -> Option<&'static str> {
    let mut known = MODELLED.into_iter().chain(["pulse_us", "temp_c", "t_s"]);
    known.find(|known| *known != name && known.eq_ignore_ascii_case(name))
}

/// The contract's name for a column that carries a known quantity in a unit that the contract does not use.
fn wrong_unit(name: &str) -> Option<&'static str> {
    const KNOWN: [(&str, &str, &[&str]); 7] = [
        ("thrust_", "thrust_n", &["g", "gf", "kg", "kgf", "lbf", "lb", "mn", "oz"]),
        ("torque_", "torque_nm", &["n_m", "ncm", "mnm", "nmm", "lbfin", "gcm"]),
        ("current_", "current_a", &["ma", "ka"]),
        ("voltage_", "voltage_v", &["mv", "kv"]),
        ("temp_", "temp_c", &["k", "f"]),
        ("pulse_", "pulse_us", &["ms", "ns", "s", "percent", "pct", "duty"]),
        ("t_", "t_s", &["ms", "us", "ns", "min"]),
    ];
    KNOWN.iter().find_map(|(stem, right, wrong)| wrong.contains(&name.strip_prefix(stem)?).then_some(*right))
}

/// Largest reading of a modelled channel: a hundred times the electrical turns of the fastest rotor.
const READ: f64 = 1e7;
/// Largest number of any column: sums of a million of its squares still have an end.
pub(crate) const FARTHEST: f64 = 1e30;

/// Number of fields of a row.
fn fields_of(line: &str) -> usize {
    1 + line.bytes().filter(|b| *b == b',').count()
}

/// The column of a row with one field too many whose number a decimal comma has cut in two, and both parts: of those that it could be the one
/// whose row is most like the row before.
fn cut_by_its_comma<'a>(line: &'a str, header: &'a [String], log: &Log) -> Option<(&'a str, &'a str, &'a str)> {
    let fields: Vec<&str> = line.split(',').map(str::trim).collect();
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    // how far a row is from the one before, each column by its own size
    let distance = |cut: usize| -> Option<f64> {
        let (whole, part) = (fields.get(cut)?, fields.get(cut + 1)?);
        if !digits(whole.strip_prefix('-').unwrap_or(whole)) || !digits(part) {
            return None;
        }
        let joined = format!("{whole}.{part}");
        let row = fields.iter().take(cut).copied().chain([joined.as_str()]).chain(fields.iter().skip(cut + 2).copied());
        let before = std::iter::once(&log.t).chain(log.columns.iter().map(|c| &c.values)).map(|values| values.last().copied());
        let mut sum = 0.0;
        for (text, before) in row.zip(before) {
            let value = if text.is_empty() { continue } else { text.parse::<f64>().ok()? };
            let size = before.map_or(0.0, |before| value.abs().max(before.abs()));
            sum += before.filter(|_| size > 0.0).map_or(0.0, |before| (value - before).abs() / size);
        }
        Some(sum)
    };
    let cuts = (0..header.len()).filter(|_| fields.len() == header.len() + 1);
    let (cut, _) = cuts.filter_map(|cut| Some((cut, distance(cut)?))).min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((header.get(cut)?.as_str(), fields.get(cut)?, fields.get(cut + 1)?))
}

fn read_row(line: &str, header: &[String], place: &Place<'_>, log: &mut Log) -> Result<(), ReadError> {
    let fields = fields_of(line);
    if let Some(missing) = header.get(fields) {
        return Err(place.refuse(
            Some(missing),
            format!("the row ends before it ({fields} field{})", if fields == 1 { "" } else { "s" }),
            format!("{} as in the header (is the file truncated?)", header.len()),
        ));
    }
    if fields > header.len() {
        if let Some((name, whole, part)) = cut_by_its_comma(line, header, log) {
            let found = format!("'{},{}', and so {fields} fields", short(whole), short(part));
            let expected = format!("{} as in the header: a decimal comma? Write {}.{}", header.len(), short(whole), short(part));
            return Err(place.refuse(Some(name), found, expected));
        }
        let commas = fields + 1 >= 2 * header.len();
        let reason = if commas { ": a decimal comma? Write decimal points" } else { "" };
        return Err(place.refuse(None, format!("{fields} fields"), format!("{} as in the header{reason}", header.len())));
    }
    for ((i, text), name) in line.split(',').enumerate().zip(header) {
        let text = text.trim();
        let value = if text.is_empty() {
            f64::NAN
        } else {
            match text.parse::<f64>() {
                Ok(v) if v.is_finite() && (v.abs() > FARTHEST || (v.abs() > READ && MODELLED.contains(&name.as_str()))) => {
                    let expected = "a number that a sensor can read (1e7 at most), or an empty field for a missing sample";
                    return Err(place.refuse(Some(name), format!("'{}'", short(text)), expected));
                }
                Ok(v) if v.is_finite() => v,
                Ok(_) => {
                    return Err(place.refuse(
                        Some(name),
                        format!("'{}'", short(text)),
                        "a finite number, or an empty field for a missing sample",
                    ));
                }
                Err(_) => {
                    return Err(place.refuse(
                        Some(name),
                        format!("'{}'", short(text)),
                        "a decimal number, or an empty field for a missing sample",
                    ));
                }
            }
        };
        if i == 0 {
            check_time(value, log, place)?;
            log.t.push(value);
        } else {
            check_range(name, value, place)?;
            log.columns[i - 1].values.push(value);
        }
    }
    Ok(())
}

fn check_time(value: f64, log: &Log, place: &Place<'_>) -> Result<(), ReadError> {
    if value.is_nan() {
        return Err(place.refuse(Some("t_s"), "an empty field", "a time stamp on every row"));
    }
    match log.t.last() {
        Some(last) if value == *last => Err(place.refuse(
            Some("t_s"),
            format!("{value} repeats the row before"),
            "strictly increasing time (`quadrig import` repairs it by a stated rule)",
        )),
        _ => Ok(()),
    }
}

fn check_range(name: &str, value: f64, place: &Place<'_>) -> Result<(), ReadError> {
    if (name == "pulse_us" || name.starts_with("pulse_us_")) && value.is_finite() && !(500.0..=2500.0).contains(&value) {
        return Err(place.refuse(Some(name), format!("{value}"), "500 to 2500 us (duty in percent is pulse_us / 200)"));
    }
    Ok(())
}

/// A text as a refusal repeats it: 40 characters, and three dots in the place of more.
#[must_use]
pub fn short(text: &str) -> String {
    if text.chars().count() > 40 { text.chars().take(40).chain("...".chars()).collect() } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Log, String> {
        Log::parse("run.csv", text.as_bytes()).map_err(|e| e.to_string())
    }

    /// One number cut in two by its comma: of several places the one that makes the row most like the row before.
    #[test]
    fn a_decimal_comma_is_told_with_its_column() {
        let read = |row: &str| {
            let text = format!("# quadrig-log 1\nt_s,pulse_us,rpm,thrust_n\n0.1,1200,4000,2.5\n{row}\n");
            Log::parse("run.csv", text.as_bytes()).expect_err("a field too many").to_string()
        };
        for (row, said) in [
            ("0.2,1200,4010,2,6", "run.csv:4: column thrust_n: '2,6', and so 5 fields; expected 4 as in the header"),
            ("0,2,1200,4010,2.6", "column t_s: '0,2', and so 5 fields"),
            ("0.2,1200,4010,5,2.6", "column rpm: '4010,5', and so 5 fields"),
            ("0.2,1200,4010,-0,6", "a decimal comma? Write -0.6"),
        ] {
            assert!(read(row).contains(said), "{row}: {}", read(row));
        }
        // nothing that could be one
        let none = read("0.2,1200.0,4010.0,2.6,x");
        assert!(none.contains("run.csv:4: 5 fields; expected 4"), "{none}");
    }

    #[test]
    fn what_a_message_quotes_is_short() {
        let said = parse("# quadrig-log 1\rt_s,rpm,thrust_n\r0,1,2\r").unwrap_err();
        assert!(said.starts_with("run.csv:1: lines that end with a carriage return alone; expected"), "{said}");
        let said = parse(&format!("# {}\nt_s,rpm,thrust_n\n0,1,2\n", "x".repeat(5000))).unwrap_err();
        assert!(said.len() < 200 && said.contains("xxx...'"), "{said}");
        let said = parse(&format!("# quadrig-log 1\nt_s,rpm,thrust_n\n0,1,{}\n", "9".repeat(100_000))).unwrap_err();
        assert!(said.len() < 200 && said.contains("run.csv:3: column thrust_n: '999") && said.contains("999...'"), "{said}");
        let named = |length: usize| format!("# quadrig-log 1\nt_s,rpm,{}\n0,1,2\n", "x".repeat(length));
        let said = parse(&named(66_000)).unwrap_err();
        assert!(
            said.len() < 250 && said.contains("run.csv:2: column xxx") && said.contains("a name of 66000 characters; expected"),
            "{said}"
        );
        assert_eq!((parse(&named(200)).unwrap().len(), parse(&named(201)).is_err()), (1, true));
        assert_eq!(parse("# quadrig-log 1\r\nt_s,rpm,thrust_n\r\n0,1,2\r\n").unwrap().len(), 1);
    }

    #[test]
    fn a_small_log_reads_and_writes_back() {
        let text = "# quadrig-log 1\n# motor = \"570KV\"\n# sample_hz = 10.0\nt_s,pulse_us,rpm,thrust_n\n0,1000,0,0.001\n0.1,1050,,0.002\n";
        let log = parse(text).unwrap();
        assert_eq!(log.t, [0.0, 0.1]);
        assert!(log.column("rpm").unwrap()[1].is_nan());
        let mut out = Vec::new();
        log.write_to(&mut out).unwrap();
        let again = Log::parse("run.csv", out.as_slice()).unwrap();
        assert_eq!(again.meta, log.meta);
        // what was made in memory has the digest of the file that it is written as, which `sha256sum` prints
        assert_eq!(Log { sha256: None, ..log.clone() }.digest(), again.digest());
        assert_ne!(parse(&text.replace("0.002", "0.003")).unwrap().digest(), log.digest());
        let known = "# quadrig-log 1\nt_s,a,b\n0,1,2\n";
        assert_eq!(parse(known).unwrap().digest(), "afdc1c5e8efe3f3426bc84a553229402e0ad54d4fb85a6dfc1c3617f2aee76ec");
        assert_eq!(again.column("thrust_n"), log.column("thrust_n"));
    }

    /// A configuration of many lines is one line of a head, and comes back as it was.
    #[test]
    fn a_text_of_several_lines_is_one_line() {
        let text = "rate_hz = 10\n\n[esc]\nanswers = \"long-ready\" # a \\ b\n";
        let mut log = parse("# quadrig-log 1\nt_s,rpm,thrust_n\n0,1,2\n").unwrap();
        log.meta.insert("rig_config".to_owned(), toml::Value::String(text.to_owned()));
        let mut out = Vec::new();
        log.write_to(&mut out).unwrap();
        assert_eq!(String::from_utf8_lossy(&out).lines().count(), 4);
        let again = Log::parse("run.csv", out.as_slice()).unwrap();
        assert_eq!(Log { sha256: log.sha256.clone(), ..again }, log);
    }

    /// An event is a line of its own, however many there are; those that a recorder left among the rows count as well.
    #[test]
    fn events_are_kept_in_their_order_wherever_they_stand() {
        let text = "# quadrig-log 1\n# event = \"0.100 s: a \\\"word\\\"\"\n# event = \"0.200 s: b\"\n# eventful = 1\nt_s,rpm,thrust_n\n0,1,2\n# event = \"0.300 s: c\"\n1,1,2\n# event: none\n";
        let log = parse(text).unwrap();
        assert_eq!(log.events, ["0.100 s: a \"word\"", "0.200 s: b", "0.300 s: c"]);
        assert_eq!((log.len(), log.meta.keys().map(String::as_str).collect::<Vec<_>>()), (2, vec!["eventful"]));
        let mut out = Vec::new();
        log.write_to(&mut out).unwrap();
        let again = Log::parse("run.csv", out.as_slice()).unwrap();
        assert_eq!(Log { sha256: log.sha256.clone(), ..again }, log);
    }

    #[test]
    fn each_fault_names_its_place() {
        let head = "# quadrig-log 1\nt_s,pulse_us,thrust_n\n";
        for (text, wanted) in [
            (String::new(), "run.csv:1: the file is empty"),
            ("t_s,a,b\n0,1,2\n".to_owned(), "run.csv:1: no format line"),
            (head.to_owned(), "run.csv:2: no data rows"),
            (
                format!("{head}0,1000,0.1\n0.1,1000\n"),
                "run.csv:4: column thrust_n: the row ends before it (2 fields); expected 3",
            ),
            (format!("{head}0,1000,NaN\n"), "run.csv:3: column thrust_n: 'NaN'; expected a finite number"),
            (format!("{head}0,1000,1e308\n"), "run.csv:3: column thrust_n: '1e308'; expected a number that a sensor can read"),
            (format!("{head}0,1000,inf\n"), "column thrust_n: 'inf'"),
            (format!("{head}0,1000,x\n"), "run.csv:3: column thrust_n: 'x'; expected a decimal number"),
            (format!("{head}0,1000,1\n0,1000,1\n"), "run.csv:4: column t_s: 0 repeats"),
            (format!("{head}1,1000,1\n0.5,1000,1\n"), "run.csv:4: column t_s: 0.5 steps back from 1"),
            (format!("{head}0,7.5,1\n"), "column pulse_us: 7.5; expected 500 to 2500 us"),
            (
                format!("{head}1.5,1000,1\n1"),
                "run.csv:4: column pulse_us: the row ends before it (1 field); expected 3 as in the header (is the file truncated?)",
            ),
            (
                "# quadrig-log 1\nt_s,pulse_us,Thrust_N\n".to_owned(),
                "run.csv:2: column Thrust_N: a known column in other letters; expected thrust_n",
            ),
            (
                "# quadrig-log 1\nt_s,pulse_us,Thrust_G\n".to_owned(),
                "run.csv:2: column Thrust_G: a known quantity in another unit; expected thrust_n",
            ),
            (
                "# quadrig-log 1\nt_s,pulse_us,thrust_g\n".to_owned(),
                "run.csv:2: column thrust_g: a known quantity in another unit; expected thrust_n",
            ),
            ("# quadrig-log 1\nt_s,rpm\n0,1\n".to_owned(), "expected t_s and at least two"),
            ("# quadrig-log 1\nrpm,thrust_n\n0,1\n".to_owned(), "column rpm: not the time column"),
        ] {
            let message = parse(&text).unwrap_err();
            assert!(message.contains(wanted), "{message:?} lacks {wanted:?}");
            assert_eq!(message.lines().count(), 1);
        }
    }

    #[test]
    fn an_endless_line_is_refused_without_reading_it() {
        let source = BufReader::new(std::io::repeat(b'7').take(1 << 30));
        let message = Log::parse("run.csv", source).unwrap_err().to_string();
        assert!(message.contains("a line longer than"), "{message}");
    }
}
