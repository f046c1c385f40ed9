//! The mutants of a package, as cargo-mutants lists them.
//!
//! What it is: for each its name, its file, the text that goes and the text that comes.
//!
//! What can go wrong: a list of another form, from another release of the tool.
//!
//! Units: bytes from the start of a file.
//!
//! Reference: `cargo mutants --list --json`.

use crate::run::Failure;
use serde_json::Value;
use std::ops::Range;

/// What is changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Genre {
    /// A function's body.
    FnValue,
    BinaryOperator,
    /// It goes.
    UnaryOperator,
    /// It goes.
    MatchArm,
    MatchArmGuard,
    /// A field of a struct that is filled up from another value: it goes.
    StructField,
}

/// Line and column, from 1, the column in characters.
pub(super) type Spot = (usize, usize);

/// A mutant.
#[derive(Debug, Clone)]
pub(super) struct Mutant {
    /// `file:line:column: change`.
    pub(super) name: String,
    pub(super) file: String,
    /// What goes.
    pub(super) span: (Spot, Spot),
    /// What comes.
    pub(super) replacement: String,
    pub(super) genre: Genre,
    /// What the function around it gives back, `-> T`.
    pub(super) returns: String,
}

/// The mutants of a list.
pub(super) fn read(json: &str) -> Result<Vec<Mutant>, Failure> {
    let whole: Value = serde_json::from_str(json)?;
    let rows = whole.as_array().map(Vec::as_slice).unwrap_or_default();
    rows.iter().map(|row| mutant(row).ok_or_else(|| Failure(format!("cargo-mutants lists what is no mutant: {row}")))).collect()
}

fn mutant(row: &Value) -> Option<Mutant> {
    let word = |key: &str| row[key].as_str().map(str::to_owned);
    let number = |value: &Value| value.as_u64().and_then(|n| usize::try_from(n).ok());
    let spot = |end: &str| Some((number(&row["span"][end]["line"])?, number(&row["span"][end]["column"])?));
    let genre = match row["genre"].as_str()? {
        "FnValue" => Genre::FnValue,
        "BinaryOperator" => Genre::BinaryOperator,
        "UnaryOperator" => Genre::UnaryOperator,
        "MatchArm" => Genre::MatchArm,
        "MatchArmGuard" => Genre::MatchArmGuard,
        "StructField" => Genre::StructField,
        _ => return None,
    };
    Some(Mutant {
        name: word("name")?,
        file: word("file")?,
        span: (spot("start")?, spot("end")?),
        replacement: word("replacement")?,
        genre,
        returns: row["function"]["return_type"].as_str().unwrap_or_default().to_owned(),
    })
}

/// Where the lines of a text begin.
pub(super) struct Lines<'t> {
    text: &'t str,
    starts: Vec<usize>,
}

impl<'t> Lines<'t> {
    pub(super) fn of(text: &'t str) -> Self {
        let starts = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        Self { text, starts }
    }

    /// The byte at which a spot lies.
    pub(super) fn byte(&self, (line, column): Spot) -> Option<usize> {
        let start = *self.starts.get(line.checked_sub(1)?)?;
        let rest = self.text.get(start..)?;
        let within = rest.char_indices().map(|(at, _)| at).chain([rest.len()]).nth(column.checked_sub(1)?)?;
        Some(start + within)
    }

    /// The bytes between two spots.
    pub(super) fn bytes(&self, (start, end): (Spot, Spot)) -> Option<Range<usize>> {
        Some(self.byte(start)?..self.byte(end)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_read_or_refused() {
        let json = r#"[{"name": "a/src/lib.rs:1:2: replace + with -", "package": "a", "file": "a/src/lib.rs",
            "function": {"function_name": "f", "return_type": "-> u8"}, "replacement": "-", "genre": "BinaryOperator",
            "span": {"start": {"line": 1, "column": 2}, "end": {"line": 1, "column": 3}}}]"#;
        let list = read(json).unwrap();
        assert_eq!((list[0].span, list[0].genre), (((1, 2), (1, 3)), Genre::BinaryOperator));
        assert_eq!(list[0].returns, "-> u8");
        assert!(read(&json.replace("BinaryOperator", "Other")).is_err());
    }

    #[test]
    fn columns_count_characters() {
        let lines = Lines::of("// µ\nlet µ = 1 + 2;\n");
        assert_eq!(lines.bytes(((2, 11), (2, 12))), Some(17..18));
        assert_eq!((lines.byte((9, 1)), lines.byte((0, 1))), (None, None));
    }
}
