//! A tachometer before the rotor's first turns are done.
//!
//! What it is: a tachometer times its marks, so that it reads nothing until the second one has passed; with one mark a turn that is up to two
//! turns after the start. Its zeros of that time are no readings.
//! What can go wrong: a rotor that stands for a moment after the command is not told from one that has begun to turn.
//! Units: rows, s, rev/min.
//! Reference: two turns from rest at a constant acceleration take 2 x 2/n at the speed n that is reached (turns, turns a second).

use super::excursion::Event;
use super::witness::Witnesses;
use crate::context::CALM_US;

/// Turns, times two for a speed that grows evenly from nothing, in s rev/min.
const SILENT: f64 = 2.0 * 2.0 * 60.0;

/// The rows in which a tachometer had not seen its second mark.
pub(super) fn found(witnesses: &Witnesses<'_>, name: &'static str) -> Vec<Event> {
    let Some(read) = witnesses.clean(name) else { return Vec::new() };
    let measured: Vec<usize> = (0..read.len()).filter(|i| read[*i].is_finite()).collect();
    let rests = |i: &usize| read[*i] <= 0.0;
    let first_readings = measured.windows(2).enumerate().filter(|(_, w)| rests(&w[0]) && !rests(&w[1]));
    first_readings
        .filter_map(|(k, w)| {
            let first = w[1];
            let rest: Vec<usize> = measured[..=k].iter().rev().copied().take_while(rests).collect();
            let commanded = |i: usize| witnesses.pulse().is_none_or(|p| (p[i] - p[first]).abs() <= CALM_US);
            let silent = |i: &&usize| witnesses.t[first] - witnesses.t[**i] < SILENT / read[first] && commanded(**i);
            let rows = rest.iter().take_while(silent).count();
            // a stretch without a row of rest is a drop-out, and no start
            let start = (rows > 0 && rows < rest.len()).then(|| rest[rows - 1])?;
            Some(Event { rows: start..first, worst: start, expected: read[first], at_step: true })
        })
        .collect()
}
