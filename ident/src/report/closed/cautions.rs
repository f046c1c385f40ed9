//! What a reader must know before the figures.
//!
//! What it is: noise floors that are guesses, and floors that no meter has; a sentence or two each, for page and terminal alike.
//! What can go wrong: nothing; most runs have none.
//! Units: rows, noise floors.
//! Reference: quantisation noise of a uniform quantiser, a step over the square root of twelve.

use crate::verdict::Verdict;
use crate::words::{channels, upper};

/// Error over noise floor from which on the floor lies beneath the rounding of a sensor of 16 bits: what it measured spans its error at the least,
/// and its rounding is a 65536th of its span over the square root of twelve.
const FINEST: f64 = 65_536.0 / 3.464_101_6;

/// The cautions of a verdict.
pub(super) fn cautions(v: &Verdict) -> Vec<String> {
    let guessed = v.guessed_floors.map(|rows| {
        format!("Only {rows} rows, one for each level: none has two to compare, so that the noise floors are guesses, and a row that is left out is guessed from its neighbours. A staircase with many rows on each level tells more.")
    });
    guessed.into_iter().chain(without_noise(v)).collect()
}

fn without_noise(v: &Verdict) -> Option<String> {
    let finer = v.channels.iter().filter(|(_, c)| c.before.heldout_rms > FINEST * c.noise_floor_rms);
    let names: Vec<String> = finer.map(|(name, _)| name.clone()).collect();
    (!names.is_empty()).then(|| {
        format!("{}: the noise floor lies beneath the rounding of any 16-bit sensor, as in a simulation without sensor noise. What is many floors may be next to nothing there: read the sizes, not the floors.", upper(&channels(&names)))
    })
}
