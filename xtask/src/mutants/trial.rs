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

/// Shortest time after which a test counts as never ended: of the processor where the system counts it, for others may be at work, too.
const LEAST: Duration = Duration::from_secs(2);
/// A test that takes so many times what it took never ends.
const TIMES: u32 = 5;
/// Longest that a test may take before anything is broken.
const FIRST: Duration = Duration::from_secs(3600);
/// So much longer on the clock: it waits for ever.
const WAITS: u32 = if cfg!(unix) { 60 } else { 1 };
/// What the shell does with a program: where a file is named for it, what of the processor was used is written there.
const RUN: &str = r#"[ "$MUTANTS_TIMES" ] || exec "$0" "$@"; "$0" "$@"; ended=$?; times > "$MUTANTS_TIMES"; exit $ended"#;
/// What ends a program that has had its time of the processor.
#[cfg(unix)]
const SIGXCPU: i32 = 24;
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
            let times = file.with_extension("times");
            let start = Instant::now();
            let status = test(program, name, FIRST).env("MUTANTS_REACHED", &file).env("MUTANTS_TIMES", &times).status()?;
            if !status.success() {
                return Err(Failure(format!("{name} of {} fails before anything is broken", program.path.display())));
            }
            let reached = fs::read_to_string(&file).unwrap_or_default();
            let took = fs::read_to_string(times).ok().and_then(|times| processor(&times)).unwrap_or_else(|| start.elapsed());
            Ok((took, reached.lines().filter_map(|line| line.parse().ok()).collect()))
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
            let longest = LEAST.max(test.took * TIMES);
            let child = self::test(test.program, &test.name, longest).env("MUTANT", id.to_string()).spawn()?;
            match ended(child, longest * WAITS)? {
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

/// One test, alone, that may use the processor for so long; what it draws is not kept for the next.
fn test(program: &Program, name: &str, longest: Duration) -> Command {
    let mut command = if cfg!(unix) {
        let mut shell = Command::new("sh");
        let limits = format!("ulimit -v {MEMORY_KB}; ulimit -S -t {}; ", longest.as_secs().max(1));
        shell.args(["-c", &(limits + RUN)]).arg(&program.path);
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
            return Ok(Some(status).filter(|status| !had_its_time(*status)));
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

/// What the shell's `times` says of the processes below it: time of the processor, of the program and of the system.
fn processor(times: &str) -> Option<Duration> {
    let seconds = times.lines().nth(1)?.split_whitespace().map(|time| {
        let (minutes, seconds) = time.strip_suffix('s')?.split_once('m')?;
        Some(60.0 * minutes.parse::<f64>().ok()? + seconds.parse::<f64>().ok()?)
    });
    Duration::try_from_secs_f64(seconds.sum::<Option<f64>>()?).ok()
}

/// Whether the system ended a program because it had its time of the processor.
#[cfg(unix)]
fn had_its_time(status: ExitStatus) -> bool {
    use std::os::unix::process::ExitStatusExt as _;
    status.signal() == Some(SIGXCPU)
}

#[cfg(not(unix))]
fn had_its_time(_: ExitStatus) -> bool {
    false
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;

    #[test]
    fn the_shell_tells_what_of_the_processor_was_used() {
        assert_eq!(processor("0m0.004s 0m0.000s\n1m2.500s 0m0.250s\n"), Some(Duration::from_millis(62_750)));
        assert_eq!((processor(""), processor("a\nb c")), (None, None));
        let file = std::env::temp_dir().join(format!("mutants-times-{}", std::process::id()));
        let status = Command::new("sh").args(["-c", RUN, "false"]).env("MUTANTS_TIMES", &file).status().unwrap();
        assert!(!status.success() && processor(&fs::read_to_string(&file).unwrap()).is_some());
        fs::remove_file(file).unwrap();
    }

    #[test]
    fn what_never_ends_is_ended() {
        let busy = Command::new("sh").args(["-c", "ulimit -S -t 1; while :; do :; done"]).spawn().unwrap();
        assert_eq!(ended(busy, Duration::from_secs(600)).unwrap(), None);
        let child = |seconds: &str| Command::new("sleep").arg(seconds).spawn().unwrap();
        assert_eq!(ended(child("60"), Duration::from_millis(20)).unwrap(), None);
        assert!(ended(child("0"), Duration::from_secs(60)).unwrap().is_some_and(|status| status.success()));
    }
}
