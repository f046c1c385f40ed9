//! The test programs: built once, run side by side.
//!
//! What it is: cargo builds them and says where they lie; as many run at a time as there are cores, each with one test at a time. Cargo itself
//! runs one program after the other, and a core waits for the last test of each. A program whose tests all lie in modules counts as so many
//! programs. Those that judge a time follow, one by one.
//!
//! What can go wrong: a program that fails; all others are run all the same, and the failure names it.
//!
//! Units: seconds.
//!
//! Reference: The Cargo Book, "External tools" (JSON messages) and "Environment variables".

use crate::place::Place;
use crate::run::{Failure, Tally, cargo, cores, output, side_by_side};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Instant;

/// Variable that tells the tests how the program that they call is built, a word a line: with the libraries that they are built with.
const WORDS: &str = "QUADRIG_CARGO_WORDS";

/// What judges how long something takes, or flies in real time: it has the machine to itself.
pub(crate) const ALONE: [&str; 2] = ["demo of suite", "rig_presets of suite"];

/// A test program, or a module of one.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Program {
    /// Its source, or the module, and its name.
    pub(crate) name: String,
    /// The tests of the module; none: all of the program's.
    tests: Vec<String>,
    /// Where it lies.
    executable: PathBuf,
    /// Folder of its package, in which it runs.
    folder: PathBuf,
}

/// Builds the test programs of the workspace; `words` choose features, `more` choose among the programs.
pub(crate) fn build(place: &Place, words: &[String], more: &[String]) -> Result<Vec<Program>, Failure> {
    let head = ["test", "--no-run", "--release", "--workspace", "--message-format", "json-render-diagnostics"];
    let said = output(cargo(place, &head).args(words).args(more))?;
    let mut programs = Vec::new();
    for line in said.lines() {
        programs.extend(program(&serde_json::from_str(line)?));
    }
    if programs.is_empty() {
        return Err(Failure("cargo built no test program".to_owned()));
    }
    let mut parts = Vec::new();
    for program in programs {
        parts.extend(split(program)?);
    }
    // those that call the command line take longest: short ones fill the end
    parts.sort_by_key(|p| (!p.folder.ends_with("tests"), p.folder.clone(), p.name.clone()));
    Ok(parts)
}

/// The modules of an integration test, or the program as it is.
fn split(program: Program) -> Result<Vec<Program>, Failure> {
    if !program.name.starts_with("tests/") {
        return Ok(vec![program]);
    }
    let listed = output(Command::new(&program.executable).args(["--list", "--format", "terse"]).current_dir(&program.folder))?;
    Ok(modules(&program, &listed).unwrap_or_else(|| vec![program]))
}

/// A program for each module in what `--list` says; nothing where a test lies in none.
fn modules(program: &Program, listed: &str) -> Option<Vec<Program>> {
    let mut of: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for test in listed.lines().filter_map(|line| line.strip_suffix(": test")) {
        of.entry(test.split_once("::")?.0).or_default().push(test.to_owned());
    }
    let (_, stem) = program.name.rsplit_once(' ')?;
    Some(
        of.into_iter().map(|(module, tests)| Program { name: format!("{module} of {stem}"), tests, ..program.clone() }).collect(),
    )
}

/// The test program that a message of cargo's is about, if it is about one.
fn program(message: &serde_json::Value) -> Option<Program> {
    if !message["profile"]["test"].as_bool()? {
        return None;
    }
    let path = |value: &serde_json::Value| value.as_str().map(PathBuf::from);
    let folder = path(&message["manifest_path"])?.parent()?.to_path_buf();
    let source = path(&message["target"]["src_path"])?;
    let name = format!("{} of {}", source.strip_prefix(&folder).ok()?.display(), message["target"]["name"].as_str()?);
    Some(Program { name, tests: Vec::new(), executable: path(&message["executable"])?, folder })
}

