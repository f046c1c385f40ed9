//! A history in sentences.
//!
//! What it is: one sentence for the whole, one for each change: when, what, by how much, and what it is called.
//! What can go wrong: a name that is not sure is told with its runner-up.
//! Units: as the measures state.
//! Reference: none.

use super::find::{Change, Kind, Moved};
use super::{Chart, History};
use crate::words::{amount, lower, upper};

/// Logarithm of the odds within which the runner-up of a name is told: e^3.
const CLOSE: f64 = 3.0;

/// When a change came: "between 2026-03-12 and 2026-03-13", "between run 30 and run 31".
#[must_use]
pub fn gap(history: &History, change: &Change) -> String {
    match change.kind {
        Kind::Step => format!("between {} and {}", history.label(change.first - 1), history.label(change.first)),
        Kind::Drift => format!("from {} to {}", history.label(change.among[0]), history.label(change.among[1] - 1)),
    }
}

/// By how much a measure moved.
pub(crate) fn by(history: &History, moved: &Moved) -> String {
    let sign = |v: f64| if v > 0.0 { "+" } else { "-" };
    let per = moved.unit.split_once(' ').map_or(String::new(), |(_, per)| format!(" {per}"));
    match moved.unit.split(' ').next().unwrap_or_default() {
        "x" => format!("{:.3} times{per}", moved.by),
        "%" => format!("{}{:.2} %{per}", sign(moved.by), moved.by.abs()),
        unit => {
            let centre = Chart::of(history, moved.measure).map_or(0.0, |c| c.centre);
            let was = if per.is_empty() && centre != 0.0 { format!(" from {}", amount(centre, unit)) } else { String::new() };
            format!("{}{}{per}{was}", sign(moved.by), amount(moved.by.abs(), unit))
        }
    }
}

/// One change as a sentence.
#[must_use]
pub fn sentence(history: &History, change: &Change) -> String {
    let place = upper(&gap(history, change));
    let first = change.moved.first();
    let size = first.map(|m| format!("{} {}", m.words, by(history, m)));
    let what = match (change.names.first(), change.kind) {
        (_, Kind::Drift) => {
            first.map_or("something drifts".to_owned(), |m| format!("the {} drifts by {}", m.words, by(history, m)))
        }
        (Some(name), _) => match size {
            Some(size) => format!("{} ({size})", lower(name.words.trim_end_matches('.'))),
            None => lower(&name.words),
        },
        (None, _) => size.map_or("something changed".to_owned(), |size| format!("{size}; no effect of the library explains it")),
    };
    let doubt = match change.names.get(..2) {
        Some([best, next]) if best.score - next.score < CLOSE && change.kind == Kind::Step => {
            format!(" It may be {} instead.", next.title)
        }
        _ => String::new(),
    };
    let wide = change.between[0] != change.between[1] && change.kind == Kind::Step;
    let wide = if wide {
        let (from, to) = (history.label(change.between[0] - 1), history.label(change.between[1]));
        format!(" It lies between {from} and {to} with 95 %.")
    } else {
        String::new()
    };
    format!("{place}: {what}.{wide}{doubt}")
}

/// The whole history in one sentence.
#[must_use]
pub fn summary(history: &History) -> String {
    let n = history.runs.len();
    let last = history.label(n - 1);
    match history.changes.len() {
        0 => {
            let first = history.label(0);
            let span = if history.dated { format!(", from {first} to {last}") } else { String::new() };
            format!("Nothing changed over {n} runs beyond what days differ by{span}.")
        }
        1 => format!("{n} runs, one change. {}", sentence(history, &history.changes[0])),
        k => {
            let all: Vec<String> = history.changes.iter().map(|c| sentence(history, c)).collect();
            format!("{n} runs, {k} changes. {}", all.join(" "))
        }
    }
}
