//! Lines of a text file, one after the other.
//!
//! What it is: a bounded reader that knows its place and keeps the digest of all that it read.
//! What can go wrong: a line longer than a megabyte, bytes that are no UTF-8, and carriage returns alone are refused with their place.
//! Units: none.
//! Reference: specification `formats.md`; FIPS 180-4 for SHA-256.

use crate::log::{Place, ReadError};
use sha2::{Digest, Sha256};
use std::io::{BufRead, Read, Write};

/// Longest line that a reader takes, bytes.
pub const MAX_LINE: usize = 1 << 20;

/// Bounded line reader that knows where it is.
pub(crate) struct Lines<'a, R> {
    file: &'a str,
    source: R,
    number: usize,
    /// Of every byte that was read.
    digest: Sha256,
}

/// A sink that keeps the digest of what is written to it.
pub(super) struct Digesting(Sha256);

impl Digesting {
    pub(super) fn new() -> Self {
        Self(Sha256::new())
    }

    /// What came in, in hexadecimal.
    pub(super) fn finish(self) -> String {
        hexadecimal(self.0)
    }
}

impl Write for Digesting {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// SHA-256 of bytes, as `sha256sum` prints it.
#[must_use]
pub fn digest(bytes: &[u8]) -> String {
    hexadecimal(Sha256::new_with_prefix(bytes))
}

/// SHA-256 of a text, as `sha256sum` prints it.
pub(crate) fn digest_of(text: &str) -> String {
    hexadecimal(Sha256::new_with_prefix(text))
}

fn hexadecimal(digest: Sha256) -> String {
    digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

impl<'a, R: BufRead> Lines<'a, R> {
    pub(crate) fn new(file: &'a str, source: R) -> Self {
        Self { file, source, number: 0, digest: Sha256::new() }
    }

    /// The digest of all that was read, in hexadecimal.
    pub(super) fn finish(self) -> String {
        hexadecimal(self.digest)
    }

    pub(crate) fn place(&self) -> Place<'a> {
        Place { file: self.file, line: self.number.max(1) }
    }

    /// The next line in a string of its own; `None` at the end.
    pub(crate) fn next_line(&mut self) -> Result<Option<String>, ReadError> {
        let mut text = String::new();
        Ok(self.read_into(&mut text)?.then_some(text))
    }

    /// The next line in place of what `text` held; false at the end.
    pub(super) fn read_into(&mut self, text: &mut String) -> Result<bool, ReadError> {
        let mut bytes = std::mem::take(text).into_bytes();
        bytes.clear();
        let n = (&mut self.source)
            .take(MAX_LINE as u64 + 1)
            .read_until(b'\n', &mut bytes)
            .map_err(|source| ReadError::Io { file: self.file.to_owned(), source })?;
        if n == 0 {
            return Ok(false);
        }
        self.digest.update(&bytes);
        self.number += 1;
        if self.number == 1 && bytes.trim_ascii_end().contains(&b'\r') {
            let found = "lines that end with a carriage return alone";
            return Err(self.place().refuse(None, found, "lines that end with a line feed: save the file so in an editor"));
        }
        if n > MAX_LINE {
            return Err(self.place().refuse(
                None,
                format!("a line longer than {MAX_LINE} bytes"),
                "a text file with one short line a sample",
            ));
        }
        while matches!(bytes.last(), Some(b'\n' | b'\r')) {
            bytes.pop();
        }
        if self.number == 1 && bytes.starts_with(&[0xEF, 0xBB, 0xBF]) {
            bytes.drain(..3);
        }
        *text = String::from_utf8(bytes)
            .map_err(|_| self.place().refuse(None, "bytes that are not UTF-8", "a CSV text file in UTF-8"))?;
        Ok(true)
    }
}
