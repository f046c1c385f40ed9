//! The table itself: columns planned, rows read.
//!
//! What it is: a foreign CSV becomes columns of numbers by the dictionary of [`super::header`].
//! What can go wrong: text in a column of numbers (refused with its place; a further column that holds mostly text is left out), fields
//! that are read missing, or too many (refused; of others see [`super::uneven`]), a quantity without a unit (its values may tell, else refused).
//! Units: the contract's.
//! Reference: specification `formats.md`, `quadrig import`.

use super::clock::{Stamp, stamp};
use super::header::{ELECTRICAL, Target, clean, quantity_of, sort_all, split_unit};
use super::layout::{Layout, Records};
use super::number::{Cell, cell};
use super::uneven::Uneven;
use super::{Mapping, Options, Report};
use crate::log::{Place, ReadError, named_shortly, short};

/// How a field becomes a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Reading {
    /// A decimal number times a factor plus an offset.
    Number(f64, f64),
    /// Date, time of day, or a number whose unit its size tells.
    Stamp,
    /// Electrical turns a minute, times this.
    Electrical(f64),
    /// A number whose unit is asked of the values.
    Unitless(&'static str),
}

/// A column while it is read.
#[derive(Debug, Clone)]
pub(super) struct Field {
    /// Name in the log.
    pub(super) name: String,
    /// Header cell.
    pub(super) cell: String,
    /// How it is read.
    pub(super) reading: Reading,
    /// Whether the user said so.
    pub(super) mapped: bool,
    /// Whether it is none of the contract's.
    further: bool,
    /// One value a row; of stamps the seconds.
    pub(super) values: Vec<f64>,
    /// How many cells were stamps with a colon, and whether all of them had a date.
    pub(super) stamps: (usize, bool),
    /// Words for a missing value.
    missing: usize,
    /// Cells of text, and the first of them.
    text: (usize, Option<(u64, String)>),
}

/// Plans the columns of a layout: for each header cell the place of its field, or nothing.
pub(super) fn plan(
    file: &str,
    layout: &Layout<'_>,
    options: &Options,
    report: &mut Report,
) -> Result<(Vec<Option<usize>>, Vec<Field>), ReadError> {
    let place = Place { file, line: layout.line as usize };
    layout.cells.iter().filter(|_| !layout.headless).try_for_each(|cell| named_shortly(cell, &place))?;
    for m in &options.mappings {
        if !layout.cells.contains(&m.source) {
            return Err(place.refuse(
                Some(&m.source),
                "no such column in the file",
                format!("one of: {}", layout.cells.join(", ")),
            ));
        }
        in_the_unit_of_its_target(m, &place)?;
        is_a_channel(m, &place, report)?;
    }
    let sorted = sort_all(&layout.cells);
    let sides = || sorted.iter().filter_map(|s| s.side);
    let wanted = options.side.or(sides().min()).unwrap_or(1);
    if options.side.is_some() && !sides().any(|s| s == wanted) {
        return Err(place.refuse(
            None,
            format!("no column of side {wanted}"),
            "headers such as 'Thrust B (kgf)'; leave out --side",
        ));
    }
    let (mut route, mut fields, mut skipped) = (Vec::new(), Vec::<Field>::new(), 0);
    for (cell, sorted) in layout.cells.iter().zip(&sorted) {
        let mapping = options.mappings.iter().find(|m| m.source == *cell);
        let own = sorted.side.is_none_or(|s| s == wanted);
        let further = |name: String| (name, Reading::Number(1.0, 0.0), true);
        let (mut name, mut reading, mut extra) = match (mapping, sorted.target.clone()) {
            (Some(m), _) => (m.target.clone(), Reading::Number(m.factor, m.offset), false),
            (None, _) if layout.headless => {
                skipped += 1;
                route.push(None);
                continue;
            }
            (None, Target::Skip) => {
                skipped += 1;
                route.push(None);
                continue;
            }
            (None, _) if !own => further(clean(cell)),
            (None, Target::Covariate(name)) => further(name),
            (None, Target::Keep(name, factor, offset)) => (name.to_owned(), Reading::Number(factor, offset), false),
            (None, Target::Stamp) => ("t_s".to_owned(), Reading::Stamp, false),
            (None, Target::Electrical(factor)) => (ELECTRICAL.to_owned(), Reading::Electrical(factor), false),
            (None, Target::Command(full)) => ("pulse_us".to_owned(), Reading::Number(1000.0 / full, 1000.0), false),
            (None, Target::Unitless("t_s")) => ("t_s".to_owned(), Reading::Stamp, false),
            (None, Target::Unitless(what)) => {
                let name = if ["pwm", "duty"].contains(&what) { "pulse_us" } else { what };
                (name.to_owned(), Reading::Unitless(what), false)
            }
            (None, Target::UnknownUnit(name)) => {
                return Err(place.refuse(
                    Some(cell),
                    format!("no known unit for {name}"),
                    format!("a unit in parentheses that can be converted, or --map {name}={cell}*FACTOR"),
                ));
            }
        };
        if let Some(before) = fields.iter().find(|f| f.name == name) {
            let expected = "one column for each channel (choose with --map)";
            if before.cell == *cell || mapping.is_some() || clean(cell) == name || extra {
                return Err(place.refuse(Some(cell), format!("a second column for {name}"), expected));
            }
            report.add(&name, format!("column '{}' is taken; '{cell}' is kept as a further column", before.cell), 1);
            (name, reading, extra) = further(clean(cell));
        }
        said(&name, cell, reading, report);
        route.push(Some(fields.len()));
        let (mapped, cell) = (mapping.is_some(), cell.clone());
        fields.push(Field {
            name,
            cell,
            reading,
            mapped,
            further: extra,
            values: Vec::new(),
            stamps: (0, true),
            missing: 0,
            text: (0, None),
        });
    }
    if sides().any(|s| s != wanted) {
        report.add(
            "(file)",
            format!("more than one powertrain: side {wanted} is the rig (--side); the others are further columns"),
            1,
        );
    }
    report.add("(file)", "columns left out: derived from others, or text", skipped);
    Ok((route, fields))
}

