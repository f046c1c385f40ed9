//! A folder of results that is there whole or not at all.
//!
//! What it is: files that are gathered in memory, written beside the wanted folder and moved to its place at once.
//! What can go wrong: a folder that holds anything but earlier results, or an input of the command, is left as it is and refused.
//! Units: none.
//! Reference: specification `formats.md`: outputs are written whole or not at all, no command writes over one of its inputs.

use crate::Failure;
use std::fs;
use std::path::{Path, PathBuf};

/// Files to be written.
pub(super) struct Folder<'a> {
    path: &'a Path,
    /// Every name that the command ever writes.
    names: &'static [&'static str],
    files: Vec<(&'static str, Vec<u8>)>,
}

impl<'a> Folder<'a> {
    /// A folder at `path` that may hold files of these `names` only, none of which is one of `inputs`.
    pub(super) fn new(path: &'a Path, names: &'static [&'static str], inputs: &[PathBuf]) -> Result<Self, Failure> {
        if let Ok(there) = fs::canonicalize(path) {
            let within = |input: &&PathBuf| fs::canonicalize(input).is_ok_and(|i| i == there || i.parent() == Some(&there));
            if let Some(input) = inputs.iter().find(within) {
                let why = "is an input and lies in the folder of the results; expected another folder";
                return Err(format!("{}: {why}", input.display()).into());
            }
            let entries = fs::read_dir(path).map_err(|e| format!("{}: {e}", path.display()))?;
            for entry in entries {
                let name = entry.map_err(|e| format!("{}: {e}", path.display()))?.file_name();
                if !names.iter().any(|known| name == *known) {
                    let found = Path::new(&name).display();
                    return Err(
                        format!("{}: holds {found}; expected a new folder or one of earlier results", path.display()).into()
                    );
                }
            }
        }
        Ok(Self { path, names, files: Vec::new() })
    }

    /// One more file.
    pub(super) fn add(&mut self, name: &'static str, bytes: Vec<u8>) {
        debug_assert!(self.names.contains(&name));
        self.files.push((name, bytes));
    }

    /// Writes them.
    pub(super) fn write(self) -> Result<(), Failure> {
        self.place().map_err(|e| format!("{}: {e}", self.path.display()).into())
    }

    fn place(&self) -> std::io::Result<()> {
        let parent = self.path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        fs::create_dir_all(parent)?;
        let workshop = tempfile::Builder::new().prefix(".quadrig-").tempdir_in(parent)?;
        let [new, old] = ["new", "old"].map(|name| workshop.path().join(name));
        fs::create_dir(&new)?;
        for (name, bytes) in &self.files {
            let path = new.join(name);
            fs::write(&path, bytes)?;
            fs::File::open(&path)?.sync_all()?;
        }
        if self.path.exists() {
            fs::rename(self.path, &old)?;
        }
        fs::rename(&new, self.path).inspect_err(|_| {
            let _ = fs::rename(&old, self.path); // back to what was there
        })
    }
}
