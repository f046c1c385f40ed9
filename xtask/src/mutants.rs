//! `cargo xtask mutants`: the code broken in every small way, and the tests that notice.
//!
//! What it is: the mutants that cargo-mutants lists for the packages of `budgets/mutants.toml`, all of a package in one program in a copy of
//! the sources. One is switched on at a time, and meets the tests that reach it. What no switch can express is broken one by one.
//! `docs/mutants.md` is written from what came of it.
//!
//! What can go wrong: a mutant that no test notices and that the list does not accept; an accepted one that is caught after all, or that is
//! gone; tests that fail before anything is broken: each is named, and the end is a failure.
//!
//! Units: seconds.
//!
//! Reference: <https://mutants.rs>; `budgets/mutants.toml`.

mod bench;
mod listed;
mod page;
mod results;
mod rewrite;
mod sites;
mod together;
mod trial;

use bench::Bench;
use page::{count, left, stale, tell};
use results::Results;

use crate::folder;
use crate::place::Place;
use crate::run::{Failure, cargo, run};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Packages, what is left out, and the mutants that may live.
const FILE: &str = "budgets/mutants.toml";
/// What a person reads of them.
const PAGE: &str = "docs/mutants.md";
/// The release of cargo-mutants: another one makes other mutants.
const TOOL: &str = "27.1.0";
/// What is built: `[profile.mutants]` of the workspace.
const PROFILE: &str = "mutants";
/// Longest that the quick tests of a file may take, s: a mutant that never ends is known by that. They take less than two.
const QUICK_S: u64 = 15;
/// The same of all tests of a package: the slowest take some ten.
const WHOLE_S: u64 = 90;
/// After that nothing new is begun by `--changed`.
const CHANGED: Duration = Duration::from_secs(600);

/// A package whose code is broken.
#[derive(Debug)]
struct Package {
    name: String,
    /// Beginnings of paths below its folder that are left out.
    without: Vec<String>,
    /// Beginnings of the paths that alone are broken; none: all.
    only: Vec<String>,
    /// Integration tests that a file meets first, where their name is not the file's.
    first: BTreeMap<String, Vec<String>>,
    /// Tests that take too long to be run for each mutant.
    skip: Vec<String>,
    /// Packages whose tests are asked where its own notice nothing.
    beside: Vec<String>,
}

/// A mutant that may live.
#[derive(Debug)]
struct Accepted {
    /// File and change, as cargo-mutants names it, without line and column.
    mutant: String,
    /// How the source goes on from where the change begins; empty: wherever it is.
    at: String,
    /// It does the same as the code.
    equivalent: bool,
    why: String,
}

/// What became of a mutant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fate {
    Caught,
    /// The tests never ended.
    TimeOut,
    Missed,
    /// It is no program.
    Unviable,
    /// Its file was not asked for.
    Untried,
}

impl Fate {
    const ALL: [(Self, &str); 5] = [
        (Self::Caught, "caught"),
        (Self::TimeOut, "timeout"),
        (Self::Missed, "missed"),
        (Self::Unviable, "unviable"),
        (Self::Untried, "untried"),
    ];

    fn word(self) -> &'static str {
        Self::ALL.iter().find(|(fate, _)| *fate == self).map_or("", |(_, word)| word)
    }
}

/// Each mutant by its name, `file:line:column: change`.
type Fates = BTreeMap<String, Fate>;

/// What is asked for.
#[derive(Debug, Default, PartialEq)]
struct Asked<'w> {
    /// Lines that differ from this commit, nothing else.
    changed: Option<&'w str>,
    /// Only what no test noticed the last time, and what was not tried.
    again: bool,
    /// Only the page, of what came of it the last time.
    page: bool,
    /// These packages, or files of theirs; none: all.
    places: Vec<&'w str>,
}

fn asked<'w>(words: &[&'w str]) -> Result<Asked<'w>, Failure> {
    let mut asked = Asked::default();
    let mut words = words.iter().copied().peekable();
    while let Some(word) = words.next() {
        match word {
            "--changed" => asked.changed = Some(words.next_if(|word| !word.starts_with('-')).unwrap_or("main")),
            "--again" => asked.again = true,
            "--page" => asked.page = true,
            _ if word.starts_with('-') => {
                return Err(Failure(format!(
                    "mutants: expected --changed [COMMIT], --again, --page, a package or a file, got {word}"
                )));
            }
            place => asked.places.push(place),
        }
    }
    Ok(asked)
}

