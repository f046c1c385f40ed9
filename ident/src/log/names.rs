//! The names of a log's columns.
//!
//! What it is: the header line, cut at its commas and checked name by name.
//! What can go wrong: a name twice, none, one of another unit or in other letters: each refusal says which and what to do.
//! Units: as the names say.
//! Reference: specification `formats.md`, "Rig log".

use crate::log::{MODELLED, Place, ReadError};

/// Longest name of a column, characters.
const LONGEST_NAME: usize = 200;

/// The names of a header, the time first, each of them one that the contract may read.
pub(super) fn check_header(line: &str, place: &Place<'_>) -> Result<Vec<String>, ReadError> {
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
