//! How long identification takes, and how much memory.
//!
//! What it is: a log of 6 000 rows 36 times and one of 600 000 rows, written, read and identified; each against its budget.
//! What can go wrong: a figure over its budget ends the bench with status 1; wall time needs an idle machine, and the processor time
//! beside it says whether it was one (`tests/budget.rs` judges that one on any machine).
//! Units: ms, MB (the process' largest resident set, from `/proc/self/status`).
//! Reference: specification `identification.md`; run with `cargo bench -p ident`.

#[path = "../tests/rig/cost.rs"]
mod cost;
#[path = "../tests/rig/mod.rs"]
mod rig;

use ident::identify::identify;
use ident::log::Log;
use std::path::Path;
use std::time::Instant;

fn once(path: &Path) -> f64 {
    let start = Instant::now();
    let log = Log::read(path).expect("the log that was just written");
    let found = identify(&log).expect("a run that can be identified");
    assert!(found.plateaus.len() >= 20, "{} plateaus", found.plateaus.len());
    start.elapsed().as_secs_f64() * 1e3
}

fn main() {
    // in processes of their own, so that the memory of one does not stand in the other's figure
    let mut arguments = std::env::args().skip(1).filter(|a| !a.starts_with("--"));
    if let Some(path) = arguments.next() {
        let repeats: usize = arguments.next().and_then(|n| n.parse().ok()).unwrap_or(1);
        let times: Vec<f64> = (0..repeats).map(|_| once(Path::new(&path))).collect();
        let (sum, most) = (times.iter().sum::<f64>(), times.iter().copied().fold(0.0, f64::max));
        let [memory, processor] = [cost::peak_mb(), cost::processor_ms()].map(|f| f.unwrap_or(f64::NAN));
        println!("{sum:.0} {most:.0} {memory:.0} {processor:.0}");
        return;
    }
    let folder = std::env::temp_dir().join(format!("ident-bench-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    let mut over = false;
    // rows a level, repeats, budgets: sum ms, one ms, MB
    for (name, hold, repeats, budget) in [
        ("36 logs of 6 300 rows", 300, 36, [5000.0, 200.0, 50.0]),
        ("one log of 600 600 rows", 28_600, 1, [2000.0, 2000.0, 150.0]),
    ] {
        let path = folder.join(format!("{hold}.csv"));
        rig::run(rig::Trouble::default(), hold, 1).log.write(&path).expect("a writable folder");
        let me = std::env::current_exe().expect("this program");
        let said = std::process::Command::new(me).arg(&path).arg(repeats.to_string()).output().expect("itself");
        let figures: Vec<f64> = String::from_utf8_lossy(&said.stdout).split_whitespace().filter_map(|v| v.parse().ok()).collect();
        let fits = figures.len() == 4 && figures.iter().zip(budget).all(|(f, b)| *f <= b);
        over |= !fits;
        println!(
            "{name}: sum, slowest, memory (processor time) {figures:?} of {budget:?} ms, ms, MB (ms){}",
            if fits { "" } else { "  OVER BUDGET" }
        );
    }
    let _ = std::fs::remove_dir_all(&folder);
    std::process::exit(i32::from(over));
}
