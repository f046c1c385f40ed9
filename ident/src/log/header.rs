//! From the first line of a log to the names of its columns.
//!
//! What it is: the format line, comments with what travels with the run, and the header.
//! What can go wrong: another format, a key twice, a name that the contract writes otherwise: each refusal says which line and what to do.
//! Units: as the names of the columns say.
//! Reference: specification `formats.md`, log.

use crate::log::head::{check, event, misread};
use crate::log::lines::Lines;
use crate::log::{FORMAT, Log, MODELLED, Place, ReadError, short};
use std::io::BufRead;

/// Longest name of a column, characters.
const LONGEST_NAME: usize = 200;

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
