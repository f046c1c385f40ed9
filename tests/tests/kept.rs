//! Ctrl-C keeps what was recorded: `sim --live`, `rig run` and `log` are interrupted in mid-run.
//!
//! What it is: the built program is sent the signal that a terminal sends; the log that it leaves is whole, and a reader takes it.
//! What can go wrong: a run that ends without a log, half a row, a part that is left beside it, a long run that starts without a word.
//! Units: s.
//! Reference: signal(7); specification `formats.md` ("nothing half-written").
#![cfg(unix)]

use quadrig_tests::{Said, call, quadrig};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

fn start(folder: &Path, words: &[&str]) -> Child {
    let mut command = Command::new(quadrig());
    command.args(words).current_dir(folder).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().expect("quadrig starts")
}

/// Waits for a line of the output that `wanted` knows, sends SIGINT, and waits for the end.
fn interrupted(folder: &Path, words: &[&str], wanted: impl Fn(&str) -> bool) -> Said {
    let mut child = start(folder, words);
    let input = child.stdin.take(); // open, as a terminal's is
    let mut lines = BufReader::new(child.stdout.take().expect("a pipe")).lines().map_while(Result::ok);
    assert!(lines.any(|line| wanted(&line)), "it never came to the instant");
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill");
    assert!(sent.success());
    let rest: Vec<String> = lines.collect();
    drop(input);
    let said = Said::new(words, child.wait_with_output().expect("it ends"));
    Said { out: rest.join("\n"), ..said }
}

/// Rows of the log; every other command reads it.
fn rows(folder: &Path, name: &str) -> usize {
    let log = ident::log::Log::read(&folder.join(name)).unwrap_or_else(|e| panic!("{e}"));
    let names: Vec<_> = std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").file_name()).collect();
    assert!(!names.iter().any(|n| n.to_string_lossy().ends_with(".part")), "{names:?}");
    log.len()
}

#[test]
fn an_interrupted_live_run_keeps_its_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    std::fs::write(
        at.join("run.toml"),
        "rest_s = 1.0\nschedule = { kind = \"staircase\", step_us = 500, hold_s = 300, top_us = 2000 }\n",
    )
    .expect("a scenario");
    let words = ["sim", "run.toml", "-o", "run.csv", "--live", "--speed", "50", "--truth", "truth.csv"];
    let second = |line: &str| line.split_whitespace().next().and_then(|s| s.parse::<f64>().ok()).unwrap_or(0.0);
    let said = interrupted(at, &words, |line| line.contains("running") && second(line) > 20.0).succeeded();
    assert!((50..5000).contains(&rows(at, "run.csv")), "{} rows of 902 s: {}", rows(at, "run.csv"), said.err);
    assert!(at.join("truth.csv").is_file());
    // it was announced before it began: 902 s at 50 times real time
    assert!(said.err.contains("15 min of a run, at 50 times real time: about 18 s"), "{}", said.err);
}

#[test]
fn an_interrupted_session_keeps_its_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let words = ["rig", "--port", "sim", "--speed", "20", "--assist", "run", "--hold", "60", "-o", "run.csv"];
    let said = interrupted(at, &words, |line| line.contains("Running")).succeeded();
    assert!(rows(at, "run.csv") > 10, "{}", said.err);
    let words = ["log", "--port", "sim", "--speed", "20", "-o", "listened.csv"];
    let mut child = start(at, &words);
    std::thread::sleep(std::time::Duration::from_millis(1500));
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill");
    drop(child.stdin.take());
    assert!(sent.success() && child.wait().expect("it ends").success());
    assert!(rows(at, "listened.csv") > 10);
}

/// A recording of a board never takes the place of an earlier one: that is found under the next free name, and one line says so.
#[test]
fn an_earlier_recording_is_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let read = |name: &str| std::fs::read(at.join(name)).expect(name);
    let log = ["log", "--port", "sim", "--speed", "0", "--seconds", "1", "-o", "real.csv"];
    let run = ["rig", "--port", "sim", "--speed", "0", "--assist", "run", "--hold", "1", "--top", "1050", "-o", "real.csv"];
    let burst = ["rig", "--port", "sim", "--speed", "0", "burst", "thrust", "-o", "real.csv"];
    std::fs::write(at.join("real.csv"), "mine\n").expect("a file");
    let mut before = read("real.csv");
    for (n, words) in [&log[..], &run, &burst].into_iter().enumerate() {
        let said = call(at, words).succeeded();
        let kept = format!("real-{}.csv", n + 1);
        let told = format!("real.csv: there was an earlier file of this name; it is now {kept}");
        assert!(said.err.lines().any(|line| line.ends_with(&told)), "{words:?}: {}", said.err);
        assert!(read(&kept) == before && read("real.csv") != before, "{words:?}");
        before = read("real.csv");
    }
    assert_eq!(std::fs::read_dir(at).expect("the folder").count(), 4);
}

