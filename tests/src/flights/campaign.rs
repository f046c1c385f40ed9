//! The campaign of blind flights from the command line: `blind --flights ...`.
//!
//! What it is: resumable, one line a trial; even seeds tune, odd seeds judge.
//! What can go wrong: an interrupted line is cut short; it is left out on reading and run again.
//! Units: s.
//! Reference: specification `flight.md`, "The loop on flights".

use super::scenario::{CLEAN, Scenario, hidden};
use super::score::{HEADER, Line, score};
use super::tally;
use indicatif::ProgressBar;
use std::fs::{self, OpenOptions};
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What is asked.
#[derive(Debug, Clone)]
pub struct Asked {
    /// Trials with something hidden.
    pub runs: usize,
    /// Clean ones.
    pub clean: usize,
    /// Odd seeds.
    pub odd: bool,
    /// First seed.
    pub from: u64,
    /// These seeds alone.
    pub seeds: Vec<u64>,
    /// Only trials that hide this.
    pub effect: Option<String>,
    /// File of results.
    pub out: PathBuf,
    /// Threads.
    pub threads: usize,
    /// Whether failures are listed.
    pub failures: bool,
    /// Whether only the table of what is there is wanted.
    pub table: bool,
}

fn seeds(a: &Asked) -> Vec<u64> {
    if !a.seeds.is_empty() {
        return a.seeds.clone();
    }
    let first = a.from / 2 * 2 + u64::from(a.odd);
    let hides = |s: &u64| a.effect.as_ref().is_none_or(|id| hidden(*s).contains(&id.as_str()));
    let mut all: Vec<u64> = (0..).map(|k| first + 2 * k).take_while(|s| *s < CLEAN).filter(hides).take(a.runs).collect();
    all.extend((0..a.clean as u64).map(|k| CLEAN + first + 2 * k));
    all
}

/// Runs a campaign.
///
/// # Errors
/// A file that cannot be read or written.
pub fn run(a: &Asked) -> Result<(), String> {
    let fault = |e: std::io::Error| format!("{}: {e}", a.out.display());
    let wanted = seeds(a);
    let known = if a.out.exists() { fs::read_to_string(&a.out).map_err(fault)? } else { String::new() };
    let mut lines: Vec<Line> = known.lines().filter_map(Line::parse).collect();
    lines.retain(|l| wanted.contains(&l.seed));
    if !a.table {
        let left: Vec<u64> = wanted.iter().copied().filter(|s| !lines.iter().any(|l| l.seed == *s)).collect();
        let mut file = OpenOptions::new().create(true).append(true).open(&a.out).map_err(fault)?;
        if known.is_empty() {
            writeln!(file, "{HEADER}").map_err(fault)?;
        } else if !known.ends_with('\n') {
            writeln!(file).map_err(fault)?;
        }
        let bar = if std::io::stderr().is_terminal() { ProgressBar::new(left.len() as u64) } else { ProgressBar::hidden() };
        std::panic::set_hook(Box::new(|_| {})); // a panic of the tool is a figure of the campaign
        let (next, sink) = (AtomicUsize::new(0), Mutex::new((file, Vec::new())));
        std::thread::scope(|scope| {
            for _ in 0..a.threads {
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
    }
    lines.sort_by_key(|l| l.seed);
    println!("{} of {} trials\n\n{}", lines.len(), wanted.len(), tally::markdown(&lines));
    if a.failures {
        println!("{}", tally::failures(&lines));
    }
    Ok(())
}

/// Writes the two logs of a seed and its truth.
///
/// # Errors
/// A folder that cannot be written.
pub fn dump(seed: u64, folder: &Path) -> Result<(), String> {
    let fault = |e: std::io::Error| format!("{}: {e}", folder.display());
    let s = Scenario::new(seed);
    fs::create_dir_all(folder).map_err(fault)?;
    for (which, name) in ["csv", "validate.csv"].iter().enumerate() {
        fs::write(folder.join(format!("{seed}.{name}")), s.log(which)).map_err(fault)?;
    }
    let truth = format!("{:?}\n{:#?}\n{:#?}\n{:#?}\n{:#?}\n", s.trial, s.causes, s.sizes, s.vehicle, s.instruments);
    fs::write(folder.join(format!("{seed}.truth.txt")), truth).map_err(fault)
}
