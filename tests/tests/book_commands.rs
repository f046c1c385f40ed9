//! Every command of the book is typed here.
//!
//! What it is: the `sh` blocks of each page, in order, in a folder of the page's own that looks like a fresh clone. `quadrig` and
//! `cargo run --release --` are the built program. `docs/first-hour.md` has a test of its own, which also types at the virtual board
//! (`first_hour.rs`).
//!
//! | block | what is done with it |
//! | --- | --- |
//! | `sh` | run by a shell; must succeed |
//! | `sh refused` | run; must end with status 1 |
//! | `sh data` | run where `$QUADRIG_DATA` (or `../shared/data`) is there, else only parsed |
//! | `sh board` | run, a virtual board with an assistant in the place of the real one; `rig.toml` is a preset where the page wrote none |
//! | `sh files` | run; the files that it reads and the page did not make are a simulated run, or a flight and its ULog |
//! | `sh long`, `sh hardware` | only parsed, see [`parse`]: takes minutes, needs hands at a real board, a second terminal or a cluster |
//! | `text says` | its lines stand in this order in what the last block wrote |
//! | `toml FILE`, `csv FILE` | written to that file |
//!
//! A picture in `docs/book/figures/` must be what the page's commands wrote.
//!
//! What can go wrong: a command, an option or a file that went; an excerpt that the program no longer writes.
//! Units: none.
//! Reference: `docs/SUMMARY.md`; CommonMark, fenced code blocks.
#![cfg(unix)]

use ident::log::{Column, flight_log};
use quadrig_tests::book::{Block, Page, blocks, pages};
use quadrig_tests::flights::scenario::{CLEAN, Scenario};
use quadrig_tests::recorders::ulog;
use quadrig_tests::{data, quadrig, root};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use tempfile::TempDir;

/// How a clone's own pages call the command line.
const CALL: &str = "cargo run --release -- ";
/// Pages with a test of their own.
const ELSEWHERE: [&str; 1] = ["first-hour.md"];
/// Where cargo's own targets lie.
const TARGETS: [(&str, &str); 4] = [("--test", "tests"), ("--bench", "benches"), ("--bin", "src/bin"), ("--example", "examples")];

/// A folder with links to what the pages name, and `quadrig` in a folder of its own for the shell's path.
struct Clone {
    folder: TempDir,
    programs: TempDir,
}

impl Clone {
    fn new() -> Self {
        let (folder, programs) = (TempDir::new().unwrap(), TempDir::new().unwrap());
        std::os::unix::fs::symlink(root().join("examples"), folder.path().join("examples")).unwrap();
        std::os::unix::fs::symlink(quadrig(), programs.path().join("quadrig")).unwrap();
        Self { folder, programs }
    }

    fn shell(&self, script: &str, data: Option<&Path>) -> Output {
        let path = std::env::var("PATH").unwrap_or_default();
        let mut shell = Command::new("sh");
        shell.args(["-e", "-c", &script.replace(CALL, "quadrig ")]).current_dir(self.folder.path()).stdin(Stdio::null());
        shell.env("PATH", format!("{}:{path}", self.programs.path().display()));
        if let Some(data) = data {
            shell.env("QUADRIG_DATA", data);
        }
        shell.output().expect("a shell")
    }
}

/// What the first block of a page left, by its words: the folder and what was said. The same words in the same empty folder leave the same
/// bytes, so pages that begin alike run them once.
static BEGUN: Mutex<BTreeMap<String, (TempDir, String)>> = Mutex::new(BTreeMap::new());

/// Runs the first block of a page that must succeed, or takes what it left on another page.
fn begin(clone: &Clone, script: &str) -> Result<String, String> {
    if let Some((left, said)) = BEGUN.lock().unwrap().get(script) {
        copy(left.path(), clone.folder.path());
        return Ok(said.clone());
    }
    let output = clone.shell(script, None);
    let said = said(&output);
    if !output.status.success() {
        return Err(format!("{}\n{said}", output.status));
    }
    let kept = TempDir::new().unwrap();
    copy(clone.folder.path(), kept.path());
    BEGUN.lock().unwrap().insert(script.to_owned(), (kept, said.clone()));
    Ok(said)
}

