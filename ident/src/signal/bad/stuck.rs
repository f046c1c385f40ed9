//! A reading that was repeated for longer than chance repeats it.
//!
//! What it is: the one run of a channel in which the same reading stands in row after row, where elsewhere readings differ.
//! What can go wrong: a standing rotor, a rail and a logger that repeats old readings all the time repeat as well, and stay.
//! Units: rows.
//! Reference: run lengths of a Bernoulli process.

use super::excursion::Event;
use super::scale::before;
use super::witness::Witnesses;

/// Fewest repeated readings.
const FEWEST: usize = 4;
/// Most: what lasts longer is no bad sample.
const MOST: usize = 240;
/// Runs as long that chance may make in one channel of a thousand.
const CHANCE: f64 = 1e-3;

/// The stuck readings of a channel, the first of them excepted.
pub(super) fn found(witnesses: &Witnesses<'_>, name: &'static str) -> Vec<Event> {
    let Some(case) = witnesses.case(name, false) else { return Vec::new() };
    let (y, n) = (&case.y, case.y.len());
    let (low, high) = y.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    // the runs of readings that are neither nothing nor a rail
    let mut runs: Vec<(usize, usize)> = Vec::new();
    let mut k = 0;
    for run in y.chunk_by(|a, b| a == b) {
        if run[0] != 0.0 && run[0] != low && run[0] != high {
            runs.push((run.len(), k));
        }
        k += run.len();
    }
    runs.sort_unstable_by(|a, b| b.cmp(a));
    let [(longest, from), second, ..] = runs[..] else { return Vec::new() };
    let repeats: usize = runs[1..].iter().map(|r| r.0 - 1).sum();
    let chance = (repeats as f64 + 1.0) / n as f64;
    let odd = n as f64 * chance.powi(longest as i32 - 1) < CHANCE && longest >= 2 * second.0;
    if !odd || !(FEWEST..=MOST.min(n / 10)).contains(&longest) {
        return Vec::new();
    }
    let usual = before(&case.r, from);
    let samples = from + 1..from + longest;
    let off = |k: &usize| (case.r[*k] - usual).abs();
    let Some(worst) = samples.clone().max_by(|a, b| off(a).total_cmp(&off(b))) else { return Vec::new() };
    let rows = case.rows[samples.start]..case.rows[samples.end - 1] + 1;
    vec![Event { rows, worst: case.rows[worst], expected: y[worst] - case.r[worst] + usual, at_step: false, silent: false }]
}