/// Says a conversion whose factor is known from the header.
fn said(name: &str, cell: &str, reading: Reading, report: &mut Report) {
    let factor = |f: f64| {
        let text = format!("{f}");
        if text.len() > 12 { format!("{f:.6}") } else { text }
    };
    let what = match reading {
        Reading::Number(f, 0.0) if f != 1.0 => format!("column '{cell}' converted, times {}", factor(f)),
        Reading::Number(f, offset) if offset != 0.0 => format!("column '{cell}' converted, times {f:.6} plus {}", factor(offset)),
        _ => return,
    };
    report.add(name, what, 1);
}

/// Refuses a column whose own head names another unit than its target's, where no factor says what to do about it.
fn in_the_unit_of_its_target(m: &Mapping, place: &Place<'_>) -> Result<(), ReadError> {
    let Some(((factor, offset), unit)) = converted(&m.target, &m.source).filter(|(c, _)| !m.stated && *c != (1.0, 0.0)) else {
        return Ok(());
    };
    let plus = if offset == 0.0 { String::new() } else { format!("+{offset}") };
    let (target, source) = (&m.target, &m.source);
    let expected = format!("a factor: --map '{target}={source}*{factor}{plus}' converts it, *1 keeps it as it is");
    Err(place.refuse(Some(source), format!("its head says {unit}, and {target} is in another unit"), expected))
}

/// Factor and offset by which a column's own unit becomes its target's, and that unit.
fn converted<'s>(target: &str, source: &'s str) -> Option<((f64, f64), &'s str)> {
    let unit = split_unit(source).1?;
    Some((quantity_of(target)?.of_unit(unit)?, unit))
}

/// Refuses a target that is a channel's name without its unit; says of any other that no channel has it.
fn is_a_channel(m: &Mapping, place: &Place<'_>, report: &mut Report) -> Result<(), ReadError> {
    if quantity_of(&m.target).is_some() || m.target == "thrust_rms_n" {
        return Ok(());
    }
    let meant = ["t_s", "pulse_us", "thrust_n", "torque_nm", "current_a", "voltage_v", "temp_c"];
    let stem = |channel: &&str| channel.rsplit_once('_').is_some_and(|(stem, _)| stem == m.target.to_lowercase());
    if let Some(channel) = meant.iter().find(|c| stem(c)) {
        return Err(place.refuse(
            Some(&m.source),
            format!("no channel is called {}", m.target),
            format!("--map '{channel}=...'"),
        ));
    }
    let known = format!("no channel is called so: a further column; the channels are rpm, {}", meant.join(", "));
    report.add(&m.target, known, 1);
    Ok(())
}

