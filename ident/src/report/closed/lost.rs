//! What a sensor that miscounts hides from its own figures: readings that were set aside, and a noise floor that holds the fault.
//!
//! What it is: the readings of a faulty speed sensor that took no part because the fault struck them too hard, and the floor of its sisters, by which
//! its bar is drawn where its own scatter is the fault.
//! What can go wrong: a drop-out of another kind in the same channel, off the same way, is counted with them.
//! Units: readings; the channels' own.
//! Reference: none.

use super::vocabulary::Vocabulary;
use crate::log::SPEED;
use crate::numeric::order::median;
use crate::signal::bad::SetAside;
use crate::verdict::words::Clause;
use crate::verdict::{Channels, EffectEntry, Verdict};

/// Causes that strike single readings of a speed sensor, and which way these are off.
const PULSES: [(&str, f64); 2] = [("missed_pulses", -1.0), ("double_pulses", 1.0)];
/// Times the floor of the other sensors above which a sensor's own floor holds its fault.
const SISTERS: f64 = 3.0;

/// Which way a cause moves single readings of a sensor; nothing of any other cause.
fn way(e: &EffectEntry) -> Option<f64> {
    PULSES.iter().find(|(id, _)| *id == e.id).map(|(_, sign)| *sign)
}

/// The stretches of an effect's sensor that were set aside and are off the way in which the effect moves a reading.
fn struck<'v>(v: &'v Verdict, e: &'v EffectEntry) -> impl Iterator<Item = &'v SetAside> {
    let sign = way(e).unwrap_or(0.0);
    let of_it = move |a: &&SetAside| e.channels.first() == Some(&a.channel) && sign * (a.value - a.expected) > 0.0;
    v.set_aside.iter().filter(of_it).filter(|a| !a.recurs && !a.silent && !a.stuck)
}

/// How many readings those are.
pub(super) fn readings(v: &Verdict, e: &EffectEntry) -> usize {
    struck(v, e).map(|a| a.rows).sum()
}

/// That further readings were set aside, to stand behind what an effect does; empty where none were.
pub(super) fn beside(v: &Verdict, e: &EffectEntry) -> String {
    let too = if way(e) == Some(1.0) { "high" } else { "low" };
    match readings(v, e) {
        0 => String::new(),
        1 => format!(", counting 1 reading set aside as too {too}"),
        n => format!(", counting {n} readings set aside as too {too}"),
    }
}

/// An effect's own clause, with the readings that were set aside.
pub(super) fn said(v: &Verdict, words: Vocabulary, e: &EffectEntry) -> Clause {
    let clause = words.said(e);
    Clause { does: format!("{}{}", clause.does, beside(v, e)), ..clause }
}

/// The sensors whose own floor holds a fault that is named, each with the median floor of the others.
pub(super) fn floors(v: &Verdict) -> Vec<(&str, f64)> {
    let of = |e: &EffectEntry| {
        way(e)?;
        let (name, own) = v.channels.get_key_value(e.channels.first()?)?;
        let others = v.channels.iter().filter(|(other, _)| *other != name && SPEED.contains(&other.as_str()));
        let mut others: Vec<f64> = others.map(|(_, c)| c.noise_floor_rms).collect();
        if others.is_empty() || !SPEED.contains(&name.as_str()) {
            return None;
        }
        let sisters = median(&mut others);
        (own.noise_floor_rms > SISTERS * sisters).then_some((name.as_str(), sisters))
    };
    v.effects.iter().filter_map(of).collect()
}

/// The channels as their bars show them: a floor that holds a named fault gives way to that of the other sensors.
pub(super) fn drawn(v: &Verdict) -> Channels {
    let mut channels = v.channels.clone();
    for (name, floor) in floors(v) {
        if let Some(c) = channels.predicted.get_mut(name) {
            c.noise_floor_rms = floor;
        }
    }
    channels
}

/// What is said of such floors beneath the bars.
pub(super) fn key(v: &Verdict) -> Vec<String> {
    let said = |(name, _): (&str, f64)| {
        format!(
            "{}: in floors of the other sensors, for its own scatter is the fault. The fault stays: it has a name, and no model predicts which readings it strikes.",
            crate::verdict::words::heading(name)
        )
    };
    floors(v).into_iter().map(said).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::closed::vocabulary::{bare_entry, bare_verdict};
    use crate::verdict::{Channel, Figures};

    fn aside(channel: &str, rows: usize, value: f64) -> SetAside {
        let (channel, expected) = (channel.to_owned(), 4000.0);
        let [recurs, silent, stuck, timeless] = [false; 4];
        let readings = vec![value; rows];
        SetAside { channel, row: 7, rows, t_s: 0.7, until_s: 0.8, value, expected, recurs, silent, stuck, timeless, readings }
    }

    fn faulty() -> Verdict {
        let mut v = bare_verdict(Vec::new());
        v.effects = vec![EffectEntry { channels: vec!["rpm_opto".into()], ..bare_entry("missed_pulses") }];
        v.set_aside = vec![
            aside("rpm_opto", 3, 2000.0),
            aside("rpm_opto", 4, 3000.0),
            aside("rpm_opto", 2, 5000.0),
            aside("rpm_hall", 9, 2000.0),
            SetAside { silent: true, ..aside("rpm_opto", 2, 0.0) },
        ];
        for (name, floor) in [("rpm_beam", 0.5), ("rpm_hall", 0.7), ("rpm_opto", 150.0)] {
            let of = Figures { rms: 170.0, heldout_rms: 170.0, across_runs_rms: None, whiteness_p: 0.5 };
            let channel = Channel { unit: "rev/min".into(), noise_floor_rms: floor, before: of, after: of };
            v.channels.predicted.insert(name.into(), channel);
        }
        v
    }

    /// Readings that are off the way of the fault, on its own sensor.
    #[test]
    fn readings_set_aside_count_for_the_fault_of_their_sensor() {
        let v = faulty();
        assert_eq!(readings(&v, &v.effects[0]), 7);
        assert!(beside(&v, &v.effects[0]).contains("7 readings set aside as too low"));
        let other = EffectEntry { channels: vec!["rpm_opto".into()], ..bare_entry("encoder_drag") };
        assert_eq!((readings(&v, &other), beside(&v, &other)), (0, String::new()));
    }

    /// A sensor that scatters with its fault stands far above the floor of the others.
    #[test]
    fn a_faulty_sensor_has_the_floor_of_the_others() {
        let v = faulty();
        assert_eq!(floors(&v), [("rpm_opto", 0.6)]);
        assert_eq!(drawn(&v)["rpm_opto"].noise_floor_rms, 0.6);
        assert!(key(&v)[0].starts_with("Speed (optical): in floors of the other sensors"));
        let healthy = Verdict { effects: Vec::new(), ..v };
        assert!(floors(&healthy).is_empty() && drawn(&healthy) == healthy.channels);
    }
}
