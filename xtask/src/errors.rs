//! `cargo xtask errors`: docs/errors.md, every refusal of the command line, from the source that says it.
//!
//! What it is: the texts that hold "expected", and the arguments of every `refuse(...)`, gathered area by area; what stands in braces in the source is
//! a place for a value: its name in the source in capitals, or `...`. For the board's refusals what to do is written here.
//!
//! What can go wrong: an area without a refusal, a reason of the board without advice; the page that is not the source's: a test fails.
//!
//! Units: none.
//!
//! Reference: docs/errors.md; `tests/tests/refusals.rs` provokes more than a hundred of them.

mod text;

use crate::place::Place;
use crate::run::Failure;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use text::{Literal, UNKNOWN, closing, ending, literals, named, nameless, past_value, plain};

/// What a part of the page is called, and the files or folders whose refusals stand in it.
const AREAS: [(&str, &[&str]); 14] = [
    (
        "Any file and folder",
        &[
            "quadrig/src/trouble.rs",
            "quadrig/src/apart.rs",
            "quadrig/src/folder.rs",
            "quadrig/src/spool.rs",
            "quadrig/src/end.rs",
            "quadrig/src/open.rs",
            "quadrig/src/say.rs",
        ],
    ),
    ("Numbers of the command line", &["quadrig/src/number.rs"]),
    (
        "Rig logs",
        &[
            "ident/src/log/mod.rs",
            "ident/src/log/lines.rs",
            "ident/src/log/names.rs",
            "ident/src/log/row.rs",
            "ident/src/log/clock.rs",
            "ident/src/log/disc.rs",
            "ident/src/log/gaps.rs",
            "ident/src/log/head.rs",
            "ident/src/log/plausible.rs",
            "ident/src/log/whole.rs",
            "ident/src/identify/mod.rs",
            "quadrig/src/close_loop.rs",
            "quadrig/src/identify.rs",
            "quadrig/src/plateaus.rs",
        ],
    ),
    ("Imports", &["ident/src/log/import", "ident/src/log/join", "quadrig/src/import.rs", "quadrig/src/join.rs"]),
    ("Models and exports", &["ident/src/model", "quadrig/src/predict.rs", "quadrig/src/export"]),
    (
        "Attitude logs and flights",
        &[
            "ident/src/log/flight_log.rs",
            "ident/src/flight",
            "ident/src/inertial",
            "quadrig/src/ahrs.rs",
            "quadrig/src/ahrs",
            "quadrig/src/close_loop",
            "quadrig/src/kind.rs",
        ],
    ),
    (
        "Scenarios, missions, simulation",
        &[
            "hal-sim/src/scenario",
            "hal-sim/src/number.rs",
            "hal-sim/src/mission",
            "hal-sim/src/native",
            "quadrig/src/sim.rs",
            "quadrig/src/sim",
            "quadrig/src/fly",
            "quadrig/src/isolability.rs",
            "quadrig/src/live.rs",
        ],
    ),
    ("Schedules", &["schedule/src"]),
    (
        "Boards and ports",
        &[
            "quadrig/src/rig.rs",
            "quadrig/src/rig",
            "quadrig/src/record.rs",
            "quadrig/src/record",
            "quadrig/src/board.rs",
            "quadrig/src/port.rs",
            "quadrig/src/imu.rs",
            "quadrig/src/imu",
            "quadrig/src/virtual_port.rs",
            "quadrig/src/view",
            "quadrig/src/flash.rs",
            "virtual-board/src",
        ],
    ),
    ("Calibration", &["quadrig/src/calibrate.rs", "quadrig/src/calibrate", "quadrig/src/recalibrate.rs"]),
    ("Selection and beam", &["ident/src/sizing/select", "quadrig/src/select.rs", "quadrig/src/beam.rs"]),
    ("Recorded sets", &["quadrig/src/measured"]),
    ("Several runs and batches", &["ident/src/several", "quadrig/src/batch", "quadrig/src/runs.rs", "quadrig/src/step.rs"]),
    ("A rig's history", &["ident/src/history", "quadrig/src/history.rs"]),
];

