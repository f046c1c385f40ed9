//! `cargo xtask mutants`: the code broken in every small way, and the tests that notice.
//!
//! What it is: cargo-mutants over the packages of `budgets/mutants.toml`, in a copy of the sources. Each mutant meets the quick tests of its
//! file first; what is left meets all tests of its package, then those of the packages that are named beside it. `docs/mutants.md` is
//! written from what came of it.
//!
//! What can go wrong: a mutant that no test notices and that the list does not accept; an accepted one that is caught after all, or that is
//! gone; tests that fail before anything is broken: each is named, and the end is a failure.
//!
//! Units: seconds.
//!
//! Reference: <https://mutants.rs>; `budgets/mutants.toml`.

use crate::folder;
use crate::place::Place;
use crate::run::{Failure, cargo, output, run, said};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
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
    let results = Results { place, folder: place.root.join("target/mutation/results") };
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

/// Where the work is done.
struct Bench<'p> {
    place: &'p Place,
    tool: PathBuf,
    copy: Place,
    results: Results<'p>,
}

/// What became of each mutant, a file a package.
struct Results<'p> {
    place: &'p Place,
    folder: PathBuf,
}

impl Package {
    /// The words after `cargo test` for all tests but those that take too long.
    fn all_tests(&self) -> Vec<&str> {
        let skip = self.skip.iter().flat_map(|test| ["--skip", test.as_str()]);
        ["--lib", "--tests", "--"].into_iter().chain(skip).collect()
    }

    /// Whether `place` is this package, or a file of it.
    fn has(&self, place: &str) -> bool {
        let below = place.strip_prefix(self.name.as_str());
        below.is_some_and(|below| below.is_empty() || (below.starts_with("/src/") && below.ends_with(".rs")))
    }
}

