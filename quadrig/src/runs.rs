//! `quadrig runs`.
//!
//! What it is: the thirty-six runs of the thesis (six motors, six propellers, 21 levels of 30 s) flown by the firmware against the
//! simulated rig on all cores, a log each.
//! What can go wrong: a run that the firmware stops has no log and is listed; the pair that does not turn is listed as well.
//! Units: s.
//! Reference: errata, "1.8, 6.1, abstract"; specification `rig.md`, "The simulator".

use crate::Failure;
use crate::progress::Bar;
use crate::run_log::to_log;
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
    #[arg(long, default_value_t = 30.0, value_parser = hold)]
    hold: f64,
    /// Threads; all cores when not given.
    #[arg(long)]
    threads: Option<usize>,
}

fn hold(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|h: &f64| (1.0..=600.0).contains(h)).ok_or_else(|| "expected 1 to 600 s".to_owned())
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    std::fs::create_dir_all(&args.output).map_err(|e| format!("{}: {e}", args.output.display()))?;
    let all: Vec<Pair> = pairs().collect();
    let threads = args.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from)).clamp(1, all.len());
    let bar = Mutex::new((Bar::new("flying", quiet), vec![0.0; all.len()]));
    let (next, begun) = (AtomicUsize::new(0), Instant::now());
    let told: Mutex<Vec<(usize, String)>> = Mutex::new(Vec::new());
    let simulated: Mutex<f64> = Mutex::new(0.0);
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
                        Ok(seconds) => *simulated.lock().unwrap_or_else(std::sync::PoisonError::into_inner) += seconds,
                        Err(why) => told.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push((i, why)),
                    }
                }
            });
        }
    });
    drop(bar);
    let mut told = told.into_inner().unwrap_or_default();
    told.sort();
    let simulated = simulated.into_inner().unwrap_or_default();
    if !quiet {
        told.iter().for_each(|(_, why)| println!("{why}"));
        let wall = begun.elapsed().as_secs_f64();
        println!(
            "{}: {} runs, {simulated:.0} s in {wall:.1} s on {threads} threads, {:.0} times real time",
            args.output.display(),
            all.len() - told.len(),
            simulated / wall
        );
    }
    Ok(())
}

/// One run and its log; simulated seconds, or why there is no log.
fn fly(pair: &Pair, args: &Args, progress: &mut dyn FnMut(f64)) -> Result<f64, String> {
    let schedule = Schedule::Staircase { step_us: 50.0, hold_s: args.hold, top_us: 2000.0 };
    let scenario = Scenario { schedule, ..pair.scenario() };
    let record = hal_sim::run(&scenario, None, progress).map_err(|e| format!("{}: {e}", scenario.name))?;
    if record.truth.iter().all(|t| t.plant.rpm == 0.0) {
        return Err(format!("{}: the motor does not turn the propeller, no result", scenario.name));
    }
    let path = args.output.join(format!("{}_{}.csv", pair.motor, pair.propeller));
    let log = to_log(&scenario, &record, &scenario.name, false);
    log.write(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    Ok(record.samples.last().map_or(0.0, |s| s.at.as_s()))
}