/// What to do about each reason of the board, in the order of its bits.
const BOARD: [(&str, &str); 16] = [
    ("not in this state", "`quadrig rig status` says the state; arm first, or stop first"),
    ("a fault is latched: clear it first", "mend its cause, then `quadrig rig clear`"),
    ("throttle is not at minimum", "`quadrig rig stop`, then ask again"),
    ("no low-throttle interval since the last run", "leave it at minimum for a moment, then ask again"),
    ("the ESC is powered", "disconnect the ESC's battery first"),
    ("confirmation is missing", "use this program's command, which confirms"),
    ("a value is out of range", "see the ranges in configuration.md"),
    ("the schedule is empty", "give it a part; see schedule.md"),
    ("the rotor turns", "wait until it stands"),
    ("the frame is not newer than the last one", "set the clock of the computer, or reset the board"),
    ("the settings could not be stored", "try `quadrig rig save` again; if it stays, the flash is worn out"),
    (
        "the supply reads off but was never seen on: switch the ESC on and off once, then ask again",
        "as it says: the board must have seen its voltage channel work",
    ),
    (
        "neither a speed sensor nor the current is fitted: nothing would see the rotor turn",
        "fit one, and configure it; see configuration.md",
    ),
    ("the stop loop is open: let the key go, check plug and wire", "as it says; see wiring.md"),
    ("too little of the schedule is there to begin with", "a line that loses much: `quadrig rig status` counts it"),
    ("DShot has no throttle range to calibrate", "nothing is to be done"),
];

/// What stands above what was expected in the place of a value that a refusal repeats.
const ECHOED: &str = "\nOther lines begin with a value as it was found. What was expected in its place is one of these:\n\n";

/// The same where an area says nothing else.
const ECHOED_ALONE: &str =
    "\nEach line begins with the option and its value as it was found. What was expected in its place is one of these:\n\n";

const HEAD: &str = "\
# Refusals

Written by `cargo xtask errors` from the source. A refusal is one line on standard error: `quadrig: FILE:LINE: what is there; expected what should be`, with what
to try where it is not plain; exit status 1. Nothing is written then, and what was there stays. A word in capitals, or `...`, stands for a name, a
place or a value. Wrong usage (an option that is none, a word that an option does not take) is status 2, and `--help` says what there is.
";

/// Calls that are refused, each with what is printed: its name, the call, the line. The table of `tests/tests/refusals.rs` holds them to it.
const EXAMPLES: &str = "tests/tests/refusals/examples.txt";

/// What stands above the examples.
const PRINTED: &str = "
## As they are printed

Each block is a call and what it prints. A test makes these calls and compares.
";

/// Writes the page.
pub(crate) fn write(place: &Place) -> Result<(), Failure> {
    let path = place.root.join("docs/errors.md");
    let text = page(&place.root).map_err(Failure)?;
    std::fs::write(&path, text).map_err(|e| Failure(format!("{}: {e}", path.display())))
}

fn page(root: &Path) -> Result<String, String> {
    let mut out = HEAD.to_owned() + &examples(root)?;
    for (heading, places) in AREAS {
        let mut rows = BTreeSet::new();
        for file in places.iter().flat_map(|place| sources(&root.join(place))) {
            let text = std::fs::read_to_string(&file).map_err(|e| format!("{}: {e}", file.display()))?;
            rows.extend(refusals(&text));
        }
        let _ = write!(out, "\n## {heading}\n"); // a string takes everything
        // what only repeats the reader's own words is known by what was expected in its place
        let (spoken, echoed): (Vec<_>, Vec<_>) = rows.into_iter().partition(|(found, expected)| said(found, expected).is_some());
        if !spoken.is_empty() {
            out += "\n| it says | it expected, and what to try |\n| --- | --- |\n";
        }
        for (found, expected) in &spoken {
            let _ = writeln!(out, "| {} | {} |", said(found, expected).unwrap_or_default(), cell(expected));
        }
        let wanted: BTreeSet<String> =
            echoed.iter().map(|(_, expected)| cell(expected)).filter(|e| e.contains(char::is_lowercase)).collect();
        if !wanted.is_empty() {
            out += if spoken.is_empty() { ECHOED_ALONE } else { ECHOED };
            wanted.iter().for_each(|expected| out += &format!("- {expected}\n"));
        }
    }
    out += "\n## What a board refuses\n\nThe board gives every reason at once, behind `the board refuses:`.\n\n| it says | what to do |\n| --- | --- |\n";
    for (says, todo) in BOARD {
        let _ = writeln!(out, "| {says} | {todo} |");
    }
    Ok(out)
}