/// Breaks the code and counts what the tests notice.
pub(crate) fn mutants(place: &Place, words: &[&str]) -> Result<(), Failure> {
    let asked = asked(words)?;
    let (packages, accepted) = read(place)?;
    let results = Results { place, folder: place.root.join("budgets/mutants") };
    if asked.page {
        return results.write_page(&packages, &accepted);
    }
    for asked in &asked.places {
        if !packages.iter().any(|package| package.has(asked)) {
            let known: Vec<&str> = packages.iter().map(|package| package.name.as_str()).collect();
            return Err(Failure(format!(
                "mutants: {asked}: expected a package of {FILE} or a file of one: {}",
                known.join(", ")
            )));
        }
    }
    let tool = tool(place)?;
    let lock = place.root.join("target/mutation/lock");
    fs::create_dir_all(lock.with_file_name(""))?;
    let lock = fs::File::create(lock)?;
    lock.try_lock().map_err(|error| Failure(format!("mutants: another run breaks the copy in target/mutation ({error})")))?;
    let copy = folder::sources(place, "target/mutation/tree")?;
    let bench = Bench { place, tool, copy, results };
    let chosen = packages.iter().filter(|package| asked.places.is_empty() || asked.places.iter().any(|place| package.has(place)));
    let mut open = Vec::new();
    match asked.changed {
        Some(base) => {
            let diff = bench.difference(base)?;
            let until = Instant::now() + CHANGED;
            for package in chosen {
                let fates = bench.run(package, &asked, Some((&diff, until)))?;
                open.extend(left(place, &fates, &accepted));
                tell(&package.name, &count(place, &fates, &accepted));
            }
        }
        None => {
            for package in chosen {
                let fates = bench.run(package, &asked, None)?;
                open.extend(left(place, &fates, &accepted));
                open.extend(stale(place, package, &fates, &accepted));
                tell(&package.name, &count(place, &fates, &accepted));
            }
            bench.results.write_page(&packages, &accepted)?;
        }
    }
    for line in &open {
        println!("{line}");
    }
    if open.is_empty() { Ok(()) } else { Err(Failure(format!("mutants: {} that {FILE} does not account for", open.len()))) }
}

/// The program: the one that is installed when it is this release, else built once below `target/`.
fn tool(place: &Place) -> Result<PathBuf, Failure> {
    let root = place.root.join("target/mutation/tool");
    let own = root.join("bin").join(format!("cargo-mutants{}", std::env::consts::EXE_SUFFIX));
    for program in [Path::new("cargo-mutants"), &own] {
        let said = Command::new(program).args(["mutants", "--version"]).stdin(Stdio::null()).output();
        if said.is_ok_and(|said| String::from_utf8_lossy(&said.stdout).trim() == format!("cargo-mutants {TOOL}")) {
            return Ok(program.to_path_buf());
        }
    }
    run(cargo(place, &["install", "cargo-mutants", "--locked", "--version", TOOL, "--root"]).arg(&root))
        .map_err(|error| Failure(format!("{error}; cargo-mutants {TOOL} is needed, from crates.io")))?;
    Ok(own)
}

fn read(place: &Place) -> Result<(Vec<Package>, Vec<Accepted>), Failure> {
    let text = fs::read_to_string(place.root.join(FILE)).map_err(|error| Failure(format!("{FILE}: {error}")))?;
    let table: toml::Table = text.parse().map_err(|error: toml::de::Error| Failure(format!("{FILE}: {}", error.message())))?;
    let rows = |key: &str| -> Vec<toml::Table> {
        let rows = table.get(key).and_then(toml::Value::as_array).cloned().unwrap_or_default();
        rows.into_iter().filter_map(|row| row.as_table().cloned()).collect()
    };
    let word = |row: &toml::Table, key: &str| -> Result<String, Failure> {
        let text = row.get(key).and_then(toml::Value::as_str);
        text.map(str::to_owned).ok_or_else(|| Failure(format!("{FILE}: {key}: expected a text in {row}")))
    };
    let words = |value: Option<&toml::Value>| -> Vec<String> {
        let list = value.and_then(toml::Value::as_array).into_iter().flatten();
        list.filter_map(|value| value.as_str().map(str::to_owned)).collect()
    };
    let mut packages = Vec::new();
    for row in rows("package") {
        let first = row.get("first").and_then(toml::Value::as_table).cloned().unwrap_or_default();
        let first = first.iter().map(|(file, tests)| (file.clone(), words(Some(tests)))).collect();
        let list = |key: &str| words(row.get(key));
        packages.push(Package {
            name: word(&row, "name")?,
            without: list("without"),
            only: list("only"),
            first,
            skip: list("skip"),
            beside: list("beside"),
        });
    }
    let mut accepted = Vec::new();
    for row in rows("accepted") {
        let at = row.get("at").and_then(toml::Value::as_str).unwrap_or_default().to_owned();
        let equivalent = row.get("equivalent").and_then(toml::Value::as_bool).unwrap_or(false);
        accepted.push(Accepted { mutant: word(&row, "mutant")?, at, equivalent, why: word(&row, "why")? });
    }
    Ok((packages, accepted))
}

