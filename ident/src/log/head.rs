//! The head of a log: its format, a comment line for each key and each event, and the header.
//!
//! What it is: values as TOML, each on one line.
//! What can go wrong: a text may hold a line's end, however deep in a table it lies; it is escaped. A value that no rig can have is refused at its line.
//! Units: as the keys state.
//! Reference: specification `formats.md`, "Rig log"; TOML 1.0.

use super::lines::Lines;
use super::names::check_header;
use super::{FORMAT, Log, Place, ReadError, flight_log, short};
use std::io::BufRead;
use std::path::Path;
use toml::Value;

/// A number of a rig's head: its key, what it may be, and the same in words.
struct Stated {
    key: &'static str,
    may_be: fn(f64) -> bool,
    expected: &'static str,
}

/// The numbers that the program reckons with.
const STATED: [Stated; 8] = [
    Stated { key: "sample_hz", may_be: |hz| hz > 0.0, expected: "a number of rows a second above 0 in the head" },
    Stated {
        key: "pole_pairs",
        may_be: |pairs| pairs.fract() == 0.0 && (1.0..=100.0).contains(&pairs),
        expected: "a whole number of pole pairs from 1 to 100, half the motor's magnets",
    },
    Stated {
        key: "blades",
        may_be: |blades| blades.fract() == 0.0 && (1.0..=12.0).contains(&blades),
        expected: "a whole number of blades from 1 to 12",
    },
    Stated { key: "diameter_m", may_be: |d| d > 0.0, expected: "the propeller's diameter in m, above 0" },
    Stated { key: super::plausible::AIR, may_be: |air| air > 0.0, expected: "the air's density in kg/m^3, such as 1.2" },
    Stated { key: "temp_c", may_be: |t| (-90.0..=200.0).contains(&t), expected: "a temperature from -90 to 200 degrees Celsius" },
    Stated { key: "pressure_hpa", may_be: |p| (1.0..=2000.0).contains(&p), expected: "a pressure from 1 to 2000 hPa" },
    Stated { key: "pressure_pa", may_be: |p| (100.0..=200_000.0).contains(&p), expected: "a pressure from 100 to 200000 Pa" },
];

/// A key with a value that no rig can have, and what is expected in its place.
pub(crate) fn odd(table: &toml::Table) -> Option<(&'static str, &Value, &'static str)> {
    let number = |value: &Value| value.as_float().or_else(|| value.as_integer().map(|n| n as f64)).filter(|v| v.is_finite());
    let odd = |stated: &Stated| {
        let found = table.get(stated.key).filter(|found| number(found).is_none_or(|v| !(stated.may_be)(v)))?;
        Some((stated.key, found, stated.expected))
    };
    STATED.iter().find_map(odd)
}

/// The texts of a rig's head that name it and its run.
const TEXTS: [&str; 4] = ["motor", "propeller", "supply", "date"];

/// Reads a log's first line, what travels with it, and the names of its columns.
pub(super) fn read_head<R: BufRead>(format: &str, lines: &mut Lines<'_, R>, log: &mut Log) -> Result<Vec<String>, ReadError> {
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
                        flight_log::FORMAT => place.refuse(
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
                    check(&table, &place)?;
                }
                log.meta.extend(table);
            } else if let Some((key, value)) = misread(comment) {
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

/// Key and value of a comment that is no TOML although it names the rig.
pub(super) fn misread(comment: &str) -> Option<(&str, &str)> {
    let (key, value) = comment.split_once('=').map(|(key, value)| (key.trim(), value.trim()))?;
    (TEXTS.contains(&key) && !value.is_empty()).then_some((key, value))
}

/// Refuses a value of the head that no rig can have; `place` is its line.
pub(crate) fn check(table: &toml::Table, place: &Place<'_>) -> Result<(), ReadError> {
    let Some((key, value, wanted)) = odd(table) else { return Ok(()) };
    let found = format!("{key} = {}", short(&value.to_string()));
    Err(place.refuse(None, found, format!("{wanted}: mend it, or take the line out")))
}

/// The line of a key in the head of a file, from 1.
pub(super) fn line_of(path: &Path, key: &str) -> Option<usize> {
    let head = super::plausible::head_of(path);
    let of = |line: &String| Some(line.strip_prefix('#')?.parse::<toml::Table>().ok()?.contains_key(key));
    head.iter().position(|line| of(line) == Some(true)).map(|n| n + 1)
}

/// The comment line of a key and its value: one line, whatever the value.
#[must_use]
pub fn meta_line(key: &str, value: &toml::Value) -> String {
    let bare = !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c));
    let key = if bare { key.to_owned() } else { basic(key) };
    let said = value.to_string();
    // the file would end the comment at a line's end
    format!("# {key} = {}", if said.contains(['\n', '\r']) { on_one_line(value) } else { said })
}

/// A value in which every line's end is escaped, however deep it lies.
fn on_one_line(value: &toml::Value) -> String {
    match value {
        toml::Value::String(text) => basic(text),
        toml::Value::Array(all) => format!("[{}]", all.iter().map(on_one_line).collect::<Vec<_>>().join(", ")),
        toml::Value::Table(table) => {
            let pairs: Vec<String> = table.iter().map(|(k, v)| format!("{} = {}", basic(k), on_one_line(v))).collect();
            format!("{{ {} }}", pairs.join(", "))
        }
        other => other.to_string(),
    }
}

/// A basic string of TOML.
fn basic(text: &str) -> String {
    let escaped = |c: char| match c {
        '\\' => "\\\\".to_owned(),
        '"' => "\\\"".to_owned(),
        '\n' => "\\n".to_owned(),
        '\r' => "\\r".to_owned(),
        '\t' => "\\t".to_owned(),
        c if c.is_control() => format!("\\u{:04X}", u32::from(c)),
        c => c.to_string(),
    };
    format!("\"{}\"", text.chars().map(escaped).collect::<String>())
}

/// The comment line of an event.
#[must_use]
pub fn event_line(text: &str) -> String {
    meta_line("event", &toml::Value::String(text.to_owned()))
}

/// The event that a comment tells, if it tells one.
pub(crate) fn event(comment: &str) -> Option<String> {
    let table = comment.strip_prefix("event").and_then(|_| comment.parse::<toml::Table>().ok())?;
    table.get("event")?.as_str().map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::super::Log;

    /// A text of two lines inside a table of the head, and a key that is no bare one.
    #[test]
    fn a_head_stays_on_its_lines() {
        let text = "# quadrig-log 1\n# source = { \"by hand\" = \"one\\ntwo \\\"three\\\"\", of = [\"a\\r\"] }\n# \"a b\" = 1\nt_s,rpm,thrust_n\n0,1,1\n";
        let log = Log::parse("a.csv", text.as_bytes()).expect("a log");
        let mut written = Vec::new();
        log.write_to(&mut written).expect("memory");
        let again = Log::parse("b.csv", written.as_slice()).expect("what was written");
        assert_eq!(again.meta, log.meta);
        assert_eq!(again.meta.len(), 2);
    }
}
