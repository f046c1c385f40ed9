//! Where mutants are made and meet their tests.
//!
//! What it is: all mutants of a package in one program, each switched on for the tests that reach it. What no switch can express is broken one
//! by one by cargo-mutants itself: the quick tests of its file, all tests of its package, those beside it.
//! What can go wrong: tests that fail before anything is broken; a mutant of which the tool says nothing. Both end it.
//! Units: s.
//! Reference: <https://mutants.rs>.

use super::listed::{self, Mutant};
use super::results::Results;
use super::together::{Out, SWITCH_CRATE, Together};
use super::trial::Trial;
use super::{Asked, Fate, Fates, PROFILE, Package, QUICK_S, WHOLE_S, missed, words};
use crate::folder;
use crate::place::Place;
use crate::run::{Failure, cargo, cores, output, run, said, side_by_side};
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
        command.env("RUSTC_BOOTSTRAP", SWITCH_CRATE); // as where all are in one program: what is below both is built once
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
        let mut fates = Fates::new();
        let mut wanted = Vec::new();
        for mutant in self.list(package, difference.map(|(diff, _)| diff))? {
            let fate = known.get(&mutant.name).copied().unwrap_or(Fate::Untried);
            let chosen = whole || asked.places.contains(&mutant.file.as_str());
            let again = !asked.again || matches!(fate, Fate::Missed | Fate::Untried);
            fates.insert(mutant.name.clone(), if chosen && again { Fate::Untried } else { fate });
            if chosen && again {
                wanted.push(mutant);
            }
        }
        println!("{}: {} mutants", package.name, wanted.len());
        if wanted.is_empty() {
            return Ok(fates);
        }
        let mut keep = |came: Fates| {
            fates.extend(came);
            // whoever ends this goes on with --again
            if difference.is_none() { self.results.keep(&self.copy.root, package, &fates) } else { Ok(()) }
        };
        let alone = self.together(package, &wanted, &mut keep)?;
        self.alone(package, &alone, difference.map(|(_, until)| until), &mut keep)?;
        println!("{}: {:.0} s", package.name, start.elapsed().as_secs_f64());
        Ok(fates)
    }

    /// The mutants of a package as the tool lists them, of a difference those of its lines.
    fn list(&self, package: &Package, difference: Option<&Path>) -> Result<Vec<Mutant>, Failure> {
        let mut list = self.tool(&["--list", "--json", "-p", &package.name]);
        if let Some(diff) = difference {
            list.arg("--in-diff").arg(diff);
        }
        let mut mutants = listed::read(&output(&mut list)?)?;
        mutants.retain(|mutant| package.breaks(&mutant.file));
        Ok(mutants)
    }

    /// What becomes of the mutants that fit into one program; the others come back.
    fn together<'m>(
        &self,
        package: &Package,
        wanted: &'m [Mutant],
        keep: &mut impl FnMut(Fates) -> Result<(), Failure>,
    ) -> Result<Vec<&'m Mutant>, Failure> {
        let start = Instant::now();
        let numbered: Vec<(u32, &Mutant)> = (1..).zip(wanted).collect();
        let copy = folder::sources(self.place, "target/mutation/switched")?;
        let copy = Place { root: copy.root, target: self.copy.target.clone() };
        let whole = Together::build(&copy, package, &numbered)?;
        let of = |asked: Out| whole.out.values().filter(|out| **out == asked).count();
        let (none, alone) = (of(Out::NoProgram), of(Out::NoSwitch));
        println!(
            "  {} in one program, {none} are none, {alone} alone, {:.0} s",
            wanted.len() - none - alone,
            start.elapsed().as_secs_f64()
        );
        let trial = Trial::record(&whole.programs, package, &self.place.root.join("target/mutation/reached"))?;
        println!("  {}", trial.words());
        let mut files: BTreeMap<&str, Vec<(u32, &Mutant)>> = BTreeMap::new();
        numbered.iter().for_each(|(id, mutant)| files.entry(&mutant.file).or_default().push((*id, mutant)));
        let mut left = Vec::new();
        for (file, mutants) in files {
            let mut came = Fates::new();
            let fate = |(id, _): &(u32, &Mutant)| match whole.out.get(id) {
                Some(Out::NoProgram) => Ok(Fate::Unviable),
                Some(Out::NoSwitch) => Ok(Fate::Untried),
                None => trial.fate(*id),
            };
            side_by_side(&mutants, cores(), fate, |(id, mutant), fate| {
                let mut fate = fate?;
                if fate == Fate::Missed && whole.constant.contains(id) {
                    fate = Fate::Untried; // the compiler ran the function as it was
                }
                if fate == Fate::Untried {
                    left.push(*mutant);
                }
                came.insert(mutant.name.clone(), fate);
                Ok(())
            })?;
            told(file, &came, start);
            keep(came)?;
        }
        Ok(left)
    }

    /// What becomes of mutants one by one.
    fn alone(
        &self,
        package: &Package,
        mutants: &[&Mutant],
        until: Option<Instant>,
        keep: &mut impl FnMut(Fates) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let start = Instant::now();
        let mut files: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
        for mutant in mutants {
            files.entry(&mutant.file).or_default().insert(mutant.name.clone());
        }
        if !files.is_empty() {
            println!("  {} one by one", mutants.len());
            run(&mut self.tests(package))?;
        }
        for (file, names) in files {
            if until.is_some_and(|until| Instant::now() > until) {
                return Err(Failure(format!("{file}: its mutants, and what comes after, have no time left: name packages")));
            }
            let below = file.strip_prefix(&format!("{}/", package.name)).unwrap_or(file);
            let quick: Vec<String> = self.quick(package, below);
            let quick: Vec<&str> = quick.iter().map(String::as_str).collect();
            let mut came = self.turn(package, below, &names, &[], &quick, QUICK_S)?;
            let mut stages = vec![(package.name.as_str(), WHOLE_S)];
            stages.extend(package.beside.iter().map(|beside| (beside.as_str(), WHOLE_S)));
            for (tests, seconds) in stages {
                let alive: BTreeSet<String> = missed(&came).map(str::to_owned).collect();
                if !alive.is_empty() {
                    came.extend(self.turn(package, below, &alive, &["--test-package", tests], &package.all_tests(), seconds)?);
                }
            }
            told(file, &came, start);
            keep(came)?;
        }
        Ok(())
    }

    /// The tests of a package, built before the first mutant is timed.
    fn tests(&self, package: &Package) -> Command {
        let mut command =
            cargo(&self.copy, &["test", "--quiet", "--no-run", "--profile", PROFILE, "--lib", "--tests", "-p", &package.name]);
        command.env("CARGO_TARGET_DIR", &self.copy.target).env("RUSTC_BOOTSTRAP", SWITCH_CRATE).stdout(Stdio::null());
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

/// Says what came of a file.
fn told(file: &str, came: &Fates, start: Instant) {
    println!("  {file}: {}, {:.0} s", words(came), start.elapsed().as_secs_f64());
    for name in missed(came) {
        println!("    missed {name}");
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
