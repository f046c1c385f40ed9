//! A history in sentences.
//!
//! What it is: one sentence for the whole, one for each change: when, what, by how much, and what it is called.
//! What can go wrong: a name that is not sure is told with its runner-up.
//! Units: as the measures state.
//! Reference: none.

use super::differ::differing;
use super::find::{Change, Kind, Moved};
use super::{Chart, History, fewest_judged};
use crate::verdict::words::{amount, digits, list, lower, probability, scaled, upper};

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

/// How a measure moved.
enum Move {
    /// So many times what it was.
    Times(String),
    /// By so much.
    By(String),
    /// From which value to which.
    FromTo(String),
}

fn movement(history: &History, moved: &Moved) -> Move {
    let sign = |v: f64| if v > 0.0 { "+" } else { "-" };
    let per = moved.unit.split_once(' ').map_or(String::new(), |(_, per)| format!(" {per}"));
    match moved.unit.split(' ').next().unwrap_or_default() {
        "x" => Move::Times(format!("{:.3} times{per}", moved.by)),
        "%" => Move::By(format!("{}{:.2} %{per}", sign(moved.by), moved.by.abs())),
        unit => match Chart::of(history, moved.measure).map_or(0.0, |c| c.centre) {
            before if per.is_empty() && before != 0.0 => Move::FromTo(from_to(before, before + moved.by, moved, unit)),
            _ => Move::By(format!("{}{}{per}", sign(moved.by), amount(moved.by.abs(), unit))),
        },
    }
}

/// By how much a measure moved; where it had a value before, from which to which.
pub(crate) fn by(history: &History, moved: &Moved) -> String {
    match movement(history, moved) {
        Move::Times(said) | Move::By(said) | Move::FromTo(said) => said,
    }
}

/// What a measure did, as a clause.
fn went(history: &History, moved: &Moved) -> String {
    let what = &moved.words;
    match movement(history, moved) {
        Move::Times(times) => format!("the {what} is {times} what it was"),
        Move::By(by) => format!("the {what} changed by {by}"),
        Move::FromTo(values) => format!("the {what} went {values}"),
    }
}

/// Both values in one unit, to the digits that the move supports.
fn from_to(before: f64, after: f64, moved: &Moved, unit: &str) -> String {
    let larger = if before.abs() > after.abs() { before } else { after };
    let (factor, unit) = scaled(larger, unit);
    let half = 0.5 * (moved.ci95[1] - moved.ci95[0]).abs();
    let [before, after] = [before, after].map(|v| digits(factor * v, factor * half));
    format!("from {before} to {after} {unit}")
}

/// One change as a sentence.
#[must_use]
pub fn sentence(history: &History, change: &Change) -> String {
    let place = upper(&gap(history, change));
    let first = change.moved.first();
    let size = first.map(|m| went(history, m));
    let what = match (change.names.first(), change.kind) {
        (_, Kind::Drift) => {
            first.map_or("something drifts".to_owned(), |m| format!("the {} drifts by {}", m.words, by(history, m)))
        }
        (Some(name), _) => match size {
            Some(size) => format!("{size}. What came on top: {}", lower(name.words.trim_end_matches('.'))),
            None => format!("what came on top: {}", lower(name.words.trim_end_matches('.'))),
        },
        (None, _) => size.map_or("something changed".to_owned(), |size| format!("{size}; no effect of the library explains it")),
    };
    let doubt = match change.names.get(..2) {
        Some([best, next]) if best.score - next.score < CLOSE && change.kind == Kind::Step => {
            format!(" Less likely ({}): {}.", probability(next.probability), lower(&next.title))
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

/// Measures that are told to differ.
const DIFFERING: usize = 2;

/// What differs from run to run by more than its own intervals.
fn differences(history: &History) -> String {
    let all = differing(history);
    let told: Vec<String> = all
        .iter()
        .take(DIFFERING)
        .map(|d| {
            let m = &history.measures[d.measure];
            let [low, high] = [d.low, d.high].map(|v| digits(v.value, v.half()));
            format!("{} from {low} to {high} {}", m.words, m.unit)
        })
        .collect();
    let (others, differ) = match all.len().saturating_sub(DIFFERING) {
        0 if told.len() == 1 => (String::new(), "differs"),
        0 => (String::new(), "differ"),
        k => (format!(", and {k} more measures"), "differ"),
    };
    if told.is_empty() {
        return "Every measure is the same within its own intervals.".to_owned();
    }
    let (told, its) =
        (if others.is_empty() { list(&told) } else { told.join(", ") }, if differ == "differs" { "its" } else { "their" });
    format!("By more than {its} own intervals {differ}: {told}{others}.")
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
            let fewest = fewest_judged();
            if n >= fewest {
                return format!("Nothing changed over {n} runs beyond what days differ by{span}.");
            }
            let few = format!(
                "No change was found over {n} runs{span}, but so few cannot show that there was none. What days differ by is not known from them: a control chart needs {fewest} runs before one of them can lie outside its limits."
            );
            [few, differences(history)].into_iter().filter(|s| !s.is_empty()).collect::<Vec<_>>().join(" ")
        }
        1 => format!("{n} runs, one change. {}", sentence(history, &history.changes[0])),
        k => {
            let all: Vec<String> = history.changes.iter().map(|c| sentence(history, c)).collect();
            format!("{n} runs, {k} changes. {}", all.join(" "))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::Value;
    use crate::history::tests::departing;

    /// Three runs whose gains are apart by more than their intervals: neither a change nor nothing.
    #[test]
    fn a_few_runs_are_not_said_to_be_alike() {
        let mut history = departing(3, false, |_| 0.0);
        history.measures[0].name = "thrust_n gain".into();
        history.measures[0].words = "gain of thrust".into();
        history.measures[0].unit = "%".into();
        for (run, gain) in history.runs.iter_mut().zip([-6.2, 5.0, 0.3]) {
            for value in &mut run.values {
                *value = Some(Value { value: 1.0, se: 0.1 });
            }
            run.values[0] = Some(Value { value: gain, se: 0.7 });
        }
        let said = summary(&history);
        assert!(said.starts_with("No change was found over 3 runs, but so few cannot show that there was none"), "{said}");
        assert!(said.contains("needs 11 runs"), "{said}");
        assert!(said.ends_with("By more than its own intervals differs: gain of thrust from -6 to 5 %."), "{said}");
        assert!(summary(&departing(11, false, |_| 0.0)).starts_with("Nothing changed over 11 runs beyond what days differ by."));
    }
}
