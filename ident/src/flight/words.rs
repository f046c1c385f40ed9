//! What a flight's verdict says in words.
//!
//! What it is: sentences for evidence, for what is left, for the next flight.
//! What can go wrong: nothing.
//! Units: s, nats.
//! Reference: specification `formats.md`, "Verdict".

use super::columns::Usual;
use super::library::Kind;
use crate::attribution::columns::{Candidate, Channel, Kept, UNKNOWN};
use crate::flight::effects;
use crate::verdict::Scope;
use crate::verdict::words::{plain, worth};
use crate::verdict::{EffectEntry, Kin, NextExperiment, ScheduleStep, Unexplained};

/// Slower than this what is left is slow, s.
const SLOW_S: f64 = 0.3;
/// Stretch of the next flight, s.
const STRETCH_S: f64 = 10.0;

/// A candidate with its form.
pub(super) fn name(candidate: &Candidate) -> String {
    if candidate.form.is_empty() { candidate.id.to_owned() } else { format!("{} ({})", candidate.id, candidate.form) }
}

/// The same in words; what has no name is told by its form.
pub(super) fn title(candidate: &Candidate) -> String {
    let form = plain(&candidate.form);
    match (effects::about(candidate.id), form.is_empty()) {
        (Some(about), true) => about.title.to_owned(),
        (Some(about), false) => format!("{} ({form})", about.title),
        (None, _) => format!("no name: {form}"),
    }
}

/// Why a term stands.
pub(super) fn evidence(kept: &Kept, kind: &Kind, channels: &[Channel]) -> String {
    let signature = match kind {
        Kind::Effect(effect, form) => {
            let what = if form.name.is_empty() { String::new() } else { format!("{}: ", form.name) };
            format!("{what}{}", effect.about().signature)
        }
        Kind::Nameless(_) => "no known effect; straight lines between knots".to_owned(),
    };
    let worth = kept.channels.first().map_or(String::new(), |(c, reduction)| worth(&channels[*c].name, *reduction));
    format!("{signature}{worth}")
}

/// The shape of what is left, from the memory of its wander.
pub(super) fn looks_like(memory_s: f64) -> String {
    if memory_s == 0.0 {
        "nothing of it lasts beyond a window".to_owned()
    } else if memory_s > SLOW_S {
        format!("slow, within {memory_s:.1} s")
    } else {
        format!("within {memory_s:.2} s")
    }
}

/// The entry of an unattributed verdict for which no function predicts left-out rows either.
pub(super) fn no_correction(left: &[Unexplained]) -> EffectEntry {
    let mut loudest: Vec<&Unexplained> = left.iter().collect();
    loudest.sort_by(|a, b| b.over_floor.total_cmp(&a.over_floor));
    EffectEntry {
        kin: Kin::Own,
        id: UNKNOWN.to_owned(),
        scope: Scope::Run,
        run: None,
        channels: loudest.iter().map(|u| u.channel.clone()).collect(),
        depends_on: Vec::new(),
        equation: "no correction".to_owned(),
        probability: 1.0,
        parameters: Vec::new(),
        heldout_error_reduction: 0.0,
        evidence: "something is left over; no function of one variable predicts left-out windows better".to_owned(),
    }
}

/// The flight that would tell causes apart: the same vehicle slow and fast, high and low, up and down.
pub(super) fn next(first: &str, rivals: &[String], usual: &Usual) -> NextExperiment {
    let hover = 1000.0 + 1000.0 * usual.command[0];
    let step =
        |share: f64| ScheduleStep { pulse_us: (hover + share * (hover - 1000.0)).clamp(1000.0, 2000.0), hold_s: STRETCH_S };
    NextExperiment {
        why: format!(
            "{first} and {} explain this flight alike. A flight that holds both still and moves tells them apart: {STRETCH_S:.0} s of hover, the same with the nose turned by 90 degrees, forward and sideways at two speeds, then climb and descent at the mean pulses below",
            rivals.join(" or ")
        ),
        separates: true,
        schedule: vec![step(0.0), step(0.05), step(-0.05), step(0.0)],
    }
}
