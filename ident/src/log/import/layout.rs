//! How a table is laid out: what parts its fields, where its header stands, which marks its numbers have.
//!
//! What it is: a look at the head of a file and at all its cells, before a column is read.
//! What can go wrong: no header (columns are called by their position), two decimal marks (refused); lines above the header are left out and
//! counted.
//! Units: a line of units under the header joins it.
//! Reference: RFC 4180; `sep=;` of spreadsheet programs; numpy's `savetxt`, whose header is a comment.

use super::header;
use super::number::{Cell, Evidence, Marks, POINT, cell};
use super::text::Text;
use super::unit::Quantity;
use super::{Options, Report};
use crate::log::{self, Place, ReadError};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Records in which a header is looked for.
const HEAD: usize = 40;

/// A table before it is read.
#[derive(Debug)]
pub(super) struct Layout<'t> {
    /// The text, fields parted by one byte.
    pub(super) content: Cow<'t, str>,
    /// Whether its last line ended with a line feed in the file.
    pub(super) whole: bool,
    /// That byte.
    pub(super) separator: u8,
    /// Header cells.
    pub(super) cells: Vec<String>,
    /// Line of the header.
    pub(super) line: u64,
    /// No header line: cells are positions.
    pub(super) headless: bool,
    /// The first line that can be data.
    pub(super) data_from: u64,
    /// How numbers are written.
    pub(super) marks: Marks,
    /// `key = value` comments above the table.
    pub(super) meta: BTreeMap<String, toml::Value>,
    /// `event` comments.
    pub(super) events: Vec<String>,
}

/// The records of a text, comments and empty lines left out, each with its line.
pub(super) struct Records<'t> {
    reader: csv::Reader<&'t [u8]>,
    record: csv::StringRecord,
}

impl<'t> Records<'t> {
    pub(super) fn new(content: &'t str, separator: u8) -> Self {
        let reader = csv::ReaderBuilder::new()
            .delimiter(separator)
            .has_headers(false)
            .flexible(true)
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(content.as_bytes());
        Self { reader, record: csv::StringRecord::new() }
    }

    /// The next record and the line that it ends on: what was skipped before it counts.
    pub(super) fn next(&mut self) -> Option<(u64, &csv::StringRecord)> {
        // the text is UTF-8 and records may differ in length: nothing else can fail
        if !self.reader.read_record(&mut self.record).unwrap_or(false) {
            return None;
        }
        Some((self.reader.position().line().saturating_sub(1).max(1), &self.record))
    }
}

/// A record and the line that it begins on.
type Line = (u64, Vec<String>);

fn first(content: &str, separator: u8) -> Vec<Line> {
    let (mut records, mut out) = (Records::new(content, separator), Vec::new());
    while let Some((line, record)) = records.next() {
        out.push((line, record.iter().map(str::to_owned).collect()));
        if out.len() == HEAD {
            break;
        }
    }
    out
}

/// Finds the layout of a text.
pub(super) fn find<'t>(file: &str, text: &'t Text, options: &Options, report: &mut Report) -> Result<Layout<'t>, ReadError> {
    let refuse = |line: u64, found: &str, expected: &str| Err(Place { file, line: line as usize }.refuse(None, found, expected));
    let known = |cells: &[String]| {
        let mapped = options.mappings.iter().filter(|m| cells.contains(&m.source)).count();
        header::known(cells) + mapped
    };
    let (content, separator) = separated(&text.content, &known);
    let mut lines = first(&content, separator);
    lines.retain(|(_, cells)| !(cells.len() <= 2 && cells.first().is_some_and(|c| c.starts_with("sep="))));
    if lines.is_empty() {
        return refuse(1, "the file is empty or ends before its header", "a CSV with one header line");
    }
    // the first of the lines with the most known names
    let best = lines.iter().map(|(_, cells)| known(cells)).max().unwrap_or(0);
    let at = lines.iter().position(|(_, cells)| known(cells) == best).unwrap_or(0);
    let at = if best == 0 { 0 } else { at };
    let (line, mut cells) = lines[at].clone();
    while cells.len() > 1 && cells.last().is_some_and(String::is_empty) {
        cells.pop();
    }
    let (mut headless, mut data_from) = (false, line + 1);
    let (meta, events, comment) = comments(file, &content, line)?;
    if cells.iter().all(|c| matches!(cell(c, POINT), Cell::Number(_))) || cells.iter().all(|c| c.parse::<f64>().is_ok()) {
        data_from = line;
        let width = cells.len();
        let split = |text: &str| text.split(char::from(separator)).map(|c| c.trim().to_owned()).collect::<Vec<_>>();
        match comment.map(|c| split(&c)).filter(|c| c.len() == width && known(c) > 0) {
            Some(named) => {
                report.add("(file)", "the comment above the first row is its header", 1);
                cells = named;
            }
            None if options.mappings.is_empty() => {
                let expected =
                    format!("a header line, or columns named by their position (1 to {width}), such as --map rpm=5*65");
                return refuse(line, "numbers where a header should stand", &expected);
            }
            None => {
                report.add("(file)", "no header line: columns are called by their position; those without --map are left out", 1);
                (headless, cells) = (true, (1..=width).map(|k| k.to_string()).collect());
            }
        }
    } else if let Some((below, units)) = lines.get(at + 1).filter(|(_, units)| are_units(units)) {
        for (cell, unit) in cells.iter_mut().zip(units).filter(|(_, unit)| !unit.is_empty()) {
            let unit = unit.trim_matches(['(', ')', '[', ']']);
            *cell = format!("{cell} ({unit})");
        }
        report.add("(file)", "a line of units under the header: joined to it", 1);
        data_from = below + 1;
    }
    report.add("(file)", "lines above the header: left out", at);
    let marks = marks(file, &content, separator, data_from)?;
    if marks != POINT {
        report.add("(file)", "decimal comma: 1.234,5 is read as 1234.5", 1);
    }
    Ok(Layout { content, whole: text.whole, separator, cells, line, headless, data_from, marks, meta, events })
}

