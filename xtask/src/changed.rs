//! The tests that a change can break.
//!
//! What it is: the files that differ from a commit, their packages, every package that is built on one of those, and the tests of all of them.
//! Of the integration tests those alone that changed, where nothing else did.
//!
//! What can go wrong: what a test reads beside its sources (pages, examples, recorded data) is the integration tests' business: any file that
//! lies in no package asks for all of them.
//!
//! Units: none.
//!
//! Reference: `cargo metadata`; `git diff --name-only`, and files that git does not know yet.

use crate::place::Place;
use crate::run::{Failure, cargo, output};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

/// The package that runs the program, which is no library for it to depend on.
const INTEGRATION: &str = "quadrig-tests";
const PROGRAM: &str = "quadrig";
/// The files that list its modules.
const ROOTS: [&str; 2] = ["suite", "boards"];
/// What the modules of the emulated boards begin with.
const EMULATED: &str = "emulated_";

/// Folder below the root and the packages that it is built on, of each package.
type Packages = BTreeMap<String, (String, BTreeSet<String>)>;

/// What is tested.
#[derive(Debug, PartialEq)]
pub(crate) enum Asked {
    /// Nothing changed.
    Nothing,
    /// These integration tests.
    Tests(BTreeSet<String>),
    /// Everything of these packages.
    Packages(BTreeSet<String>),
}

/// The words after `cargo test` for what differs from `base`.
pub(crate) fn words(place: &Place, base: &str) -> Result<Vec<String>, Failure> {
    let git = |words: &[&str]| output(Command::new("git").args(words).current_dir(&place.root));
    let files = [git(&["diff", "--name-only", base])?, git(&["ls-files", "--others", "--exclude-standard"])?].join("\n");
    let files: Vec<&str> = files.lines().filter(|line| !line.is_empty()).collect();
    let metadata = output(&mut cargo(place, &["metadata", "--format-version", "1", "--no-deps"]))?;
    let asked = asked(&files, &packages(place, &metadata)?);
    Ok(match asked {
        Asked::Nothing => Vec::new(),
        Asked::Tests(names) => {
            let (on_boards, names): (Vec<_>, Vec<_>) = names.into_iter().partition(|name| name.starts_with(EMULATED));
            if !on_boards.is_empty() {
                println!("not run: {}; `cargo xtask test --emulated` runs the emulated boards", on_boards.join(", "));
            }
            if names.is_empty() {
                return Ok(Vec::new());
            }
            let each = names.into_iter().map(|name| format!("{name}::"));
            ["-p", INTEGRATION, "--test", "suite", "--"].map(str::to_owned).into_iter().chain(each).collect()
        }
        Asked::Packages(names) => names.into_iter().flat_map(|name| ["-p".to_owned(), name]).collect(),
    })
}

fn packages(place: &Place, metadata: &str) -> Result<Packages, Failure> {
    let strange = || Failure("cargo metadata: a package without name or folder".to_owned());
    let whole: serde_json::Value = serde_json::from_str(metadata)?;
    let mut out = Packages::new();
    for package in whole["packages"].as_array().into_iter().flatten() {
        let name = package["name"].as_str().ok_or_else(strange)?.to_owned();
        let manifest = Path::new(package["manifest_path"].as_str().ok_or_else(strange)?);
        let folder = manifest.parent().and_then(|f| f.strip_prefix(&place.root).ok()).ok_or_else(strange)?;
        let dependencies = package["dependencies"].as_array().into_iter().flatten();
        let ours = dependencies.filter(|d| d["path"].is_string()).filter_map(|d| d["name"].as_str()).map(str::to_owned);
        out.insert(name, (folder.to_string_lossy().into_owned(), ours.collect()));
    }
    if let Some((_, on)) = out.get_mut(INTEGRATION) {
        on.insert(PROGRAM.to_owned());
    }
    Ok(out)
}

/// What `files` can break.
fn asked(files: &[&str], packages: &Packages) -> Asked {
    let module = |name: &String| !name.contains('/') && !ROOTS.contains(&name.as_str());
    let name = |file: &str| Some(file.strip_prefix("tests/tests/")?.strip_suffix(".rs")?.to_owned()).filter(module);
    let own: Option<BTreeSet<String>> = files.iter().map(|file| name(file)).collect();
    match own {
        _ if files.is_empty() => return Asked::Nothing,
        Some(tests) => return Asked::Tests(tests),
        None => {}
    }
    let package_of = |file: &&str| {
        let inside = |folder: &String| file.strip_prefix(folder.as_str()).is_some_and(|rest| rest.starts_with('/'));
        packages.iter().find(|(_, (folder, _))| inside(folder)).map_or(INTEGRATION, |(name, _)| name).to_owned()
    };
    let mut out: BTreeSet<String> = files.iter().map(package_of).collect();
    loop {
        let before = out.len();
        let built_on = packages.iter().filter(|(_, (_, on))| !on.is_disjoint(&out)).map(|(name, _)| name.clone());
        out.extend(built_on.collect::<Vec<_>>());
        if out.len() == before {
            return Asked::Packages(out);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn few() -> Packages {
        let of = |folder: &str, on: &[&str]| (folder.to_owned(), on.iter().map(|s| (*s).to_owned()).collect());
        [
            ("frame", of("frame", &[])),
            ("firmware-rig", of("firmware-rig", &["frame"])),
            ("ident", of("ident", &[])),
            (PROGRAM, of("quadrig", &["ident", "firmware-rig"])),
            (INTEGRATION, of("tests", &[PROGRAM])),
        ]
        .map(|(name, of)| (name.to_owned(), of))
        .into()
    }

    fn set(names: &[&str]) -> BTreeSet<String> {
        names.iter().map(|n| (*n).to_owned()).collect()
    }

    #[test]
    fn what_is_built_on_a_change_is_tested_and_nothing_else() {
        let asked = |files: &[&str]| asked(files, &few());
        assert_eq!(asked(&[]), Asked::Nothing);
        assert_eq!(asked(&["tests/tests/readme.rs"]), Asked::Tests(set(&["readme"])));
        assert_eq!(asked(&["tests/tests/suite.rs"]), Asked::Packages(set(&[INTEGRATION])));
        assert_eq!(asked(&["README.md", "tests/tests/readme.rs"]), Asked::Packages(set(&[INTEGRATION])));
        assert_eq!(asked(&["ident/src/lib.rs"]), Asked::Packages(set(&["ident", PROGRAM, INTEGRATION])));
        assert_eq!(asked(&["frame/src/wire.rs"]), Asked::Packages(set(&["frame", "firmware-rig", PROGRAM, INTEGRATION])));
        assert_eq!(asked(&["firmware-rig/src/rig.rs"]), Asked::Packages(set(&["firmware-rig", PROGRAM, INTEGRATION])));
    }
}
