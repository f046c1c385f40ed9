//! A copy of the sources with all mutants of a package in it, and its test programs.
//!
//! What it is: each mutant behind its switch; what the compiler refuses is taken out, and the rest built again, until it is a program.
//!
//! What can go wrong: an error that no mutant is the reason of; it ends the run with the compiler's words.
//!
//! Units: bytes from the start of a file.
//!
//! Reference: The Cargo Book, "External tools"; The rustc book, "JSON output".

use super::listed::{Genre, Mutant};
use super::rewrite::{Change, Rewritten, Unfit, change};
use super::sites::Sites;
use super::{PROFILE, Package};
use crate::place::Place;
use crate::run::{Failure, cargo};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;

/// The crate of the switch, as the compiler knows it: it alone may use what is not stable.
pub(super) const SWITCH_CRATE: &str = "mutant_switch";
const SWITCH: &str = include_str!("switch.rs");
const MANIFEST: &str = "[package]\nname = \"mutant-switch\"\nversion = \"0.1.0\"\nedition = \"2024\"\n";
const DEPENDENCY: &str = "[dependencies]\nmutant-switch = { path = \"../mutant-switch\" }\n";
/// What a mutant is refused for wherever it stands: what it asks of its types is not there.
const ITS_OWN: [&str; 9] = ["E0277", "E0308", "E0369", "E0368", "E0425", "E0433", "E0560", "E0599", "E0600"];
/// More rounds than errors can hide behind one another.
const ROUNDS: usize = 40;

/// Why a mutant is not in the copy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Out {
    /// It is no program, whatever stands around it.
    NoProgram,
    /// No switch can express it, or it does not compile behind one.
    NoSwitch,
}

/// A test program.
#[derive(Debug)]
pub(super) struct Program {
    pub(super) path: PathBuf,
    /// Folder of its package: where it runs.
    pub(super) folder: PathBuf,
}

/// A package with its mutants switched.
pub(super) struct Together {
    pub(super) programs: Vec<Program>,
    /// Mutants that are not in it.
    pub(super) out: BTreeMap<u32, Out>,
    /// Those in functions that the compiler may run.
    pub(super) constant: BTreeSet<u32>,
}

/// A source as it was, and as it stands in the copy.
struct Source {
    plain: String,
    changes: BTreeMap<u32, Change>,
    now: Rewritten,
}

impl Together {
    /// Builds the tests of a package with `mutants` in it; each is known by its place in the list, from 1.
    pub(super) fn build(copy: &Place, package: &Package, mutants: &[(u32, &Mutant)]) -> Result<Self, Failure> {
        let mut whole = Self { programs: Vec::new(), out: BTreeMap::new(), constant: BTreeSet::new() };
        let mut sources = whole.sources(copy, mutants)?;
        switch(copy, package)?;
        let by_id: BTreeMap<u32, &Mutant> = mutants.iter().copied().collect();
        for _ in 0..ROUNDS {
            for (file, source) in &mut sources {
                let changes: Vec<(u32, &Change)> = source.changes.iter().map(|(id, change)| (*id, change)).collect();
                source.now = Rewritten::of(&source.plain, &changes);
                write(&copy.root.join(file), &source.now.text)?;
            }
            let said = compiled(copy, package)?;
            let errors: Vec<&Value> = said.iter().filter(|line| line["message"]["level"] == "error").collect();
            if errors.is_empty() {
                whole.programs = said.iter().filter_map(program).collect();
                return Ok(whole);
            }
            let mut refused = BTreeMap::new();
            for error in &errors {
                blame(&error["message"], &sources, &by_id, &mut refused);
            }
            if refused.is_empty() {
                let words = errors.iter().filter_map(|error| error["message"]["rendered"].as_str());
                return Err(Failure(format!(
                    "{}: no mutant is the reason of this:\n{}",
                    package.name,
                    words.collect::<String>()
                )));
            }
            for (id, out) in refused {
                sources.values_mut().for_each(|source| drop(source.changes.remove(&id)));
                whole.out.insert(id, out);
            }
        }
        Err(Failure(format!("{}: still not a program after {ROUNDS} builds", package.name)))
    }

