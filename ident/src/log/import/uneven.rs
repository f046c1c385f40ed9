//! Lines of a table that are no row of it: fewer fields than the others, or swallowed by a quotation mark.
//!
//! What it is: a field that is missing moves those behind it, so that the row is dropped; each kind is counted, with its first line.
//! What can go wrong: where more than a fifth would go the file is refused: it is not the table that its header promises.
//! Units: none.
//! Reference: specification `formats.md`, `quadrig import`; RFC 4180 (quoted fields).

use super::Report;
use super::layout::{Layout, Records};
use super::repair::DROPPED;
use crate::log::{Place, ReadError};
use std::cell::OnceCell;
use std::collections::BTreeMap;

/// Some lines: how many, and the first of them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Lines {
    count: usize,
    first: Option<u64>,
}

impl Lines {
    fn add(&mut self, line: u64, count: usize) {
        if count > 0 {
            self.count += count;
            self.first = self.first.or(Some(line));
        }
    }

    fn tell(&self, report: &mut Report, what: &str) {
        if let Some(first) = self.first {
            report.add("(file)", format!("{what}, the first on line {first}"), self.count);
        }
    }
}

/// The lines of a table that are no row of it.
pub(super) struct Uneven<'l> {
    layout: &'l Layout<'l>,
    /// Fields that the header promises.
    width: usize,
    /// Fields that most rows have: a program may leave out the last ones where they are empty. Counted where a row is short.
    usual: OnceCell<usize>,
    short: Lines,
    quoted: Lines,
    blank: Lines,
    /// Blank lines since the last row: at the end of a file they are no loss.
    pending: Lines,
    rows: usize,
}

impl<'l> Uneven<'l> {
    pub(super) fn of(layout: &'l Layout<'l>) -> Self {
        let (width, none) = (layout.cells.len(), Lines::default());
        Self { layout, width, usual: OnceCell::new(), short: none, quoted: none, blank: none, pending: none, rows: 0 }
    }

    /// Whether a record has fewer fields than the header and than most rows.
    pub(super) fn is_short(&self, fields: usize) -> bool {
        fields < self.width && fields < *self.usual.get_or_init(|| usual(self.layout))
    }

    pub(super) fn drop_short(&mut self, line: u64) {
        self.short.add(line, 1);
    }

    pub(super) fn leave_blank(&mut self, line: u64) {
        self.pending.add(line, 1);
    }

    /// Takes a row into account: what was blank before it, and the lines that stand inside its quotation marks; `line` is its last.
    pub(super) fn take(&mut self, line: u64, record: &csv::StringRecord) {
        let within: usize = record.iter().map(|cell| cell.matches('\n').count()).sum();
        self.quoted.add(line.saturating_sub(within as u64) + 1, within);
        if let Some(first) = self.pending.first {
            self.blank.add(first, self.pending.count);
        }
        self.pending = Lines::default();
        self.rows += 1;
    }

    /// Tells what was left out.
    ///
    /// # Errors
    /// [`ReadError`] at the first line where more than a fifth would go.
    pub(super) fn settle(&self, file: &str, report: &mut Report) -> Result<(), ReadError> {
        let (short, quoted) = (self.short, self.quoted);
        let dropped = short.count + quoted.count;
        let all = self.rows + dropped;
        if dropped as f64 > DROPPED * all as f64 {
            let worse = if short.count >= quoted.count { short } else { quoted };
            let likely = if short.count >= quoted.count {
                "fields left out, or two tables in one file?"
            } else {
                "a quotation mark without its fellow?"
            };
            let found = format!(
                "{dropped} of {all} rows would be dropped ({} have fewer fields than the others, {} stand inside quotation marks): {likely}",
                short.count, quoted.count
            );
            let place = Place { file, line: worse.first.unwrap_or(1) as usize };
            return Err(place.refuse(None, found, "rows with as many fields as the header has, at least four in five"));
        }
        short.tell(report, "rows with fewer fields than the others: row dropped");
        quoted.tell(report, "lines inside quotation marks: no rows");
        self.blank.tell(report, "rows without a value in any field: row dropped");
        Ok(())
    }
}

