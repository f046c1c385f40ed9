//! Folders.
//!
//! What it is: a folder copied with all that is in it.
//!
//! What can go wrong: what cannot be read or written; the system's own words say which.
//!
//! Units: none.
//!
//! Reference: none.

use crate::run::Failure;
use std::fs;
use std::path::Path;

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
