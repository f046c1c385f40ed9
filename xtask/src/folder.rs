//! Folders.
//!
//! What it is: a folder copied with all that is in it; the sources of the workspace copied to where they may be broken.
//!
//! What can go wrong: what cannot be read or written; the system's own words say which.
//!
//! Units: none.
//!
//! Reference: none.

use crate::place::Place;
use crate::run::{Failure, said};
use std::fs;
use std::path::Path;
use std::process::Command;

/// Copies a folder.
pub(crate) fn copy(from: &Path, to: &Path) -> Result<(), Failure> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy(&entry.path(), &target)?;
        } else {
            fs::copy(entry.path(), target)?;
        }
    }
    Ok(())
}

/// The sources in `folder` of the workspace, builds below it; a file that is the same is left alone, so that little is built anew.
pub(crate) fn sources(place: &Place, folder: &str) -> Result<Place, Failure> {
    let root = place.root.join(folder);
    let mut list = Command::new("git");
    list.args(["ls-files", "--cached", "--others", "--exclude-standard", "-z"]).current_dir(&place.root);
    let (true, list) = said(&mut list)? else { return Err(Failure("git ls-files failed: a checkout is needed".to_owned())) };
    for name in list.split('\0').filter(|name| !name.is_empty()) {
        let (from, to) = (place.root.join(name), root.join(name));
        let Ok(bytes) = fs::read(&from) else {
            let _ = fs::remove_file(&to); // taken away and not yet committed
            continue;
        };
        if fs::read(&to).is_ok_and(|there| there == bytes) {
            continue;
        }
        if let Some(folder) = to.parent() {
            fs::create_dir_all(folder)?;
        }
        fs::write(&to, bytes)?;
    }
    let target = root.join("target");
    Ok(Place { root, target })
}