/// Fields of most rows; of as many the larger number.
fn usual(layout: &Layout<'_>) -> usize {
    let mut widths: BTreeMap<usize, usize> = BTreeMap::new();
    let mut records = Records::new(&layout.content, layout.separator);
    while let Some((line, record)) = records.next() {
        if line >= layout.data_from && !record.iter().all(str::is_empty) {
            *widths.entry(record.len()).or_default() += 1;
        }
    }
    widths.into_iter().max_by_key(|(_, count)| *count).map_or(0, |(width, _)| width)
}

#[cfg(test)]
mod tests {
    use crate::log::import::{Options, Report, import_from};

    /// What comes of twenty rows and more under a header whose last column is left out; each row by its number.
    fn import(rows: usize, row: impl Fn(usize) -> String) -> Result<(usize, Report), String> {
        let text: String = (0..rows).map(row).collect();
        let text = format!("t_s,rpm,thrust_n,Electrical Power (W)\n{text}");
        let found = import_from("x.csv", text.as_bytes(), &Options::default()).map_err(|e| e.to_string())?;
        Ok((found.0.len(), found.1))
    }

    fn whole(k: usize) -> String {
        format!("{k},{},1.5,20\n", 3000 + k)
    }

    /// A row that lacks its speed would have the thrust for it.
    #[test]
    fn a_row_with_fewer_fields_is_dropped_and_told() {
        let lacking = |every: usize| move |k: usize| if k % every == 3 { format!("{k},1.5,20\n") } else { whole(k) };
        let (rows, report) = import(40, lacking(10)).expect("a tenth");
        assert_eq!(rows, 36);
        let table = report.table();
        assert!(table.contains("4  rows with fewer fields than the others: row dropped, the first on line 5"), "{table}");
        let said = import(40, lacking(4)).expect_err("a quarter");
        assert!(said.starts_with("x.csv:5: 10 of 40 rows would be dropped (10 have fewer fields than the others"), "{said}");
        assert!(said.contains("two tables in one file?; expected rows with as many fields"), "{said}");
    }

    /// A program that never writes the last field is as good as its other fields.
    #[test]
    fn rows_that_all_lack_the_last_field_are_kept() {
        let (rows, report) = import(40, |k| format!("{k},{},1.5\n", 3000 + k)).expect("they are even");
        assert_eq!(rows, 40);
        assert!(!report.table().contains("fewer fields"), "{}", report.table());
    }

    /// A quotation mark in a column that is left out hides every row up to the next.
    #[test]
    fn rows_inside_quotation_marks_are_told_and_refused() {
        let quoted = |last: usize| {
            move |k: usize| match k {
                10 => format!("{k},3010,1.5,\"20\n"),
                k if k == last => format!("{k},{},1.5,20\"\n", 3000 + k),
                k => whole(k),
            }
        };
        let (rows, report) = import(40, quoted(13)).expect("three lines");
        assert_eq!(rows, 37);
        let table = report.table();
        assert!(table.contains("3  lines inside quotation marks: no rows, the first on line 13"), "{table}");
        let said = import(40, quoted(39)).expect_err("most of the file");
        assert!(said.starts_with("x.csv:13: 29 of 40 rows would be dropped") && said.contains("without its fellow?"), "{said}");
    }

    #[test]
    fn blank_rows_are_told_and_those_at_the_end_are_not() {
        let (rows, report) = import(40, |k| if k % 10 == 5 || k > 36 { ",,,\n".to_owned() } else { whole(k) }).expect("some");
        assert_eq!(rows, 33);
        let table = report.table();
        assert!(table.contains("4  rows without a value in any field: row dropped, the first on line 7"), "{table}");
    }
}