/// Some refusals as they are printed.
fn examples(root: &Path) -> Result<String, String> {
    let text = std::fs::read_to_string(root.join(EXAMPLES)).map_err(|e| format!("{EXAMPLES}: {e}"))?;
    let mut out = PRINTED.to_owned();
    for block in text.trim_end().split("\n\n") {
        let Some((name, printed)) = block.split_once('\n') else {
            return Err(format!("{EXAMPLES}: {block}; expected a name, a call and what it prints, a line each"));
        };
        let (first, rest) = name.split_at(name.chars().next().map_or(0, char::len_utf8));
        let _ = write!(out, "\n{}{rest}:\n\n```text\n{printed}\n```\n", first.to_uppercase()); // a string takes everything
    }
    Ok(out)
}

/// What the page says of what is found: its words; where the source holds none, what stands in their place. Nothing where a refusal says what
/// it found as it stands there.
fn said(found: &str, expected: &str) -> Option<String> {
    match &*nameless(found) {
        // a key, a column or an option alone
        bare if bare.contains(char::is_alphabetic) && !bare.contains([' ', ':', '"']) => {
            Some(format!("the value of `{}`", cell(found)))
        }
        bare if bare.contains(char::is_alphabetic) => Some(cell(found)),
        // it is told at the end, behind the name of its key, option or field
        "" | "..." if expected.contains("found ") => Some("the name of what holds the value".to_owned()),
        "... ..." => Some("the option and its value".to_owned()),
        bare if bare.contains('\'') => Some(format!("the value: {}", cell(found))),
        _ => None,
    }
}

/// The source files of a place, in order; tests in files of their own are none.
fn sources(place: &Path) -> Vec<PathBuf> {
    if place.is_file() {
        return vec![place.to_owned()];
    }
    let Ok(entries) = std::fs::read_dir(place) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.filter_map(Result::ok).map(|e| e.path()).collect();
    paths.sort();
    let is_source = |p: &PathBuf| p.extension().is_some_and(|e| e == "rs") && p.file_stem().is_some_and(|n| n != "tests");
    paths
        .iter()
        .flat_map(|p| {
            if p.is_dir() {
                sources(p)
            } else if is_source(p) {
                vec![p.clone()]
            } else {
                Vec::new()
            }
        })
        .collect()
}

