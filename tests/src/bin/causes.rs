//! `causes`: the page `docs/ahrs-causes.md` on standard output.
//!
//! What it is: simulated recordings with one hidden cause each, on judging seeds, and the recorded BROAD trials, half by half: what
//! the command line names, and the error before and after.
//! What can go wrong: absent data; it then says so and writes the simulated part alone.
//! Units: uT, m/s^2.
//! Reference: `tests/src/inertial`; README of the recorded trials.
#![forbid(unsafe_code)]

use quadrig_tests::inertial::{Answer, CAUSES, Cause, JUDGING, Tally, UNKNOWN, ask, judged, simulate};
use std::io::Read;
use std::path::Path;

const FIELD: [&str; 3] = ["mx", "my", "mz"];
const FORCE: [&str; 3] = ["ax", "ay", "az"];

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let seeds: u64 = words.first().and_then(|w| w.parse().ok()).unwrap_or(10);
    let tuning = words.get(1).is_some_and(|w| w == "--tuning");
    let folder = tempfile::tempdir().expect("a temporary folder");
    print!("{}", include_str!("causes.md"));
    simulated(folder.path(), seeds, if tuning { 0 } else { JUDGING });
    recorded(folder.path());
}

fn simulated(folder: &Path, seeds: u64, first: u64) {
    println!("\n## Simulated\n");
    println!(
        "Seeds {first} to {} for each size. First: the right cause is the first one of the verdict, and it is not `unattributed`; for",
        first + seeds - 1
    );
    println!(
        "clean logs the verdict is `none`, for the two causes that the library lacks it is `unattributed` or `ambiguous`. With: further names"
    );
    println!("beside the right one. Shares with Wilson's 95 % interval.\n");
    println!("| hidden | small | middle | large | with further names |\n| --- | --- | --- | --- | --- |");
    for cause in [Cause::Clean].into_iter().chain(CAUSES).chain(UNKNOWN) {
        let mut cells = Vec::new();
        let mut further = Tally::default();
        let mut wrong: Vec<String> = Vec::new();
        for size in 1..=3 {
            let mut tally = Tally::default();
            for seed in first..first + seeds {
                let answer = ask(folder, "run", &simulate(cause, size, seed).csv, None);
                let ids: Vec<&str> = answer.ids.iter().map(String::as_str).collect();
                let right = judged(cause, &answer.verdict, &ids);
                tally.add(right);
                if right && !matches!(cause, Cause::Clean | Cause::Clipped | Cause::Bursts) {
                    further.add(ids.len() > 1);
                }
                if !right {
                    wrong.push(format!("{size}/{seed}: {} {}", answer.verdict, answer.ids.join(" + ")));
                }
            }
            cells.push(tally.to_string());
        }
        let name = if cause.id().is_empty() { "nothing".to_owned() } else { format!("`{}`", cause.id()) };
        let name = if cause.id() == "unknown" { format!("not in the library: {cause:?}") } else { name };
        let beside = if further.of > 0 { further.to_string() } else { "-".to_owned() };
        println!("| {name} | {} | {beside} |", cells.join(" | "));
        eprintln!("{cause:?}: {}", wrong.join("; "));
    }
}

fn recorded(folder: &Path) {
    let Some(data) = quadrig_tests::data("BROAD trials") else {
        println!("\nThe recorded trials were not there.");
        return;
    };
    let trials = data.join("ahrs/broad");
    let mut files: Vec<_> = std::fs::read_dir(&trials).into_iter().flatten().filter_map(|e| Some(e.ok()?.path())).collect();
    files.sort();
    println!(
        "\n## Recorded: BROAD\n\nHalf A (every second trial from the first) was in view while the tracer was made. Half B is not quite blind: trial 33 was looked at once, and the field's statistics of all trials were read."
    );
    println!("Held-out error, root mean square over the three axes.\n");
    println!(
        "| half | trial | verdict | named | field before -> after, uT | force before -> after, m/s^2 |\n| --- | --- | --- | --- | --- | --- |"
    );
    for (n, file) in files.iter().enumerate() {
        let mut text = String::new();
        let read = std::fs::File::open(file).and_then(|f| flate2::read::GzDecoder::new(f).read_to_string(&mut text));
        assert!(read.is_ok(), "{}: cannot be read", file.display());
        let name = file.file_name().unwrap_or_default().to_string_lossy().replace(".csv.gz", "");
        let answer = ask(folder, &name, &text, None);
        let pair = |channels: [&str; 3]| match (answer.heldout(channels, "before"), answer.heldout(channels, "after")) {
            (Some(b), Some(a)) => format!("{b:.2} -> {a:.2}"),
            _ => "-".to_owned(),
        };
        let half = if n % 2 == 0 { "A" } else { "B" };
        println!("| {half} | {name} | {} | {} | {} | {} |", answer.verdict, named(&answer), pair(FIELD), pair(FORCE));
    }
}

/// The effects with the number that tells most of each.
fn named(answer: &Answer) -> String {
    let number = |id: &str, name: &str, unit: &str, scale: f64| {
        answer.parameter(id, name).map_or(String::new(), |(v, _)| format!(" {:.1} {unit}", v * scale))
    };
    let norm = |id: &str, names: [&str; 3], unit: &str, scale: f64| {
        let parts = names.map(|n| answer.parameter(id, n).map_or(0.0, |p| p.0 * scale));
        format!(" {:.1} {unit}", parts.iter().map(|p| p * p).sum::<f64>().sqrt())
    };
    let one = |id: &String| {
        let size = match id.as_str() {
            "channel_delay" => number(id, "delay", "ms", 1e3),
            "stationary_magnet" => number(id, "rms", "uT rms", 1.0),
            "hard_iron" => norm(id, ["offset_x", "offset_y", "offset_z"], "uT", 1.0),
            "lever_arm" => norm(id, ["arm_x", "arm_y", "arm_z"], "cm", 100.0),
            "linear_acceleration" => norm(id, ["rms_north", "rms_east", "rms_down"], "m/s^2", 1.0),
            "vibration" => number(id, "frequency", "Hz", 1.0) + &number(id, "rms", "m/s^2", 1.0),
            _ => String::new(),
        };
        format!("`{id}`{size}")
    };
    answer.ids.iter().map(one).collect::<Vec<_>>().join(", ")
}
