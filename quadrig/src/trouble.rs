//! Files that cannot be read or written, in the words of every command.
//!
//! What it is: what the system says, and what to look at.
//! What can go wrong: nothing.
//! Units: none.
//! Reference: docs/errors.md.

use std::io::{Error, ErrorKind};
use std::path::Path;

/// A file that cannot be read.
pub(crate) fn unread<P: AsRef<Path>>(path: P) -> impl FnOnce(Error) -> String {
    move |e| {
        let file = path.as_ref().display();
        match e.kind() {
            ErrorKind::InvalidData => format!("{file}:1:1: bytes that are no text in UTF-8; expected a text file"),
            _ => format!("{file}: cannot be read ({e}); expected a file: check name and folder"),
        }
    }
}

/// A file or folder that cannot be written.
pub(crate) fn unwritten<P: AsRef<Path>>(path: P) -> impl FnOnce(Error) -> String {
    move |e| {
        format!("{}: cannot be written ({e}); expected a folder that is there, with rights and room", path.as_ref().display())
    }
}
