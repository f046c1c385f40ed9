//! A rig's history as a person reads it.
//!
//! What it is: the text of a terminal, and a page with control charts; numbers with their interval behind them in brackets.
//! What can go wrong: nothing; what a run does not tell is a dash.
//! Units: in the heads of the columns.
//! Reference: GUM, clause 7.2.2 (a result and its uncertainty in brackets).

mod chart;
mod page;
mod terminal;

pub use page::page;
pub use terminal::terminal;

use crate::history::{History, Value};
use crate::verdict::words;

/// Why values that differ are no change.
const NO_CHANGE: &str = "Runs that differ by more than their own intervals are no change by themselves. An interval holds what one run's rows show; days differ by more, by air, warmth and how the rig was set up. A change is a level that stays: the runs before a gap lie together, those after it lie together elsewhere, by more than days differ.";

/// That said of a history without a change; nothing where a change was found.
fn why_no_change(history: &History) -> Option<&'static str> {
    history.changes.is_empty().then_some(NO_CHANGE)
}

/// Measures that stand first: at most so many of what moved, the surest first, then the constants of the thesis.
fn foremost(history: &History, most: usize) -> Vec<usize> {
    let mut moved: Vec<_> = history.changes.iter().flat_map(|c| &c.moved).collect();
    moved.sort_by(|a, b| b.evidence.total_cmp(&a.evidence).then(a.measure.cmp(&b.measure)));
    let constants = (0..history.measures.len()).filter(|m| history.measures[*m].channel.is_empty());
    let mut out: Vec<usize> = Vec::new();
    for m in moved.iter().map(|m| m.measure).take(most).chain(constants) {
        if !out.contains(&m) {
            out.push(m);
        }
    }
    out
}

/// Most measures that moved at the head of a table.
const MOVED: usize = 2;

/// A value with the half width of its 95 % interval in brackets.
fn bracketed(v: Value) -> String {
    words::bracketed(v.value, v.half()).unwrap_or_else(|| "-".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_has_its_interval_in_brackets() {
        let said = |value: f64, half: f64| bracketed(Value { value, se: half / 1.96 });
        assert_eq!(said(0.049_76, 0.000_51), "0.0498(5)");
        assert_eq!(said(1.560_16e-5, 1.2e-9), "1.56016(12)e-5");
        assert_eq!(said(-131.66, 28.0), "-130(30)");
        assert_eq!(said(569.77, 1.3), "569.8(13)");
        assert_eq!(said(0.0, 0.02), "0.00(2)");
        assert_eq!(said(1.0, 0.0), "-");
    }
}
