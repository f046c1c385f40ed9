//! Other programs, run from here.
//!
//! What it is: cargo and friends as child processes whose output passes through.
//!
//! What can go wrong: a program that is missing or fails; the message quotes the command.
//!
//! Units: none.
//!
//! Reference: cargo's environment variables, The Cargo Book.

use crate::place::Place;
use std::ffi::OsStr;
use std::fmt;
use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};

/// Why a task ended: one line.
#[derive(Debug)]
pub(crate) struct Failure(pub(crate) String);

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl<T: fmt::Display> From<T> for Failure
where
    T: std::error::Error,
{
    fn from(error: T) -> Self {
        Self(error.to_string())
    }
}

/// Cargo in the workspace root, by the very program that runs us.
pub(crate) fn cargo(place: &Place, words: &[&str]) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.args(words).current_dir(&place.root);
    command
}

/// The command as a person would type it.
fn typed(command: &Command) -> String {
    let program = std::path::Path::new(command.get_program()).file_name().unwrap_or(command.get_program());
    let words = std::iter::once(program).chain(command.get_args()).map(OsStr::to_string_lossy);
    words.collect::<Vec<_>>().join(" ")
}

/// Runs a command to its end; its output passes through.
pub(crate) fn run(command: &mut Command) -> Result<(), Failure> {
    let words = typed(command);
    println!("$ {words}");
    let status =
        command.stdin(Stdio::null()).status().map_err(|error| Failure(format!("`{words}` cannot be started: {error}")))?;
    if status.success() { Ok(()) } else { Err(Failure(format!("`{words}` failed ({status})"))) }
}

/// Runs a command and returns its standard output.
pub(crate) fn output(command: &mut Command) -> Result<String, Failure> {
    let words = typed(command);
    let done = command
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .map_err(|error| Failure(format!("`{words}` cannot be started: {error}")))?;
    if !done.status.success() {
        return Err(Failure(format!("`{words}` failed ({})", done.status)));
    }
    Ok(String::from_utf8_lossy(&done.stdout).trim().to_owned())
}

/// How many checks passed and failed.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Tally {
    /// Checks that held.
    pub(crate) passed: usize,
    /// Checks that did not.
    pub(crate) failed: usize,
}

impl Tally {
    fn read(&mut self, line: &str) {
        let Some(rest) = line.trim().strip_prefix("test result: ") else { return };
        for part in rest.split(['.', ';']) {
            match part.trim().split_once(' ') {
                Some((n, "passed")) => self.passed += n.parse().unwrap_or(0),
                Some((n, "failed")) => self.failed += n.parse().unwrap_or(0),
                _ => {}
            }
        }
    }
}

/// Runs a test command; its output passes through while its summary lines are counted.
pub(crate) fn tests(command: &mut Command, tally: &mut Tally) -> Result<(), Failure> {
    let words = typed(command);
    println!("$ {words}");
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .map_err(|error| Failure(format!("`{words}` cannot be started: {error}")))?;
    if let Some(stdout) = child.stdout.take() {
        let mut out = std::io::stdout().lock();
        for line in BufReader::new(stdout).lines() {
            let line = line?;
            tally.read(&line);
            writeln!(out, "{line}")?;
        }
    }
    let status = child.wait()?;
    if status.success() { Ok(()) } else { Err(Failure(format!("`{words}` failed ({status})"))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn summary_lines_are_counted_and_others_are_not() {
        let mut tally = Tally::default();
        for line in [
            "running 3 tests",
            "test result: ok. 12 passed; 0 failed; 1 ignored; 0 measured; 3 filtered out; finished in 0.10s",
            "test result: FAILED. 2 passed; 1 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.10s",
            "a test printed 7 passed; 7 failed",
        ] {
            tally.read(line);
        }
        assert_eq!(tally, Tally { passed: 14, failed: 1 });
    }

    #[test]
    fn a_failing_command_is_quoted() {
        let failure = run(Command::new("false").arg("--really")).unwrap_err();
        assert!(failure.to_string().starts_with("`false --really` failed"), "{failure}");
        let failure = output(&mut Command::new("no-such-program-here")).unwrap_err();
        assert!(failure.to_string().contains("cannot be started"), "{failure}");
    }
}