fn are_units(cells: &[String]) -> bool {
    let units = cells.iter().filter(|c| !c.is_empty());
    units.clone().count() > 1 && units.into_iter().all(|u| Quantity::any_unit(u.trim_matches(['(', ')', '[', ']'])))
}

/// What parts the fields: the best known header decides, then how even the records are, then their width. Blanks become tabs.
fn separated<'t>(content: &'t str, known: &dyn Fn(&[String]) -> usize) -> (Cow<'t, str>, u8) {
    let score = |content: &str, separator: u8| {
        let lines = first(content, separator);
        let names = lines.iter().map(|(_, cells)| known(cells)).max().unwrap_or(0);
        let mut widths: BTreeMap<usize, usize> = BTreeMap::new();
        lines.iter().for_each(|(_, cells)| *widths.entry(cells.len()).or_default() += 1);
        let (width, even) = widths.into_iter().max_by_key(|(_, count)| *count).unwrap_or((0, 0));
        if width < 2 && names < 2 { (0, 0, 0) } else { (names, even, width) }
    };
    let best = [b';', b'\t', b','].into_iter().map(|s| (score(content, s), s)).max_by_key(|(score, _)| *score);
    match best {
        Some((score, separator)) if score > (0, 0, 0) => (Cow::Borrowed(content), separator),
        _ => {
            let tabs: String = content.lines().map(|l| l.split_whitespace().collect::<Vec<_>>().join("\t") + "\n").collect();
            if score(&tabs, b'\t') > (0, 0, 0) { (Cow::Owned(tabs), b'\t') } else { (Cow::Borrowed(content), b',') }
        }
    }
}

/// What the comments above a line tell: metadata, events, and the last of them.
type Comments = (BTreeMap<String, toml::Value>, Vec<String>, Option<String>);

/// The comments above a line.
fn comments(file: &str, content: &str, line: u64) -> Result<Comments, ReadError> {
    let (mut meta, mut events, mut last) = (BTreeMap::new(), Vec::new(), None);
    for (n, text) in content.lines().take(line.saturating_sub(1) as usize).enumerate() {
        let Some(comment) = text.strip_prefix('#').map(str::trim) else { continue };
        if let Some(event) = log::event(comment) {
            events.push(event);
        } else if let Ok(table) = comment.parse::<toml::Table>() {
            log::check_head(&table, &Place { file, line: n + 1 })?;
            meta.extend(table);
        }
        last = Some(comment.to_owned());
    }
    Ok((meta, events, last))
}

/// The marks of the numbers, from every cell.
fn marks(file: &str, content: &str, separator: u8, from: u64) -> Result<Marks, ReadError> {
    let mut evidence = Evidence::default();
    if !content.contains(',') || (separator == b',' && !content.contains('"')) {
        return Ok(POINT);
    }
    let mut records = Records::new(content, separator);
    while let Some((line, record)) = records.next() {
        if line >= from {
            record.iter().for_each(|c| evidence.add(line, c));
        }
    }
    evidence.marks(separator).map_err(|(comma, point)| {
        let found = format!("a decimal point, and on line {comma} a decimal comma");
        Place { file, line: point as usize }.refuse(None, found, "one decimal mark in the whole file")
    })
}
