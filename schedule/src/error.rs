//! Why a schedule was refused.

use std::path::{Path, PathBuf};

/// Why a schedule was refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScheduleError {
    /// The text is no schedule.
    #[error("{}:{line}:{column}: {reason}", file.display())]
    Refused {
        /// File that was read.
        file: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What was found and what was expected.
        reason: String,
    },
    /// The file cannot be read.
    #[error("{}: cannot be read ({source}); expected a file: check name and folder", file.display())]
    Unreadable {
        /// File that was to be read.
        file: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
}

impl ScheduleError {
    /// Something is wrong at a byte of a text.
    pub(crate) fn at(file: &Path, text: &str, byte: usize, reason: impl Into<String>) -> Self {
        let before = text.get(..byte.min(text.len())).unwrap_or(text);
        let line = before.matches('\n').count() + 1;
        let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
        Self::Refused { file: file.to_owned(), line, column, reason: reason.into() }
    }

    /// The text of a file.
    pub(crate) fn text_of(file: &Path) -> Result<String, Self> {
        std::fs::read_to_string(file).map_err(|source| match source.kind() {
            std::io::ErrorKind::InvalidData => {
                Self::at(file, "", 0, "bytes that are no text in UTF-8; expected a schedule in TOML, or a verdict in JSON")
            }
            _ => Self::Unreadable { file: file.to_owned(), source },
        })
    }
}
