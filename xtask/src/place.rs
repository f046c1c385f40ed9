//! Where things lie.
//!
//! What it is: the folders of the workspace, and the recorded data beside it.
//!
//! What can go wrong: no data beside the workspace; steps that need them are then skipped on a desk and fail in CI.
//!
//! Units: none.
//!
//! Reference: `QUADRIG_DATA` and `CARGO_TARGET_DIR` override the defaults; `CI` marks a build server.

use std::env;
use std::path::{Path, PathBuf};

/// The boards' Rust target.
pub(crate) const BOARD: &str = "thumbv7em-none-eabihf";

/// The folders.
#[derive(Debug)]
pub(crate) struct Place {
    /// Workspace root.
    pub(crate) root: PathBuf,
    /// Cargo's target folder of the host builds.
    pub(crate) target: PathBuf,
}

impl Place {
    /// From the variables that cargo sets for a running program.
    pub(crate) fn find() -> Self {
        let package = env::var_os("CARGO_MANIFEST_DIR").map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")), PathBuf::from);
        let root = package.parent().map(Path::to_path_buf).unwrap_or(package);
        let target = env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), |dir| root.join(dir));
        Self { root, target }
    }

    /// Target folder of the flash images: its own, so that host and board builds never wait for each other.
    pub(crate) fn firmware(&self) -> PathBuf {
        self.root.join("target/fw")
    }

    /// Where the flash images lie.
    pub(crate) fn images(&self) -> PathBuf {
        self.firmware().join(BOARD).join("release")
    }

    /// The command line that the tests build.
    pub(crate) fn quadrig(&self) -> PathBuf {
        self.target.join("release").join(format!("quadrig{}", env::consts::EXE_SUFFIX))
    }

    /// Folder of the recorded data; it may be absent.
    pub(crate) fn data(&self) -> PathBuf {
        env::var_os("QUADRIG_DATA").map_or_else(|| self.root.join("../shared/data"), PathBuf::from)
    }

    /// The verdict contract in executable form, beside the data.
    pub(crate) fn checker(&self) -> PathBuf {
        self.data().join("../tools/check_verdict.py")
    }
}

/// Whether a build server runs this: there, nothing is skipped.
pub(crate) fn on_ci() -> bool {
    env::var("CI").is_ok_and(|v| !v.is_empty() && v != "false" && v != "0")
}
