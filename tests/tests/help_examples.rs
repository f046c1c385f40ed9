//! The example in the help of every command is typed here.
//!
//! What it is: what `quadrig COMMAND --help` gives as its example, run in a folder that looks like a fresh clone with the files of the first
//! examples. A virtual board runs as fast as it goes.
//! What can go wrong: an example that can never work, such as a pulse for a board that nobody has armed.
//! Units: none.
//! Reference: `quadrig/src/help.rs`.
#![cfg(unix)]

use quadrig_tests::{call, root};
use std::path::Path;
use tempfile::TempDir;

/// Examples that are not run, and what they need.
const NOT_RUN: [(&str, &str); 10] = [
    ("recalibrate", "a log with raw codes: tests/tests/rig_calibration.rs"),
    ("rig arm", "typed lines, or a terminal"),
    ("flash", "a board"),
    ("rig set", "a board that is armed"),
    ("rig calibrate", "a board whose ESC has no power"),
    ("rig view", "a terminal"),
    ("virtual", "runs until it is stopped: tests/tests/virtual_board.rs"),
    ("measured", "recorded data, and minutes: tests/tests/pages.rs"),
    ("runs", "minutes: 36 runs"),
    ("isolability", "minutes: tests/tests/isolability.rs"),
];

/// Commands whose files the others read.
const FIRST: [&str; 3] = ["sim", "identify", "close-loop"];

/// Commands of the reference page, in its order.
fn commands() -> Vec<String> {
    let page = std::fs::read_to_string(root().join("docs/book/reference/command-line.md")).expect("the page");
    let usage = page.lines().filter_map(|line| line.strip_prefix("quadrig "));
    let words = |line: &str| {
        line.split(' ').take_while(|w| w.starts_with(|c: char| c.is_ascii_lowercase())).collect::<Vec<_>>().join(" ")
    };
    let mut commands: Vec<String> = usage.map(words).filter(|command| command != "rig").collect();
    commands.sort_by_key(|command| FIRST.iter().position(|first| first == command).unwrap_or(FIRST.len()));
    commands
}

/// The words of a command's example, behind `quadrig`; a virtual board goes as fast as it can.
fn example(folder: &Path, command: &str) -> Vec<String> {
    let help = call(folder, &[&command.split(' ').collect::<Vec<_>>()[..], &["--help"]].concat()).succeeded().out;
    let line = help.lines().skip_while(|line| *line != "Example:").nth(1).unwrap_or_else(|| panic!("{command}: no example"));
    let mut words = Vec::new();
    for (n, part) in line.trim().strip_prefix("quadrig ").expect("a call").split('"').enumerate() {
        if n % 2 == 1 { words.push(part.to_owned()) } else { words.extend(part.split_whitespace().map(str::to_owned)) }
    }
    if let Some(at) = words.iter().position(|word| word == "--port") {
        words.splice(at..at, ["--speed".to_owned(), "0".to_owned()]);
    }
    words
}

/// What the examples find beside what other examples wrote.
fn bench() -> TempDir {
    let folder = TempDir::new().expect("a folder");
    let at = folder.path();
    std::os::unix::fs::symlink(root().join("examples"), at.join("examples")).expect("a link");
    std::fs::create_dir_all(at.join("out/runs")).expect("a folder");
    let flat =
        |seed: u32, steps: &str| format!("seed = {seed}\nrest_s = 2\nschedule = {{ kind = \"steps\", steps = [{steps}] }}\n");
    let steps = "{ pulse_us = 1000, hold_s = 3 }, { pulse_us = 1300, hold_s = 6 }, { pulse_us = 1600, hold_s = 6 }, { pulse_us = 1900, hold_s = 6 }";
    // the three values of the example's calibration
    std::fs::write(
        at.join("run.toml"),
        flat(4, "{ pulse_us = 1000, hold_s = 3 }, { pulse_us = 1300, hold_s = 6 }, { pulse_us = 1482, hold_s = 6 }"),
    )
    .expect("a scenario");
    call(at, &["--quiet", "sim", "run.toml", "-o", "run.csv"]).succeeded();
    for (seed, names) in [(1, &["day1.csv"][..]), (2, &["day2.csv", "out/runs/a.csv"]), (3, &["day3.csv"])] {
        std::fs::write(at.join("run.toml"), flat(seed, steps)).expect("a scenario");
        for name in names {
            call(at, &["--quiet", "sim", "run.toml", "-o", name]).succeeded();
        }
    }
    let log = std::fs::read_to_string(at.join("day1.csv")).expect("a log");
    let rows: String = log.lines().filter(|l| !l.starts_with('#')).map(|l| format!("{l}\n")).collect();
    std::fs::write(at.join("export.csv"), rows.replacen("thrust_n", "Load", 1)).expect("an export");
    let readings = |n: u32| format!("{},0.001,0,0,0.01,0,-9.8\n", f64::from(n) * 0.005);
    std::fs::write(at.join("readings.csv"), "t_s,gx,gy,gz,ax,ay,az\n".to_owned() + &(1..2000).map(readings).collect::<String>())
        .expect("readings");
    folder
}

#[test]
fn every_example_of_the_help_runs() {
    let folder = bench();
    let at = folder.path();
    let mut failed = Vec::new();
    let (mut run, commands) = (0, commands());
    for command in &commands {
        if NOT_RUN.iter().any(|(other, _)| other == command) {
            continue;
        }
        let words = example(at, command);
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let begun = std::time::Instant::now();
        let said = call(at, &words);
        println!("{:>6.1} s  quadrig {}", begun.elapsed().as_secs_f64(), words.join(" "));
        run += 1;
        if said.status != Some(0) {
            failed.push(format!("quadrig {}: {:?}\n{}", words.join(" "), said.status, said.err));
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
    assert!(run >= 30, "{run} examples of {} commands", commands.len());
    for (command, _) in NOT_RUN {
        assert!(commands.iter().any(|known| known == command), "no command {command}");
    }
}
