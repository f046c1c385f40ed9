//! `causes`: the page `docs/ahrs-causes.md` on standard output, its figure beside it.
//!
//! What it is: recordings of two generators with one hidden cause each, on judging seeds, how often the intervals hold the truth, and
//! the recorded BROAD trials, half by half: what the command line names, and the error before and after.
//! What can go wrong: absent data; it then says so and writes the simulated part alone.
//! Units: uT, m/s^2.
//! Reference: `tests/src/inertial`; README of the recorded trials.
#![forbid(unsafe_code)]

mod broad;

use hal_sim::imu::hidden::{ImuEffectKind, UNKNOWN as FOREIGN};
use quadrig_tests::inertial::{
    Answer, CAUSES, Cause, Coverage, JUDGING, Simulated, Tally, UNKNOWN, ask, hidden, right, simulate,
};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Seeds of a tuning run begin here.
const TUNING: u64 = 0;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let flag = |name: &str| words.iter().any(|w| w == name);
    let folder = tempfile::tempdir().expect("a temporary folder");
    if let Some(to) = words.iter().position(|w| w == "--dump").and_then(|k| words.get(k + 1)) {
        return dump(&PathBuf::from(to), folder.path());
    }
    let seeds: u64 = words.first().and_then(|w| w.parse().ok()).unwrap_or(10);
    let first = if flag("--tuning") { TUNING } else { JUDGING };
    print!("{}", include_str!("causes.md"));
    let only = words.iter().position(|w| w == "--only").and_then(|k| words.get(k + 1)).map(String::as_str);
    let mut coverage = [Coverage::default(), Coverage::default()];
    if !flag("--simulator") {
        simulated(folder.path(), (seeds, first), only, &mut coverage[0]);
    }
    hidden_ones(folder.path(), (seeds, first), only, &mut coverage[1]);
    covered(&coverage);
    if only.is_none() && !flag("--tuning") && !flag("--simulator") {
        broad::recorded(folder.path());
    }
}

/// One log's case and what came of it.
struct Asked {
    log: Simulated,
    answer: Answer,
}

/// Works the cases off on two threads, each in a folder of its own; answers in the cases' order.
fn all<C: Sync>(folder: &Path, cases: &[C], make: impl Fn(&Path, &C) -> Simulated + Sync) -> Vec<Asked> {
    let (next, done) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for worker in 0..2 {
            let (next, done, make) = (&next, &done, &make);
            let own = folder.join(format!("worker{worker}"));
            std::fs::create_dir_all(&own).expect("the folder can be written");
            scope.spawn(move || {
                loop {
                    let k = next.fetch_add(1, Ordering::Relaxed);
                    let Some(case) = cases.get(k) else { return };
                    let log = make(&own, case);
                    let answer = ask(&own, "run", &log.csv, None);
                    done.lock()
                        .expect("no worker panics with it")
                        .push((k, Asked { log: Simulated { csv: String::new(), ..log }, answer }));
                }
            });
        }
    });
    let mut done = done.into_inner().expect("all are back");
    done.sort_by_key(|d| d.0);
    done.into_iter().map(|d| d.1).collect()
}

/// Counts a row's cell; says what went wrong on standard error.
fn count(id: &str, what: &str, asked: &[Asked], coverage: &mut Coverage, further: &mut Tally) -> Tally {
    let mut tally = Tally::default();
    for (n, Asked { log, answer }) in asked.iter().enumerate() {
        let ids: Vec<&str> = answer.ids.iter().map(String::as_str).collect();
        let hit = right(id, &answer.verdict, &ids);
        tally.add(hit);
        if hit && !matches!(id, "" | "unknown") {
            further.add(ids.len() > 1);
            coverage.add(id, &log.truth, answer);
        }
        if !hit {
            eprintln!("{what}, seed {n}: {} {}", answer.verdict, ids.join(" + "));
        }
    }
    tally
}