/// Copies what commands wrote; the links of a clone are there already.
fn copy(from: &Path, to: &Path) {
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let (kind, target) = (entry.file_type().unwrap(), to.join(entry.file_name()));
        if kind.is_dir() {
            std::fs::create_dir_all(&target).unwrap();
            copy(&entry.path(), &target);
        } else if kind.is_file() {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// Names under which pages speak of a real board's port.
const PORTS: [&str; 2] = ["--port /dev/ttyUSB0", "--port PORT"];
/// What stands in its place here.
const VIRTUAL: &str = "--port sim --speed 0 --assist";
/// Names under which pages speak of a log that the reader has.
const GIVEN: [&str; 4] = ["FILE", "FOLDER/run.csv", "healthy.csv", "today.csv"];
/// A flight controller's recording, and another flight of the same vehicle.
const FLIGHTS: [&str; 2] = ["LOG.ulg", "other.csv"];
/// A verdict with an open question, and what would settle it.
const OPEN: (&str, &str) = (
    "out/verdict.json",
    r#"{"format": "quadrig-verdict 2", "next_experiment": {"why": "a hold", "schedule": [{"pulse_us": 1300, "hold_s": 3}]}}"#,
);

/// The script for a virtual board.
fn at_a_virtual_board(clone: &Clone, script: &str) -> String {
    let rig = clone.folder.path().join("rig.toml");
    if !rig.exists() {
        std::fs::copy(root().join("examples/rig/thesis.toml"), rig).unwrap();
    }
    let verdict = clone.folder.path().join(OPEN.0);
    if script.contains(OPEN.0) && !verdict.exists() {
        std::fs::create_dir_all(verdict.parent().unwrap()).unwrap();
        std::fs::write(verdict, OPEN.1).unwrap();
    }
    PORTS.iter().fold(script.to_owned(), |script, port| script.replace(port, VIRTUAL))
}

/// Lays the logs there that a reader of the page has.
fn give(clone: &Clone, script: &str) {
    if FLIGHTS.iter().any(|name| script.contains(name)) {
        give_flights(clone.folder.path());
    }
    let scenario = "rest_s = 2\nschedule = { kind = \"up_down\", step_us = 200, hold_s = 4, top_us = 1800 }\n";
    let at = clone.folder.path();
    std::fs::write(at.join("given.toml"), scenario).unwrap();
    for name in GIVEN.iter().filter(|name| script.contains(name.split('/').next().unwrap_or_default())) {
        std::fs::create_dir_all(at.join(name).parent().unwrap()).unwrap();
        let output = clone.shell(&format!("quadrig --quiet sim given.toml -o {name}"), None);
        assert!(output.status.success(), "{}", said(&output));
    }
}

/// Two flights of a vehicle of the blind generator: the first as PX4 would have recorded it, the second as a log.
fn give_flights(at: &Path) {
    let vehicle = Scenario::new(CLEAN + 2);
    let mut log = flight_log::parse("flight.csv", vehicle.log(0).as_bytes()).unwrap_or_else(|e| panic!("{e}"));
    let current = Column { name: "current_a".into(), values: vec![3.0; log.len()] };
    if log.column(&current.name).is_none() {
        log.columns.push(current);
    }
    let places: Vec<[f64; 3]> = vehicle.vehicle.hubs.iter().map(|hub| [hub.x, hub.y, hub.turns]).collect();
    std::fs::write(at.join(FLIGHTS[0]), ulog(&log, &places)).unwrap();
    std::fs::write(at.join(FLIGHTS[1]), vehicle.log(1)).unwrap();
}

/// Both streams of what was said.
fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// The commands of a block: a line that ends in a backslash goes on, comments are gone.
fn commands(lines: &[String]) -> Vec<String> {
    let joined = lines.join("\n").replace("\\\n", " ");
    let bare = joined.lines().map(|line| line.split(" #").next().unwrap_or_default().trim().to_owned());
    bare.filter(|line| !line.is_empty() && !line.starts_with('#')).collect()
}

/// Looks at a command without running it. One of `quadrig` gets `--help` behind it: clap reads every option and value before that and
/// refuses one that it does not know. Of `cargo xtask` the first word must stand in its usage, of other `cargo` calls the target that is
/// named must exist.
fn parse(clone: &Clone, command: &str) -> Result<(), String> {
    let command = command.replace(CALL, "quadrig ").replace("target/quadrig-emulated ", "quadrig ");
    if let Some(rest) = command.strip_prefix("cargo xtask ") {
        let usage = std::fs::read_to_string(root().join("xtask/src/main.rs")).expect("the usage");
        let word = rest.split_whitespace().next().unwrap_or_default();
        return if usage.contains(&format!("\n  {word} ")) { Ok(()) } else { Err(format!("cargo xtask knows no {word}")) };
    }
    let words: Vec<&str> = command.split_whitespace().skip_while(|word| word.contains('=')).collect();
    match words.first() {
        Some(&"cargo") => cargo(&words),
        // a cluster's call wraps one of ours in quotes
        Some(&"sbatch") => {
            command.split('"').nth(1).map_or(Err("sbatch wraps no command".to_owned()), |inner| parse(clone, inner))
        }
        Some(&"quadrig") => {
            let output = clone.shell(&format!("{command} --help"), None);
            if output.status.success() { Ok(()) } else { Err(said(&output)) }
        }
        _ => Err("neither quadrig nor cargo".to_owned()),
    }
}

/// The target that a cargo call names.
fn cargo(words: &[&str]) -> Result<(), String> {
    let mut packages = Vec::new();
    for entry in std::fs::read_dir(root()).expect("the workspace") {
        packages.push(entry.expect("an entry").path());
    }
    for pair in words.windows(2) {
        let Some((_, folder)) = TARGETS.iter().find(|(option, _)| *option == pair[0]) else { continue };
        let names = [format!("{}.rs", pair[1]), format!("{}/main.rs", pair[1])];
        if !packages.iter().any(|p| names.iter().any(|name| p.join(folder).join(name).is_file())) {
            return Err(format!("no package has {} {}", pair[0], pair[1]));
        }
    }
    Ok(())
}

/// The first line that does not stand in `said` behind those before it.
fn unsaid<'a>(lines: &'a [String], said: &str) -> Option<&'a str> {
    let mut rest = said;
    for line in lines.iter().filter(|line| !line.trim().is_empty() && line.trim() != "...") {
        match rest.split_once(line.as_str()) {
            Some((_, after)) => rest = after,
            None => return Some(line),
        }
    }
    None
}

