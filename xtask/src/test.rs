//! The test command.
//!
//! What it is: every check in order, cheap ones first, each under its own heading with its own time; stops at the first failure.
//!
//! What can go wrong: any step; the last lines say which and how long each took.
//!
//! Units: seconds.
//!
//! Reference: `.ci/run` calls exactly this.

use crate::book;
use crate::changed;
use crate::emulator;
use crate::image;
use crate::place::{BOARD, Place};
use crate::programs;
use crate::run::{Failure, Tally, cargo, run, tests};
use crate::setup;
use crate::strangers;
use crate::verdict;
use std::time::{Duration, Instant};

/// Test programs that are named at the end, the slowest first.
const SLOWEST: usize = 10;

/// The steps that were taken, with their times.
#[derive(Debug, Default)]
struct Steps {
    taken: Vec<(&'static str, Duration)>,
    tally: Tally,
}

impl Steps {
    fn step(&mut self, name: &'static str, work: impl FnOnce(&mut Tally) -> Result<(), Failure>) -> Result<(), Failure> {
        println!("\n==== {name}");
        let start = Instant::now();
        let done = work(&mut self.tally).map_err(|failure| Failure(format!("{name}: {failure}")));
        self.taken.push((name, start.elapsed()));
        println!("---- {name}: {:.1} s", start.elapsed().as_secs_f64());
        done
    }

