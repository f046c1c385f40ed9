//! Blind campaign from the command line.
//!
//! What it is: `blind --runs N --clean M`, resumable, one line a run; `--dump SEED DIR` writes one run and its truth.
//! What can go wrong: an interrupted line is cut short; it is left out on reading and run again.
//! Units: sizes in noise floors.
//! Reference: specification `closing-the-loop.md`, "What counts as proof".

use quadrig_tests::blind::resume::{known, resumed};
use quadrig_tests::blind::scenario::{CLEAN, Hidden, Scenario};
use quadrig_tests::blind::score::{Line, score};
use quadrig_tests::blind::{history, messy, simulated, tally, write};
use quadrig_tests::flights;
use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

const USAGE: &str = "usage: blind [--runs N] [--clean M] [--half tuning|judging] [--effect ID] [--kind one|two|unknown] [--seed-from S | --seeds S,S,...] [--out FILE.csv] [--threads T] [--simulated | --messy | --flights | --history] [--failures] [--table] | blind --dump SEED DIR [--simulated | --messy | --flights | --history] | blind --plan N";

struct Options {
    runs: usize,
    clean: usize,
    odd: bool,
    effect: Option<String>,
    kind: Option<String>,
    seeds: Vec<u64>,
    from: u64,
    out: PathBuf,
    threads: usize,
    failures: bool,
    simulated: bool,
    messy: bool,
    flights: bool,
    history: bool,
    table: bool,
}

fn flights_of(o: Options) -> flights::campaign::Asked {
    let Options { runs, clean, odd, from, seeds, effect, out, threads, failures, table, .. } = o;
    flights::campaign::Asked { runs, clean, odd, from, seeds, effect, out, threads, failures, table }
}

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    match command(&words) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("blind: {why}");
            ExitCode::from(if why.starts_with("usage") { 2 } else { 1 })
        }
    }
}

fn command(words: &[String]) -> Result<(), String> {
    match words.first().map(String::as_str) {
        Some("--dump") => {
            let [_, seed, folder, rest @ ..] = words else { return Err(USAGE.into()) };
            let (seed, folder) = (seed.parse().map_err(|_| USAGE)?, PathBuf::from(folder));
            match rest {
                [] => dump(seed, &folder).map_err(|e| e.to_string()),
                [flag] if flag == "--simulated" => simulated::dump(seed, &folder),
                [flag] if flag == "--flights" => flights::campaign::dump(seed, &folder),
                [flag] if flag == "--history" => dump_history(seed, &folder).map_err(|e| e.to_string()),
                [flag] if flag == "--messy" => dump_messy(seed, &folder).map_err(|e| e.to_string()),
                _ => Err(USAGE.into()),
            }
        }
        Some("--plan") => {
            for seed in 0..words.get(1).and_then(|n| n.parse().ok()).ok_or(USAGE)? {
                let s = Scenario::new(seed);
                println!(
                    "{seed} {:?} sizes {:?} shown {:?} strengths {:?}",
                    s.hidden,
                    s.sizes,
                    s.shown,
                    s.effects.iter().map(|e| e.strength).collect::<Vec<_>>()
                );
            }
            Ok(())
        }
        _ => {
            let o = options(words)?;
            match (o.messy, o.flights) {
                _ if o.history => history_campaign(&o),
                (true, _) => messy_campaign(&o),
                (_, true) => flights::campaign::run(&flights_of(o)),
                _ => campaign(&o),
            }
        }
    }
}

fn options(words: &[String]) -> Result<Options, String> {
    let mut o = Options {
        runs: 2000,
        clean: 1000,
        odd: true,
        effect: None,
        kind: None,
        seeds: Vec::new(),
        from: 0,
        out: PathBuf::from("blind.csv"),
        threads: 2,
        failures: false,
        simulated: false,
        messy: false,
        flights: false,
        history: false,
        table: false,
    };
    let mut i = words.iter();
    while let Some(flag) = i.next() {
        if flag == "--failures" {
            o.failures = true;
            continue;
        }
        if flag == "--simulated" {
            o.simulated = true;
            continue;
        }
        if flag == "--messy" {
            o.messy = true;
            continue;
        }
        if flag == "--flights" {
            o.flights = true;
            continue;
        }
        if flag == "--history" {
            o.history = true;
            continue;
        }
        if flag == "--table" {
            o.table = true;
            continue;
        }
        let value = i.next().ok_or(USAGE)?;
        let number = || value.parse::<u64>().map_err(|_| format!("{flag} {value}: expected a whole number"));
        match flag.as_str() {
            "--runs" => o.runs = number()? as usize,
            "--clean" => o.clean = number()? as usize,
            "--half" => {
                o.odd = match value.as_str() {
                    "judging" => true,
                    "tuning" => false,
                    _ => return Err(format!("--half {value}: expected tuning or judging")),
                }
            }
            "--effect" => o.effect = Some(value.clone()),
            "--kind" => o.kind = Some(value.clone()),
            "--seeds" => o.seeds = value.split(',').map(|s| s.parse().map_err(|_| USAGE)).collect::<Result<_, _>>()?,
            "--seed-from" => o.from = number()?,
            "--out" => o.out = PathBuf::from(value),
            "--threads" => o.threads = (number()? as usize).max(1),
            _ => return Err(USAGE.into()),
        }
    }
    Ok(o)
}