/// What a page did: commands run, commands parsed, lines of excerpts found.
type Tally = [usize; 3];

/// Runs a page; the first thing that is not as the page says ends it.
fn run(page: &Page) -> Result<Tally, String> {
    let (clone, data) = (Clone::new(), data("data blocks of the book"));
    let (mut last, mut tally) = (None::<String>, [0; 3]);
    let mut fresh = true; // nothing but the links of a clone is in the folder
    for Block { kind, lines, line } in blocks(&page.text) {
        let at = format!("docs/{}:{line}", page.name);
        let words: Vec<&str> = kind.split_whitespace().collect();
        let (runs, wanted) = match words.as_slice() {
            ["sh"] => (true, 0),
            ["sh", "board" | "files"] => (true, 0),
            ["sh", "refused"] => (true, 1),
            ["sh", "data"] => (data.is_some(), 0),
            ["sh", "long" | "hardware"] => (false, 0),
            ["sh" | "console", ..] => return Err(format!("{at}: nobody knows a block `{kind}`")),
            ["text", "says"] => {
                let Some(said) = &last else { continue };
                if let Some(line) = unsaid(&lines, said) {
                    return Err(format!("{at}: the page promises\n{line}\nand the command says\n{said}"));
                }
                tally[2] += lines.len();
                continue;
            }
            ["toml" | "csv", file] => {
                fresh = false;
                std::fs::write(clone.folder.path().join(file), lines.join("\n") + "\n").map_err(|e| format!("{at}: {e}"))?;
                continue;
            }
            _ => continue,
        };
        let commands = commands(&lines);
        if std::mem::take(&mut fresh) && words == ["sh"] {
            let script = lines.join("\n");
            last = Some(begin(&clone, &script).map_err(|e| format!("{at}: {script}\n{e}"))?);
            tally[0] += commands.len();
        } else if runs {
            let script = lines.join("\n");
            let script = match words.as_slice() {
                ["sh", "board"] => at_a_virtual_board(&clone, &script),
                ["sh", "files"] => {
                    give(&clone, &script);
                    script
                }
                _ => script,
            };
            let output = clone.shell(&script, data.as_deref());
            let said = said(&output);
            if output.status.code() != Some(wanted) {
                return Err(format!("{at}: {}\n{}\n{said}", output.status, lines.join("\n")));
            }
            tally[0] += commands.len();
            last = Some(said);
        } else {
            for command in &commands {
                parse(&clone, command).map_err(|e| format!("{at}: {command}: {e}"))?;
                tally[1] += 1;
            }
            last = None;
        }
    }
    pictures(page, clone.folder.path()).map(|()| tally)
}