    /// The files of the mutants, and what each does to its file.
    fn sources(&mut self, copy: &Place, mutants: &[(u32, &Mutant)]) -> Result<BTreeMap<String, Source>, Failure> {
        let mut sources: BTreeMap<String, (Source, Sites)> = BTreeMap::new();
        for (id, mutant) in mutants {
            if !sources.contains_key(&mutant.file) {
                let plain = fs::read_to_string(copy.root.join(&mutant.file))?;
                let sites = Sites::of(&plain).map_err(|error| Failure(format!("{}: {error}", mutant.file)))?;
                let source = Source { plain, changes: BTreeMap::new(), now: Rewritten::default() };
                sources.insert(mutant.file.clone(), (source, sites));
            }
            let Some((source, sites)) = sources.get_mut(&mutant.file) else { continue };
            match change(&source.plain, sites, *id, mutant) {
                Ok(change) => {
                    if change.constant {
                        self.constant.insert(*id);
                    }
                    source.changes.insert(*id, change);
                }
                Err(Unfit::Fixed) => drop(self.out.insert(*id, Out::NoSwitch)),
                Err(Unfit::NoProgram) => drop(self.out.insert(*id, Out::NoProgram)),
            }
        }
        Ok(sources.into_iter().map(|(file, (source, _))| (file, source)).collect())
    }
}

/// Writes a file unless it is there.
fn write(path: &Path, text: &str) -> Result<(), Failure> {
    if fs::read_to_string(path).is_ok_and(|there| there == text) {
        return Ok(());
    }
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    Ok(fs::write(path, text)?)
}

/// Puts the crate of the switch into the copy, and into what the package depends on.
fn switch(copy: &Place, package: &Package) -> Result<(), Failure> {
    write(&copy.root.join("mutant-switch/Cargo.toml"), MANIFEST)?;
    write(&copy.root.join("mutant-switch/src/lib.rs"), SWITCH)?;
    let manifest = copy.root.join(&package.name).join("Cargo.toml");
    let text = fs::read_to_string(&manifest)?;
    if !text.contains("[dependencies]\n") {
        return Err(Failure(format!("{}/Cargo.toml: expected [dependencies]", package.name)));
    }
    write(&manifest, &text.replacen("[dependencies]\n", DEPENDENCY, 1))
}

/// What cargo says of the package's tests and of those beside it, a line each.
fn compiled(copy: &Place, package: &Package) -> Result<Vec<Value>, Failure> {
    let words = ["test", "--no-run", "--quiet", "--profile", PROFILE, "--lib", "--tests", "--message-format", "json"];
    let mut command = cargo(copy, &words);
    for name in std::iter::once(&package.name).chain(&package.beside) {
        command.args(["-p", name]);
    }
    command.env("CARGO_TARGET_DIR", &copy.target).env("RUSTC_BOOTSTRAP", SWITCH_CRATE).env_remove("DEFMT_LOG");
    let done = command.stdin(Stdio::null()).output()?;
    let text = String::from_utf8_lossy(&done.stdout);
    let said: Vec<Value> = text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
    if !done.status.success() && !said.iter().any(|line| line["message"]["level"] == "error") {
        return Err(Failure(format!("{}: tests cannot be built: {}", package.name, String::from_utf8_lossy(&done.stderr))));
    }
    Ok(said)
}

/// The test program that a line of cargo's announces.
fn program(line: &Value) -> Option<Program> {
    let of_tests = line["profile"]["test"] == true;
    let folder = Path::new(line["manifest_path"].as_str()?).parent()?.to_path_buf();
    let path = line["executable"].as_str().filter(|_| of_tests)?.into();
    Some(Program { path, folder })
}