/// Runs them; what each says comes in one piece.
pub(crate) fn run(place: &Place, programs: &[Program], words: &[String], tally: &mut Tally) -> Result<(), Failure> {
    let is_alone = |p: &&Program| ALONE.contains(&p.name.as_str());
    let (alone, others): (Vec<&Program>, Vec<&Program>) = programs.iter().partition(is_alone);
    let mut failed = Vec::new();
    // one more than cores: those that talk over a line wait for the clock
    for (programs, workers) in [(others, cores() + 1), (alone, 1)] {
        let timed = |program: &&Program| {
            let began = Instant::now();
            (run_one(place, program, words, workers > 1), began.elapsed().as_secs_f64())
        };
        side_by_side(&programs, workers, timed, |program, (done, seconds)| {
            let (held, text) = done?;
            println!("     Running {}\n{text}", program.name);
            for line in text.lines() {
                tally.read(line);
            }
            tally.took.push((program.name.clone(), seconds));
            if !held {
                failed.push(program.name.clone());
            }
            Ok(())
        })?;
    }
    if failed.is_empty() { Ok(()) } else { Err(Failure(format!("failed: {}", failed.join(", ")))) }
}

fn run_one(place: &Place, program: &Program, words: &[String], in_company: bool) -> Result<(bool, String), Failure> {
    let mut command = Command::new(&program.executable);
    if !program.tests.is_empty() {
        command.arg("--exact").args(&program.tests);
    }
    if in_company {
        command.env("RUST_TEST_THREADS", "1");
    }
    let done = command
        .current_dir(&program.folder)
        .env("CARGO", std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .env("CARGO_MANIFEST_DIR", &program.folder)
        .env("QUADRIG_FW_DIR", place.images())
        .env("QUADRIG_EMULATOR_KEEPS_FLASH", "1")
        .env(WORDS, words.join("\n"))
        .stdin(Stdio::null())
        .output()
        .map_err(|error| Failure(format!("{}: cannot be started: {error}", program.executable.display())))?;
    let text = [done.stdout, done.stderr].concat();
    Ok((done.status.success(), String::from_utf8_lossy(&text).into_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn a_test_program_is_found_among_cargo_s_messages() {
        let message = |test: bool, executable: &str| {
            let text = format!(
                r#"{{"reason":"compiler-artifact","manifest_path":"/w/tests/Cargo.toml","target":{{"name":"batch","src_path":"/w/tests/tests/batch.rs"}},"profile":{{"test":{test}}},"executable":{executable}}}"#
            );
            program(&serde_json::from_str(&text).expect("a message"))
        };
        let found = message(true, "\"/w/target/batch-1\"").expect("a test program");
        assert_eq!((found.name.as_str(), found.folder.as_path()), ("tests/batch.rs of batch", Path::new("/w/tests")));
        assert_eq!(message(false, "\"/w/target/batch\""), None);
        assert_eq!(message(true, "null"), None);
        assert_eq!(program(&serde_json::json!({ "reason": "build-finished", "success": true })), None);
    }

    #[test]
    fn a_program_of_modules_is_as_many_programs() {
        let whole = Program {
            name: "tests/suite.rs of suite".to_owned(),
            tests: Vec::new(),
            executable: "/w/suite-1".into(),
            folder: "/w/tests".into(),
        };
        let parts = modules(&whole, "a::one: test\na::deep::two: test\nb::one: test\nb::fast: benchmark\n").expect("modules");
        let said: Vec<(&str, usize)> = parts.iter().map(|p| (p.name.as_str(), p.tests.len())).collect();
        assert_eq!(said, [("a of suite", 2), ("b of suite", 1)]);
        assert_eq!(modules(&whole, "a::one: test\nroot: test\n"), None, "a test that lies in no module is not lost");
    }

    #[test]
    fn every_program_runs_and_one_that_fails_is_named() {
        let of = |name: &str, executable: &str| Program {
            name: name.to_owned(),
            tests: Vec::new(),
            executable: executable.into(),
            folder: std::env::temp_dir(),
        };
        let mut tally = Tally::default();
        let all = [of("good", "/bin/true"), of("bad", "/bin/false"), of("also good", "/bin/true")];
        let failure = run(&Place::find(), &all, &[], &mut tally).unwrap_err();
        assert_eq!((failure.to_string().as_str(), tally.took.len()), ("failed: bad", 3));
        assert!(run(&Place::find(), &[of("none", "/no/such/program")], &[], &mut tally).is_err());
    }
}