fn beside(further: Tally) -> String {
    if further.of > 0 { further.to_string() } else { "-".to_owned() }
}

fn simulated(folder: &Path, (seeds, first): (u64, u64), only: Option<&str>, coverage: &mut Coverage) {
    println!("\n## Simulated: the tests' own generator\n");
    println!("Seeds {first} to {} for each size.\n", first + seeds - 1);
    println!("| hidden | small | middle | large | with further names |\n| --- | --- | --- | --- | --- |");
    let asked_for = |id: &str| only.is_none_or(|o| o == id);
    for cause in [Cause::Clean].into_iter().chain(CAUSES).chain(UNKNOWN).filter(|c| asked_for(c.id())) {
        let cases: Vec<(usize, u64)> = (1..=3).flat_map(|size| (first..first + seeds).map(move |s| (size, s))).collect();
        let asked = all(folder, &cases, |_, (size, seed)| simulate(cause, *size, *seed));
        let mut further = Tally::default();
        let cells: Vec<String> = asked
            .chunks(seeds as usize)
            .zip(1..)
            .map(|(cell, size)| count(cause.id(), &format!("{cause:?} {size}"), cell, coverage, &mut further).to_string())
            .collect();
        let name = match cause.id() {
            "" => "nothing".to_owned(),
            "unknown" => format!("not in the library: {cause:?}"),
            id => format!("`{id}`"),
        };
        println!("| {name} | {} | {} |", cells.join(" | "), beside(further));
    }
}

fn hidden_ones(folder: &Path, (seeds, first): (u64, u64), only: Option<&str>, coverage: &mut Coverage) {
    print!("{}", include_str!("causes_hidden.md"));
    println!("Seeds {first} to {}.\n", first + seeds - 1);
    println!("| hidden | named first | with further names |\n| --- | --- | --- |");
    let cases: Vec<u64> = (first..first + seeds).collect();
    for id in [""].iter().chain(ImuEffectKind::IDS).filter(|id| only.is_none_or(|o| o == **id)) {
        let asked = all(folder, &cases, |own, seed| hidden::fly(own, Some(*id).filter(|i| !i.is_empty()), *seed));
        let judged_as = if FOREIGN.contains(id) { "unknown" } else { id };
        let mut further = Tally::default();
        let tally = count(judged_as, &format!("hidden {id}"), &asked, coverage, &mut further);
        let name = match (*id, judged_as) {
            ("", _) => "nothing".to_owned(),
            (id, "unknown") => format!("not in the library: `{id}`"),
            (id, _) => format!("`{id}`"),
        };
        println!("| {name} | {tally} | {} |", beside(further));
    }
}

fn covered(coverage: &[Coverage; 2]) {
    print!("{}", include_str!("causes_covered.md"));
    println!("| generator | cause | parameter | inside | half width that would hold 95 % |\n| --- | --- | --- | --- | --- |");
    for (coverage, generator) in coverage.iter().zip(["own", "simulator"]) {
        for (cause, parameter, tally, width) in coverage.rows() {
            println!("| {generator} | `{cause}` | `{parameter}` | {tally} | {width:.2} of ours |");
        }
    }
}

/// Logs for the verdict's checker: of either generator, and two recorded ones where they are.
fn dump(to: &Path, folder: &Path) {
    std::fs::create_dir_all(to).expect("the folder can be made");
    let write = |name: &str, text: &str| std::fs::write(to.join(format!("{name}.csv")), text).expect("the folder can be written");
    for cause in [Cause::Clean, Cause::StationaryMagnet, Cause::Bursts] {
        write(&format!("own-{cause:?}"), &simulate(cause, 3, JUDGING).csv);
    }
    for id in ["hard_iron", "gyro_temperature", "vibration"] {
        write(&format!("simulator-{id}"), &hidden::fly(folder, Some(id), JUDGING).csv);
    }
    for (name, text) in broad::trials().into_iter().filter(|(name, _)| name.contains("_disturbed_")) {
        write(&name, &text);
    }
}
