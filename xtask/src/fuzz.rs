//! Fuzzing of every way in.
//!
//! What it is: the targets of `fuzz/`, each for some minutes with cargo-fuzz on a nightly compiler, beginning with the inputs that are kept and with
//! the examples.
//!
//! What can go wrong: cargo-fuzz or a nightly compiler that is not there (it says how to have them); a target that crashes: its input is named.
//!
//! Units: minutes of each target.
//!
//! Reference: `fuzz/README.md`; The Rust Fuzz Book.

use crate::place::Place;
use crate::run::{Failure, run};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Minutes of a target where none are asked for.
const MINUTES: u64 = 5;
/// Longest input, bytes; longest time of one, s; most memory of a target, MB.
const LIMITS: [&str; 3] = ["-max_len=32768", "-timeout=20", "-rss_limit_mb=4096"];
/// Longest example that is taken as a beginning, bytes.
const SHORT: u64 = 20_000;
/// Examples that a target begins with: folders and the ends of their files' names.
const EXAMPLES: [(&str, &str, &str); 3] =
    [("scenario", "examples", ".toml"), ("mission", "examples/flight", ".toml"), ("schedule", "examples/schedule", ".toml")];

/// `--minutes N` and names of targets; without names all of them.
pub(crate) fn fuzz(place: &Place, words: &[&str]) -> Result<(), Failure> {
    let (minutes, names) = match words {
        ["--minutes", n, names @ ..] => (n.parse().map_err(|_| Failure(format!("--minutes {n}: expected a number")))?, names),
        names => (MINUTES, names),
    };
    let known = targets(place)?;
    if let Some(other) = names.iter().find(|name| !known.iter().any(|k| k == *name)) {
        return Err(Failure(format!("{other} is no target; expected one of {}", known.join(", "))));
    }
    let nightly = "fuzzing needs `rustup toolchain install nightly` and `cargo install cargo-fuzz --locked`";
    for name in known.iter().filter(|k| names.is_empty() || names.contains(&k.as_str())) {
        let corpus = place.root.join("fuzz/corpus").join(name);
        begin(place, name, &corpus)?;
        let seconds = format!("-max_total_time={}", 60 * minutes);
        let mut command = Command::new("rustup");
        command.args(["run", "nightly", "cargo", "fuzz", "run", "--fuzz-dir", "fuzz", name]).current_dir(&place.root);
        command.arg(&corpus).arg(format!("fuzz/seeds/{name}")).arg("--").args(LIMITS).arg(seconds);
        // the pinned compiler must not stand in for the nightly one
        for variable in ["RUSTUP_TOOLCHAIN", "CARGO", "RUSTC"] {
            command.env_remove(variable);
        }
        run(&mut command)
            .map_err(|failure| Failure(format!("{failure}; an input that crashes lies in fuzz/artifacts/{name}, {nightly}")))?;
    }
    Ok(())
}

/// The names of the targets.
fn targets(place: &Place) -> Result<Vec<String>, Failure> {
    let mut out = Vec::new();
    for entry in fs::read_dir(place.root.join("fuzz/fuzz_targets"))? {
        out.extend(entry?.path().file_stem().map(|stem| stem.to_string_lossy().into_owned()));
    }
    out.sort();
    Ok(out)
}

/// Gives a corpus the short examples of its kind.
fn begin(place: &Place, name: &str, corpus: &Path) -> Result<(), Failure> {
    fs::create_dir_all(corpus)?;
    fs::create_dir_all(place.root.join("fuzz/seeds").join(name))?;
    for (_, folder, end) in EXAMPLES.iter().filter(|e| e.0 == name) {
        for entry in fs::read_dir(place.root.join(folder))? {
            let path: PathBuf = entry?.path();
            let short = path.metadata().is_ok_and(|m| m.is_file() && m.len() < SHORT);
            if let Some(file) = path.file_name().filter(|f| short && f.to_string_lossy().ends_with(end)) {
                fs::copy(&path, corpus.join(file))?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each target calls the function of its name, each function has a target, and cargo-fuzz knows all of them.
    #[test]
    fn every_way_in_is_a_target() {
        let place = Place::find();
        let manifest = fs::read_to_string(place.root.join("fuzz/Cargo.toml")).expect("a manifest");
        let functions = fs::read_to_string(place.root.join("tests/src/fuzzed.rs")).expect("the functions");
        let known = targets(&place).expect("a folder");
        for name in &known {
            let text = fs::read_to_string(place.root.join(format!("fuzz/fuzz_targets/{name}.rs"))).expect("a target");
            assert!(text.contains(&format!("fuzzed!({name})")), "{name}");
            assert!(
                manifest.contains(&format!("name = \"{name}\"")) && functions.contains(&format!("(\"{name}\", {name})")),
                "{name}"
            );
        }
        assert_eq!(functions.matches("pub fn ").count(), known.len());
    }

    #[test]
    fn what_is_no_target_is_refused() {
        let place = Place::find();
        let said = |words: &[&str]| fuzz(&place, words).expect_err("refused").to_string();
        assert!(said(&["--minutes", "soon"]).contains("expected a number"));
        assert!(said(&["nothing"]).contains("nothing is no target; expected one of"));
    }
}
