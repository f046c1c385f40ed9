//! The crates that a stranger would take, as a stranger gets them.
//!
//! What it is: `cargo package` of each, `cargo doc` without a warning, and a program outside of the workspace that is built on the packages
//! and run.
//!
//! What can go wrong: a package that lacks a file, a dependency or a word of documentation; the step that failed is quoted.
//!
//! Units: none.
//!
//! Reference: `examples/stranger`; The Cargo Book, "cargo package".

use crate::place::Place;
use crate::run::{Failure, cargo, run};
use std::process::Command;

/// The crates, those first that others need.
pub(crate) const CRATES: [&str; 4] = ["esc-pwm", "frame", "dcm", "imu-sensors"];

/// Packs the crates, documents them, and runs the stranger's program.
pub(crate) fn strangers(place: &Place) -> Result<(), Failure> {
    let chosen = || CRATES.into_iter().flat_map(|name| ["--package", name]);
    // not built from the package here: the stranger's program does that once for all four
    let pack = |more: &[&str]| {
        let words = ["package", "--no-verify", "--allow-dirty", "--quiet", "--target-dir", "target"];
        run(cargo(place, &words).args(more).args(chosen()))
    };
    // what the workspace is built of is here already; a new machine has to ask the registry for the rest
    pack(&["--offline"]).or_else(|_| pack(&[]))?;
    let packed = place.root.join("target/package"); // where examples/stranger/Cargo.toml looks, whatever CARGO_TARGET_DIR says
    for name in CRATES {
        let _ = std::fs::remove_dir_all(packed.join(format!("{name}-{VERSION}"))); // what was deleted since must not stay
        run(Command::new("tar").arg("xzf").arg(format!("{name}-{VERSION}.crate")).current_dir(&packed))?;
    }
    run(cargo(place, &["doc", "--no-deps", "--quiet"]).args(chosen()).env("RUSTDOCFLAGS", "-D warnings"))?;
    let mut program = cargo(place, &["run", "--locked", "--quiet", "--target-dir"]);
    run(program.arg(place.root.join("target/stranger")).current_dir(place.root.join("examples/stranger")))
}

/// Version of every crate of the workspace, this one included.
const VERSION: &str = env!("CARGO_PKG_VERSION");

#[cfg(test)]
mod tests {
    use super::*;

    fn text(path: &str) -> String {
        std::fs::read_to_string(format!("{}/../{path}", env!("CARGO_MANIFEST_DIR")))
            .unwrap_or_else(|error| panic!("{path}: {error}"))
    }

    fn manifest(path: &str) -> toml::Table {
        text(path).parse().unwrap_or_else(|error| panic!("{path}: {error}"))
    }

    /// The compiler that builds and tests everything is the oldest that the crates promise: what it does not know cannot be used.
    #[test]
    fn the_rust_that_is_promised_is_the_rust_that_tests() {
        let workspace = manifest("Cargo.toml");
        let package = &workspace["workspace"]["package"];
        let (rust, edition) = (package["rust-version"].as_str().unwrap(), package["edition"].as_str().unwrap());
        let pinned = manifest("rust-toolchain.toml");
        assert_eq!(pinned["toolchain"]["channel"].as_str(), Some(format!("{rust}.0").as_str()));
        for name in CRATES {
            let readme = text(&format!("{name}/README.md"));
            assert!(readme.contains(&format!("\nRust {rust}, edition {edition}.\n")), "{name}/README.md: which Rust it needs");
        }
    }

    #[test]
    fn every_crate_says_what_a_stranger_asks_first() {
        for name in CRATES {
            let path = format!("{name}/Cargo.toml");
            let manifest = manifest(&path);
            let package = manifest["package"].as_table().unwrap();
            for key in ["description", "keywords", "categories", "readme", "license", "rust-version"] {
                assert!(package.contains_key(key), "{path}: {key}");
            }
            assert!(package["keywords"].as_array().unwrap().len() <= 5, "{path}: a registry takes five keywords");
            assert!(package["metadata"]["docs"]["rs"].is_table(), "{path}: package.metadata.docs.rs");
            let readme = text(&format!("{name}/README.md"));
            for heading in ["## Use", "## Features", "## Rust version", "## Licence"] {
                assert!(readme.contains(&format!("\n{heading}\n")), "{name}/README.md: {heading}");
            }
            for feature in manifest["features"].as_table().unwrap().keys() {
                assert!(readme.contains(&format!("\n| `{feature}` |")), "{name}/README.md: feature {feature}");
            }
            let example = readme.split("cargo run --example ").nth(1).and_then(|rest| rest.split('`').next());
            let example = example.unwrap_or_else(|| panic!("{name}/README.md: its example"));
            text(&format!("{name}/examples/{example}.rs"));
        }
    }

    #[test]
    fn the_stranger_takes_every_crate_and_nothing_else_of_the_house() {
        let manifest = manifest("examples/stranger/Cargo.toml");
        let patched: Vec<&str> = manifest["patch"]["crates-io"].as_table().unwrap().keys().map(String::as_str).collect();
        let mut crates = CRATES.to_vec();
        crates.sort_unstable();
        assert_eq!(patched, crates);
        for name in CRATES {
            let path = manifest["patch"]["crates-io"][name]["path"].as_str();
            assert_eq!(path, Some(format!("../../target/package/{name}-{VERSION}").as_str()));
        }
        let locked = text("examples/stranger/Cargo.lock");
        for name in ["ident", "hal-sim", "quadrig", "schedule", "settings-store", "safe-start"] {
            assert!(!locked.contains(&format!("name = \"{name}\"")), "{name}");
        }
    }
}
