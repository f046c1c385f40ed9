//! What a reader must know before the figures.
//!
//! What it is: noise floors that are guesses, floors that no meter has, a speed sensor whose own error was taken off, and other runs on which the
//! model is far off; a sentence or two each, for page and terminal alike.
//! What can go wrong: nothing; most runs have none.
//! Units: rows, noise floors.
//! Reference: quantisation noise of a uniform quantiser, a step over the square root of twelve.

use crate::attribution::unexplained::LOUD;
use crate::verdict::words::{channel, channels, list, upper};
use crate::verdict::{Validation, Verdict};

/// Error over noise floor from which on the floor lies beneath the rounding of a sensor of 16 bits: what it measured spans its error at the least,
/// and its rounding is a 65536th of its span over the square root of twelve.
const FINEST: f64 = 65_536.0 / 3.464_101_6;

/// Share of its fluctuations from which on a speed sensor reads its own error rather than the rotor.
const MOSTLY: f64 = 0.5;

/// The cautions of a verdict.
pub(super) fn cautions(v: &Verdict) -> Vec<String> {
    let guessed = v.guessed_floors.map(|rows| {
        format!("Only {rows} rows, one for each level: none has two to compare, so that the noise floors are guesses, and a row that is left out is guessed from its neighbours. A staircase with many rows on each level tells more.")
    });
    let own_error = v.sensor_share.filter(|share| *share > MOSTLY).map(|share| {
        let part = if share > 0.995 { "all".to_owned() } else { format!("{:.0} %", 100.0 * share) };
        format!("Of what the speed sensor reads off the course of a level, {part} is its own error: thrust, torque and current do not follow it. It was taken off before they were predicted.")
    });
    guessed.into_iter().chain(without_noise(v)).chain(own_error).chain(far_off(v)).collect()
}

fn without_noise(v: &Verdict) -> Option<String> {
    let finer = v.channels.iter().filter(|(_, c)| c.before.heldout_rms > FINEST * c.noise_floor_rms);
    let names: Vec<String> = finer.map(|(name, _)| name.clone()).collect();
    (!names.is_empty()).then(|| {
        format!("{}: the noise floor lies beneath the rounding of any 16-bit sensor, as in a simulation without sensor noise. What is many floors may be next to nothing there: read the sizes, not the floors.", upper(&channels(&names)))
    })
}

/// Times its error on left-out rows of its own run above which a channel of another run is said to be far off.
const FAR: f64 = 2.0;

/// What another run has on which the model is far off, a line each run: above what is loud, and above what its own run promised.
fn far_off(v: &Verdict) -> Vec<String> {
    let of_run = |run: &Validation| {
        let told = run.channels.iter().filter_map(|(name, error)| {
            let own = v.channels.get(name)?;
            let floors = error.after / own.noise_floor_rms;
            let far = floors > LOUD && error.after > FAR * own.after.heldout_rms;
            far.then(|| format!("{} ({floors:.0} noise floors)", channel(name)))
        });
        let told: Vec<String> = told.collect();
        (!told.is_empty()).then(|| format!("On {} the model is far off on {}. Something differs there that this run does not show, or that the model does not carry over.", run.run, list(&told)))
    };
    v.validation.iter().filter_map(of_run).collect()
}