impl Package {
    /// The words after `cargo test` for all tests but those that take too long.
    fn all_tests(&self) -> Vec<&str> {
        let skip = self.skip.iter().flat_map(|test| ["--skip", test.as_str()]);
        ["--lib", "--tests", "--"].into_iter().chain(skip).collect()
    }

    /// Whether a file of this package is broken.
    fn breaks(&self, file: &str) -> bool {
        let below = file.strip_prefix(self.name.as_str()).and_then(|below| below.strip_prefix('/'));
        let among = |list: &[String]| below.is_some_and(|below| list.iter().any(|start| below.starts_with(start.as_str())));
        below.is_some() && !among(&self.without) && (self.only.is_empty() || among(&self.only))
    }

    /// Whether `place` is this package, or a file of it.
    fn has(&self, place: &str) -> bool {
        let below = place.strip_prefix(self.name.as_str());
        below.is_some_and(|below| below.is_empty() || (below.starts_with("/src/") && below.ends_with(".rs")))
    }
}

fn missed(fates: &Fates) -> impl Iterator<Item = &str> {
    fates.iter().filter(|(_, fate)| **fate == Fate::Missed).map(|(name, _)| name.as_str())
}

fn words(fates: &Fates) -> String {
    let of = |asked: Fate| fates.values().filter(|fate| **fate == asked).count();
    let each = Fate::ALL.into_iter().map(|(fate, word)| (of(fate), word)).filter(|(n, _)| *n > 0);
    each.map(|(n, word)| format!("{n} {word}")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn whole() -> (Place, Vec<Package>, Vec<Accepted>) {
        let place = Place::find();
        let (packages, accepted) = read(&place).unwrap_or_else(|failure| panic!("{failure}"));
        (place, packages, accepted)
    }

    #[test]
    fn each_accepted_mutant_stands_in_its_file_and_has_its_reason() {
        let (place, packages, accepted) = whole();
        for Accepted { mutant, at, why, .. } in &accepted {
            let file = mutant.split(':').next().unwrap_or_default();
            let text = fs::read_to_string(place.root.join(file)).unwrap_or_else(|error| panic!("{file}: {error}"));
            assert!(at.is_empty() || text.contains(at.as_str()), "{mutant}: {at} is not in its file");
            assert!(why.split(' ').count() > 3, "{mutant}: why?");
            assert!(packages.iter().any(|package| file.starts_with(&format!("{}/", package.name))), "{file}: of no package");
        }
    }

    #[test]
    fn what_the_list_names_is_there() {
        let (place, packages, _) = whole();
        for package in &packages {
            let exists = |below: &str| place.root.join(&package.name).join(below).exists();
            assert!(package.without.iter().chain(&package.only).all(|path| exists(path)), "{package:?}");
            assert!(package.first.keys().all(|file| exists(file)), "{package:?}");
            let tests = package.first.values().flatten();
            assert!(tests.into_iter().all(|test| exists(&format!("tests/{test}.rs"))), "{package:?}");
            assert!(package.beside.iter().all(|other| place.root.join(other).is_dir()), "{package:?}");
        }
    }

    #[test]
    fn words_are_understood_or_refused() {
        assert_eq!(asked(&["--changed", "v1", "frame"]).unwrap().places, ["frame"]);
        assert_eq!(asked(&["--changed"]).unwrap().changed, Some("main"));
        assert_eq!(asked(&["--again", "frame"]).unwrap(), Asked { again: true, places: vec!["frame"], ..Asked::default() });
        assert!(asked(&["--agian"]).is_err());
        let (_, packages, _) = whole();
        let found = |place: &str| packages.iter().find(|package| package.has(place)).map(|package| package.name.as_str());
        assert_eq!(found("firmware-rig/src/rig.rs"), Some("firmware-rig"));
        assert_eq!((found("frame"), found("frames"), found("frame/tests")), (Some("frame"), None, None));
    }
}