/// What a source refuses: what is found, and what was expected.
fn refusals(source: &str) -> Vec<(String, String)> {
    let code = source.split("#[cfg(test)]").next().unwrap_or_default();
    let literals = literals(code);
    let mut out = Vec::new();
    for literal in &literals {
        if let Some((found, expected)) = literal.text.split_once("expected ") {
            let before = code[..literal.start].trim_end();
            let of_expect = before.ends_with(".expect(") || before.ends_with("expect_err(");
            let is_whole = found.is_empty() || found.ends_with([' ', ':', ';', '(']);
            if !of_expect && is_whole && !expected.is_empty() {
                let found = found.trim_end_matches([' ', ';', ':']);
                let found =
                    if found.is_empty() { used_in(code, &literals, literal).unwrap_or_default() } else { found.to_owned() };
                out.push((found, expected.to_owned()));
            }
        }
    }
    // refusal(key, what it holds, expected), of a key of a model file
    for (at, call) in code.match_indices("refusal(").filter(|(at, _)| !code[..*at].ends_with("fn ")) {
        let from = at + call.len();
        let arguments = arguments(code, from, closing(code, from));
        let text_in = |n: usize| literals.iter().find(|l| arguments.get(n).is_some_and(|range| range.contains(&l.start)));
        if let Some(expected) = text_in(2).filter(|_| arguments.len() >= 3) {
            let is_word = |l: &&Literal| l.text.contains(char::is_alphabetic);
            let key = text_in(0).filter(is_word).map_or("...", |l| l.text.as_str());
            out.push((format!("key {key}: ..."), expected.text.clone()));
        }
    }
    // refuse(.., found, expected), of a place or by a closure of this name: the word itself stands in the type's own text
    for (at, call) in code.match_indices("refuse(") {
        if code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_') {
            continue;
        }
        let end = closing(code, at + call.len());
        // the column's name is no part of what is said
        let is_column = |l: &Literal| code[..l.start].ends_with("Some(");
        let inside: Vec<&str> = literals
            .iter()
            .filter(|l| !is_column(l))
            .filter(|l| l.start > at && l.start < end)
            .map(|l| l.text.as_str())
            .filter(|t| nameless(t).len() > 2)
            .collect();
        let ranges = arguments(code, at + call.len(), end);
        let is_found = |text: &str| {
            let holds = |l: &&Literal| l.text == text && ranges.get(1).is_some_and(|range| range.contains(&l.start));
            // a reason alone is all that is found
            ranges.len() == 1 || (ranges.len() == 3 && literals.iter().any(|l| holds(&l)))
        };
        let arguments = &code[at + call.len()..end];
        let bound = |name: &str| {
            let is_there = arguments.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|word| word == name);
            if is_there { bound_to(code, &literals, at, name) } else { Vec::new() }
        };
        let founds = bound("found");
        let found = founds.first().cloned().unwrap_or_default();
        let told: Vec<String> = ["reason", "expected"].iter().flat_map(|name| bound(name)).collect();
        match inside[..] {
            [] => out.extend(told.into_iter().filter(|t| !t.contains("expected ")).map(|t| (found.clone(), t))),
            [expected] if !expected.contains("expected ") && !told.is_empty() && founds.is_empty() => {
                out.extend(told.into_iter().map(|t| (expected.to_owned(), t)));
            }
            // the text stands where what is found does, and what was expected has none
            [found] if is_found(found) && !found.contains("expected ") => {
                out.push((found.to_owned(), String::new()));
            }
            [expected] if !expected.contains("expected ") => {
                let rest = told.first().and_then(|begins| Some((begins, past_value(expected)?)));
                out.push((found, rest.map_or_else(|| expected.to_owned(), |(begins, rest)| format!("{begins}{rest}"))));
            }
            [found, ref expected @ ..] if !found.contains("expected ") && !expected.is_empty() => {
                out.push((found.to_owned(), expected.join(" ")));
            }
            _ => {}
        }
    }
    // what one of several looks at a log found: a refusal that only hands it on says it for each
    let found = doubts(code, &literals);
    let is_handed_on = |(found, expected): &(String, String)| found.is_empty() && expected.starts_with("what a rig can do");
    if let (false, Some(at)) = (found.is_empty(), out.iter().position(is_handed_on)) {
        let (_, expected) = out.remove(at);
        out.extend(found.into_iter().map(|found| (found, expected.clone())));
    }
    out
}

/// What no rig does: `doubt(column, never, what)`, where `what` is a text, or a reason that a closure `said` puts behind its own.
fn doubts(code: &str, literals: &[Literal]) -> Vec<String> {
    let is_call = |at: usize| !code[..at].ends_with("fn ") && !code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
    let calls = code.match_indices("doubt(").filter(|(at, _)| is_call(*at));
    let found = calls.filter_map(|(at, call)| {
        let from = at + call.len();
        let what = arguments(code, from, closing(code, from)).into_iter().nth(2)?;
        let text = literals.iter().find(|l| what.contains(&l.start)).map(|l| l.text.clone());
        if !code[what].trim_start().starts_with("said(") {
            return text;
        }
        let all = bound_to(code, literals, at, "said");
        let begins = &all.first()?[..all.first()?.rfind(UNKNOWN)?];
        Some(begins.to_owned() + &text.unwrap_or_else(|| UNKNOWN.to_owned()))
    });
    found.collect()
}

