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
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

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

/// Whether a command succeeds, and all that it says.
pub(crate) fn said(command: &mut Command) -> Result<(bool, String), Failure> {
    let words = typed(command);
    command.env_remove("DEFMT_LOG"); // cargo gave it to us: the configuration of where the command runs counts
    let done = command.stdin(Stdio::null()).output().map_err(|error| Failure(format!("`{words}` cannot be started: {error}")))?;
    let both = [done.stdout, done.stderr].concat();
    Ok((done.status.success(), String::from_utf8_lossy(&both).into_owned()))
}

/// How many checks passed and failed.
#[derive(Debug, Default, Clone, PartialEq)]
pub(crate) struct Tally {
    /// Checks that held.
    pub(crate) passed: usize,
    /// Checks that did not.
    pub(crate) failed: usize,
    /// Test programs, with what each took, s.
    pub(crate) took: Vec<(String, f64)>,
}

impl Tally {
    /// Takes up what a line says of a test program that has ended: how long it took, s, where it says so.
    pub(crate) fn read(&mut self, line: &str) -> Option<f64> {
        let rest = line.trim().strip_prefix("test result: ")?;
        for part in rest.split(['.', ';']) {
            match part.trim().split_once(' ') {
                Some((n, "passed")) => self.passed += n.parse().unwrap_or(0),
                Some((n, "failed")) => self.failed += n.parse().unwrap_or(0),
                _ => {}
            }
        }
        rest.rsplit_once("finished in ")?.1.strip_suffix('s')?.parse().ok()
    }

    /// The test programs that took longest, the slowest first.
    pub(crate) fn slowest(&self, most: usize) -> Vec<&(String, f64)> {
        let mut all: Vec<&(String, f64)> = self.took.iter().collect();
        all.sort_by(|a, b| b.1.total_cmp(&a.1));
        all.truncate(most);
        all
    }
}

/// The test program that a line of cargo's announces: a source file, or the package of a doc test.
fn announced(line: &str) -> Option<String> {
    let line = line.trim();
    if let Some(package) = line.strip_prefix("Doc-tests ") {
        return Some(format!("examples in the documentation of {package}"));
    }
    let (source, program) = line.strip_prefix("Running ")?.trim_start_matches("unittests ").rsplit_once(" (")?;
    let name = program.rsplit('/').next()?.rsplit_once('-')?.0;
    Some(format!("{source} of {name}"))
}

/// Does a piece of work for each item, so many at a time, and hears of each as it ends.
pub(crate) fn side_by_side<'i, T: Sync, R: Send>(
    items: &'i [T],
    workers: usize,
    work: impl Fn(&'i T) -> R + Sync,
    mut heard: impl FnMut(&'i T, R) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let (next, (ended, arrived)) = (AtomicUsize::new(0), mpsc::channel());
    std::thread::scope(|scope| {
        for _ in 0..workers {
            let (ended, next, work) = (ended.clone(), &next, &work);
            scope.spawn(move || {
                while let Some(item) = items.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if ended.send((item, work(item))).is_err() {
                        return;
                    }
                }
            });
        }
        drop(ended);
        arrived.into_iter().try_for_each(|(item, done)| heard(item, done))
    })
}

/// As many workers as there are cores.
pub(crate) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Runs a test command; its output passes through while its summary lines are counted.
pub(crate) fn tests(command: &mut Command, tally: &mut Tally) -> Result<(), Failure> {
    let words = typed(command);
    println!("$ {words}");
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| Failure(format!("`{words}` cannot be started: {error}")))?;
    let stderr = child.stderr.take();
    let names = std::thread::spawn(move || {
        let lines = stderr.into_iter().flat_map(|stderr| BufReader::new(stderr).lines().map_while(Result::ok));
        lines.inspect(|line| eprintln!("{line}")).filter_map(|line| announced(&line)).collect::<Vec<String>>()
    });
    let mut took = Vec::new();
    if let Some(stdout) = child.stdout.take() {
        let mut out = std::io::stdout().lock();
        for line in BufReader::new(stdout).lines() {
            let line = line?;
            took.extend(tally.read(&line));
            writeln!(out, "{line}")?;
        }
    }
    let status = child.wait()?;
    // a program that died left no summary: nobody knows then whose the others are
    if let Some(names) = names.join().ok().filter(|names| names.len() == took.len()) {
        tally.took.extend(names.into_iter().zip(took));
    }
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
        assert_eq!((tally.passed, tally.failed), (14, 1));
    }

    #[test]
    fn each_test_program_has_its_name_and_its_time() {
        let mut tally = Tally::default();
        let summary = "test result: ok. 2 passed; 0 failed; 1 ignored; 0 measured; 3 filtered out; finished in 12.50s";
        assert_eq!(tally.read(summary), Some(12.5));
        for (line, name) in [
            ("     Running unittests src/lib.rs (target/release/deps/ident-6d32b2bd1c1e3d4a)", Some("src/lib.rs of ident")),
            ("     Running tests/batch.rs (target/release/deps/batch-f2a8a332c64dce3e)", Some("tests/batch.rs of batch")),
            ("   Doc-tests hal_sim", Some("examples in the documentation of hal_sim")),
            ("   Compiling ident v0.1.0 (/somewhere/ident)", None),
        ] {
            assert_eq!(announced(line).as_deref(), name);
        }
        tally.took = [("a", 1.0), ("b", 3.0), ("c", 2.0)].map(|(name, s)| (name.to_owned(), s)).to_vec();
        assert_eq!(tally.slowest(2).iter().map(|t| t.1).collect::<Vec<_>>(), [3.0, 2.0]);
    }

    #[test]
    fn a_failing_command_is_quoted() {
        let failure = run(Command::new("false").arg("--really")).unwrap_err();
        assert!(failure.to_string().starts_with("`false --really` failed"), "{failure}");
        let failure = output(&mut Command::new("no-such-program-here")).unwrap_err();
        assert!(failure.to_string().contains("cannot be started"), "{failure}");
    }
}