/// A picture below `docs/book/` is what the page's own commands wrote under that name; with `QUADRIG_BLESS=1` it becomes so.
fn pictures(page: &Page, written: &Path) -> Result<(), String> {
    let own = |target: &&str| page.name.starts_with("book/") && target.ends_with(".svg") && target.contains("figures/");
    for target in page.text.split("](").skip(1).filter_map(|rest| rest.split(')').next()).filter(own) {
        let at = format!("docs/{}: {target}", page.name);
        let file = target.rsplit('/').next().unwrap_or_default();
        let fresh = std::fs::read(written.join("figures").join(file))
            .map_err(|e| format!("{at}: no command wrote figures/{file} ({e})"))?;
        let kept = root().join("docs").join(&page.name).with_file_name("").join(target);
        if std::env::var_os("QUADRIG_BLESS").is_some() {
            std::fs::write(&kept, &fresh).map_err(|e| format!("{at}: {e}"))?;
        }
        if std::fs::read(&kept).ok() != Some(fresh) {
            return Err(format!(
                "{at} is not what the commands write: QUADRIG_BLESS=1 cargo test -p quadrig-tests --test suite book_commands"
            ));
        }
    }
    Ok(())
}

#[test]
fn every_command_of_the_book_runs() {
    let pages: Vec<Page> = pages().into_iter().filter(|page| !ELSEWHERE.contains(&page.name.as_str())).collect();
    println!("{}", quadrig().display()); // built once, before the pages ask for it side by side
    let (next, failed, tally) = (AtomicUsize::new(0), Mutex::new(Vec::new()), Mutex::new([0; 3]));
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while let Some(page) = pages.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let start = std::time::Instant::now();
                    let done = run(page);
                    println!("{:>6.1} s  {}", start.elapsed().as_secs_f64(), page.name);
                    match done {
                        Ok(done) => tally.lock().unwrap().iter_mut().zip(done).for_each(|(all, n)| *all += n),
                        Err(why) => failed.lock().unwrap().push(why),
                    }
                }
            });
        }
    });
    let failed = failed.into_inner().unwrap();
    assert!(failed.is_empty(), "{}", failed.join("\n\n"));
    let [run, parsed, found] = tally.into_inner().unwrap();
    println!("{run} commands run, {parsed} parsed, {found} lines of excerpts found");
    assert!(run >= 20 && parsed >= 10 && found >= 20, "{run} commands run, {parsed} parsed, {found} lines of excerpts found");
}

#[test]
fn what_is_wrong_on_a_page_is_told() {
    let told = |text: &str| run(&Page { name: "x.md".to_owned(), text: text.to_owned() });
    assert_eq!(told("```sh\nquadrig --version\n```\n```text says\nquadrig\n```\n"), Ok([1, 0, 1]));
    assert_eq!(told("```sh refused\nquadrig close-loop gone.csv\n```\n"), Ok([1, 0, 0]));
    assert_eq!(told("```sh hardware\nquadrig log --port PORT -o run.csv\ncargo xtask image # a comment\n```\n"), Ok([0, 2, 0]));
    assert_eq!(told("```sh board\nquadrig rig --port /dev/ttyUSB0 configure rig.toml\n```\n"), Ok([1, 0, 0]));
    assert_eq!(told("```sh files\nquadrig --quiet identify healthy.csv -o m.toml\n```\n"), Ok([1, 0, 0]));
    assert_eq!(told("```sh files\nquadrig --quiet import LOG.ulg -o flight.csv --meta mass_kg=0.9\n```\n"), Ok([1, 0, 0]));
    assert_eq!(told("```sh board\nquadrig --quiet rig --port PORT run --next out/verdict.json -o n.csv\n```\n"), Ok([1, 0, 0]));
    for wrong in [
        "```sh board\nquadrig rig --port /dev/ttyUSB0 configure gone.toml\n```\n",
        "```sh\nquadrig close-loop gone.csv\n```\n",
        "```sh refused\nquadrig --version\n```\n",
        "```sh\nquadrig --version\n```\n```text says\nquadrig\nquadrig\n```\n",
        "```sh hardware\nquadrig log --prot PORT\n```\n",
        "```sh long\ncargo xtask imagine\n```\n",
        "```sh long\ncargo test --test no_such_test\n```\n",
        "```sh long\nrm x\n```\n",
        "```sh hardware\nsbatch --wrap \"quadrig batch FOLDER --shrd 1/8 -o OUT\"\n```\n",
        "```sh never\nquadrig --version\n```\n",
        "```text says\nnobody said it\n```\n```sh\nquadrig --version\n```\n```text says\nnor this\n```\n",
    ] {
        assert!(told(wrong).is_err(), "{wrong}");
    }
}