/// Where the arguments of a call stand, of which the first begins at `from` and the last ends at `end`.
fn arguments(code: &str, from: usize, end: usize) -> Vec<std::ops::Range<usize>> {
    let (mut depth, mut begin, mut out) = (0, from, Vec::new());
    let literals = literals(&code[from..end]);
    let is_text = |at: usize| literals.iter().any(|l| at >= l.start && at <= ending(&code.as_bytes()[from..end], l.start + 1));
    for (at, c) in code[from..end].char_indices().filter(|(at, _)| !is_text(*at)) {
        match c {
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => depth -= 1,
            ',' if depth == 0 => {
                out.push(begin..from + at);
                begin = from + at + 1;
            }
            _ => {}
        }
    }
    out.push(begin..end);
    out
}

/// What is said before a text that has a name of its own: the text that this name is put into.
fn used_in(code: &str, literals: &[Literal], named: &Literal) -> Option<String> {
    let before = code[..named.start].trim_end().trim_end_matches("format!(").trim_end().strip_suffix('=')?.trim_end();
    let statement =
        before.rsplit(['{', '}', ';']).next()?.trim().trim_start_matches("pub(super) ").trim_start_matches("pub(crate) ");
    let name = statement.strip_prefix("let ").or_else(|| statement.strip_prefix("const "))?.split(':').next()?.trim();
    let mark = format!("{{{name}}}");
    let user = literals
        .iter()
        .find(|l| l.start > named.start && code[l.start + 1..ending(code.as_bytes(), l.start + 1)].contains(&mark))?;
    let raw = &code[user.start + 1..ending(code.as_bytes(), user.start + 1)];
    let said = plain(raw.split(&mark).next()?, &[]);
    let said = said.trim_end_matches([' ', ';', ':']).to_owned();
    said.chars().any(char::is_alphabetic).then_some(said)
}

/// The texts of the last `let NAME = ...;` before a place.
fn bound_to(code: &str, literals: &[Literal], at: usize, name: &str) -> Vec<String> {
    let Some(from) = code[..at].rfind(&format!("let {name} =")) else { return Vec::new() };
    let mut depth = 0;
    let length = code[from..].find(|c| {
        match c {
            '{' | '(' => depth += 1,
            '}' | ')' => depth -= 1,
            _ => {}
        }
        c == ';' && depth == 0
    });
    let end = from + length.unwrap_or(0);
    // what is bound within belongs to another name
    let is_own = |l: &&Literal| {
        let before = &code[from + 4..l.start];
        before.rfind("let ").is_none_or(|k| before[k..].contains(';'))
    };
    let least = if name == "found" { 0 } else { 12 };
    let inside = literals.iter().filter(|l| l.start > from && l.start < end && nameless(&l.text).len() > least);
    inside.filter(is_own).map(|l| l.text.clone()).collect()
}

