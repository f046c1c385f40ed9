//! The hazards of a real bench, each mend broken on purpose.
//!
//! What it is: `tests/hazards.toml` names each hazard, what is done against it, and the test that notices. In a copy of the sources each
//! mend is taken away, its test is run, and must fail. `docs/hazards.md` is written from the same file.
//!
//! What can go wrong: a line that has moved (it must occur once), a test that goes on passing, a mend that no longer compiles: each is
//! named, and the end is a failure.
//!
//! Units: seconds.
//!
//! Reference: specification `rig.md`, "On a real bench".

use crate::emulator;
use crate::folder;
use crate::image::images;
use crate::place::Place;
use crate::run::{Failure, cargo, said};
use crate::setup;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

/// The hazards, their mends and tests.
const FILE: &str = "tests/hazards.toml";
/// What a person reads of them.
const PAGE: &str = "docs/hazards.md";

/// A hazard.
#[derive(Debug)]
struct Hazard {
    line: i64,
    danger: String,
    now: String,
    mends: Vec<Mend>,
}

/// One thing done against it.
#[derive(Debug)]
struct Mend {
    file: String,
    find: String,
    replace: String,
    test: Check,
}

/// What notices when it is gone.
#[derive(Debug)]
enum Check {
    /// A test.
    Test { path: String, name: String },
    /// `cargo xtask image` refuses, and says this.
    Image(String),
}

impl Check {
    fn read(text: &str) -> Option<Self> {
        if let Some(says) = text.strip_prefix("image: ") {
            return Some(Self::Image(says.to_owned()));
        }
        let (path, name) = text.split_once("::")?;
        Some(Self::Test { path: path.to_owned(), name: name.to_owned() })
    }

    /// Program and words that run it in `copy`, the images built beforehand where it flies one.
    fn command(&self, copy: &Place) -> Result<Command, Failure> {
        let Self::Test { path, .. } = self else { return Ok(cargo(copy, &["xtask", "image"])) };
        let (program, name) = self.place();
        let package = match path.split('/').next() {
            Some("tests") => "quadrig-tests",
            Some(package) => package,
            None => "",
        };
        let mut command = if self.flies() {
            let mut command = cargo(copy, &["test", "--release", "--workspace"]);
            command.args(emulator::words(copy)?);
            command.env("QUADRIG_EMULATOR_KEEPS_FLASH", "1").env("QUADRIG_FW_DIR", copy.images());
            command
        } else {
            cargo(copy, &["test", "--release", "-p", package])
        };
        if path.contains("/src/") {
            command.arg("--lib");
        } else {
            command.args(["--test", program]);
        }
        command.args(["--", "--exact", &name]);
        Ok(command)
    }

    /// The test program, and the name of the test in it.
    fn place(&self) -> (&str, String) {
        let Self::Test { path, name } = self else { return ("", String::new()) };
        let stem = Path::new(path).file_stem().and_then(|s| s.to_str()).unwrap_or_default();
        match path.strip_prefix("tests/tests/") {
            Some(_) => (if self.flies() { "boards" } else { "suite" }, format!("{stem}::{name}")),
            None => (stem, name.clone()),
        }
    }

    /// It needs the flash images.
    fn flies(&self) -> bool {
        matches!(self, Self::Test { path, .. } if path.contains("/emulated_"))
    }

    /// What the output of a check that notices says.
    fn says(&self) -> String {
        match self {
            Self::Test { .. } => format!("test {} ... FAILED", self.place().1),
            Self::Image(says) => says.clone(),
        }
    }

    fn typed(&self) -> String {
        match self {
            Self::Test { path, name } => format!("`{path}`, {name}"),
            Self::Image(_) => "`cargo xtask image`".to_owned(),
        }
    }
}

fn read(place: &Place) -> Result<Vec<Hazard>, Failure> {
    let text = fs::read_to_string(place.root.join(FILE)).map_err(|error| Failure(format!("{FILE}: {error}")))?;
    let table: toml::Table = text.parse().map_err(|error: toml::de::Error| Failure(format!("{FILE}: {}", error.message())))?;
    let rows = |table: &toml::Table, key: &str| -> Vec<toml::Table> {
        let rows = table.get(key).and_then(toml::Value::as_array).cloned().unwrap_or_default();
        rows.into_iter().filter_map(|row| row.as_table().cloned()).collect()
    };
    let word = |table: &toml::Table, key: &str| -> Result<String, Failure> {
        let text = table.get(key).and_then(toml::Value::as_str);
        text.map(str::to_owned).ok_or_else(|| Failure(format!("{FILE}: {key}: expected a text in {table}")))
    };
    let mut hazards = Vec::new();
    for row in rows(&table, "hazard") {
        let line = row.get("line").and_then(toml::Value::as_integer).ok_or_else(|| Failure(format!("{FILE}: line: a number")))?;
        let mut mends = Vec::new();
        for mend in rows(&row, "mend") {
            let test = word(&mend, "test")?;
            let test = Check::read(&test).ok_or_else(|| Failure(format!("{FILE}: test: expected PATH::NAME, got {test}")))?;
            mends.push(Mend { file: word(&mend, "file")?, find: word(&mend, "find")?, replace: word(&mend, "replace")?, test });
        }
        hazards.push(Hazard { line, danger: word(&row, "danger")?, now: word(&row, "now")?, mends });
    }
    Ok(hazards)
}