impl Bench<'_> {
    /// The tool's `words` in the copy, builds of the copy's own.
    fn tool(&self, words: &[&str]) -> Command {
        let mut command = Command::new(&self.tool);
        command.arg("mutants").args(words).current_dir(&self.copy.root).env("CARGO_TARGET_DIR", &self.copy.target);
        command
    }

    /// What differs from `base`, as a file: new files that git does not know yet included.
    fn difference(&self, base: &str) -> Result<PathBuf, Failure> {
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
    fn run(&self, package: &Package, asked: &Asked<'_>, difference: Option<(&Path, Instant)>) -> Result<Fates, Failure> {
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

impl Results<'_> {
    fn file(&self, package: &str) -> PathBuf {
        self.folder.join(format!("{package}.txt"))
    }

    /// What is known of a package, as far as its files in `root` are those that were broken then.
    fn known(&self, root: &Path, package: &Package) -> Result<Fates, Failure> {
        let Ok(text) = fs::read_to_string(self.file(&package.name)) else { return Ok(Fates::new()) };
        let mut fates = Fates::new();
        let mut same = false;
        for line in text.lines() {
            match line.split_once('\t') {
                Some(("file", rest)) => {
                    let Some((digest, file)) = rest.split_once('\t') else { continue };
                    same = Self::digest(root, file).is_ok_and(|now| now == digest);
                }
                Some((word, name)) if same => {
                    fates.extend(Fate::ALL.iter().find(|(_, w)| *w == word).map(|(fate, _)| (name.to_owned(), *fate)));
                }
                _ => {}
            }
        }
        Ok(fates)
    }

    /// Of what a file holds beside its unit tests.
    fn digest(root: &Path, file: &str) -> Result<String, Failure> {
        use sha2::Digest as _;
        let text = fs::read_to_string(root.join(file))?;
        // unit tests stand at the end of a file, and are never broken
        let code = text.split("\n#[cfg(test)]\nmod ").next().unwrap_or_default();
        Ok(sha2::Sha256::digest(code).iter().fold(String::new(), |mut hex, byte| {
            let _ = write!(hex, "{byte:02x}");
            hex
        }))
    }

    /// Writes what became of the mutants of a package whose sources are in `root`, for `--again` and the page.
    fn keep(&self, root: &Path, package: &Package, fates: &Fates) -> Result<(), Failure> {
        let mut text = String::new();
        let mut last = "";
        for (name, fate) in fates {
            let file = name.split(':').next().unwrap_or_default();
            if file != last {
                let _ = writeln!(text, "file\t{}\t{file}", Self::digest(root, file)?);
                last = file;
            }
            let _ = writeln!(text, "{}\t{name}", fate.word());
        }
        fs::create_dir_all(&self.folder)?;
        Ok(fs::write(self.file(&package.name), text)?)
    }

    /// Writes the page; a package that was not broken here keeps its row.
    fn write_page(&self, packages: &[Package], accepted: &[Accepted]) -> Result<(), Failure> {
        let before = fs::read_to_string(self.place.root.join(PAGE)).unwrap_or_default();
        let mut rows = Vec::new();
        for package in packages {
            let head = head(&package.name);
            let fates = self.known(&self.place.root, package)?;
            if fates.is_empty() {
                rows.extend(before.lines().find(|line| line.starts_with(&head)).map(str::to_owned));
            } else {
                rows.push(row(&package.name, &count(self.place, &fates, accepted)));
            }
        }
        fs::write(self.place.root.join(PAGE), page(&rows, accepted))?;
        println!("{PAGE}");
        Ok(())
    }
}

/// A name with what regular expressions know made plain.
fn escaped(name: &str) -> String {
    let special = |c: char| "\\.+*?()|[]{}^$#&-~".contains(c);
    name.chars().flat_map(|c| special(c).then_some('\\').into_iter().chain([c])).collect()
}

fn missed(fates: &Fates) -> impl Iterator<Item = &str> {
    fates.iter().filter(|(_, fate)| **fate == Fate::Missed).map(|(name, _)| name.as_str())
}

fn words(fates: &Fates) -> String {
    let of = |asked: Fate| fates.values().filter(|fate| **fate == asked).count();
    let each = Fate::ALL.into_iter().map(|(fate, word)| (of(fate), word)).filter(|(n, _)| *n > 0);
    each.map(|(n, word)| format!("{n} {word}")).collect::<Vec<_>>().join(", ")
}

/// A mutant's file, line and column from 1, and its name without the two.
fn parts(name: &str) -> Option<(&str, usize, usize, String)> {
    let (file, rest) = name.split_once(':')?;
    let (line, rest) = rest.split_once(':')?;
    let (column, change) = rest.split_once(": ")?;
    Some((file, line.parse().ok()?, column.parse().ok()?, format!("{file}: {change}")))
}

/// How the source goes on where a mutant begins.
fn source(place: &Place, name: &str) -> Option<String> {
    let (file, line, column, _) = parts(name)?;
    let text = fs::read_to_string(place.root.join(file)).ok()?;
    Some(text.lines().nth(line.checked_sub(1)?)?.chars().skip(column.checked_sub(1)?).collect())
}

impl Accepted {
    fn is(&self, place: &Place, name: &str) -> bool {
        let same = parts(name).is_some_and(|(_, _, _, plain)| plain == self.mutant);
        same && (self.at.is_empty() || source(place, name).is_some_and(|source| source.starts_with(&self.at)))
    }
}

/// The missed mutants that the list does not accept, a line each.
fn left(place: &Place, fates: &Fates, accepted: &[Accepted]) -> Vec<String> {
    let open = missed(fates).filter(|name| !accepted.iter().any(|accepted| accepted.is(place, name)));
    open.map(|name| format!("missed: {name}   [{}]", source(place, name).unwrap_or_default())).collect()
}

/// The accepted mutants of a package that live no more, a line each.
fn stale(place: &Place, package: &Package, fates: &Fates, accepted: &[Accepted]) -> Vec<String> {
    if fates.values().any(|fate| *fate == Fate::Untried) {
        return Vec::new();
    }
    let prefix = format!("{}/", package.name);
    let own = accepted.iter().filter(|accepted| accepted.mutant.starts_with(&prefix));
    let gone = own.filter(|accepted| !missed(fates).any(|name| accepted.is(place, name)));
    gone.map(|accepted| format!("accepted, but caught or gone: {} [{}]", accepted.mutant, accepted.at)).collect()
}

/// A row of the table.
#[derive(Debug, PartialEq)]
struct Count {
    viable: usize,
    caught: usize,
    time_outs: usize,
    missed: usize,
    equivalent: usize,
    untried: usize,
}

fn count(place: &Place, fates: &Fates, accepted: &[Accepted]) -> Count {
    let of = |asked: Fate| fates.values().filter(|fate| **fate == asked).count();
    let same = |name: &&str| accepted.iter().any(|accepted| accepted.equivalent && accepted.is(place, name));
    let equivalent = missed(fates).filter(same).count();
    let missed = of(Fate::Missed) - equivalent;
    let (caught, time_outs) = (of(Fate::Caught), of(Fate::TimeOut));
    Count { viable: caught + time_outs + missed, caught, time_outs, missed, equivalent, untried: of(Fate::Untried) }
}

impl Count {
    /// Share of what was noticed, per cent.
    fn share(&self) -> f64 {
        100.0 * (self.caught + self.time_outs) as f64 / self.viable.max(1) as f64
    }
}

fn tell(package: &str, count: &Count) {
    let Count { viable, caught, time_outs, missed, equivalent, untried } = count;
    println!(
        "{package}: {viable} viable, {caught} caught, {time_outs} never ended, {missed} missed, {equivalent} equivalent, \
         {untried} untried: {:.1} %",
        count.share()
    );
}

fn head(package: &str) -> String {
    format!("| `{package}` |")
}

fn row(package: &str, count: &Count) -> String {
    let Count { viable, caught, time_outs, missed, equivalent, untried } = count;
    format!(
        "{} {viable} | {caught} | {time_outs} | {missed} | {:.1} % | {equivalent} | {untried} |",
        head(package),
        count.share()
    )
}

fn page(rows: &[String], accepted: &[Accepted]) -> String {
    let mut page = String::from(
        "# Broken on purpose: do the tests notice?\n\n\
         `cargo xtask mutants` breaks the code in every small way that cargo-mutants knows: a sign, a comparison, a function's result.\n\
         Each broken program is a mutant. It is caught when a test fails, and missed when all pass.\n\
         Its own quick tests come first, then all tests of its package. This page is written by that command from `budgets/mutants.toml`.\n\n\
         - *Viable*: mutants that compile and do something else than the code.\n\
         - *Never ended*: the tests hang; that is noticed, too, and counts as caught.\n\
         - *Equivalent*: the mutant does what the code does. No test can tell, so it is left out of the share.\n\
         - *Untried*: its file was not broken yet.\n\n\
         Code that touches registers is left out: the emulated boards hold it.\n\n\
         | package | viable | caught | never ended | missed | share | equivalent | untried |\n\
         | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    for row in rows {
        let _ = writeln!(page, "{row}");
    }
    let typed = |text: &str| format!("`{}`", text.replace('|', "\\|"));
    for (title, equivalent) in [("Missed, and why they may", false), ("Equivalent, and why", true)] {
        let mut list = accepted.iter().filter(|accepted| accepted.equivalent == equivalent).peekable();
        if list.peek().is_none() {
            continue;
        }
        let _ = write!(page, "\n## {title}\n\n| mutant | where | why |\n| --- | --- | --- |\n");
        for Accepted { mutant, at, why, .. } in list {
            let at = if at.is_empty() { String::new() } else { typed(at) };
            let _ = writeln!(page, "| {} | {at} | {why} |", typed(mutant));
        }
    }
    page
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
            assert!(package.without.iter().all(|path| exists(path)), "{package:?}");
            assert!(package.first.keys().all(|file| exists(file)), "{package:?}");
            let tests = package.first.values().flatten();
            assert!(tests.into_iter().all(|test| exists(&format!("tests/{test}.rs"))), "{package:?}");
            assert!(package.beside.iter().all(|other| place.root.join(other).is_dir()), "{package:?}");
        }
    }

    #[test]
    fn the_page_is_current() {
        let (place, packages, accepted) = whole();
        let there = fs::read_to_string(place.root.join(PAGE)).unwrap_or_default();
        let rows = |package: &Package| there.lines().find(|line| line.starts_with(&head(&package.name))).map(str::to_owned);
        let rows: Vec<String> = packages.iter().filter_map(rows).collect();
        assert!(there == page(&rows, &accepted), "{PAGE}: run `cargo xtask mutants --page`");
    }

    #[test]
    fn a_mutant_is_known_by_its_file_its_change_and_its_place() {
        let place = Place::find();
        let name = "xtask/src/mutants.rs:1:5: replace x with y";
        assert_eq!(parts(name), Some(("xtask/src/mutants.rs", 1, 5, "xtask/src/mutants.rs: replace x with y".to_owned())));
        let accepted = |at: &str| Accepted {
            mutant: "xtask/src/mutants.rs: replace x with y".to_owned(),
            at: at.to_owned(),
            equivalent: true,
            why: String::new(),
        };
        assert!(accepted("`cargo xtask").is(&place, name) && accepted("").is(&place, name));
        assert!(!accepted("cargo xtask").is(&place, name));
        let fates = |fate| Fates::from([(name.to_owned(), fate)]);
        assert_eq!(left(&place, &fates(Fate::Missed), &[]).len(), 1);
        assert!(left(&place, &fates(Fate::Missed), &[accepted("")]).is_empty());
        assert!(left(&place, &fates(Fate::TimeOut), &[]).is_empty());
        assert_eq!(count(&place, &fates(Fate::Missed), &[accepted("")]).viable, 0, "no test can tell it");
        assert_eq!(count(&place, &fates(Fate::Missed), &[]).share(), 0.0);
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

    #[test]
    fn names_are_plain_to_a_regular_expression() {
        assert_eq!(escaped("a.rs:1:2: replace | with (b)"), "a\\.rs:1:2: replace \\| with \\(b\\)");
    }
}
