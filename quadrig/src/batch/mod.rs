//! `quadrig batch`.
//!
//! What it is: closes the loop on every log and export of a folder and writes two tables of what came of it. Each run's result is a file of
//! its own, so that an interrupted batch goes on where it stopped and a cluster's array can share the work.
//! What can go wrong: a bad file costs one line and one row (`refused`); a fault of the program on one run another (`failed`); the others
//! go on. A folder that holds what no batch wrote is refused.
//! Units: as the tables' headers state.
//! Reference: Slurm, "Job Array Support" (`SLURM_ARRAY_TASK_ID` and its kin).

mod own;
mod result;
mod shard;
mod table;

use crate::Failure;
use crate::apart::Paths;
use crate::open::{Columns, Names, is_own, may_be_a_run, no_run_in, open};
use crate::progress::Bar;
use crate::trouble::{unread, unwritten};
use ident::log::write_whole;
use result::{Done, close_one, key};
use shard::Shard;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder of rig logs and exports (.csv, .tsv, .txt, .log), folders in it included.
    folder: PathBuf,
    /// Folder for manifest.csv (a row a run), effects.csv (a row a parameter) and each run's result.
    #[arg(short, long)]
    output: PathBuf,
    /// Runs at a time; all cores when not given (SLURM_CPUS_PER_TASK where it is set).
    #[arg(short, long, value_parser = crate::number::whole::<u32>(1, 4096, "jobs"))]
    jobs: Option<u32>,
    /// Only the I-th of N shares of the runs; a Slurm array sets it by itself.
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Each run's folder as close-loop writes it: model, verdict, page.
    #[arg(long)]
    folders: bool,
    /// Runs whose result is there already, too.
    #[arg(long)]
    again: bool,
    #[command(flatten)]
    columns: Columns,
    #[command(flatten)]
    names: Names,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().reads([&self.folder]).adds_to("-o", [&self.output])
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let all = files(&args.folder, &args.output)?;
    own::refuse_others(&args.output)?;
    let shard = match args.shard {
        Some(shard) => shard,
        None => Shard::of_slurm(&|name| std::env::var(name).ok())?.unwrap_or_default(),
    };
    let own: Vec<&String> = all.iter().enumerate().filter(|(k, _)| shard.takes(*k)).map(|(_, f)| f).collect();
    std::fs::create_dir_all(args.output.join("runs")).map_err(unwritten(&args.output))?;
    let threads = args
        .jobs
        .map(|n| n as usize)
        .or_else(|| std::env::var("SLURM_CPUS_PER_TASK").ok()?.parse().ok())
        .unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from))
        .clamp(1, own.len().max(1));
    let (next, known, begun) = (AtomicUsize::new(0), AtomicUsize::new(0), Instant::now());
    let bar = Mutex::new((Bar::new("closing", quiet), 0_usize));
    let told: Mutex<Vec<String>> = Mutex::default();
    let failed: Mutex<Option<String>> = Mutex::default();
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(file) = own.get(next.fetch_add(1, Ordering::Relaxed)) {
                    match one(args, file) {
                        Ok(None) => drop(known.fetch_add(1, Ordering::Relaxed)),
                        Ok(Some(line)) => lock(&told).extend(line.message()),
                        // what cannot be written ends the batch: every further run would meet it too
                        Err(e) => {
                            lock(&failed).get_or_insert(e.to_string());
                            next.fetch_add(own.len(), Ordering::Relaxed);
                        }
                    }
                    let mut bar = lock(&bar);
                    bar.1 += 1;
                    bar.0.set(bar.1 as f64 / own.len() as f64);
                }
            });
        }
    });
    drop(bar);
    if let Some(why) = failed.into_inner().unwrap_or_default() {
        return Err(why.into());
    }
    let mut told = told.into_inner().unwrap_or_default();
    told.sort();
    told.iter().for_each(|line| note!("{line}"));
    let left = gather(args, &all)?;
    let states: Vec<String> = own.iter().filter_map(|file| Done::read(&result_path(args, file))).map(|done| done.state).collect();
    let counted = |state: &str| states.iter().filter(|s| *s == state).count();
    if !quiet {
        let known = known.into_inner();
        let wall = begun.elapsed().as_secs_f64();
        say!(
            "{shard}{} of {} runs: {} closed{}; {wall:.1} s on {threads} threads, {known} were there already",
            own.len(),
            all.len(),
            counted("closed"),
            others(counted("refused"), counted("failed"), &args.output)
        );
        match left {
            0 => say!("{}: {} rows", args.output.join("manifest.csv").display(), all.len()),
            n => say!("{n} runs of other shares are not there yet; the tables come with the last share"),
        }
    }
    if left == 0 { one_closes(args, &all) } else { Ok(()) }
}

