//! `quadrig runs`.
//!
//! What it is: the thirty-six runs of the thesis (six motors, six propellers, 21 levels of 30 s) flown by the firmware against the
//! simulated rig on all cores, a log each.
//! What can go wrong: a run that the firmware stops has no log and is listed; the pair that does not turn is listed as well.
//! Units: s.
//! Reference: errata, "1.8, 6.1, abstract"; specification `rig.md`, "The simulator".

use crate::Failure;
use crate::apart::Paths;
use crate::folder::Folder;
use crate::progress::{Bar, foretell};
use crate::run_log::to_log;
use crate::sim::pace;
use hal_sim::Scenario;
use hal_sim::catalogue::{Pair, pairs};
use hal_sim::scenario::Schedule;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder for the logs.
    #[arg(short, long)]
    output: PathBuf,
    /// Hold of each level, s.
    #[arg(long, default_value_t = 30.0, value_parser = crate::number::from(1.0, 600.0, "seconds"))]
    hold: f64,
    /// Threads; all cores when not given.
    #[arg(long, value_parser = crate::number::whole::<usize>(1, 4096, "threads"))]
    threads: Option<usize>,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().fills("-o", [&self.output])
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let mut folder = Folder::new(&args.output, "runs")?;
    let all: Vec<Pair> = pairs().collect();
    let threads = args.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from)).clamp(1, all.len());
    let whole_s: f64 = all.iter().map(|pair| scenario(pair, args).run_s()).sum();
    foretell(whole_s, threads as f64 * pace(&scenario(&all[0], args), all.len() as f64), quiet);
    let bar = Mutex::new((Bar::new("flying", quiet), vec![0.0; all.len()]));
    let (next, begun) = (AtomicUsize::new(0), Instant::now());
    let told: Mutex<Vec<(usize, String)>> = Mutex::new(Vec::new());
    let flown: Mutex<Vec<Flown>> = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some((i, pair)) = Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|i| Some((i, all.get(i)?))) {
                    let done = fly(pair, args, &mut |share| {
                        if let Ok(mut bar) = bar.lock() {
                            bar.1[i] = share;
                            bar.0.set(bar.1.iter().sum::<f64>() / bar.1.len() as f64);
                        }
                    });
                    match done {
                        Ok(run) => flown.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(run),
                        Err(why) => told.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push((i, why)),
                    }
                }
            });
        }
    });
    drop(bar);
    let mut told = told.into_inner().unwrap_or_default();
    told.sort();
    let flown = flown.into_inner().unwrap_or_default();
    let simulated: f64 = flown.iter().map(|run| run.seconds).sum();
    folder.extend(flown.into_iter().map(|run| (run.file, run.text)));
    folder.write()?;
    if !quiet {
        told.iter().for_each(|(_, why)| say!("{why}"));
        let wall = begun.elapsed().as_secs_f64();
        say!(
            "{}: {} runs, {simulated:.0} s in {wall:.1} s on {threads} threads, {:.0} times real time",
            args.output.display(),
            all.len() - told.len(),
            simulated / wall
        );
    }
    Ok(())
}

/// One run and its log.
struct Flown {
    file: String,
    text: Vec<u8>,
    /// Simulated, s.
    seconds: f64,
}

/// The file of a pair's log.
fn file_name(pair: &Pair) -> String {
    format!("{}_{}.csv", pair.motor, pair.propeller)
}

fn scenario(pair: &Pair, args: &Args) -> Scenario {
    let schedule = Schedule::Staircase { step_us: 50.0, hold_s: args.hold, top_us: 2000.0 };
    Scenario { schedule, ..pair.scenario() }
}

/// One run, or why there is no log.
fn fly(pair: &Pair, args: &Args, progress: &mut dyn FnMut(f64)) -> Result<Flown, String> {
    let scenario = scenario(pair, args);
    let record = hal_sim::run(&scenario, None, progress).map_err(|e| format!("{}: {e}", scenario.name))?;
    if record.truth.iter().all(|t| t.plant.rpm == 0.0) {
        return Err(format!("{}: the motor does not turn the propeller, no result", scenario.name));
    }
    let mut text = Vec::new();
    to_log(&scenario, &record, &scenario.name, false).write_to(&mut text).map_err(|e| format!("{}: {e}", scenario.name))?;
    Ok(Flown { file: file_name(pair), text, seconds: record.samples.last().map_or(0.0, |s| s.at.as_s()) })
}
