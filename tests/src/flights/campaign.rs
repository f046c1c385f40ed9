//! The campaign of blind flights from the command line: `blind --flights ...`.
//!
//! What it is: resumable, one line a trial; even seeds tune, odd seeds judge.
//! What can go wrong: an interrupted line is cut short; it is left out on reading and run again.
//! Units: s.
//! Reference: specification `flight.md`, "The loop on flights".

use super::scenario::{CLEAN, Scenario, hidden};
use super::score::{Line, score};
use super::tally;
use crate::blind::resume::{known, resumed};
use std::fs;
use std::path::{Path, PathBuf};

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
    let wanted = seeds(a);
    let lines: Vec<Line> = if a.table { known(&a.out, &wanted)? } else { resumed(&a.out, &wanted, a.threads, score)? };
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
