//! How long closing the loop takes with the full library, and how much memory.
//!
//! What it is: logs of 6 000 and of 600 000 rows, a staircase up and down, that hide a drift of the zero, read and closed by one thread; 3
//! and 30 runs of 6 000 rows together, on all cores. Each in a process of its own; processor time and memory against their budgets.
//! What can go wrong: a figure over its budget, or a cause that is not found, ends the bench with status 1. Wall time beside the
//! processor time says whether the machine was idle.
//! Units: ms, MB (largest resident set, from `/proc/self`).
//! Reference: `docs/speed.md`; run with `cargo bench -p ident --bench close_loop`.

#[path = "../tests/rig/cost.rs"]
mod cost;
#[path = "../tests/rig/mod.rs"]
mod rig;

use ident::close::close;
use ident::log::Log;
use ident::several::{close_each, close_together};
use std::path::Path;
use std::time::Instant;

/// The allocator of the command line, so that what is measured is what users run.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Drift over the run: about five times the thrust's noise at its end, N.
const DRIFT_N: f64 = 0.06;

/// Rows of a level of a log of 6 000 rows.
const HOLD: usize = 147;

/// Closes the loop on a log, or on several of one rig, and prints what it cost.
fn measured(paths: &[String]) {
    let start = Instant::now();
    let mut logs: Vec<Log> = paths.iter().map(|p| Log::read(Path::new(p)).expect("the log that was just written")).collect();
    let read = cost::processor_ms().unwrap_or(f64::NAN);
    let effects = if logs.len() > 1 {
        close_together(&close_each(logs, &|_| {}).expect("runs that can be closed"), &mut |_| {}).verdict.effects
    } else {
        close(&logs.remove(0), None, &[], &mut |_| {}).expect("a run that can be closed").verdict.effects
    };
    let found = effects.iter().map(|e| e.id.as_str()).collect::<Vec<_>>().join("+");
    let [memory, processor] = [cost::peak_mb(), cost::processor_ms()].map(|f| f.unwrap_or(f64::NAN));
    println!("{processor:.0} {memory:.0} {:.0} {read:.0} {found}", start.elapsed().as_secs_f64() * 1e3);
}

/// A run that hides a drift of the zero, written to a file.
fn written(folder: &Path, hold: usize, seed: u64) -> String {
    let path = folder.join(format!("run-{hold}-{seed}.csv"));
    let mut log = rig::run(rig::Trouble { up_down: true, ..rig::Trouble::default() }, hold, seed).log;
    let span = log.t[log.len() - 1];
    let thrust = log.columns.iter_mut().find(|c| c.name == "thrust_n").expect("a thrust");
    thrust.values.iter_mut().zip(&log.t).for_each(|(v, t)| *v += DRIFT_N * t / span);
    log.write(&path).expect("a writable folder");
    path.display().to_string()
}

fn main() {
    let paths: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    if !paths.is_empty() {
        measured(&paths);
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut over = false;
    // runs, rows a level, budget of processor time, ms: of several runs that of two cores that keep 4 s and 60 s
    for (runs, hold, budget) in [(1, HOLD, 1000.0), (1, 14_640, 20_000.0), (3, HOLD, 8000.0), (30, HOLD, 120_000.0)] {
        let paths: Vec<String> = (1..=runs).map(|seed| written(folder.path(), hold, seed)).collect();
        let me = std::env::current_exe().expect("this program");
        let out = std::process::Command::new(me).args(&paths).output().expect("itself");
        let said = String::from_utf8_lossy(&out.stdout);
        let words: Vec<&str> = said.split_whitespace().collect();
        let rows = 41 * hold;
        let [processor, memory, wall, read, found] = words[..] else {
            println!("{runs} x {rows} rows: failed: {said}{}", String::from_utf8_lossy(&out.stderr));
            over = true;
            continue;
        };
        let fits = processor.parse::<f64>().is_ok_and(|ms| ms <= budget) && found.contains("zero_drift");
        over |= !fits;
        println!(
            "{runs} x {rows} rows: {processor} ms of processor time (budget {budget:.0}; {read} ms of it reading), {wall} ms of wall time, {memory} MB, names {found}{}",
            if fits { "" } else { "  NOT KEPT" }
        );
    }
    std::process::exit(i32::from(over));
}