/// Refuses a batch of which not one run closes: its tables hold no figure.
fn one_closes(args: &Args, all: &[String]) -> Result<(), Failure> {
    let mut done = all.iter().filter_map(|file| Done::read(&result_path(args, file)));
    if done.any(|done| done.state == "closed") {
        return Ok(());
    }
    let expected = "expected one run at least that `quadrig close-loop` takes";
    let why = args.output.join("manifest.csv");
    Err(format!(
        "{}: not one of its runs closes ({} in all); {expected} (why not: column message of {})",
        args.folder.display(),
        all.len(),
        why.display()
    )
    .into())
}

/// How many runs were not closed, and where it stands why.
fn others(refused: usize, failed: usize, output: &Path) -> String {
    let said = [(refused, "refused"), (failed, "failed")].map(|(n, state)| (n > 0).then(|| format!(", {n} {state}")));
    let said: String = said.into_iter().flatten().collect();
    if said.is_empty() { said } else { format!("{said} (why: column message of {})", output.join("manifest.csv").display()) }
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// Files that may be runs, by their path from the folder, in order. What lies in the output folder is none.
fn files(folder: &Path, output: &Path) -> Result<Vec<String>, Failure> {
    if !folder.is_dir() {
        let expected = "expected a folder of rig logs and exports (`quadrig close-loop` takes a single one)";
        return Err(format!("{}: no folder of this name is there; {expected}", folder.display()).into());
    }
    let output = std::fs::canonicalize(output).ok();
    let (mut found, mut open) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(at) = open.pop() {
        for entry in std::fs::read_dir(&at).map_err(unread(&at))? {
            let path = entry.map_err(unread(&at))?.path();
            if path.is_dir() {
                if std::fs::canonicalize(&path).ok() != output || output.is_none() {
                    open.push(path);
                }
            } else if may_be_a_run(&path) {
                let relative = path.strip_prefix(folder).unwrap_or(&path);
                let parts: Vec<String> = relative.components().map(|c| c.as_os_str().to_string_lossy().into_owned()).collect();
                found.push(parts.join("/"));
            }
        }
    }
    found.sort();
    if found.is_empty() {
        return Err(no_run_in(folder));
    }
    Ok(found)
}

/// Where a run's result is kept.
fn result_path(args: &Args, file: &str) -> PathBuf {
    args.output.join("runs").join(format!("{file}.json"))
}

/// One run: nothing where its result is there already.
fn one(args: &Args, file: &str) -> Result<Option<Done>, Failure> {
    let (path, kept) = (args.folder.join(file), result_path(args, file));
    let options = args.columns.options(&args.names);
    let key = key(&path, &format!("{options:?} {}", args.folders))?;
    if !args.again && Done::read(&kept).is_some_and(|d| d.key == key) {
        return Ok(None);
    }
    let folder = args.folders.then(|| args.output.join("runs").join(file));
    let done = close_one(file, key, folder.as_deref(), &|| {
        let own = is_own(&path)?;
        open(
            &path,
            &if own { ident::log::import::Options { mappings: Vec::new(), ..options.clone() } } else { options.clone() },
            true,
        )
    });
    if let Some(parent) = kept.parent() {
        std::fs::create_dir_all(parent).map_err(unwritten(&parent))?;
    }
    let text = done.to_json()?;
    write_whole(&kept, |out| out.write_all(text.as_bytes())).map_err(unwritten(&kept))?;
    Ok(Some(done))
}

/// Writes the tables once every run has its result; else how many have none.
fn gather(args: &Args, all: &[String]) -> Result<usize, Failure> {
    let done: Vec<Done> = all.iter().filter_map(|file| Done::read(&result_path(args, file))).collect();
    if done.len() < all.len() {
        return Ok(all.len() - done.len());
    }
    own::refuse_others(&args.output)?;
    let tables = [("manifest.csv", table::manifest(&done)?), ("effects.csv", table::effects(&done)?)];
    own::list(&args.output, &tables).map_err(unwritten(&args.output))?;
    for (name, text) in tables {
        let path = args.output.join(name);
        write_whole(&path, |out| out.write_all(&text)).map_err(unwritten(&path))?;
    }
    Ok(0)
}
