//! The test programs: built once, run side by side.
//!
//! What it is: cargo builds them and says where they lie; as many run at a time as there are cores, each with one test at a time. Cargo itself
//! runs one program after the other, and a core waits for the last test of each. Those that judge a time follow, one by one.
//!
//! What can go wrong: a program that fails; all others are run all the same, and the failure names it.
//!
//! Units: seconds.
//!
//! Reference: The Cargo Book, "External tools" (JSON messages) and "Environment variables".

use crate::place::Place;
use crate::run::{Failure, Tally, cargo, cores, output, side_by_side};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Instant;

/// Variable that tells the tests how the program that they call is built, a word a line: with the libraries that they are built with.
const WORDS: &str = "QUADRIG_CARGO_WORDS";

/// Programs that judge how long something takes, or fly in real time: they have the machine to themselves.
const ALONE: [&str; 2] = ["demo", "rig_presets"];

/// A test program.
#[derive(Debug, PartialEq)]
pub(crate) struct Program {
    /// Its source and its name.
    pub(crate) name: String,
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
    // those that call the command line take longest: short ones fill the end
    programs.sort_by_key(|p| (!p.folder.ends_with("tests"), p.folder.clone(), p.name.clone()));
    Ok(programs)
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
    Some(Program { name, executable: path(&message["executable"])?, folder })
}

/// Runs them; what each says comes in one piece.
pub(crate) fn run(place: &Place, programs: &[Program], words: &[String], tally: &mut Tally) -> Result<(), Failure> {
    let is_alone = |p: &&Program| ALONE.iter().any(|name| p.name.ends_with(&format!(" of {name}")));
    let (alone, others): (Vec<&Program>, Vec<&Program>) = programs.iter().partition(is_alone);
    let mut failed = Vec::new();
    for (programs, workers) in [(others, cores()), (alone, 1)] {
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
    fn every_program_runs_and_one_that_fails_is_named() {
        let of = |name: &str, executable: &str| Program {
            name: name.to_owned(),
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
