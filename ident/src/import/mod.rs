//! Other people's exports become rig logs, and everything that was repaired on the way is counted.
//!
//! What it is: one reader a family of files, one set of repair rules, one report.
//! What can go wrong: real loggers repeat and step back time stamps and leave blanks; each repair has a stated rule and a count.
//! Units: converted to the contract's on the way in; the factor stands in the report.
//! Reference: specification `formats.md`, `quadrig import`; RCbenchmark and Tyto CSV headers carry their units in parentheses.

mod blackbox;
mod findings;
mod flight;
mod header;
mod streams;
mod table;
mod ulog;

pub use flight::{flight, flight_from};
pub use table::{Mapping, import, import_from};

/// Whether a file begins with these bytes.
fn begins(path: &std::path::Path, magic: &[u8]) -> std::io::Result<bool> {
    use std::io::Read;
    let mut head = Vec::with_capacity(magic.len());
    std::fs::File::open(path)?.take(magic.len() as u64).read_to_end(&mut head)?;
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
    fn add(&mut self, column: &str, what: impl Into<String>, count: usize) {
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
