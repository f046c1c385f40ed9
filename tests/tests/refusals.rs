//! Malformed input of every kind, in one table: logs, models, scenarios, missions, schedules, configurations, calibrations, arguments, outputs.
//!
//! What it is: each case is a call that must end with status 1 and one line, which says where, what, and what was expected; what lay in the
//! folder before lies there after, byte for byte, and nothing else.
//! What can go wrong: a fault that is accepted, a place that is wrong, an input that is written over, a file that is left behind.
//! Units: as the columns and keys state.
//! Reference: specification `formats.md`; docs/errors.md.

use quadrig_tests::bench::{Bench, good_log};
use std::collections::BTreeMap;
use std::path::Path;

mod commands;
mod files;
mod logs;

const IDENTIFY: &str = "identify bad.csv -o out.toml";

/// One malformed input, and a call that meets it.
struct Case {
    name: &'static str,
    /// The file that is wrong, and what stands in it; none where the call itself is.
    file: Option<(&'static str, Vec<u8>)>,
    words: &'static str,
    /// What the line must hold beside what was expected.
    said: &'static [&'static str],
}

fn with(
    name: &'static str,
    file: &'static str,
    text: impl Into<Vec<u8>>,
    words: &'static str,
    said: &'static [&'static str],
) -> Case {
    Case { name, file: Some((file, text.into())), words, said }
}

fn alone(name: &'static str, words: &'static str, said: &'static [&'static str]) -> Case {
    Case { name, file: None, words, said }
}

/// Refusals as docs/errors.md shows them: the name of a case, its call and what it prints, a line each.
const EXAMPLES: &str = include_str!("refusals/examples.txt");

/// What the page shows of a case, if it does.
fn example(case: &Case) -> Option<(&'static str, &'static str)> {
    let lines = |block: &'static str| {
        let (name, rest) = block.split_once('\n')?;
        let (call, printed) = rest.split_once('\n')?;
        Some((name, call.strip_prefix("$ quadrig ")?, printed))
    };
    let mut all = EXAMPLES.trim_end().split("\n\n").map(|block| lines(block).expect("a name, a call and what it prints"));
    all.find(|(name, ..)| *name == case.name).map(|(_, call, printed)| (call, printed))
}

/// Everything in a folder, with its bytes.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        if path.is_dir() {
            found.extend(contents(&path).into_iter().map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)));
        } else {
            found.insert(name, std::fs::read(&path).expect("a file"));
        }
    }
    found
}

/// A pipe gives its bytes once, and an input is looked at before it is read; a link to a device stays one.
#[cfg(unix)]
#[test]
fn pipes_and_links_to_devices_are_left_alone() {
    let bench = Bench::new();
    let made = std::process::Command::new("mkfifo").arg(bench.path("pipe.csv")).status().expect("mkfifo");
    assert!(made.success());
    for words in [vec!["identify", "pipe.csv", "-o", "out.toml"], vec!["import", "pipe.csv", "-o", "out.csv"]] {
        bench
            .call(&words)
            .refused(&["pipe.csv: is a pipe, which can be read only once", "expected a file: save it to one first"]);
    }
    bench.call(&["identify", "good.csv", "-o", "pipe.csv"]).refused(&["pipe.csv: is a pipe, which stays as it is"]);
    std::os::unix::fs::symlink("/dev/null", bench.path("link.toml")).expect("a link");
    bench.call(&["identify", "good.csv", "-o", "link.toml"]).refused(&["link.toml: is a device"]);
    assert!(bench.path("link.toml").is_symlink());
    assert_eq!(bench.names(), ["good.csv", "link.toml", "model.toml", "pipe.csv"]);
}

/// One missing folder is made, whatever the command and its option; a link to a file leads on to it.
#[test]
fn a_missing_folder_of_an_output_is_made() {
    let bench = Bench::new();
    std::fs::write(bench.path("run.toml"), "schedule = { kind = \"steps\", steps = [{ pulse_us = 1300, hold_s = 2 }] }\n")
        .expect("a scenario");
    for (words, files) in [
        ("sim run.toml -o a/run.csv --truth b/truth.csv", vec!["a/run.csv", "b/truth.csv"]),
        (
            "identify good.csv -o c/model.toml --report d/page.html --svg e/figures",
            vec!["c/model.toml", "d/page.html", "e/figures"],
        ),
        ("predict model.toml good.csv -o f/pred.csv", vec!["f/pred.csv"]),
        ("export model.toml --to csv -o g/table.csv", vec!["g/table.csv"]),
        ("log --port sim --speed 0 --seconds 1 -o h/log.csv", vec!["h/log.csv"]),
    ] {
        bench.call(&words.split(' ').collect::<Vec<_>>()).succeeded();
        assert!(files.iter().all(|file| bench.path(file).exists()), "{words}");
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("a/run.csv", bench.path("link.csv")).expect("a link");
        bench.call(&["export", "model.toml", "--to", "csv", "-o", "link.csv"]).succeeded();
        let read = |name: &str| std::fs::read(bench.path(name)).expect("a file");
        assert!(bench.path("link.csv").is_symlink() && read("a/run.csv") == read("g/table.csv"));
    }
}

