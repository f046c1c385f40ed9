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
mod lines;
mod names;
pub(crate) mod plausible;
pub(crate) use plausible::STANDSTILL;
pub mod quantity;
mod rig;
mod row;
pub mod sparse;
mod whole;

pub use disc::Disc;
pub use gaps::Gaps;
pub(crate) use head::{check as check_head, event, odd as odd_in_head};
pub use head::{event_line, meta_line};
pub(crate) use lines::{Lines, digest_of};
pub use lines::{MAX_LINE, digest};
pub(crate) use names::named_shortly;
pub use rig::{Named, OtherRig, named_alike};
pub(crate) use row::FARTHEST;
pub use whole::{folder_of, no_regular_file, place_of, what_lies_at, write_whole};

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;

/// First line of the format.
pub const FORMAT: &str = "quadrig-log 1";
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
            let mut text = lines::Digesting::new();
            // nothing that is kept in memory fails to take bytes
            let _ = self.write_to(&mut text);
            text.finish()
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
        let header = head::read_head(format, &mut lines, &mut log)?;
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
            let whole = header.len() == row::fields_of(&line);
            if let Some(t) = clock::first_field(&line).filter(|t| whole && log.t.last().is_some_and(|last| t < last)) {
                return Err(clock::stepped_back(t, &log, &row_lines, &place, &mut lines)?);
            }
            row_lines.push(place.line);
            row::read_row(&line, &header, &place, &mut log)?;
        }
        if log.is_empty() {
            return Err(lines.place().refuse(None, "no data rows", "at least one line of numbers under the header"));
        }
        if format == FORMAT {
            clock::check(&log, file, &row_lines)?;
        }
        log.sha256 = Some(lines.finish());
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

/// A text as a refusal repeats it: 40 characters, and three dots in the place of more.
#[must_use]
pub fn short(text: &str) -> String {
    if text.chars().count() > 40 { text.chars().take(40).chain("...".chars()).collect() } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

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
