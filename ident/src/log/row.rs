//! One row of a log.
//!
//! What it is: as many numbers as the header has names; an empty field is a missing sample.
//! What can go wrong: a decimal comma makes one field too many: the refusal names the column that it most likely cut.
//! Units: as the names of the columns say.
//! Reference: specification `formats.md`, "Rig log".

use crate::log::{Log, MODELLED, Place, ReadError, short};

/// Largest reading of a modelled channel: a hundred times the electrical turns of the fastest rotor.
const READ: f64 = 1e7;
/// Largest number of any column: sums of a million of its squares still have an end.
pub(crate) const FARTHEST: f64 = 1e30;

/// Number of fields of a row.
pub(super) fn fields_of(line: &str) -> usize {
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

pub(super) fn read_row(line: &str, header: &[String], place: &Place<'_>, log: &mut Log) -> Result<(), ReadError> {
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
