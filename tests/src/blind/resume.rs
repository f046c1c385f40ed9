//! Campaigns that can be interrupted: a line of results a seed, kept as soon as it is there.
//!
//! What it is: seeds of which a file holds a line are not run again; the others run on several threads.
//! What can go wrong: a file that cannot be read or written; a line that was cut short is left out on reading and run again.
//! Units: none.
//! Reference: specification `closing-the-loop.md`, "Blind trials".

use indicatif::{ProgressBar, ProgressStyle};
use std::fs::{self, OpenOptions};
use std::io::{IsTerminal, Write};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The results of one seed, a line of a file.
pub trait Line: Send + Sized {
    /// First line of the file.
    const HEADER: &'static str;
    /// From a line of the file; nothing for one that was cut short.
    fn parse(line: &str) -> Option<Self>;
    /// As a line of the file.
    fn csv(&self) -> String;
    /// The seed.
    fn seed(&self) -> u64;
}

/// The fields of a line, as many as the header has; nothing for a line that was cut short.
#[must_use]
pub fn fields<'l>(line: &'l str, header: &str) -> Option<Vec<&'l str>> {
    let fields: Vec<&str> = line.trim_end().split(',').collect();
    (fields.len() == header.split(',').count()).then_some(fields)
}

/// Says that a type with these three is a [`Line`].
macro_rules! is_line {
    ($line:ty, $header:expr) => {
        impl $crate::blind::resume::Line for $line {
            const HEADER: &'static str = $header;

            fn parse(line: &str) -> Option<Self> {
                <$line>::parse(line)
            }

            fn csv(&self) -> String {
                <$line>::csv(self)
            }

            fn seed(&self) -> u64 {
                self.seed
            }
        }
    };
}
pub(crate) use is_line;

/// Lines of the wanted seeds that `out` holds, by seed.
///
/// # Errors
/// A file that cannot be read.
pub fn known<L: Line>(out: &Path, wanted: &[u64]) -> Result<Vec<L>, String> {
    let text = if out.exists() { fs::read_to_string(out).map_err(|e| format!("{}: {e}", out.display()))? } else { String::new() };
    let mut lines: Vec<L> = text.lines().filter_map(L::parse).filter(|l| wanted.contains(&l.seed())).collect();
    lines.sort_by_key(L::seed);
    Ok(lines)
}

/// Runs those of the wanted seeds that `out` does not hold, adds their lines to it, and gives all of them, by seed.
///
/// # Errors
/// A file that cannot be read or written.
pub fn resumed<L: Line>(out: &Path, wanted: &[u64], threads: usize, score: impl Fn(u64) -> L + Sync) -> Result<Vec<L>, String> {
    let fault = |e: std::io::Error| format!("{}: {e}", out.display());
    let mut lines: Vec<L> = known(out, wanted)?;
    let left: Vec<u64> = wanted.iter().copied().filter(|s| !lines.iter().any(|l| l.seed() == *s)).collect();
    let mut file = OpenOptions::new().create(true).append(true).open(out).map_err(fault)?;
    let before = fs::read(out).map_err(fault)?;
    if before.is_empty() {
        writeln!(file, "{}", L::HEADER).map_err(fault)?;
    } else if before.last() != Some(&b'\n') {
        writeln!(file).map_err(fault)?;
    }
    let bar = if std::io::stderr().is_terminal() { ProgressBar::new(wanted.len() as u64) } else { ProgressBar::hidden() };
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} runs, {elapsed} gone, {eta} left");
    bar.set_style(style.map_err(|e| e.to_string())?);
    bar.set_position((wanted.len() - left.len()) as u64);
    // a panic of the tool is a figure of the campaign; one of the campaign itself must not end it without a word
    std::panic::set_hook(Box::new(|panic| eprintln!("blind: {panic}")));
    let (next, sink) = (AtomicUsize::new(0), Mutex::new((file, Vec::new())));
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(seed) = left.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let line = score(*seed);
                    let Ok(mut sink) = sink.lock() else { return };
                    let _ = writeln!(sink.0, "{}", line.csv()).and_then(|()| sink.0.flush());
                    sink.1.push(line);
                    bar.inc(1);
                }
            });
        }
    });
    bar.finish_and_clear();
    lines.extend(sink.into_inner().map_err(|e| e.to_string())?.1);
    lines.sort_by_key(L::seed);
    Ok(lines)
}