    fn finish(self, done: Result<(), Failure>) -> Result<(), Failure> {
        println!();
        for (name, time) in &self.taken {
            println!("{:>7.1} s  {name}", time.as_secs_f64());
        }
        let all: Duration = self.taken.iter().map(|(_, t)| *t).sum();
        println!("{:>7.1} s  in all", all.as_secs_f64());
        let slowest = self.tally.slowest(SLOWEST);
        if !slowest.is_empty() {
            println!("\nthe slowest test programs");
        }
        for (name, seconds) in slowest {
            println!("{seconds:>7.1} s  {name}");
        }
        println!();
        let failed = self.tally.failed + usize::from(done.is_err() && self.tally.failed == 0);
        println!("{} passed, {failed} failed", self.tally.passed);
        done
    }
}

/// Everything that CI runs. The host's programs are built once, with the emulator in them.
pub(crate) fn everything(place: &Place) -> Result<(), Failure> {
    let mut steps = Steps::default();
    let done = (|| {
        set_up(place, &mut steps)?;
        host_lints(place, &mut steps)?;
        steps.step("lints of the flash images", |_| {
            let mut clippy = cargo(place, &["clippy", "--config", ".cargo/image.toml", "--release", "--target", BOARD]);
            clippy.args(image::PACKAGES.iter().flat_map(|p| ["-p", p])).args([
                "--target-dir",
                "target/fw",
                "--",
                "-D",
                "warnings",
            ]);
            run(&mut clippy)
        })?;
        steps.step("the book and its links", |_| book::book(place))?;
        images(place, &mut steps)?;
        steps.step("the crates as a stranger gets them", |_| strangers::strangers(place))?;
        let words = emulator::words(place)?;
        host_tests(place, &words, &mut steps)?;
        steps.step("the attitude filter on recordings", |_| ahrs_bench(place, &words, &[]))?;
        logs(place, &words, &mut steps)
    })();
    steps.finish(done)
}

/// The attitude filter on recordings; `words` as in [`programs::build`].
pub(crate) fn ahrs_bench(place: &Place, words: &[String], rest: &[&str]) -> Result<(), Failure> {
    let head = ["run", "--quiet", "--release", "--bin", "ahrs-bench"];
    run(cargo(place, &head).args(words).arg("--").args(rest))
}

/// Format, lints and tests of the host.
pub(crate) fn quick(place: &Place) -> Result<(), Failure> {
    let mut steps = Steps::default();
    let done = host_lints(place, &mut steps).and_then(|()| host_tests(place, &[], &mut steps));
    steps.finish(done)
}

/// Tests of what differs from a commit, and of all that is built on it.
pub(crate) fn changed(place: &Place, base: &str) -> Result<(), Failure> {
    let words = changed::words(place, base)?;
    if words.is_empty() {
        println!("nothing to run: no test of the host's differs from {base}");
        return Ok(());
    }
    let mut steps = Steps::default();
    let done = steps
        .step("tests of what changed", |tally| tests(cargo(place, &["test", "--release", "--no-fail-fast"]).args(&words), tally));
    steps.finish(done)
}

/// Format and lints, those of the emulated boards included.
pub(crate) fn lints(place: &Place) -> Result<(), Failure> {
    let mut steps = Steps::default();
    let done = host_lints(place, &mut steps).and_then(|()| {
        steps.step("lints of the emulated boards", |_| {
            let mut clippy = cargo(place, &["clippy"]);
            run(clippy.args(["--release", "--workspace"]).args(emulator::words(place)?).args([
                "--all-targets",
                "--",
                "-D",
                "warnings",
            ]))
        })
    });
    steps.finish(done)
}

/// What is looked at for every value there is. The tests of the host hold all of it, too.
pub(crate) fn proofs(place: &Place) -> Result<(), Failure> {
    let mut steps = Steps::default();
    let done = (|| {
        steps.step("pulses, clock, stuffing and checksum", |tally| {
            tests(&mut cargo(place, &["test", "--release", "--workspace", "--test", "exhaustive"]), tally)
        })?;
        steps.step("queue", |tally| {
            tests(&mut cargo(place, &["test", "--release", "-p", "firmware-rig", "--lib", "queue::"]), tally)
        })
    })();
    steps.finish(done)
}

/// Tests of which the suite tries some cases, with all of them.
const LONG: [&str; 3] = ["watch::", "isolability::", "demo::"];
/// Tests that the suite leaves out for their length, by program: a thousand runs for intervals, two hundred joined clocks, the plateaus' table.
const LEFT_OUT: [&str; 3] = ["intervals", "join", "plateaus"];

/// The long forms of tests.
pub(crate) fn campaign(place: &Place) -> Result<(), Failure> {
    let mut steps = Steps::default();
    let done = steps.step("campaigns", |tally| {
        let words = ["test", "--release", "--workspace", "--no-fail-fast", "--test", "suite", "--"];
        tests(cargo(place, &words).args(LONG).env("QUADRIG_CAMPAIGN", "1"), tally)?;
        let mut command = cargo(place, &["test", "--release", "--no-fail-fast", "-p", "ident"]);
        tests(command.args(LEFT_OUT.iter().flat_map(|name| ["--test", name])).args(["--", "--ignored"]), tally)
    });
    steps.finish(done)
}

/// Every test program, with the emulator in it.
pub(crate) fn on_host_and_boards(place: &Place) -> Result<(), Failure> {
    let mut steps = Steps::default();
    let done = (|| {
        images(place, &mut steps)?;
        host_tests(place, &emulator::words(place)?, &mut steps)
    })();
    steps.finish(done)
}

/// The flash images in the emulator.
pub(crate) fn on_boards(place: &Place) -> Result<(), Failure> {
    let mut steps = Steps::default();
    let done = images(place, &mut steps).and_then(|()| boards(place, &mut steps));
    steps.finish(done)
}

/// The verdict contract.
pub(crate) fn on_logs(place: &Place) -> Result<(), Failure> {
    let mut steps = Steps::default();
    let done = logs(place, &[], &mut steps);
    steps.finish(done)
}

fn set_up(place: &Place, steps: &mut Steps) -> Result<(), Failure> {
    steps.step("set-up", |_| setup::target(place).and_then(|()| setup::python(place).map(|_| ())))
}

fn images(place: &Place, steps: &mut Steps) -> Result<(), Failure> {
    steps.step("flash images and their size", |_| image::image(place, false))
}

fn boards(place: &Place, steps: &mut Steps) -> Result<(), Failure> {
    steps.step("the images on emulated boards", |tally| emulated(place, tally))
}

fn logs(place: &Place, words: &[String], steps: &mut Steps) -> Result<(), Failure> {
    steps.step("verdict contract", |tally| verdict::verdicts(place, words, tally))
}

fn host_lints(place: &Place, steps: &mut Steps) -> Result<(), Failure> {
    steps.step("format", |_| run(&mut cargo(place, &["fmt", "--all", "--check"])))?;
    // the profile of the tests, so that build scripts and procedural macros compile once
    steps.step("lints of the host", |_| {
        run(&mut cargo(place, &["clippy", "--release", "--workspace", "--all-targets", "--", "-D", "warnings"]))?;
        let alone = ["clippy", "--release", "-p", "hal-sim", "--no-default-features", "--lib", "--", "-D", "warnings"];
        run(&mut cargo(place, &alone))
    })
}

/// Every test program there is with these features, and the examples in the documentation.
fn host_tests(place: &Place, words: &[String], steps: &mut Steps) -> Result<(), Failure> {
    let mut all = Vec::new();
    steps.step("the test programs are built", |_| {
        all = programs::build(place, words, &[])?;
        Ok(())
    })?;
    steps.step("tests", |tally| {
        let of_programs = programs::run(place, &all, words, tally);
        let mut examples = cargo(place, &["test", "--release", "--workspace", "--doc"]);
        tests(examples.args(words), tally).and(of_programs)
    })?;
    // the digests that the release build has just met; without debug information it compiles in half the time
    steps.step("same bytes in a debug build", |tally| {
        tests(&mut cargo(place, &["test", "--config", "profile.dev.debug=0", "-p", "hal-sim", "--test", "golden"]), tally)
    })
}

/// The tests that load the flash images into the emulator.
fn emulated(place: &Place, tally: &mut Tally) -> Result<(), Failure> {
    let words = emulator::words(place)?;
    let all = programs::build(place, &words, &["--test".to_owned(), "boards".to_owned()])?;
    programs::run(place, &all, &words, tally)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A filter that names no module would run nothing and pass.
    #[test]
    fn what_is_named_is_a_module_of_the_suite() {
        let root = Place::find().root;
        let suite = std::fs::read_to_string(root.join("tests/tests/suite.rs")).expect("the list of modules");
        let alone = programs::ALONE.iter().map(|name| name.strip_suffix(" of suite").expect("a module of the suite"));
        for module in LONG.iter().map(|name| name.trim_end_matches("::")).chain(alone) {
            assert!(suite.contains(&format!("mod {module};")), "{module}");
        }
        for program in LEFT_OUT {
            assert!(root.join(format!("ident/tests/{program}.rs")).is_file(), "{program}");
        }
    }
}