/// A typing error loses nothing: what an output would take the place of, and what no command can compute again, is found under another name.
#[test]
fn only_what_was_computed_is_replaced() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let steps = |pulse: u32| {
        let text = format!("schedule = {{ kind = \"staircase\", step_us = 100, hold_s = 2, top_us = {pulse} }}\n");
        std::fs::write(at.join("run.toml"), text).expect("a scenario");
    };
    let files = || std::fs::read_dir(at).expect("the folder").count();
    steps(1700);
    for _ in 0..2 {
        call(at, &["sim", "run.toml", "-o", "run.csv", "--truth", "truth.csv"]).succeeded();
        call(at, &["identify", "run.csv", "-o", "model.toml", "--table", "table.csv", "--report", "page.html"]).succeeded();
        call(at, &["export", "model.toml", "--to", "px4", "--extrapolate", "-o", "px4.params"]).succeeded();
    }
    assert_eq!(files(), 7, "the same again leaves nothing beside it");
    steps(1800);
    call(at, &["sim", "run.toml", "-o", "run.csv"]).succeeded();
    call(at, &["identify", "run.csv", "-o", "model.toml", "--table", "table.csv", "--report", "page.html"]).succeeded();
    assert_eq!(files(), 7, "what is computed is computed again");
    for (name, words) in [
        ("mine.toml", &["identify", "run.csv", "-o", "mine.toml"][..]),
        ("mine.csv", &["sim", "run.toml", "-o", "mine.csv"]),
        ("mine.params", &["export", "model.toml", "--to", "px4", "--extrapolate", "-o", "mine.params"]),
        ("notes.html", &["identify", "run.csv", "-o", "model.toml", "--report", "notes.html"]),
        ("thrust.csv", &["predict", "model.toml", "run.csv", "-o", "thrust.csv"]),
    ] {
        let mine = format!("# quadrig-log 1\n# of = {name:?}\nt_s,thrust_n,rpm\n0,0.1,0\n");
        std::fs::write(at.join(name), &mine).expect("a file");
        let said = call(at, words).succeeded();
        let (stem, ending) = name.split_once('.').expect("a name");
        let kept = format!("{stem}-1.{ending}");
        assert!(said.err.contains(&format!("{name}: there was an earlier file of this name; it is now {kept}")), "{}", said.err);
        assert_eq!(std::fs::read_to_string(at.join(kept)).expect("it is kept"), mine);
        assert_ne!(std::fs::read_to_string(at.join(name)).expect("it is written"), mine);
    }
}

/// A folder of results is written again; one whose file was changed by hand is not, and stays as it is.
#[test]
fn a_result_that_was_changed_by_hand_is_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    std::fs::write(at.join("short.toml"), "duration_s = 1\n").expect("a mission");
    let again = ["--quiet", "fly", "short.toml", "-o", "out"];
    call(at, &again).succeeded();
    call(at, &again).succeeded();
    std::fs::write(at.join("out/states.csv"), "by hand\n").expect("a file");
    call(at, &again).refused(&["out: states.csv was changed since `quadrig fly` wrote it", "expected a new or an empty folder"]);
    assert_eq!(std::fs::read_to_string(at.join("out/states.csv")).expect("it is there"), "by hand\n");
    // another command's results are no earlier results of this one
    std::fs::remove_file(at.join("out/states.csv")).expect("it is there");
    call(at, &["effects", "-o", "out"]).refused(&["which no `quadrig effects` wrote"]);
    call(at, &again).succeeded();
}

/// A run of a day says how long it will take before it starts; a short one says nothing.
#[test]
fn a_long_simulation_is_announced() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let scenario = |hold: f64| format!("schedule = {{ kind = \"steps\", steps = [{{ pulse_us = 1300, hold_s = {hold} }}] }}\n");
    std::fs::write(at.join("day.toml"), scenario(86_400.0)).expect("a scenario");
    let mut child = start(at, &["sim", "day.toml", "-o", "day.csv"]);
    let mut line = String::new();
    BufReader::new(child.stderr.take().expect("a pipe")).read_line(&mut line).expect("a line");
    child.kill().expect("it ends");
    let _ = child.wait();
    assert!(line.starts_with("24.0 h of a run, at ") && line.contains(" times real time: about "), "{line}");
    assert!(!at.join("day.csv").exists());
    std::fs::write(at.join("short.toml"), scenario(5.0)).expect("a scenario");
    assert_eq!(call(at, &["sim", "short.toml", "-o", "short.csv"]).succeeded().err, "");
}

/// `quadrig ... | head`: whoever reads the result has seen enough; what was to be written is written, and nothing panics.
#[test]
fn a_reader_that_is_gone_loses_no_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    std::fs::write(
        at.join("run.toml"),
        "rest_s = 1.0\nschedule = { kind = \"staircase\", step_us = 200, hold_s = 2, top_us = 1800 }\n",
    )
    .expect("a scenario");
    call(at, &["--quiet", "sim", "run.toml", "-o", "run.csv"]).succeeded();
    for (words, file) in [
        (vec!["close-loop", "run.csv", "-o", "out"], "out/verdict.json"),
        (vec!["identify", "run.csv", "-o", "m.toml"], "m.toml"),
    ] {
        let mut child = start(at, &words);
        drop(child.stdout.take());
        drop(child.stderr.take());
        let status = child.wait().expect("it ends");
        assert!(status.success() && at.join(file).is_file(), "{words:?}: {status}");
    }
}

/// A full disk behind `>` is a failure.
#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").expect("a full disk");
    let command = Command::new(quadrig()).args(["effects"]).current_dir(folder.path()).stdout(full).output().expect("it runs");
    let said = String::from_utf8_lossy(&command.stderr);
    assert!(!command.status.success() && said.contains("standard output cannot be written"), "{said}");
}
