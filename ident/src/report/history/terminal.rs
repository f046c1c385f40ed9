//! A rig's history as text.
//!
//! What it is: what changed in sentences, what moved by how much, then a row a run; no line is wider than 100 columns.
//! What can go wrong: a name of a run that is longer than its column is cut; `history.csv` has every measure.
//! Units: in the heads.
//! Reference: specification `report.md`.

use super::{MOVED, bracketed, foremost, why_no_change};
use crate::history::{Change, History, Kind, summary};
use crate::report::closed::{WIDEST, wrapped};
use crate::verdict::words::with_interval;

/// Most measures told of a change.
const TOLD: usize = 6;
/// Width of a run's name, and of a measure's column.
const NAME: usize = 26;
const WIDE: usize = 18;

/// The text.
#[must_use]
pub fn terminal(history: &History) -> String {
    let mut out = format!("{}\n", wrapped(&summary(history), 0));
    why_no_change(history).iter().for_each(|why| out += &format!("{}\n", wrapped(why, 0)));
    for change in &history.changes {
        out += &moved(history, change);
    }
    out + &runs(history)
}

/// What moved at a change.
fn moved(history: &History, change: &Change) -> String {
    let when = match change.kind {
        Kind::Step => format!("moved before {}", history.label(change.first)),
        Kind::Drift => "drifts".to_owned(),
    };
    let mut out = format!("\n{when:<46}{:>14}  {:<24}unit\n", "by", "95 % interval");
    for m in change.moved.iter().take(TOLD) {
        let [by, low, high] = with_interval(m.by, m.ci95);
        let interval = format!("{low} to {high}");
        out += &format!("  {:<44.43}{by:>14}  {interval:<24}{:.14}\n", m.words, m.unit);
    }
    match change.moved.len().saturating_sub(TOLD) {
        0 => {}
        n => out += &format!("  and {n} more, which history.json lists\n"),
    }
    out
}

/// A row a run, with a line where something changed.
fn runs(history: &History) -> String {
    let shown: Vec<usize> = foremost(history, MOVED).into_iter().take((WIDEST - NAME) / WIDE).collect();
    let row = |first: &str, cells: &dyn Fn(usize) -> String| {
        let cells: String = shown.iter().map(|m| format!("{:>WIDE$.w$}", cells(*m), w = WIDE - 1)).collect();
        format!("{first:<NAME$.w$}{cells}\n", w = NAME - 1).replace(" \n", "\n")
    };
    let (of, what): (Vec<String>, Vec<String>) = history.measures.iter().map(|m| halves(&m.name)).unzip();
    let mut out = format!("\n{}", row("", &|m| of[m].clone()));
    out += &row("run", &|m| what[m].clone());
    out += &row("", &|m| history.measures[m].unit.clone());
    for (k, run) in history.runs.iter().enumerate() {
        if history.changes.iter().any(|c| c.kind == Kind::Step && c.first == k) {
            out += &format!("{}\n", "-".repeat(NAME + WIDE * shown.len()));
        }
        let name = if history.dated { format!("{} {}", history.label(k), run.run) } else { format!("{:>2} {}", k + 1, run.run) };
        out += &row(&name, &|m| run.values[m].map_or_else(|| "-".to_owned(), bracketed));
    }
    out + "In brackets: half of the 95 % interval, in units of the last digit.\n"
}

/// Channel and quantity of a measure's name; a constant has no channel.
fn halves(name: &str) -> (String, String) {
    name.split_once(' ').map_or_else(|| (String::new(), name.to_owned()), |(of, what)| (of.to_owned(), what.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::tests::stepped;

    #[test]
    fn no_line_is_wider_than_the_terminal_and_the_gap_is_marked() {
        let history = stepped(12, 7);
        let text = terminal(&history);
        assert!(text.lines().all(|l| l.chars().count() <= WIDEST), "{text}");
        let lines: Vec<&str> = text.lines().collect();
        let rule = lines.iter().position(|l| l.starts_with("---")).expect("a rule");
        assert!(lines[rule - 1].starts_with(" 7 ") && lines[rule + 1].starts_with(" 8 "), "{text}");
        assert!(text.contains("moved before run 8"), "{text}");
    }
}
