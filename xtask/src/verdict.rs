//! The verdict contract on recorded and simulated logs.
//!
//! What it is: the contract's checker is called with our command line on each log; every claimed figure is recomputed by it
//! from `quadrig predict`.
//!
//! What can go wrong: a claim that does not hold; the checker prints which, and all logs are tried before the step fails.
//! Without the data the step says that it was skipped, and fails on a build server.
//!
//! Units: as the channels state.
//!
//! Reference: `check_verdict.py`, the contract of `quadrig-verdict 2` in executable form.

use crate::place::{Place, on_ci};
use crate::run::{Failure, Tally, cargo, cores, run, side_by_side};
use crate::setup;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Checks every log at hand; `words` choose the features of the programs that are built.
pub(crate) fn verdicts(place: &Place, words: &[String], tally: &mut Tally) -> Result<(), Failure> {
    let (data, checker) = (place.data(), place.checker());
    for needed in [&data, &checker] {
        if !needed.exists() {
            let what = format!(
                "verdict contract: {} is not there (QUADRIG_DATA names the folder of the recorded data)",
                needed.display()
            );
            if on_ci() {
                return Err(Failure(what));
            }
            println!("SKIPPED: {what}");
            return Ok(());
        }
    }
    let python = setup::python(place)?;
    run(cargo(place, &["build", "--quiet", "--release", "--bin", "quadrig"]).args(words))?;
    let mut logs = imports(place, &data)?;
    logs.push(glitches(place, words)?);
    logs.extend(attitudes(place, words)?);
    logs.extend(listed(&data.join("blind-sample"), |name| name.ends_with(".csv") && !name.contains(".validate."))?);
    let kept = check_all(&logs, |log| check(&python, &checker, &place.quadrig(), log))?;
    tally.passed += kept;
    tally.failed += logs.len() - kept;
    println!("{kept} of {} verdicts keep the contract", logs.len());
    if kept == logs.len() { Ok(()) } else { Err(Failure(format!("{} verdicts do not keep the contract", logs.len() - kept))) }
}

/// The thrust-stand recordings as rig logs.
fn imports(place: &Place, data: &Path) -> Result<Vec<PathBuf>, Failure> {
    let folder = place.root.join("target/verdict");
    std::fs::create_dir_all(&folder)?;
    let mut logs = Vec::new();
    for original in listed(&data.join("rig/spitz-esc-test/original"), |name| name.starts_with("Log_") && name.ends_with(".csv"))?
    {
        let Some(name) = original.file_name() else { continue };
        let log = folder.join(name);
        run(Command::new(place.quadrig()).args(["--quiet", "import"]).arg(&original).arg("-o").arg(&log))?;
        logs.push(log);
    }
    Ok(logs)
}

/// A run of the independent generator that hides glitch rows, about which nothing may be claimed.
fn glitches(place: &Place, features: &[String]) -> Result<PathBuf, Failure> {
    const SEED: &str = "102";
    let folder = place.root.join("target/verdict");
    let words = ["run", "--quiet", "--release", "--bin", "blind"];
    run(cargo(place, &words).args(features).args(["--", "--dump", SEED]).arg(&folder))?;
    Ok(folder.join(format!("{SEED}.csv")))
}

/// Attitude logs: simulated ones of both generators and the disturbed BROAD trials.
fn attitudes(place: &Place, features: &[String]) -> Result<Vec<PathBuf>, Failure> {
    let folder = place.root.join("target/verdict/attitude");
    let words = ["run", "--quiet", "--release", "--bin", "causes"];
    run(cargo(place, &words).args(features).args(["--", "--dump"]).arg(&folder))?;
    listed(&folder, |name| name.ends_with(".csv"))
}

/// The files of a folder that a test of the name accepts, in order of name.
fn listed(folder: &Path, wanted: impl Fn(&str) -> bool) -> Result<Vec<PathBuf>, Failure> {
    let entries = std::fs::read_dir(folder).map_err(|error| Failure(format!("{}: {error}", folder.display())))?;
    let mut files: Vec<PathBuf> = entries.map(|e| e.map(|e| e.path())).collect::<Result<_, _>>()?;
    files.retain(|f| f.file_name().and_then(|n| n.to_str()).is_some_and(&wanted));
    if files.is_empty() {
        return Err(Failure(format!("{}: holds none of the logs that were expected", folder.display())));
    }
    files.sort();
    Ok(files)
}

/// Tries all logs, as many at a time as there are cores, and prints each answer in one piece; returns how many held.
fn check_all(logs: &[PathBuf], check: impl Fn(&Path) -> Result<(bool, String), Failure> + Sync) -> Result<usize, Failure> {
    let mut kept = 0;
    side_by_side(
        logs,
        cores(),
        |log| check(log),
        |log, answer| {
            let (held, text) = answer?;
            println!("{}: {}\n{text}", log.display(), if held { "kept" } else { "NOT KEPT" });
            kept += usize::from(held);
            Ok(())
        },
    )?;
    Ok(kept)
}

fn check(python: &Path, checker: &Path, quadrig: &Path, log: &Path) -> Result<(bool, String), Failure> {
    // the checker splits the command like a shell does
    let quoted = format!("'{}'", quadrig.display());
    let done = Command::new(python)
        .arg(checker)
        .args(["--least", "2", "--cmd", &quoted])
        .arg(log)
        .stdin(Stdio::null())
        .output()
        .map_err(|error| Failure(format!("{} cannot be started: {error}", python.display())))?;
    let text = [done.stdout, done.stderr].concat();
    Ok((done.status.success(), String::from_utf8_lossy(&text).into_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_log_is_tried_and_failures_are_counted() {
        let logs: Vec<PathBuf> = (0..7).map(|n| PathBuf::from(format!("{n}.csv"))).collect();
        let kept = check_all(&logs, |log| Ok((log != Path::new("3.csv"), String::new()))).unwrap();
        assert_eq!(kept, 6);
        assert!(check_all(&logs, |_| Err(Failure("no checker".to_owned()))).is_err());
    }

    #[test]
    fn an_empty_folder_is_no_success() {
        let folder = std::env::temp_dir();
        assert!(listed(&folder, |_| false).is_err());
    }
}