/// The seeds of a campaign: even ones tune, odd ones judge.
fn seeds(o: &Options) -> Vec<u64> {
    if !o.seeds.is_empty() {
        return o.seeds.clone();
    }
    let half = u64::from(o.odd);
    let first = o.from / 2 * 2 + half;
    let wanted = |s: &u64| {
        let hidden = Hidden::of(*s);
        o.effect.as_ref().is_none_or(|id| hidden.ids().contains(&id.as_str()))
            && o.kind.as_ref().is_none_or(|k| hidden.name() == k)
    };
    let mut all: Vec<u64> = (0..).map(|k| first + 2 * k).take_while(|s| *s < CLEAN).filter(wanted).take(o.runs).collect();
    // a clean run after every few others, so that an interrupted campaign has both
    let clean: Vec<u64> = (0..o.clean as u64).map(|k| CLEAN + first + 2 * k).collect();
    let every = (all.len() / clean.len().max(1)).max(1);
    for (k, c) in clean.into_iter().enumerate() {
        let at = ((every + 1) * k).min(all.len());
        all.insert(at, c);
    }
    all
}

fn campaign(o: &Options) -> Result<(), String> {
    let wanted = seeds(o);
    if o.table {
        // what an interrupted campaign has so far
        let lines: Vec<Line> = known(&o.out, &wanted)?;
        println!("{} of {} runs\n\n{}", lines.len(), wanted.len(), tally::markdown(&lines));
        return Ok(());
    }
    let ask = |seed: u64| if o.simulated { simulated::score(seed) } else { score(seed) };
    let lines = resumed(&o.out, &wanted, o.threads, ask)?;
    println!("{}", tally::markdown(&lines));
    if o.failures {
        println!("{}", tally::failures(&lines));
    }
    Ok(())
}

/// Messy rigs: every seed of a half has one, clean ones among them.
fn messy_campaign(o: &Options) -> Result<(), String> {
    let first = o.from / 2 * 2 + u64::from(o.odd);
    let wanted: Vec<u64> = if o.seeds.is_empty() { (0..o.runs as u64).map(|k| first + 2 * k).collect() } else { o.seeds.clone() };
    let lines = if o.table { known(&o.out, &wanted)? } else { resumed(&o.out, &wanted, o.threads, messy::score::score)? };
    println!("{} of {} runs\n\n{}", lines.len(), wanted.len(), messy::tally::markdown(&lines));
    if o.failures {
        println!("{}", messy::tally::failures(&lines));
    }
    Ok(())
}

/// Rigs over weeks: `--runs` of them change, `--clean` do not.
fn history_campaign(o: &Options) -> Result<(), String> {
    let first = o.from / 2 * 2 + u64::from(o.odd);
    let some = |base: u64, n: usize| (0..n as u64).map(move |k| base + first + 2 * k);
    let all: Vec<u64> = some(0, o.runs).chain(some(CLEAN, o.clean)).collect();
    let wanted = if o.seeds.is_empty() { all } else { o.seeds.clone() };
    let lines = if o.table { known(&o.out, &wanted)? } else { resumed(&o.out, &wanted, o.threads, history::score::score)? };
    println!("{} of {} rigs\n\n{}", lines.len(), wanted.len(), history::tally::markdown(&lines));
    if o.failures {
        println!("{}", history::tally::failures(&lines));
    }
    Ok(())
}

fn dump_history(seed: u64, folder: &std::path::Path) -> std::io::Result<()> {
    let life = history::life::Life::new(seed);
    fs::create_dir_all(folder)?;
    for k in 0..life.days.len() {
        fs::write(folder.join(format!("run{:02}.csv", k + 1)), life.log(k))?;
    }
    fs::write(folder.join("truth.md"), format!("{:#?}\nsize {}\n{:#?}\n", life.fate, life.size, life.change))
}

fn dump_messy(seed: u64, folder: &std::path::Path) -> std::io::Result<()> {
    let m = messy::scenario::Messy::new(seed);
    fs::create_dir_all(folder)?;
    for (which, name) in ["csv", "validate.csv"].iter().enumerate() {
        fs::write(folder.join(format!("{seed}.{name}")), write::text(&m.rig, &m.run(which).0))?;
    }
    let truth = format!("own {}\n{:#?}\n{:#?}\n{:#?}\n", m.own, m.effects, m.sizes, m.dirt);
    fs::write(folder.join(format!("{seed}.truth.txt")), truth)
}

fn dump(seed: u64, folder: &std::path::Path) -> std::io::Result<()> {
    let s = Scenario::new(seed);
    fs::create_dir_all(folder)?;
    for (which, name) in ["csv", "validate.csv"].iter().enumerate() {
        fs::write(folder.join(format!("{seed}.{name}")), write::text(&s.rig, &s.run(which)))?;
    }
    fs::write(folder.join(format!("{seed}.truth.txt")), write::truth(&s))
}
