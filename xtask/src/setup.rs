//! Set-up of a bare machine.
//!
//! What it is: the boards' Rust target, a Python environment with what the verdict checker imports, and one with mdBook.
//! Nothing is installed outside `target/` but the Rust target, and a second call does nothing.
//!
//! What can go wrong: no rustup, no python3, no venv module, no package index: one line says what to do.
//!
//! Units: none.
//!
//! Reference: `rust-toolchain.toml`, `xtask/requirements.txt`, `xtask/mdbook.txt`.

use crate::place::{BOARD, Place};
use crate::run::{Failure, output, run};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Adds the boards' target to the pinned toolchain when it is missing.
pub(crate) fn target(place: &Place) -> Result<(), Failure> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let sysroot = output(Command::new(rustc).args(["--print", "sysroot"]).current_dir(&place.root))?;
    if Path::new(&sysroot).join("lib/rustlib").join(BOARD).join("lib").is_dir() {
        println!("{BOARD}: present");
        return Ok(());
    }
    run(Command::new("rustup").args(["target", "add", BOARD]).current_dir(&place.root))
        .map_err(|error| Failure(format!("{error}; the images need the Rust target {BOARD}, from rustup or your distribution")))
}

/// Makes the Python environment of the verdict checker and returns its interpreter.
pub(crate) fn python(place: &Place) -> Result<PathBuf, Failure> {
    environment(place, "target/py", "xtask/requirements.txt")
}

/// Makes the environment that holds mdBook and returns the program.
pub(crate) fn mdbook(place: &Place) -> Result<PathBuf, Failure> {
    let python = environment(place, "target/mdbook", "xtask/mdbook.txt")?;
    Ok(python.with_file_name(if cfg!(windows) { "mdbook.exe" } else { "mdbook" }))
}

/// A Python environment in `folder` that holds the packages of the list `packages`; nothing is done where it is there already.
fn environment(place: &Place, folder: &str, packages: &str) -> Result<PathBuf, Failure> {
    let folder = place.root.join(folder);
    let python = if cfg!(windows) { folder.join("Scripts/python.exe") } else { folder.join("bin/python") };
    let wanted = std::fs::read_to_string(place.root.join(packages))?;
    let stamp = folder.join("requirements.installed");
    if python.exists() && std::fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) {
        println!("{}: present", folder.display());
        return Ok(python);
    }
    run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder))
        .map_err(|error| Failure(format!("{error}; install python3 with its venv module (Debian: python3-venv)")))?;
    run(Command::new(&python)
        .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r", packages])
        .current_dir(&place.root))
    .map_err(|error| Failure(format!("{error}; the packages of {packages} are needed")))?;
    std::fs::write(&stamp, wanted)?;
    Ok(python)
}
