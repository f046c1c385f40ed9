//! What became of each mutant, kept below `target/`, a file a package.
//!
//! What it is: a line for each mutant beneath the digest of its file, so that only what has changed since is broken anew.
//! What can go wrong: results of another release of the tool name other mutants; they are left out.
//! Units: none.
//! Reference: `docs/mutants.md`.

use super::page::{count, head, page, row};
use super::{Accepted, Fate, Fates, PAGE, Package};
use crate::place::Place;
use crate::run::Failure;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

/// What became of each mutant, a file a package.
pub(super) struct Results<'p> {
    pub(super) place: &'p Place,
    pub(super) folder: PathBuf,
}

impl Results<'_> {
    fn file(&self, package: &str) -> PathBuf {
        self.folder.join(format!("{package}.txt"))
    }

    /// What is known of a package, as far as its files in `root` are those that were broken then.
    pub(super) fn known(&self, root: &Path, package: &Package) -> Result<Fates, Failure> {
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
    pub(super) fn keep(&self, root: &Path, package: &Package, fates: &Fates) -> Result<(), Failure> {
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
    pub(super) fn write_page(&self, packages: &[Package], accepted: &[Accepted]) -> Result<(), Failure> {
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
