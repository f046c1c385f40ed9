//! The emulator whose flash can be programmed.
//!
//! What it is: crate rigless as published maps the flash of its part read-only and drops every store. A copy of it with one line more,
//! made under `target/`, stands in for it where the emulated boards are tested.
//!
//! What can go wrong: another release of the crate in which that line is elsewhere; the copy is then refused.
//!
//! Units: none.
//!
//! Reference: rigless 0.4, `soc/stm32f427/memory_map.rs`; The Cargo Book, "Path overrides".

use crate::folder;
use crate::place::Place;
use crate::run::{Failure, cargo, output, run};
use std::fs;
use std::path::{Path, PathBuf};

/// The flash region as published, and with its programmer named.
const READ_ONLY: &str = "        .erased_in(&SECTORS)\n        .erased_to(0xFF),";
const PROGRAMMED: &str = "        .erased_in(&SECTORS)\n        .erased_to(0xFF)\n        .programmed_by(\"FLASH\"),";

/// The words with which cargo builds the workspace with this emulator in it. It declares a newer Rust than the pinned one and compiles on it.
pub(crate) fn words(place: &Place) -> Result<Vec<String>, Failure> {
    let feature = ["--features", "quadrig-tests/emulated", "--ignore-rust-version", "--config"].map(str::to_owned);
    Ok(feature.into_iter().chain([with_flash(place)?]).collect())
}

/// The argument that lets cargo build with the copy, which is made if it is not there.
pub(crate) fn with_flash(place: &Place) -> Result<String, Failure> {
    let source = published(place)?;
    let name = source.file_name().ok_or_else(|| Failure("the emulator has no folder".to_owned()))?;
    let copy = place.root.join("target/emulator").join(name);
    if !copy.is_dir() {
        let part = copy.with_extension("part");
        if part.exists() {
            fs::remove_dir_all(&part)?;
        }
        folder::copy(&source, &part)?;
        let map = part.join("src/soc/stm32f427/memory_map.rs");
        let text = fs::read_to_string(&map)?;
        if text.matches(READ_ONLY).count() != 1 {
            return Err(Failure(format!("{}: expected the flash region once, as in rigless 0.4.0", map.display())));
        }
        fs::write(&map, text.replace(READ_ONLY, PROGRAMMED))?;
        // it lies inside this workspace and is none of it; and its warnings are not ours, as those of any fetched crate
        let manifest = part.join("Cargo.toml");
        fs::write(&manifest, fs::read_to_string(&manifest)? + "\n[workspace]\n")?;
        let library = part.join("src/lib.rs");
        fs::write(&library, format!("#![allow(warnings)]\n{}", fs::read_to_string(&library)?))?;
        fs::rename(&part, &copy)?;
    }
    Ok(format!("paths=[{:?}]", copy.display().to_string()))
}

/// Builds the command line with this emulator in it, and puts it where no later build of it replaces it.
pub(crate) fn program(place: &Place) -> Result<(), Failure> {
    let config = with_flash(place)?;
    let words = ["build", "--release", "-p", "quadrig", "--features", "emulated", "--ignore-rust-version", "--config", &config];
    run(&mut cargo(place, &words))?;
    let name = |stem: &str| format!("{stem}{}", std::env::consts::EXE_SUFFIX);
    let target = place.target.join(name("quadrig-emulated"));
    fs::copy(place.target.join("release").join(name("quadrig")), &target)?;
    println!("{}", target.display());
    Ok(())
}

/// Folder of the crate as cargo has fetched it.
fn published(place: &Place) -> Result<PathBuf, Failure> {
    let words = ["metadata", "--format-version", "1", "--features", "quadrig-tests/emulated"];
    let text = output(&mut cargo(place, &words))?;
    let manifest = text
        .split("\"manifest_path\":\"")
        .filter_map(|rest| rest.split('"').next())
        .find(|path| path.contains("/rigless-0.4"))
        .ok_or_else(|| Failure("cargo metadata names no rigless 0.4".to_owned()))?;
    Path::new(manifest).parent().map(Path::to_path_buf).ok_or_else(|| Failure(format!("{manifest}: no folder")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_copy_differs_by_one_line() {
        let place = Place::find();
        let argument = with_flash(&place).unwrap_or_else(|failure| panic!("{failure}"));
        let copy = argument.split('"').nth(1).map(PathBuf::from).expect("a path");
        let text = |folder: &Path| fs::read_to_string(folder.join("src/soc/stm32f427/memory_map.rs")).expect("the memory map");
        let before = text(&published(&place).unwrap_or_else(|failure| panic!("{failure}")));
        let after = text(&copy);
        let added: Vec<&str> = after.lines().filter(|line| line.contains("programmed_by")).collect();
        assert_eq!(added, ["        .programmed_by(\"FLASH\"),"]);
        assert_eq!(after.replace(PROGRAMMED, READ_ONLY), before);
    }
}
