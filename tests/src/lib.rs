//! What the integration tests share: the built command line, and the recorded data.
//!
//! What it is: finders; no test of its own.
//! What can go wrong: a workspace that does not build; recorded data that are absent (a test then says so and passes on a desk,
//! and fails on a build server).
//! Units: none.
//! Reference: `QUADRIG_DATA` names the data folder, `CI` marks a build server.
#![forbid(unsafe_code)]

pub mod bench;
pub mod blind;
pub mod book;
pub mod budget;
pub mod chip;
pub mod desk;
pub mod flights;
pub mod fuzzed;
pub mod inertial;
pub mod probe;
pub mod recorders;
#[cfg(unix)]
pub mod screen;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

/// The workspace root.
#[must_use]
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the package lies in the workspace")
}

/// The command line, built once in the profile that the README uses.
///
/// # Panics
/// When it does not build: no test that needs it can go on.
#[must_use]
pub fn quadrig() -> &'static Path {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    BUILT.get_or_init(|| {
        let built = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
            .args(["build", "--quiet", "--release", "--bin", "quadrig", "--message-format", "json-render-diagnostics"])
            .args(cargo_words())
            .current_dir(root())
            .stdin(Stdio::null())
            .stderr(Stdio::inherit())
            .output()
            .expect("cargo runs");
        assert!(built.status.success(), "`cargo build --release --bin quadrig` failed");
        // cargo itself says where the program lies, whatever the target folder
        String::from_utf8_lossy(&built.stdout)
            .lines()
            .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
            .find(|message| message["target"]["name"] == "quadrig" && message["executable"].is_string())
            .and_then(|message| message["executable"].as_str().map(PathBuf::from))
            .expect("cargo names the program that it built")
    })
}

/// Further words for cargo with which the running tests were built, so that no library is built a second time for the program that they
/// call: a word a line in `QUADRIG_CARGO_WORDS`, which `cargo xtask test` sets.
#[must_use]
pub fn cargo_words() -> Vec<String> {
    std::env::var("QUADRIG_CARGO_WORDS").map_or_else(|_| Vec::new(), |words| words.lines().map(str::to_owned).collect())
}

/// How many cases of a long campaign are tried: `few` in the suite, `all` by `cargo xtask campaign`, which sets `QUADRIG_CAMPAIGN`.
#[must_use]
pub fn cases<N>(few: N, all: N) -> N {
    if std::env::var_os("QUADRIG_CAMPAIGN").is_some() { all } else { few }
}

/// What one call of the command line left.
#[derive(Debug)]
pub struct Said {
    /// The words of the call.
    pub words: String,
    /// Exit status; `None` after a signal.
    pub status: Option<i32>,
    /// Standard output.
    pub out: String,
    /// Standard error.
    pub err: String,
}

impl Said {
    /// From a finished process.
    #[must_use]
    pub fn new(words: &[&str], output: Output) -> Self {
        Self {
            words: words.join(" "),
            status: output.status.code(),
            out: String::from_utf8_lossy(&output.stdout).into_owned(),
            err: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }

    /// The call succeeded.
    ///
    /// # Panics
    /// When it did not; the message quotes what it said.
    #[track_caller]
    pub fn succeeded(self) -> Self {
        assert_eq!(self.status, Some(0), "`quadrig {}`: {}", self.words, self.err);
        self
    }

    /// The call refused its input: status 1, nothing on standard output, and one line on standard error that holds each text.
    ///
    /// # Panics
    /// When it did not.
    #[track_caller]
    pub fn refused(self, texts: &[&str]) -> Self {
        assert_eq!(
            self.status,
            Some(1),
            "`quadrig {}` is to refuse its input; stdout {:?}, stderr {:?}",
            self.words,
            self.out,
            self.err
        );
        assert_eq!(self.err.lines().count(), 1, "`quadrig {}` is to say one line: {:?}", self.words, self.err);
        assert_eq!(self.out, "", "`quadrig {}` said something on standard output", self.words);
        for text in texts {
            assert!(self.err.contains(text), "`quadrig {}` says {:?}, which lacks {text:?}", self.words, self.err);
        }
        self
    }
}

/// Calls the command line in a folder.
///
/// # Panics
/// When it cannot be started.
#[must_use]
pub fn call(folder: &Path, words: &[&str]) -> Said {
    let output = Command::new(quadrig()).args(words).current_dir(folder).stdin(Stdio::null()).output().expect("quadrig starts");
    Said::new(words, output)
}

/// The recorded data, or nothing when they are absent; what is skipped for that reason is said on standard error.
///
/// # Panics
/// When they are absent on a build server.
#[must_use]
pub fn data(skipped: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("QUADRIG_DATA").map_or_else(|| root().join("../shared/data"), PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    let server = std::env::var("CI").is_ok_and(|v| !v.is_empty() && v != "false" && v != "0");
    assert!(!server, "{}: no recorded data (QUADRIG_DATA), and a build server skips nothing", folder.display());
    eprintln!("SKIPPED {skipped}: no recorded data at {} (QUADRIG_DATA names the folder)", folder.display());
    None
}

/// The files of a folder whose name a test accepts, in order of name.
///
/// # Panics
/// When the folder cannot be read or holds none: an empty set proves nothing.
#[must_use]
pub fn files(folder: &Path, wanted: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.expect("a readable folder").path()).collect();
    files.retain(|file| file.file_name().and_then(|name| name.to_str()).is_some_and(&wanted));
    assert!(!files.is_empty(), "{}: none of the expected files", folder.display());
    files.sort();
    files
}