/// The page of them.
fn page(hazards: &[Hazard]) -> String {
    let mut page = String::from(
        "# Hazards of a real bench\n\n\
         What can go wrong beyond a simulation, what holds now, and which test notices when it does not.\n\
         `cargo xtask hazards` takes each mend away in a copy of the sources and sees its test fail; `cargo xtask hazards --page` writes\n\
         this page from `tests/hazards.toml`. What a fault in flight does: [faults](rig.md).\n\n\
         | | hazard | what holds now | tests that fail without it |\n| ---: | --- | --- | --- |\n",
    );
    for Hazard { line, danger, now, mends } in hazards {
        let tests: Vec<_> = mends.iter().map(|mend| mend.test.typed()).collect();
        let tests: Vec<_> =
            tests.iter().enumerate().filter(|(n, test)| !tests[..*n].contains(test)).map(|(_, test)| test.as_str()).collect();
        let _ = writeln!(page, "| {line} | {danger} | {now} | {} |", tests.join("<br>"));
    }
    page
}

/// Writes the page.
pub(crate) fn write_page(place: &Place) -> Result<(), Failure> {
    fs::write(place.root.join(PAGE), page(&read(place)?))?;
    println!("{PAGE}");
    Ok(())
}

/// Breaks the mends, those of `only` these lines where any are named, and sees their tests fail.
pub(crate) fn break_each(place: &Place, only: &[&str]) -> Result<(), Failure> {
    setup::target(place)?;
    let copy = folder::sources(place, "target/hazards")?;
    let (mut noticed, mut missed) = (0, Vec::new());
    for Hazard { line, mends, .. } in &read(place)? {
        if !only.is_empty() && !only.contains(&line.to_string().as_str()) {
            continue;
        }
        for mend in mends {
            let start = Instant::now();
            let found = broken(&copy, mend)?;
            let seconds = start.elapsed().as_secs_f64();
            let place = format!("line {line}, {}: {}", mend.file, mend.find.trim());
            match found {
                Ok(()) => {
                    noticed += 1;
                    println!("noticed  {place}\n         {} ({seconds:.0} s)", mend.test.typed());
                }
                Err(output) => {
                    println!("MISSED   {place}\n         {} ({seconds:.0} s)\n{output}", mend.test.typed());
                    missed.push(place);
                }
            }
        }
    }
    println!("{noticed} noticed, {} missed", missed.len());
    if missed.is_empty() { Ok(()) } else { Err(Failure(format!("no test notices: {}", missed.join("; ")))) }
}

/// Takes one mend away, runs its check, and puts it back. The inner error: what the check said, when it did not notice.
fn broken(copy: &Place, mend: &Mend) -> Result<Result<(), String>, Failure> {
    let path = copy.root.join(&mend.file);
    let whole = fs::read_to_string(&path).map_err(|error| Failure(format!("{}: {error}", mend.file)))?;
    fs::write(&path, whole.replacen(&mend.find, &mend.replace, 1))?;
    if matches!(mend.test, Check::Image(_)) {
        // cargo does not see that the log's level has changed
        for main in ["firmware-rig/src/main.rs", "firmware-ahrs/src/main.rs"].map(|main| copy.root.join(main)) {
            fs::write(&main, fs::read(&main)?)?;
        }
    }
    let built = if mend.test.flies() { said(&mut images(copy)) } else { Ok((true, String::new())) };
    let outcome = match built {
        Ok((true, _)) => said(&mut mend.test.command(copy)?),
        other => other,
    };
    fs::write(&path, whole)?;
    let (passed, output) = outcome?;
    let noticed = !passed && output.contains(&mend.test.says());
    let end: Vec<&str> = output.lines().rev().take(30).collect();
    Ok(if noticed { Ok(()) } else { Err(end.into_iter().rev().collect::<Vec<_>>().join("\n")) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_mend_stands_once_in_its_file_and_each_test_exists() {
        let place = Place::find();
        let hazards = read(&place).unwrap_or_else(|failure| panic!("{failure}"));
        assert_eq!(hazards.iter().map(|h| h.line).collect::<Vec<_>>(), (1..=12).collect::<Vec<_>>());
        for mend in hazards.iter().flat_map(|hazard| &hazard.mends) {
            let text = |path: &str| fs::read_to_string(place.root.join(path)).unwrap_or_else(|error| panic!("{path}: {error}"));
            assert_eq!(text(&mend.file).matches(&mend.find).count(), 1, "{}: {}", mend.file, mend.find);
            assert_ne!(mend.find, mend.replace);
            if let Check::Test { path, name } = &mend.test {
                let name = name.rsplit("::").next().unwrap_or(name);
                assert!(text(path).contains(&format!("fn {name}(")), "{path}: no test {name}");
            }
        }
    }

    #[test]
    fn the_page_is_current() {
        let place = Place::find();
        let wanted = page(&read(&place).unwrap_or_else(|failure| panic!("{failure}")));
        let there = fs::read_to_string(place.root.join(PAGE)).unwrap_or_default();
        assert!(there == wanted, "{PAGE}: run `cargo xtask hazards --page`");
    }
}
