//! The emulator whose flash can be programmed, and whose translations outlive a board.
//!
//! What it is: crate rigless as published maps the flash of its part read-only and drops every store. It translates an image anew for each
//! board and at each reset, which takes longer than to run it. A copy of it, made under `target/`, stands in for it where the emulated
//! boards are tested: its flash has a programmer, and a core that ends leaves its translations to the next (`xtask/emulator/kept.rs`).
//!
//! What can go wrong: another release of the crate in which these lines are elsewhere; the copy is then refused.
//!
//! Units: none.
//!
//! Reference: rigless 0.4, `soc/stm32f427/memory_map.rs`, `cpu/armv7m/family.rs`, `runtime/emulator/core.rs`; The Cargo Book, "Path
//! overrides".

use crate::folder;
use crate::place::Place;
use crate::run::{Failure, cargo, output, run};
use std::fs;
use std::path::{Path, PathBuf};

/// What replaces a piece of a file that stands in it once.
struct Change {
    file: &'static str,
    /// As published.
    from: &'static str,
    to: &'static str,
}

const MAP: &str = "src/soc/stm32f427/memory_map.rs";
const CORE: &str = "src/cpu/armv7m/family.rs";
const BLOCKS: &str = "src/runtime/emulator/core.rs";

/// The flash region with its programmer named; translations that are taken up, looked at before the core runs, and kept over a reset unless
/// memory protection was on.
const CHANGES: [Change; 9] = [
    Change {
        file: MAP,
        from: "        .erased_in(&SECTORS)\n        .erased_to(0xFF),",
        to: "        .erased_in(&SECTORS)\n        .erased_to(0xFF)\n        .programmed_by(\"FLASH\"),",
    },
    Change {
        file: CORE,
        from: "    jit: Jit,\n    blocks: Blocks,\n",
        to: "    jit: std::mem::ManuallyDrop<Jit>,\n    blocks: Blocks,\n    made_of: Vec<(u64, Vec<u8>)>,\n",
    },
    Change {
        file: CORE,
        from: "        let mut family = Box::new(Self {\n",
        to: "        let kept = kept::take_up(features)?;\n        let mut family = Box::new(Self {\n",
    },
    Change {
        file: CORE,
        from: "            jit: Jit::new()?,\n            blocks: Blocks::default(),\n",
        to: "            jit: std::mem::ManuallyDrop::new(kept.jit),\n            blocks: kept.blocks,\n            made_of: kept.made_of,\n",
    },
    Change { file: CORE, from: "            looping: BTreeSet::new(),\n", to: "            looping: kept.looping,\n" },
    Change {
        file: CORE,
        from: "        self.mpu = Mpu::new(self.mpu.regions());\n        self.reset_requested = false;\n        self.in_debug_state = false;\n        self.host_calling = false;\n        self.mpu_changed(false);\n",
        to: "        let checked = self.mpu.enabled();\n        self.mpu = Mpu::new(self.mpu.regions());\n        self.reset_requested = false;\n        self.in_debug_state = false;\n        self.host_calling = false;\n        if checked {\n            self.mpu_changed(false);\n        }\n",
    },
    Change {
        file: CORE,
        from: "        self.bus = Some(NonNull::from(&mut bus).cast());\n        self.budget = budget;\n",
        to: "        self.look_at_kept();\n        self.bus = Some(NonNull::from(&mut bus).cast());\n        self.budget = budget;\n",
    },
    Change {
        file: CORE,
        from: "#[cfg(test)]\npub(crate) mod tests {",
        to: "#[path = \"kept.rs\"]\nmod kept;\n\n#[cfg(test)]\npub(crate) mod tests {",
    },
    Change {
        file: BLOCKS,
        from: "    /// How many blocks the page holding `address` lists.\n",
        to: "    /// The first and last byte that each block was translated from.\n    pub(crate) fn spans(&self) -> Vec<(u64, u64)> {\n        self.by_key.values().map(|&(_, first, last)| (first, last)).collect()\n    }\n\n    /// How many blocks the page holding `address` lists.\n",
    },
];
/// The file that is new, and what is in it.
const NEW: (&str, &str) = ("src/cpu/armv7m/kept.rs", include_str!("../emulator/kept.rs"));
/// Where the copy says what it was made with.
const STAMP: &str = ".changes";

/// Everything that makes the copy what it is.
fn stamp() -> String {
    CHANGES.iter().fold(NEW.1.to_owned(), |all, change| all + change.file + change.from + change.to)
}

/// Changes the copy at `root`.
fn change(root: &Path) -> Result<(), Failure> {
    for Change { file, from, to } in CHANGES {
        let text = fs::read_to_string(root.join(file))?;
        if text.matches(from).count() != 1 {
            let piece = from.trim().lines().next().unwrap_or_default();
            return Err(Failure(format!("{}: expected `{piece}` once, as in rigless 0.4.0", root.join(file).display())));
        }
        fs::write(root.join(file), text.replace(from, to))?;
    }
    fs::write(root.join(NEW.0), NEW.1)?;
    Ok(fs::write(root.join(STAMP), stamp())?)
}

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
    if fs::read_to_string(copy.join(STAMP)).is_ok_and(|made| made == stamp()) {
        return Ok(argument(&copy));
    }
    let part = copy.with_extension("part");
    for old in [&part, &copy] {
        if old.exists() {
            fs::remove_dir_all(old)?;
        }
    }
    folder::copy(&source, &part)?;
    change(&part)?;
    // it lies inside this workspace and is none of it; and its warnings are not ours, as those of any fetched crate
    let manifest = part.join("Cargo.toml");
    fs::write(&manifest, fs::read_to_string(&manifest)? + "\n[workspace]\n")?;
    let library = part.join("src/lib.rs");
    fs::write(&library, format!("#![allow(warnings)]\n{}", fs::read_to_string(&library)?))?;
    fs::rename(&part, &copy)?;
    Ok(argument(&copy))
}

/// The copy, for cargo.
fn argument(copy: &Path) -> String {
    format!("paths=[{:?}]", copy.display().to_string())
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
    fn the_copy_differs_by_these_changes() {
        let place = Place::find();
        let argument = with_flash(&place).unwrap_or_else(|failure| panic!("{failure}"));
        let copy = argument.split('"').nth(1).map(PathBuf::from).expect("a path");
        let published = published(&place).unwrap_or_else(|failure| panic!("{failure}"));
        for file in [MAP, CORE, BLOCKS] {
            let text = |folder: &Path| fs::read_to_string(folder.join(file)).expect(file);
            let of_file = CHANGES.iter().filter(|change| change.file == file);
            let back = of_file.fold(text(&copy), |all, change| all.replace(change.to, change.from));
            assert_eq!(back, text(&published), "{file}");
            assert_ne!(back, text(&copy), "{file}");
        }
        assert!(!published.join(NEW.0).exists());
    }

    #[test]
    fn a_release_with_other_lines_is_refused() {
        let folder = std::env::temp_dir().join(format!("quadrig-other-release-{}", std::process::id()));
        fs::create_dir_all(folder.join("src/soc/stm32f427")).expect("folders");
        fs::write(folder.join(MAP), "fn other() {}\n").expect("a file");
        let why = change(&folder).expect_err("the lines are not there").to_string();
        fs::remove_dir_all(&folder).expect("it is ours");
        assert!(why.contains("memory_map.rs: expected `.erased_in(&SECTORS)` once"), "{why}");
    }
}
