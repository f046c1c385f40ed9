//! What identification may cost.
//!
//! What it is: 36 logs of 6 300 rows and one of 600 600 rows, read and identified in processes of their own, against their budgets of
//! processor time and memory.
//! What can go wrong: wall time would depend on what else the machine does, so processor time is judged; a system without `/proc`
//! measures nothing and says so.
//! Units: ms, MB.
//! Reference: `docs/identification.md`, "Cost"; wall times: `cargo bench -p ident --bench identify`.

#[path = "rig/cost.rs"]
mod cost;
mod rig;

use ident::identify::identify;
use ident::log::Log;
use std::path::Path;
use std::process::Command;

const LOG: &str = "QUADRIG_BUDGET_LOG";
const TIMES: &str = "QUADRIG_BUDGET_TIMES";

/// Run by the test below in a process of its own; alone it has no log and does nothing.
#[test]
#[ignore = "the process that `identification_keeps_its_budget` measures"]
fn measured_process() {
    let (Ok(path), Ok(times)) = (std::env::var(LOG), std::env::var(TIMES)) else { return };
    for _ in 0..times.parse().unwrap() {
        let log = Log::read(Path::new(&path)).unwrap();
        assert!(identify(&log).unwrap().plateaus.len() >= 20);
    }
    if let (Some(ms), Some(mb)) = (cost::processor_ms(), cost::peak_mb()) {
        println!("cost {ms} {mb}");
    }
}

#[test]
fn identification_keeps_its_budget() {
    if cfg!(debug_assertions) {
        println!("not measured without optimisation");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    // rows a level, times, processor ms for each log, MB
    for (hold, times, budget) in [(300, 36, [5000.0 / 36.0, 50.0]), (28_600, 1, [2000.0, 150.0])] {
        let path = folder.path().join("run.csv");
        rig::run(rig::Trouble::default(), hold, 1).log.write(&path).unwrap();
        let out = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "measured_process", "--ignored", "--nocapture"])
            .env(LOG, &path)
            .env(TIMES, times.to_string())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&out.stdout);
        assert!(out.status.success(), "{said}");
        let figures: Vec<f64> = said
            .lines()
            .filter_map(|l| l.split_once("cost "))
            .flat_map(|(_, f)| f.split_whitespace().filter_map(|v| v.parse().ok()).collect::<Vec<f64>>())
            .collect();
        let [ms, mb] = figures[..] else {
            println!("this system has no /proc/self: not measured");
            return;
        };
        let each = ms / f64::from(times);
        println!("{times} x {} rows: {each:.0} ms of processor time each, {mb:.0} MB", 21 * hold);
        assert!(each <= budget[0] && mb <= budget[1], "{each:.0} ms, {mb:.0} MB of {budget:?}");
    }
}
