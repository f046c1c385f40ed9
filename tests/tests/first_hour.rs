//! The tutorial, typed line by line: `docs/first-hour.md` against the virtual board.
//!
//! What it is: `sh bench` starts the board in the first terminal, `text bench` is typed there; `sh` runs in the second and succeeds, `sh refused` is refused; `text says` is in the
//! output of the last command; `sh view` opens the view there, and `text keys` are keys (before the bar) and what the screen then shows (after it).
//! What can go wrong: a command that was renamed, a word that the page shows and the program does not say.
#![cfg(unix)]

use quadrig_tests::book::{Block, blocks};
use quadrig_tests::screen::Screen;
use quadrig_tests::{quadrig, root};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::time::Duration;

/// How the page calls the command line.
const CALL: &str = "cargo run --release -- ";

/// The first terminal.
struct Bench {
    child: Child,
    hands: ChildStdin,
}

impl Bench {
    fn new(folder: &Path, words: &[&str]) -> Self {
        let piped = |c: &mut Command| c.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
        let mut child = piped(Command::new(quadrig()).args(words).current_dir(folder)).expect("quadrig starts");
        let mut said = BufReader::new(child.stdout.take().expect("its output"));
        let mut port = String::new();
        said.read_line(&mut port).expect("the port's name");
        assert!(port.starts_with("/dev/"), "{port}");
        std::thread::spawn(move || said.lines().map_while(Result::ok).for_each(|line| println!("bench: {line}")));
        let hands = child.stdin.take().expect("its input");
        Self { child, hands }
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The keys of a line: names of keys, or what is typed.
fn typed(words: &str) -> String {
    words
        .split_whitespace()
        .map(|word| match word {
            "Enter" => "\r",
            "Space" => " ",
            "Up" => "\x1b[A",
            typed => typed,
        })
        .collect()
}

#[test]
fn every_line_of_the_first_hour_works() {
    let folder = tempfile::tempdir().expect("a folder");
    std::os::unix::fs::symlink(root().join("examples"), folder.path().join("examples")).expect("the examples");
    let page = std::fs::read_to_string(root().join("docs/first-hour.md")).expect("the page");
    let (mut bench, mut view, mut said) = (None, None::<Screen>, String::new());
    let mut counted = [0; 3];
    for Block { kind, lines, .. } in blocks(&page) {
        println!("--- {kind}: {lines:?}");
        let words = |line: &str| line.strip_prefix(CALL).unwrap_or_else(|| panic!("{line}")).to_owned();
        match kind.as_str() {
            "sh bench" => {
                let words = words(&lines[0]);
                bench = Some(Bench::new(folder.path(), &words.split(' ').collect::<Vec<_>>()));
            }
            "text bench" => {
                let bench: &mut Bench = bench.as_mut().expect("a bench");
                for line in &lines {
                    writeln!(bench.hands, "{line}").expect("it listens");
                }
                std::thread::sleep(Duration::from_millis(300)); // a log interval, and the board's tick
            }
            "sh" | "sh refused" => {
                assert!(view.is_none(), "the view is still open");
                said.clear();
                for line in &lines {
                    let words = words(line);
                    let output =
                        Command::new(quadrig()).args(words.split(' ')).current_dir(folder.path()).stdin(Stdio::null()).output();
                    let output = output.expect("quadrig starts");
                    said += &String::from_utf8_lossy(&output.stdout);
                    said += &String::from_utf8_lossy(&output.stderr);
                    println!("{said}");
                    let wanted = if kind == "sh" { Some(0) } else { Some(1) };
                    assert_eq!(output.status.code(), wanted, "{line}: {said}");
                    counted[0] += 1;
                }
            }
            "text says" => {
                for line in &lines {
                    assert!(said.contains(line.as_str()), "the page promises {line:?}; it says\n{said}");
                    counted[1] += 1;
                }
            }
            "sh view" => {
                let words = words(&lines[0]);
                view = Some(Screen::start(folder.path(), &words.split(' ').collect::<Vec<_>>(), (100, 30)));
            }
            "text keys" => {
                for line in &lines {
                    let (keys, shown) = line.split_once('|').expect("keys | what is shown");
                    let screen = view.as_mut().expect("a view");
                    if keys.trim() == "wait" {
                        std::thread::sleep(Duration::from_secs(4)); // as a person does who reads the screen
                    } else {
                        screen.press(&typed(keys));
                    }
                    if !shown.trim().is_empty() {
                        screen.until_within(shown.trim(), Duration::from_secs(90));
                    }
                    counted[2] += 1;
                }
                // the view that was left, or that ended by itself
                let last = lines.last().expect("a line");
                if last.starts_with('q') || last.contains("recorded in") {
                    let (status, rest) = view.take().expect("a view").end();
                    assert!(status.success(), "{rest}");
                }
            }
            other => panic!("{other:?}: nobody knows such a block"),
        }
    }
    println!("{counted:?}");
    assert!(counted[0] >= 9 && counted[1] >= 6 && counted[2] >= 30, "{counted:?}");
}