/// Reads every row into the fields; the line of each.
pub(super) fn read_rows(
    file: &str,
    layout: &Layout<'_>,
    route: &[Option<usize>],
    fields: &mut Vec<Field>,
    report: &mut Report,
) -> Result<Vec<u64>, ReadError> {
    let width = layout.cells.len();
    let lines = layout.content.lines().count() as u64;
    let (mut cut, mut records) = (0, Records::new(&layout.content, layout.separator));
    let (mut uneven, mut read) = (Uneven::of(layout), Vec::new());
    while let Some((line, record)) = records.next() {
        if line < layout.data_from {
            continue;
        }
        if record.iter().all(str::is_empty) {
            uneven.leave_blank(line);
            continue;
        }
        let place = Place { file, line: line as usize };
        let needed = route.iter().rposition(Option::is_some).map_or(0, |k| k + 1);
        let surplus = record.iter().skip(width).any(|c| !c.is_empty());
        if (record.len() < needed || surplus || uneven.is_short(record.len())) && !layout.whole && line == lines {
            cut = 1;
            break;
        }
        if record.len() < needed || surplus {
            let commas = if surplus && layout.separator == b',' { " (decimal commas? then export with semicolons)" } else { "" };
            let missing = layout.cells.get(record.len()).map(String::as_str);
            return Err(place.refuse(missing, format!("{} fields", record.len()), format!("{width} as in the header{commas}")));
        }
        if uneven.is_short(record.len()) {
            uneven.drop_short(line);
            continue;
        }
        uneven.take(line, record);
        read.push(line);
        for (text, k) in record.iter().zip(route) {
            let Some(field) = k.and_then(|k| fields.get_mut(k)) else { continue };
            let value = field.read(text, line, layout, &place)?;
            field.values.push(value);
        }
    }
    uneven.settle(file, report)?;
    report.add("(file)", "last line cut short without a line feed: dropped", cut);
    for field in fields.iter().filter(|f| f.missing > 0) {
        report.add(&field.name, "words or signs for no value (NaN, inf, -, n/a), kept as missing", field.missing);
    }
    settle_text(file, fields, report)?;
    Ok(read)
}

impl Field {
    fn read(&mut self, text: &str, line: u64, layout: &Layout<'_>, place: &Place<'_>) -> Result<f64, ReadError> {
        match cell(text, layout.marks) {
            Cell::Number(v) => Ok(match self.reading {
                Reading::Number(factor, offset) => v * factor + offset,
                _ => v,
            }),
            Cell::Empty => Ok(f64::NAN),
            Cell::Missing => {
                self.missing += 1;
                Ok(f64::NAN)
            }
            Cell::Text if self.reading == Reading::Stamp => match stamp(text) {
                Some(Stamp { seconds, dated }) => {
                    self.stamps = (self.stamps.0 + 1, self.stamps.1 && dated);
                    Ok(seconds)
                }
                None => {
                    let expected = "seconds with a unit in the header, or a date and time such as 2019-11-05 17:14:08.947";
                    Err(place.refuse(Some(&self.cell), format!("'{}'", short(text)), expected))
                }
            },
            Cell::Text if self.further => {
                self.text.0 += 1;
                self.text.1.get_or_insert_with(|| (line, text.to_owned()));
                Ok(f64::NAN)
            }
            Cell::Text => Err(not_a_number(place, &self.cell, text)),
        }
    }
}

fn not_a_number(place: &Place<'_>, cell: &str, text: &str) -> ReadError {
    place.refuse(Some(cell), format!("'{}'", short(text)), "a decimal number, or an empty field for a missing sample")
}

/// A further column of words is left out; one of numbers with a word in it is refused.
fn settle_text(file: &str, fields: &mut Vec<Field>, report: &mut Report) -> Result<(), ReadError> {
    let mut refused = None;
    fields.retain(|f| {
        let numbers = f.values.iter().filter(|v| v.is_finite()).count();
        match &f.text {
            (0, _) | (_, None) => true,
            (words, Some((line, text))) if 2 * words < numbers => {
                refused.get_or_insert_with(|| not_a_number(&Place { file, line: *line as usize }, &f.cell, text));
                true
            }
            (words, _) => {
                report.add(&f.name, "cells of text: column left out", *words);
                false
            }
        }
    });
    refused.map_or(Ok(()), Err)
}
