//! Which tests reach a mutant, and what they say of it.
//!
//! What it is: each test runs once alone, and what it reaches and how long it takes is written down. A mutant then meets the tests that reach
//! it, the fastest first, until one fails.
//!
//! What can go wrong: a test that fails before anything is broken; it ends the run.
//!
//! Units: seconds.
//!
//! Reference: `PROGRAM --list`, `--exact` of Rust's test programs.

use super::together::Program;
use super::{Fate, Package};
use crate::run::{Failure, cores, side_by_side};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Shortest time after which a test counts as never ended.
const LEAST: Duration = Duration::from_secs(3);
/// A test that takes so many times what it took never ends.
const TIMES: u32 = 5;
/// No test of ours needs a quarter of it, kB: a mutant that asks for ever more fails before the machine does.
const MEMORY_KB: &str = "8000000";

/// A test.
#[derive(Debug)]
struct Test<'p> {
    program: &'p Program,
    name: String,
    took: Duration,
}

/// The tests, the fastest first, and which of them reach a mutant.
#[derive(Debug)]
pub(super) struct Trial<'p> {
    tests: Vec<Test<'p>>,
    reach: BTreeMap<u32, Vec<usize>>,
}

impl<'p> Trial<'p> {
    /// Runs each test once; what they reach is noted below `folder`.
    pub(super) fn record(programs: &'p [Program], package: &Package, folder: &Path) -> Result<Self, Failure> {
        let _ = fs::remove_dir_all(folder);
        fs::create_dir_all(folder)?;
        let mut names = Vec::new();
        for program in programs {
            let list = list(program)?;
            names.extend(
                list.into_iter().filter(|name| !package.skip.iter().any(|skip| name.contains(skip))).map(|name| (program, name)),
            );
        }
        let files: Vec<(usize, &Program, String)> =
            names.into_iter().enumerate().map(|(n, (program, name))| (n, program, name)).collect();
        let run = |(n, program, name): &(usize, &'p Program, String)| -> Result<(Duration, Vec<u32>), Failure> {
            let file = folder.join(n.to_string());
            let start = Instant::now();
            let status = test(program, name).env("MUTANTS_REACHED", &file).status()?;
            if !status.success() {
                return Err(Failure(format!("{name} of {} fails before anything is broken", program.path.display())));
            }
            let reached = fs::read_to_string(&file).unwrap_or_default();
            Ok((start.elapsed(), reached.lines().filter_map(|line| line.parse().ok()).collect()))
        };
        let mut ran = Vec::new();
        side_by_side(&files, cores(), run, |(_, program, name), done| {
            let (took, reached) = done?;
            ran.push((Test { program, name: name.clone(), took }, reached));
            Ok(())
        })?;
        ran.sort_by(|(a, _), (b, _)| (a.took, &a.name).cmp(&(b.took, &b.name)));
        let mut reach: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (n, (_, reached)) in ran.iter().enumerate() {
            reached.iter().for_each(|id| reach.entry(*id).or_default().push(n));
        }
        Ok(Self { tests: ran.into_iter().map(|(test, _)| test).collect(), reach })
    }

    /// How many tests there are, how long they take one after the other, and the slowest.
    pub(super) fn words(&self) -> String {
        let whole: Duration = self.tests.iter().map(|test| test.took).sum();
        let slow = self.tests.iter().rev().take(3).map(|test| format!("{} {:.1} s", test.name, test.took.as_secs_f64()));
        format!("{} tests, {:.0} s; {}", self.tests.len(), whole.as_secs_f64(), slow.collect::<Vec<_>>().join(", "))
    }

    /// What becomes of a mutant.
    pub(super) fn fate(&self, id: u32) -> Result<Fate, Failure> {
        for test in self.reach.get(&id).into_iter().flatten().filter_map(|n| self.tests.get(*n)) {
            let child = self::test(test.program, &test.name).env("MUTANT", id.to_string()).spawn()?;
            match ended(child, LEAST.max(test.took * TIMES))? {
                None => return Ok(Fate::TimeOut),
                Some(status) if !status.success() => return Ok(Fate::Caught),
                Some(_) => {}
            }
        }
        Ok(Fate::Missed)
    }
}

/// The tests of a program.
fn list(program: &Program) -> Result<Vec<String>, Failure> {
    let said = Command::new(&program.path).args(["--list", "--format", "terse"]).current_dir(&program.folder).output()?;
    let text = String::from_utf8_lossy(&said.stdout);
    Ok(text.lines().filter_map(|line| line.strip_suffix(": test")).map(str::to_owned).collect())
}

/// One test, alone; what it would draw anew is not kept for the next.
fn test(program: &Program, name: &str) -> Command {
    let mut command = if cfg!(unix) {
        let mut shell = Command::new("sh");
        shell.args(["-c", "ulimit -v $0; exec \"$@\"", MEMORY_KB]).arg(&program.path);
        shell
    } else {
        Command::new(&program.path)
    };
    command.args(["--exact", name, "--test-threads", "1"]).current_dir(&program.folder);
    command.env("CARGO_MANIFEST_DIR", &program.folder).env("PROPTEST_DISABLE_FAILURE_PERSISTENCE", "true");
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command
}

/// How a program ended; none: not within `longest`, and it is ended here.
fn ended(mut child: Child, longest: Duration) -> Result<Option<ExitStatus>, Failure> {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        let passed = start.elapsed();
        if passed > longest {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        sleep((passed / 8).clamp(Duration::from_micros(300), Duration::from_millis(50)));
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;

    #[test]
    fn what_never_ends_is_ended() {
        let child = |seconds: &str| Command::new("sleep").arg(seconds).spawn().unwrap();
        assert_eq!(ended(child("60"), Duration::from_millis(20)).unwrap(), None);
        assert!(ended(child("0"), Duration::from_secs(60)).unwrap().is_some_and(|status| status.success()));
    }
}
