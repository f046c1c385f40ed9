//! A folder with a good log and a good model, for tests that break them.
//!
//! What it is: a made-up run that every command takes, and calls of the command line beside it.
//! What can go wrong: a command that refuses the good log: the test stops and says what it said.
//! Units: as the columns state.
//! Reference: specification `formats.md`, "Rig log".

use crate::{Said, call};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Lines of the good log before its first row: format, metadata, header.
pub const HEAD: usize = 3;
/// Plateaus of the good log, us.
pub const PULSES: [f64; 7] = [1000.0, 1200.0, 1350.0, 1500.0, 1650.0, 1800.0, 1000.0];
/// Rows of each plateau, at 10 Hz.
pub const ROWS: usize = 60;

/// A run of a made-up rig: a quadratic propeller on a motor with a time constant, a little repeatable noise.
#[must_use]
pub fn good_log() -> String {
    let mut text = "# quadrig-log 1\n# sample_hz = 10.0\nt_s,pulse_us,rpm,thrust_n,current_a,voltage_v\n".to_owned();
    let (mut rpm, mut seed) = (0.0_f64, 7_u64);
    let mut noise = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
    };
    for (n, pulse) in PULSES.iter().flat_map(|p| std::iter::repeat_n(p, ROWS)).enumerate() {
        let steady = if *pulse > 1060.0 { 8.0 * (pulse - 1000.0) } else { 0.0 };
        rpm += (steady - rpm) * 0.7;
        let measured = (rpm + 6.0 * noise()).max(0.0);
        let thrust = 1.1e-7 * rpm * rpm + 0.01 * noise();
        let current = 0.05 + 2e-11 * rpm.powi(3) + 0.02 * noise();
        let voltage = 11.5 + 0.01 * noise();
        text += &format!("{:.1},{pulse:.1},{measured:.1},{thrust:.4},{current:.3},{voltage:.3}\n", n as f64 * 0.1);
    }
    text
}

/// A folder with a good log, a good model, and room for outputs.
pub struct Bench {
    folder: TempDir,
}

impl Bench {
    /// A folder with `good.csv`, and `model.toml` identified from it.
    ///
    /// # Panics
    /// When the folder cannot be made or the good log is refused.
    #[must_use]
    pub fn new() -> Self {
        let bench = Self { folder: TempDir::new().unwrap() };
        fs::write(bench.path("good.csv"), good_log()).unwrap();
        bench.call(&["--quiet", "identify", "good.csv", "-o", "model.toml"]).succeeded();
        bench
    }

    /// The folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// A file in the folder.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Calls the command line in the folder.
    #[must_use]
    pub fn call(&self, words: &[&str]) -> Said {
        call(self.folder.path(), words)
    }

    /// Every name in the folder, so that anything left behind shows.
    ///
    /// # Panics
    /// When the folder cannot be read.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(self.folder.path()).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

impl Default for Bench {
    fn default() -> Self {
        Self::new()
    }
}
