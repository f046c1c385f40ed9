//! The published figures of histories.
//!
//! What it is: lines of results in, Markdown out: rates with Wilson intervals, and each rig that was not as it should be.
//! What can go wrong: a campaign without a kind of rig has no rate of it and says so.
//! Units: per cent.
//! Reference: Wilson 1927.

use super::score::Line;
use crate::blind::tally::Rate;
use std::fmt::Write;

/// The table.
#[must_use]
pub fn markdown(lines: &[Line]) -> String {
    let of = |kind: &'static str| lines.iter().filter(move |l| l.kind == kind);
    let changed = || lines.iter().filter(|l| l.kind != "none");
    let rows: [(&str, Rate); 8] = [
        ("change found in the right gap", Rate::over(of("change"), |l| l.right)),
        ("the gap's 95 % interval holds it", Rate::over(of("change"), |l| l.held)),
        ("its name first", Rate::over(of("change"), |l| l.named)),
        ("its name first, of those that were found", Rate::over(of("change").filter(|l| l.held), |l| l.named)),
        ("its name among the first two", Rate::over(of("change"), |l| among(l, 2))),
        ("drift found as a drift, of the thrust's gain", Rate::over(of("drift"), |l| l.right && l.named)),
        ("rigs with a change that is none, among those that changed", Rate::over(changed(), |l| l.extra > 0)),
        ("rigs with a change that is none, among those that did not", Rate::over(of("none"), |l| l.extra > 0)),
    ];
    let mut out = String::from("| figure | rate |\n| --- | --- |\n");
    for (what, rate) in rows {
        let _ = writeln!(out, "| {what} | {} |", rate.text());
    }
    let failed = lines.iter().filter(|l| l.found.starts_with("refused") || l.found == "panic").count();
    let _ = writeln!(out, "| refused, or a panic | {failed} |");
    out
}

/// Whether the true name is among the first so many.
fn among(line: &Line, most: usize) -> bool {
    line.held && line.names.split('|').take(most).any(|n| n.split(' ').next() == Some(&line.truth))
}

/// Each rig that was not as it should be, a line each.
#[must_use]
pub fn failures(lines: &[Line]) -> String {
    let failed = |l: &&Line| if l.kind == "none" { l.extra > 0 } else { !l.right || !l.named || l.extra > 0 };
    let mut out = String::new();
    for l in lines.iter().filter(failed) {
        let _ = writeln!(
            out,
            "{} {} {} {:.3} before run {} of {}: found [{}], moved {}, names {}",
            l.seed, l.kind, l.truth, l.size, l.first, l.runs, l.found, l.moved, l.names
        );
    }
    out
}
