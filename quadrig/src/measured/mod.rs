//! `quadrig measured`: the loop on every recorded set, and the pages that say what came of it.
//!
//! What it is: each set under `DATA/rig` is imported, its loop is closed run by run, causes named on one run of a rig are tried on
//! the rig's other runs, each corrected model predicts them, and `measured.md` with one page and its figures a set is written.
//! What can go wrong: a set that is absent is said to be absent; a run that cannot be closed says why on its page; pages that somebody else
//! wrote are left alone.
//! Units: as the channels state.
//! Reference: specification `closing-the-loop.md`, "Real measurements".

mod cross;
mod flights;
mod own;
mod page;
mod set;
mod table;
mod together;
mod transfer;

use crate::Failure;
use crate::apart::Paths;
use crate::progress::Bar;
use crate::trouble::unwritten;
use cross::{Tried, across};
use ident::close::{Closed, close};
use ident::log::{Log, write_whole};
use ident::report::write_figures;
use set::{SETS, Set};
use std::path::PathBuf;
use together::Together;
use transfer::Transfer;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder of the recorded data; its `rig` folder holds the sets.
    data: PathBuf,
    /// Folder for `measured.md` and `measured/`.
    #[arg(short, long, default_value = "docs")]
    output: PathBuf,
    /// Only this set, without `measured.md`; may be given more than once.
    #[arg(long)]
    set: Vec<String>,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().reads([&self.data]).adds_to("-o", [&self.output])
    }
}

/// A recorded run and what came of it.
pub(crate) struct Recorded {
    /// File name without its ending.
    pub(crate) name: String,
    /// Runs with the same key come from the same rig.
    pub(crate) rig: String,
    /// The log; `None` where the file was refused.
    pub(crate) log: Option<Log>,
    /// What the import repaired.
    pub(crate) notes: usize,
    /// The closed loop, or why it could not be closed.
    pub(crate) closed: Result<Closed, String>,
}

/// Everything about one set.
pub(crate) struct Outcome {
    /// The set.
    pub(crate) set: &'static Set,
    /// Its runs in order of name.
    pub(crate) runs: Vec<Recorded>,
    /// Each cause on the rig's other runs.
    pub(crate) tried: Vec<Tried>,
    /// Each run's model on the rig's other runs.
    pub(crate) transfer: Transfer,
    /// The runs of each rig together.
    pub(crate) together: Together,
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let known = || SETS.iter().map(|s| s.folder).chain(flights::SETS.iter().map(|s| s.folder));
    if let Some(unknown) = args.set.iter().find(|n| !known().any(|s| s == n.as_str())) {
        let names: Vec<&str> = known().collect();
        return Err(format!("no set is called {unknown}; expected one of {}", names.join(", ")).into());
    }
    let rig = args.data.join("rig");
    if !rig.is_dir() {
        return Err(format!("{}: no such folder; expected the recorded sets in it", rig.display()).into());
    }
    own::refuse_others(&args.output)?;
    let wanted: Vec<&'static Set> =
        SETS.iter().filter(|s| args.set.is_empty() || args.set.iter().any(|n| n == s.folder)).collect();
    let folder = args.output.join("measured");
    std::fs::create_dir_all(&folder).map_err(unwritten(&folder))?;
    let mut outcomes = Vec::new();
    for set in wanted {
        let outcome = work(set, &rig.join(set.folder), quiet)?;
        let (text, figures) = page::set(&outcome);
        let file = folder.join(format!("{}.md", set.folder));
        write_whole(&file, |out| out.write_all(text.as_bytes())).map_err(unwritten(&file))?;
        write_figures(&folder, &figures).map_err(|(path, e)| format!("{}: {e}", path.display()))?;
        if !quiet {
            say!("{}: {} runs, {}", set.folder, outcome.runs.len(), file.display());
            if !outcome.transfer.is_empty() {
                say!("{}", table::line(set.folder, &outcome.transfer));
                say!("{}", table::line(&format!("{} together", set.folder), &outcome.together.fitted));
                say!("{}", table::line(&format!("{} together, blind", set.folder), &outcome.together.blind));
            }
        }
        outcomes.push(outcome);
    }
    let mut flown = Vec::new();
    for set in flights::SETS.iter().filter(|s| args.set.is_empty() || args.set.iter().any(|n| n == s.folder)) {
        let page = flights::work(set, &rig, &folder, quiet)?;
        if !quiet {
            say!("{}", page.section());
        }
        flown.push(page);
    }
    if args.set.is_empty() {
        let file = args.output.join("measured.md");
        let text = page::index(&outcomes) + &flights::summary(&flown);
        write_whole(&file, |out| out.write_all(text.as_bytes())).map_err(unwritten(&file))?;
    }
    Ok(())
}

fn work(set: &'static Set, folder: &std::path::Path, quiet: bool) -> Result<Outcome, Failure> {
    let files = set.files(folder)?;
    let bar = Bar::new(set.folder, quiet);
    let count = files.len().max(1) as f64;
    let mut runs = Vec::new();
    for (k, file) in files.iter().enumerate() {
        let name = file.file_stem().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let rig = set.rig(&name);
        runs.push(match set.read(file) {
            Err(why) => Recorded { name, rig, log: None, notes: 0, closed: Err(why) },
            Ok((log, notes)) => {
                let closed = close(&log, None, &[], &mut |p| bar.set((k as f64 + p) / count)).map_err(|e| e.to_string());
                Recorded { name, rig, log: Some(log), notes, closed }
            }
        });
    }
    drop(bar);
    let bar = Bar::new("other runs", quiet);
    let tried = across(&runs, &mut |p| bar.set(0.5 * p));
    let transfer = transfer::of(&runs, &mut |p| bar.set(0.5 + 0.1 * p));
    let together = together::of(&runs, &mut |p| bar.set(0.6 + 0.4 * p));
    Ok(Outcome { set, runs, tried, transfer, together })
}