/// The mutants that an error comes from: the one whose own text is blamed, else one that the error speaks of, else all of that switch.
fn blame(error: &Value, sources: &BTreeMap<String, Source>, mutants: &BTreeMap<u32, &Mutant>, refused: &mut BTreeMap<u32, Out>) {
    let mut spans = Vec::new();
    collect(error, &mut spans);
    let places = |primary: bool| {
        let chosen = spans.iter().filter(move |span| !primary || span["is_primary"] == true);
        chosen.filter_map(|span| {
            let source = sources.get(span["file_name"].as_str()?)?;
            Some((source, usize::try_from(span["byte_start"].as_u64()?).ok()?))
        })
    };
    let code = error["code"]["code"].as_str().unwrap_or_default();
    let own: Vec<u32> = places(true).filter_map(|(source, at)| source.now.at(at)).collect();
    for id in &own {
        let opaque = |mutant: &&Mutant| mutant.genre == Genre::FnValue && mutant.returns.contains("impl ");
        let its_own = ITS_OWN.contains(&code) && !mutants.get(id).is_some_and(opaque);
        refused.insert(*id, if its_own { Out::NoProgram } else { Out::NoSwitch });
    }
    if own.is_empty() {
        let spoken: Vec<u32> = places(false).filter_map(|(source, at)| source.now.at(at)).collect();
        let around = places(true).flat_map(|(source, at)| source.now.around(at).iter().copied());
        let blamed: Vec<u32> = if spoken.is_empty() { around.collect() } else { spoken };
        refused.extend(blamed.into_iter().map(|id| (id, Out::NoSwitch)));
    }
}

/// The spans of a message, those that a macro was called from, and those of the notes below it.
fn collect<'v>(message: &'v Value, spans: &mut Vec<&'v Value>) {
    for span in message["spans"].as_array().into_iter().flatten() {
        let mut span = span;
        while !span.is_null() {
            spans.push(span);
            span = &span["expansion"]["span"];
        }
    }
    for child in message["children"].as_array().into_iter().flatten() {
        collect(child, spans);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// Whom an error of this code is blamed on whose spans begin at these texts of the copy.
    fn blamed(code: &str, returns: &str, spans: &[(&str, bool)]) -> BTreeMap<u32, Out> {
        let plain = "fn f() { a - b }".to_owned();
        let mutant = |genre, span, replacement: &str| Mutant {
            name: String::new(),
            file: "f.rs".to_owned(),
            span,
            replacement: replacement.to_owned(),
            genre,
            returns: returns.to_owned(),
        };
        let mutants = [
            mutant(Genre::BinaryOperator, ((1, 12), (1, 13)), "+"),
            mutant(Genre::BinaryOperator, ((1, 12), (1, 13)), "/"),
            mutant(Genre::FnValue, ((1, 10), (1, 15)), "0"),
        ];
        let sites = Sites::of(&plain).unwrap();
        let by_id: BTreeMap<u32, &Mutant> = (1..).zip(&mutants).collect();
        let changes: BTreeMap<u32, Change> =
            by_id.iter().map(|(id, mutant)| (*id, change(&plain, &sites, *id, mutant).unwrap())).collect();
        let now = Rewritten::of(&plain, &changes.iter().map(|(id, change)| (*id, change)).collect::<Vec<_>>());
        let span = |(text, primary): &(&str, bool)| {
            let at = now.text.find(text).unwrap();
            json!({"file_name": "f.rs", "byte_start": at, "is_primary": primary, "expansion": null})
        };
        let error = json!({"code": {"code": code}, "spans": spans.iter().map(span).collect::<Vec<_>>(), "children": []});
        let sources = BTreeMap::from([("f.rs".to_owned(), Source { plain, changes, now })]);
        let mut refused = BTreeMap::new();
        blame(&error, &sources, &by_id, &mut refused);
        refused
    }

    #[test]
    fn an_error_is_blamed_on_the_mutant_whose_text_it_is_in() {
        assert_eq!(blamed("E0369", "", &[("a / b", true)]), BTreeMap::from([(2, Out::NoProgram)]));
        assert_eq!(blamed("E0505", "", &[("a / b", true)]), BTreeMap::from([(2, Out::NoSwitch)]));
        assert_eq!(blamed("E0308", "-> u8", &[("return 0", true)]), BTreeMap::from([(3, Out::NoProgram)]));
        assert_eq!(blamed("E0308", "-> impl Fn()", &[("return 0", true)]), BTreeMap::from([(3, Out::NoSwitch)]));
    }

    #[test]
    fn an_error_beside_the_mutants_is_blamed_on_what_it_speaks_of_or_on_the_switch() {
        assert_eq!(blamed("E0308", "", &[("a - b", true), ("a + b", false)]), BTreeMap::from([(1, Out::NoSwitch)]));
        assert_eq!(blamed("E0282", "", &[("a - b", true)]), BTreeMap::from([(1, Out::NoSwitch), (2, Out::NoSwitch)]));
        assert!(blamed("E0282", "", &[("fn f", true)]).is_empty());
    }
}
