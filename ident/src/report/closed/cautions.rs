//! What a reader must know before the figures.
//!
//! What it is: noise floors that are guesses, floors that no meter has, a speed sensor whose own error was taken off, and other runs on which the
//! model is far off; a sentence or two each, for page and terminal alike.
//! What can go wrong: nothing; most runs have none.
//! Units: rows, noise floors.
//! Reference: quantisation noise of a uniform quantiser, a step over the square root of twelve.

use super::sentence::quantity;
use crate::attribution::unexplained::LOUD;
use crate::channel::NOISIER;
use crate::numeric::order::median;
use crate::verdict::words::{channel, channels, heading, list, upper};
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
    guessed.into_iter().chain(without_noise(v)).chain(noisy_sensor(v)).chain(own_error).chain(far_off(v)).collect()
}

fn without_noise(v: &Verdict) -> Option<String> {
    let finer = v.channels.iter().filter(|(_, c)| c.before.heldout_rms > FINEST * c.noise_floor_rms);
    let names: Vec<String> = finer.map(|(name, _)| name.clone()).collect();
    (!names.is_empty()).then(|| {
        format!("{}: the noise floor lies beneath the rounding of any 16-bit sensor, as in a simulation without sensor noise. What is many floors may be next to nothing there: read the sizes, not the floors.", upper(&channels(&names)))
    })
}

/// Fewest speed sensors of which two can say that the third is noisy.
const SENSORS: usize = 3;

/// The speed sensor that scatters far more than the others of the same rotor. Its floor is its own, so that nothing else shows it, unless a cause on it
/// has a name.
fn noisy_sensor(v: &Verdict) -> Option<String> {
    let floors: Vec<(&String, f64)> =
        v.channels.iter().filter(|(name, _)| quantity(name) == "rpm").map(|(name, c)| (name, c.noise_floor_rms)).collect();
    let (name, worst) = floors.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let usual = median(&mut floors.iter().filter(|f| f.0 != name).map(|f| f.1).collect::<Vec<_>>());
    let has_a_name = v.effects.iter().any(|e| e.channels.first() == Some(name) && e.channels.len() == 1);
    (floors.len() >= SENSORS && worst > NOISIER * usual && !has_a_name).then(|| {
        format!("{} scatters {:.0} times as much as the other sensors of this rotor do. Its noise floor is as high, so that the figures below make it look well: look at the sensor, its marks and its cable.", heading(name), worst / usual)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::closed::vocabulary::{bare_entry, bare_verdict};
    use crate::verdict::{Channel, EffectEntry, Figures};

    fn of(floors: &[(&str, f64)]) -> Verdict {
        let figures = Figures { rms: 1.0, heldout_rms: 1.0, across_runs_rms: None, whiteness_p: 0.5 };
        let mut v = bare_verdict(Vec::new());
        for (name, floor) in floors {
            let c = Channel { unit: "rev/min".into(), noise_floor_rms: *floor, before: figures, after: figures };
            v.channels.predicted.insert((*name).to_owned(), c);
        }
        v
    }

    #[test]
    fn a_sensor_that_scatters_more_than_its_peers_is_told() {
        let told = cautions(&of(&[("rpm_beam", 0.55), ("rpm_opto", 10.1), ("rpm_hall", 0.55), ("rpm_encoder", 0.6)]));
        assert_eq!(told.len(), 1, "{told:?}");
        assert!(told[0].starts_with("Speed (optical) scatters 18 times as much"), "{told:?}");
        let mut named = of(&[("rpm_beam", 0.55), ("rpm_opto", 10.1), ("rpm_hall", 0.55)]);
        named.effects = vec![EffectEntry { channels: vec!["rpm_opto".into()], ..bare_entry("missed_pulses") }];
        assert!(cautions(&named).is_empty());
        // sensors differ, and of two nobody can say which is the sick one
        assert!(cautions(&of(&[("rpm_beam", 0.55), ("rpm_opto", 1.4), ("rpm_hall", 0.6)])).is_empty());
        assert!(cautions(&of(&[("rpm_beam", 0.55), ("rpm_opto", 10.1)])).is_empty());
    }
}
