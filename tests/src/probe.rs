//! A stand-in for probe-rs.
//!
//! What it is: a folder with a program of that name that writes down what it was asked and does what a test wants. No probe is here.
//! What can go wrong: it shows what `quadrig flash` asks of probe-rs, not what probe-rs does with it.
//! Units: none.
//! Reference: `probe-rs list`, `probe-rs run`.

use crate::{Said, quadrig};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The stand-in.
pub struct Probe {
    bin: PathBuf,
}

impl Probe {
    /// A program `probe-rs` in `folder` that runs the shell's `script` after it has written down its arguments.
    ///
    /// # Panics
    /// When the folder cannot be written to.
    #[must_use]
    pub fn new(folder: &Path, script: &str) -> Self {
        let bin = folder.join("bin");
        std::fs::create_dir_all(&bin).expect("a folder");
        let program = bin.join("probe-rs");
        std::fs::write(&program, format!("#!/bin/sh\necho \"$@\" >> \"$0.asked\"\n{script}\n")).expect("a script");
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).expect("it may run");
        Self { bin }
    }

    /// What it was asked so far, a line a call.
    #[must_use]
    pub fn asked(&self) -> String {
        std::fs::read_to_string(self.bin.join("probe-rs.asked")).unwrap_or_default()
    }

    /// `quadrig flash` with this stand-in before everything else that the system has.
    #[must_use]
    pub fn flash(&self, words: &[&str]) -> Said {
        let path = std::env::var_os("PATH").unwrap_or_default();
        flash(std::iter::once(self.bin.clone()).chain(std::env::split_paths(&path)), words)
    }
}

/// `quadrig flash` where programs are looked for in these folders only.
///
/// # Panics
/// When it cannot be started.
pub fn flash(path: impl IntoIterator<Item = PathBuf>, words: &[&str]) -> Said {
    let words = [&["flash"], words].concat();
    let path = std::env::join_paths(path).expect("folders without a colon");
    let output = Command::new(quadrig()).args(&words).env("PATH", path).stdin(Stdio::null()).output().expect("quadrig starts");
    Said::new(&words, output)
}