/// Where one of several outputs cannot be written the model is not there, and what is there is said.
#[test]
fn what_is_written_before_a_refusal_is_said() {
    let bench = Bench::new();
    let words = format!("identify good.csv -o out.toml --table out.csv --report {}.html", "x".repeat(300));
    let said = bench.call(&words.split(' ').collect::<Vec<_>>());
    said.refused(&["html: cannot be written", "written already: out.csv"]);
    assert_eq!(bench.names(), ["good.csv", "model.toml", "out.csv"]);
}

#[test]
fn malformed_input_is_refused_in_one_line_that_teaches() {
    let bench = Bench::new();
    let write = |name: &str, bytes: &[u8]| std::fs::write(bench.path(name), bytes).expect("a file");
    std::fs::create_dir(bench.path("full")).expect("a folder");
    write("full/notes.csv", b"mine,yours,ours\n1,2,3\n");
    std::fs::create_dir_all(bench.path("data/rig")).expect("a folder");
    for name in [
        "kept/run.csv",
        "models/model.toml",
        "flown/flight.csv",
        "drawn/thrust.svg",
        "listed/manifest.csv",
        "caused/effects.csv",
        "kept-runs/runs/good.csv.json",
        "told/measured.md",
        "paged/measured/notes.txt",
    ] {
        std::fs::create_dir_all(bench.path(name).parent().expect("a folder")).expect("a folder");
        write(name, b"mine");
    }
    write(
        "export.csv",
        good_log().lines().skip(2).map(|l| l.replacen("t_s", "Time (s)", 1) + "\n").collect::<String>().as_bytes(),
    );
    write("empty.toml", b"");
    write("short.toml", b"duration_s = 1\n");
    write("plan.toml", b"[[part]]\nkind = \"hold\"\npulse_us = 1200\nhold_s = 1\n");
    write("on-file.toml", b"schedule = { kind = \"file\", file = \"plan.toml\" }\n");
    write("replay.toml", b"[[part]]\nkind = \"replay\"\nfile = \"good.csv\"\n");
    write("on-replay.toml", b"schedule = { kind = \"file\", file = \"replay.toml\" }\n");
    let without_command = |line: &str| match line.split(',').collect::<Vec<_>>()[..] {
        [t, _, ref rest @ ..] if !line.starts_with('#') => format!("{t},{}\n", rest.join(",")),
        _ => format!("{line}\n"),
    };
    write("no-command.csv", good_log().lines().map(without_command).collect::<String>().as_bytes());
    let logs = [logs::logs(), logs::plain_words(), logs::heads(), logs::impossible()];
    let files =
        [files::kinds(), files::models(), files::scenarios(), files::descriptions(), files::missions(), files::schedules()];
    let commands = [commands::boards(), commands::arguments(), commands::outputs(), commands::attitudes()];
    let cases: Vec<Case> = logs.into_iter().chain(files).chain(commands).flatten().collect();
    assert!(cases.len() >= 330, "{} cases", cases.len());
    let mut wrong = Vec::new();
    let mut shown = 0;
    for case in &cases {
        if let Some((file, bytes)) = &case.file {
            write(file, bytes);
        }
        let before = contents(bench.folder());
        let words: Vec<&str> = case.words.split(' ').collect();
        let said = bench.call(&words);
        let lacks: Vec<&str> = case.said.iter().chain(&["expected"]).copied().filter(|text| !said.err.contains(text)).collect();
        if said.status != Some(1) || said.err.lines().count() != 1 || !said.out.is_empty() || !lacks.is_empty() {
            wrong.push(format!(
                "{}: `quadrig {}`: status {:?}, lacks {lacks:?}\n  {}{}",
                case.name, case.words, said.status, said.err, said.out
            ));
        }
        if let Some(example) = example(case) {
            shown += 1;
            if example != (case.words, said.err.trim_end()) {
                wrong.push(format!("{}: docs/errors.md shows {example:?}, it is `{}`: {}", case.name, case.words, said.err));
            }
        }
        for leaked in ["f64", "u32", "struct ", "enum ", "os error"] {
            if said.err.contains(leaked)
                && !["read", "written"].iter().any(|done| said.err.contains(&format!("cannot be {done}")))
            {
                wrong.push(format!("{}: `quadrig {}` says {leaked}: {}", case.name, case.words, said.err));
            }
        }
        if contents(bench.folder()) != before {
            wrong.push(format!("{}: `quadrig {}` changed the folder", case.name, case.words));
        }
        if let Some((file, _)) = &case.file {
            std::fs::remove_file(bench.path(file)).expect("it is there");
        }
    }
    assert_eq!(shown, EXAMPLES.trim_end().split("\n\n").count(), "examples that are no case, or several");
    assert!(wrong.is_empty(), "{} of {} cases:\n{}", wrong.len(), cases.len(), wrong.join("\n"));
}