fn cell(text: &str) -> String {
    let text = named(text.trim()).replace('|', "\\|").replace('<', "&lt;");
    if text.is_empty() { UNKNOWN.to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_are_found_as_they_are_printed() {
        let source = r#"
            // "a comment; expected nothing"
            let a = format!("{}: {column} is \"late\"; expected seconds: sort {them}", 1);
            let b = x.expect("expected as a habit");
            return Err(place.refuse(Some(name), format!("{n} fields"), "6 as in the header"));
            let expected = "expected a new folder";
            return Err(format!("{path}: holds {name}, mixed up with these; {expected}"));
            let found = format!("{n} of {rows} rows would be dropped: {likely}");
            return refuse(found, "a clock that moves on");
            let c = ['"', '\'', 'x'];
            return Err(place.refuse(None, format!("by its name a {}", r.name), r.whole));
            return Err(refusal("start_pulse_us", start, "a finite number, in us"));
            return Err(refusal(&format!("{place}.{key}"), root.get("format"), &format!("one of {}", known.join(", "))));
            return Err(refusal("shape", at("shape"), &wanted()));
            fn doubt(column: &str, never: bool, what: String) {}
            let said = |likely: &str| format!("{thrust} N at {n} rev/min: {likely}");
            doubt("thrust_n", true, said("grams?"));
            doubt("voltage_v", top > 500.0, format!("{top:.0} V: hundredths of a volt?"));
            let expected = format!("what a rig can do, in the unit of {column}");
            Err(place.refuse(Some(column), what, expected))
            #[error("no effect {0:?}; expected one of {list}")]
            #[cfg(test)]
            let d = "in a test; expected nothing";
        "#;
        let wanted = [
            ("...: COLUMN is \"late\"", "seconds: sort THEM"),
            ("FILE: holds NAME, mixed up with these", "a new folder"),
            ("no effect ...", "one of LIST"),
            ("key start_pulse_us: ...", "a finite number, in us"),
            ("key PLACE.KEY: ...", "one of KNOWN"),
            ("N fields", "6 as in the header"),
            ("N of ROWS rows would be dropped: LIKELY", "a clock that moves on"),
            ("by its name a NAME", ""),
            ("THRUST N at N rev/min: grams?", "what a rig can do, in the unit of COLUMN"),
            ("TOP V: hundredths of a volt?", "what a rig can do, in the unit of COLUMN"),
        ];
        let wanted: Vec<(String, String)> = wanted.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect();
        let told: Vec<(String, String)> = refusals(source).iter().map(|(a, b)| (named(a), named(b))).collect();
        assert_eq!(told, wanted);
    }

    #[test]
    fn the_page_is_the_sources() {
        let root = Place::find().root;
        let page = page(&root).expect("sources");
        for (heading, _) in AREAS {
            let part = page.split(&format!("\n## {heading}\n")).nth(1).and_then(|t| t.split("\n## ").next()).unwrap_or_default();
            assert!(part.lines().count() >= 4, "{heading}: {part}");
            assert!(
                !part.trim_end().ends_with("| --- | --- |") && !part.contains("| --- | --- |\n\n"),
                "{heading}: an empty table"
            );
        }
        // refusals as they are printed stand first
        let printed = page.split(PRINTED).nth(1).and_then(|t| t.split("\n## ").next()).unwrap_or_default();
        assert!((6..=8).contains(&printed.matches("\n$ quadrig ").count()) && !printed.contains("..."), "{printed}");
        // what is found says more than the name of what holds it
        assert!(page.contains("| the value of `-o` | "), "a word alone says nothing");
        assert!(
            !page.lines().any(|l| l.starts_with("| ") && l.split(" | ").next().is_some_and(|w| !w[2..].contains([' ', '-'])))
        );
        assert!(page.lines().filter(|l| l.starts_with("| ")).count() > 200);
        let there = std::fs::read_to_string(root.join("docs/errors.md")).expect("docs/errors.md");
        assert!(there == page, "docs/errors.md is not what the source says: cargo xtask errors");
    }

    /// What a program says besides, and refuses nothing by.
    const NOTES: [&str; 3] = ["hal-sim/src/fault/rule.rs", "ident/src/signal/bad.rs", "ident/src/log/sparse.rs"];

    #[test]
    fn every_source_that_refuses_stands_in_an_area() {
        let root = Place::find().root;
        let listed: Vec<PathBuf> =
            AREAS.iter().flat_map(|a| a.1).chain(&NOTES).flat_map(|place| sources(&root.join(place))).collect();
        let folders = ["quadrig/src", "ident/src", "hal-sim/src", "schedule/src", "virtual-board/src"];
        let refuses = |file: &PathBuf| !refusals(&std::fs::read_to_string(file).expect("a source")).is_empty();
        let all = folders.iter().flat_map(|folder| sources(&root.join(folder)));
        let missing: Vec<PathBuf> = all.filter(|file| !listed.contains(file) && refuses(file)).collect();
        assert!(missing.is_empty(), "in no area of docs/errors.md: {missing:?}");
    }

    /// Each reason of the board has its advice, in its own words.
    #[test]
    fn every_reason_of_the_board_has_advice() {
        let source = std::fs::read_to_string(Place::find().root.join("esc-pwm/src/fault.rs")).expect("the source");
        let list =
            source.split("pub const WORDS: [(u16, &'static str)").nth(1).and_then(|t| t.split("];").next()).expect("its words");
        let words: Vec<String> = literals(list).into_iter().map(|l| l.text).collect();
        let told: Vec<&str> = BOARD.iter().map(|b| b.0).collect();
        assert_eq!(words, told);
    }
}
