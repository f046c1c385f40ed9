//! Where mutants are made and meet their tests.
//!
//! What it is: cargo-mutants in a copy of the sources, one file after the other: its quick tests, all tests of its package, those beside it.
//! What can go wrong: tests that fail before anything is broken; a mutant of which the tool says nothing. Both end it.
//! Units: s.
//! Reference: <https://mutants.rs>.

use super::results::Results;
use super::{Asked, Fate, Fates, PROFILE, Package, QUICK_S, WHOLE_S, missed, words};
use crate::place::Place;
use crate::run::{Failure, cargo, output, run, said};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

/// Where the work is done.
pub(super) struct Bench<'p> {
    pub(super) place: &'p Place,
    pub(super) tool: PathBuf,
    pub(super) copy: Place,
    pub(super) results: Results<'p>,
}

impl Bench<'_> {
    /// The tool's `words` in the copy, builds of the copy's own.
    fn tool(&self, words: &[&str]) -> Command {
        let mut command = Command::new(&self.tool);
        command.arg("mutants").args(words).current_dir(&self.copy.root).env("CARGO_TARGET_DIR", &self.copy.target);
        command
    }

    /// What differs from `base`, as a file: new files that git does not know yet included.
    pub(super) fn difference(&self, base: &str) -> Result<PathBuf, Failure> {
        let git = |words: &[&str]| {
            let mut command = Command::new("git");
            command.args(words).current_dir(&self.place.root);
            command
        };
        let mut whole = output(&mut git(&["diff", base, "--", "*.rs"]))? + "\n";
        let new = output(&mut git(&["ls-files", "--others", "--exclude-standard", "--", "*.rs"]))?;
        for file in new.lines() {
            // a difference is no success of `git diff --no-index`
            let (_, text) = said(&mut git(&["diff", "--no-index", "--", "/dev/null", file]))?;
            whole += &text;
        }
        let file = self.place.root.join("target/mutation/changed.diff");
        fs::write(&file, whole)?;
        Ok(file)
    }

    /// Breaks a package, or what of it is asked for; of a difference its lines only, and nothing is begun after the instant.
    pub(super) fn run(
        &self,
        package: &Package,
        asked: &Asked<'_>,
        difference: Option<(&Path, Instant)>,
    ) -> Result<Fates, Failure> {
        let start = Instant::now();
        let known = if difference.is_none() { self.results.known(&self.copy.root, package)? } else { Fates::new() };
        let whole = asked.places.is_empty() || asked.places.contains(&package.name.as_str());
        let mut list = self.tool(&["--list", "-p", &package.name]);
        if let Some((diff, _)) = difference {
            list.arg("--in-diff").arg(diff);
        }
        let prefix = format!("{}/", package.name);
        let mut files: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        let mut fates = Fates::new();
        for name in output(&mut list)?.lines() {
            let file = name.split(':').next().unwrap_or_default();
            let Some(below) = file.strip_prefix(&prefix) else { continue };
            if package.without.iter().any(|start| below.starts_with(start.as_str())) {
                continue;
            }
            let fate = known.get(name).copied().unwrap_or(Fate::Untried);
            let wanted = whole || asked.places.contains(&file);
            if wanted && (!asked.again || matches!(fate, Fate::Missed | Fate::Untried)) {
                files.entry(below.to_owned()).or_default().insert(name.to_owned());
                fates.insert(name.to_owned(), Fate::Untried);
            } else {
                fates.insert(name.to_owned(), fate);
            }
        }
        let all: usize = files.values().map(BTreeSet::len).sum();
        println!("{}: {all} mutants in {} files", package.name, files.len());
        if all == 0 {
            return Ok(fates);
        }
        run(&mut self.tests(package)).map_err(|error| Failure(format!("{error} before anything was broken")))?;
        for (file, names) in files {
            if difference.is_some_and(|(_, until)| Instant::now() > until) {
                return Err(Failure(format!(
                    "{prefix}{file}: its mutants, and what comes after, have no time left: name packages"
                )));
            }
            let quick: Vec<String> = self.quick(package, &file);
            let quick: Vec<&str> = quick.iter().map(String::as_str).collect();
            let mut came = self.turn(package, &file, &names, &[], &quick, QUICK_S)?;
            let mut stages = vec![(package.name.as_str(), WHOLE_S)];
            stages.extend(package.beside.iter().map(|beside| (beside.as_str(), WHOLE_S)));
            for (tests, seconds) in stages {
                let alive: BTreeSet<String> = missed(&came).map(str::to_owned).collect();
                if !alive.is_empty() {
                    came.extend(self.turn(package, &file, &alive, &["--test-package", tests], &package.all_tests(), seconds)?);
                }
            }
            println!("  {file}: {}, {:.0} s", words(&came), start.elapsed().as_secs_f64());
            for name in missed(&came) {
                println!("    missed {name}");
            }
            fates.extend(came);
            if difference.is_none() {
                self.results.keep(&self.copy.root, package, &fates)?; // whoever ends this goes on with --again
            }
        }
        Ok(fates)
    }

    /// `cargo test` of a package as the mutants will meet it.
    fn tests(&self, package: &Package) -> Command {
        let mut command = cargo(&self.copy, &["test", "--quiet", "--profile", PROFILE, "-p", &package.name]);
        command.args(package.all_tests()).env("CARGO_TARGET_DIR", &self.copy.target).stdout(Stdio::null());
        command
    }

    /// Unit tests, and the integration test that bears the name of the file (of the module that it is a part of).
    fn quick(&self, package: &Package, file: &str) -> Vec<String> {
        let stem = file.split('/').nth(1).unwrap_or_default().trim_end_matches(".rs").to_owned();
        let tests = package.first.get(file).cloned().unwrap_or_else(|| vec![stem]);
        let there = |test: &String| self.copy.root.join(format!("{}/tests/{test}.rs", package.name)).exists();
        let each = tests.into_iter().filter(there).flat_map(|test| ["--test".to_owned(), test]);
        std::iter::once("--lib".to_owned()).chain(each).collect()
    }

    /// What becomes of the mutants `names` of one file under some tests.
    fn turn(
        &self,
        package: &Package,
        file: &str,
        names: &BTreeSet<String>,
        words: &[&str],
        tests: &[&str],
        seconds: u64,
    ) -> Result<Fates, Failure> {
        let out = self.place.root.join("target/mutation/turn");
        let _ = fs::remove_dir_all(&out);
        fs::create_dir_all(&out)?;
        let path = format!("{}/{file}", package.name);
        let only: Vec<String> = names.iter().map(|name| format!("^{}$", escaped(name))).collect();
        let list = self.place.root.join("target/mutation/turn.toml");
        let mut table = toml::Table::new();
        table.insert("examine_re".to_owned(), only.into());
        fs::write(&list, table.to_string())?;
        let seconds = seconds.to_string();
        let mut command = self.tool(&["--in-place", "--baseline", "skip", "--profile", PROFILE, "--colors", "never"]);
        command.args(["--build-timeout", "300", "--timeout", &seconds, "-p", &package.name, "-f", &path]).args(words);
        command.arg("--config").arg(&list).arg("-o").arg(&out).arg("--").args(tests);
        let (_, text) = said(&mut command)?;
        let mut came = Fates::new();
        for (fate, word) in Fate::ALL.into_iter().filter(|(fate, _)| *fate != Fate::Untried) {
            let text = fs::read_to_string(out.join(format!("mutants.out/{word}.txt"))).unwrap_or_default();
            // the tool lets deleted fields of a struct pass its own filter
            came.extend(text.lines().filter(|line| names.contains(*line)).map(|line| (line.to_owned(), fate)));
        }
        match names.iter().find(|name| !came.contains_key(*name)) {
            Some(name) => Err(Failure(format!("{name}: cargo-mutants says nothing of it: {}", text.trim()))),
            None => Ok(came),
        }
    }
}

/// A name with what regular expressions know made plain.
fn escaped(name: &str) -> String {
    let special = |c: char| "\\.+*?()|[]{}^$#&-~".contains(c);
    name.chars().flat_map(|c| special(c).then_some('\\').into_iter().chain([c])).collect()
}

#[cfg(test)]
mod tests {
    use super::escaped;

    #[test]
    fn names_are_plain_to_a_regular_expression() {
        assert_eq!(escaped("a.rs:1:2: replace | with (b)"), "a\\.rs:1:2: replace \\| with \\(b\\)");
    }
}
