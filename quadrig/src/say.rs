//! What is said on the terminal.
//!
//! What it is: [`say!`] for results on standard output, [`note!`] for remarks on standard error, and the two streams themselves.
//! What can go wrong: a reader that has seen enough (`quadrig ... | head`) ends nothing: what follows is dropped, and the files are still
//! written. Any other failure, a full disk behind `>`, is told once on standard error, and the exit status is 1.
//! Units: none.

use std::fmt::Arguments;
use std::io::{ErrorKind, Result, Write, stderr, stdout};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether standard output could not be written.
static LOST: AtomicBool = AtomicBool::new(false);

/// A line on standard output.
macro_rules! say {
    ($($text:tt)*) => { $crate::say::line(format_args!($($text)*)) };
}

/// A line on standard error.
macro_rules! note {
    ($($text:tt)*) => { $crate::say::remark(format_args!($($text)*)) };
}

/// A stream of which the reader may be gone.
#[derive(Debug)]
pub(crate) struct Heard<W>(W);

impl<W: Write> Write for Heard<W> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        match self.0.write(bytes) {
            Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(bytes.len()),
            other => other,
        }
    }

    fn flush(&mut self) -> Result<()> {
        match self.0.flush() {
            Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(()),
            other => other,
        }
    }
}

/// Standard output.
pub(crate) fn out() -> Heard<impl Write> {
    Heard(stdout().lock())
}

pub(crate) fn line(text: Arguments<'_>) {
    kept(out().write_fmt(format_args!("{text}\n")));
}

/// Text on standard output as it is, lines and all.
pub(crate) fn text(text: &str) {
    kept(out().write_all(text.as_bytes()));
}

pub(crate) fn remark(text: Arguments<'_>) {
    let _ = writeln!(stderr(), "{text}"); // there is no third stream to tell it on
}

fn kept(written: Result<()>) {
    if let Err(e) = written
        && !LOST.swap(true, Ordering::Relaxed)
    {
        note!("quadrig: standard output cannot be written ({e}); expected a terminal, a pipe or a file with room left");
    }
}

/// The exit status of a job that is done: a failure where a part of what it said is lost.
pub(crate) fn status() -> ExitCode {
    kept(out().flush());
    ExitCode::from(u8::from(LOST.load(Ordering::Relaxed)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Error;

    struct Fails(ErrorKind);

    impl Write for Fails {
        fn write(&mut self, _: &[u8]) -> Result<usize> {
            Err(Error::from(self.0))
        }

        fn flush(&mut self) -> Result<()> {
            Err(Error::from(self.0))
        }
    }

    #[test]
    fn a_reader_that_is_gone_is_no_failure_and_a_full_disk_is_one() {
        let mut gone = Heard(Fails(ErrorKind::BrokenPipe));
        assert!(gone.write_all(b"more").is_ok() && gone.flush().is_ok());
        let mut full = Heard(Fails(ErrorKind::StorageFull));
        assert!(full.write_all(b"more").is_err() && full.flush().is_err());
    }
}
