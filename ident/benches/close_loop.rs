//! How long closing the loop takes with the full library, and how much memory.
//!
//! What it is: logs of 6 000 and of 600 000 rows, a staircase up and down, that hide a drift of the zero, read and closed by one thread, each in a process of
//! its own; processor time and memory against their budgets.
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
use std::path::Path;
use std::time::Instant;

/// The allocator of the command line, so that what is measured is what users run.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Drift over the run: about five times the thrust's noise at its end, N.
const DRIFT_N: f64 = 0.06;

/// Closes the loop on a log and prints what it cost.
fn measured(path: &Path) {
    let start = Instant::now();
    let log = Log::read(path).expect("the log that was just written");
    let read = cost::processor_ms().unwrap_or(f64::NAN);
    let closed = close(&log, None, &[], &mut |_| {}).expect("a run that can be closed");
    let found = closed.verdict.effects.iter().map(|e| e.id.as_str()).collect::<Vec<_>>().join("+");
    let [memory, processor] = [cost::peak_mb(), cost::processor_ms()].map(|f| f.unwrap_or(f64::NAN));
    println!("{processor:.0} {memory:.0} {:.0} {read:.0} {found}", start.elapsed().as_secs_f64() * 1e3);
}

fn main() {
    if let Some(path) = std::env::args().skip(1).find(|a| !a.starts_with("--")) {
        measured(Path::new(&path));
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut over = false;
    // rows a level, budget of processor time, ms
    for (hold, budget) in [(147, 1000.0), (14_640, 20_000.0)] {
        let path = folder.path().join("run.csv");
        let mut log = rig::run(rig::Trouble { up_down: true, ..rig::Trouble::default() }, hold, 1).log;
        let span = log.t[log.len() - 1];
        let thrust = log.columns.iter_mut().find(|c| c.name == "thrust_n").expect("a thrust");
        thrust.values.iter_mut().zip(&log.t).for_each(|(v, t)| *v += DRIFT_N * t / span);
        log.write(&path).expect("a writable folder");
        let me = std::env::current_exe().expect("this program");
        let out = std::process::Command::new(me).arg(&path).output().expect("itself");
        let said = String::from_utf8_lossy(&out.stdout);
        let words: Vec<&str> = said.split_whitespace().collect();
        let [processor, memory, wall, read, found] = words[..] else {
            println!("{} rows: failed: {said}{}", log.len(), String::from_utf8_lossy(&out.stderr));
            over = true;
            continue;
        };
        let fits = processor.parse::<f64>().is_ok_and(|ms| ms <= budget) && found.contains("zero_drift");
        over |= !fits;
        println!(
            "{} rows: {processor} ms of processor time (budget {budget:.0}; {read} ms of it reading), {wall} ms of wall time, {memory} MB, names {found}{}",
            log.len(),
            if fits { "" } else { "  NOT KEPT" }
        );
    }
    std::process::exit(i32::from(over));
}
