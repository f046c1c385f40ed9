//! `dead_rotor_speed`: one rotor's speed channel does not read the speed.
//!
//! What it is: it reads a fixed share of it (a pulse lost or counted twice each turn), from the beginning or from an instant on; or it is stuck.
//! What it reads then is not believed: the rotor's speed comes from the share, or from its pulse by the curve of the others.
//! What can go wrong: without pulses a stuck channel cannot be replaced and is not asked.
//! Units: share; s.
//! Reference: specification `closing-the-loop.md`, table.

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope, Sink};
use crate::attribution::columns::{Prior, Shape};
use crate::flight::channels::Target;
use crate::flight::columns::Flight;
use crate::flight::record::Record;
use crate::flight::scene::{Broken, Scene};
use crate::verdict::Parameter;

pub(super) struct DeadRotorSpeed;

/// Shares that a channel may read: range and starts.
const RANGE: (f64, f64) = (0.2, 3.2);
const STARTS: [f64; 2] = [0.5, 2.0];
/// Instants at which it may set in, as shares of the flight.
const INSTANTS: [f64; 5] = [0.2, 0.35, 0.5, 0.65, 0.8];
/// A channel is stuck when it repeats itself for so long, s, and so many times longer than it does otherwise.
const STUCK_S: f64 = 0.4;
const STUCK_TIMES: f64 = 10.0;

impl AirframeEffect for DeadRotorSpeed {
    fn id(&self) -> &'static str {
        "dead_rotor_speed"
    }

    fn about(&self) -> About {
        About {
            title: "One rotor's speed channel is broken",
            equation: "rpm of one rotor reads factor * rpm from t0 on, or is stuck; the rotor's speed is taken from the factor, or from its pulse",
            source: "specification, closing-the-loop.md.",
            depends_on: &["rpm", "pulse_us"],
            signature: "one speed departs from its pulse, and forces and moments follow the pulse",
            look_alikes: &["rotor_gain"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        let rotor = found.parameter("channel").map_or_else(|| "a rotor".to_owned(), |p| format!("rotor {:.0}", p.value));
        let does = match (found.parameter("reads"), found.parameter("factor")) {
            (Some(_), _) => found.tell("reads", |v| format!("is stuck at {v}"), "is stuck"),
            (_, Some(_)) => found.tell("factor", |v| format!("reads {v} of what it turns"), "is broken"),
            _ => "is broken".to_owned(),
        };
        Clause::new(format!("the speed channel of {rotor}"), does)
    }

    fn scope(&self, form: &Form) -> Scope {
        if form.shapes.len() == 1 { Scope::Rig } else { Scope::Event }
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        let record = &flight.record;
        if record.speed.is_empty() || record.command.is_empty() || record.rotors() < 2 {
            return Vec::new();
        }
        let factor = || Shape { name: "factor", unit: "1", range: RANGE, closed: false };
        let (first, last) = (record.t.first().copied().unwrap_or(0.0), record.t.last().copied().unwrap_or(1.0));
        let at = |share: f64| first + share * (last - first);
        let onset = || Shape { name: "t0", unit: "s", range: (at(0.02), at(0.98)), closed: false };
        let mut out = Vec::new();
        for index in 0..record.rotors() {
            let named = |what: &str| format!("rotor {}{what}", index + 1);
            out.push(Form {
                name: named(""),
                index,
                shapes: vec![factor()],
                starts: STARTS.map(|s| vec![s]).to_vec(),
                ..Form::default()
            });
            let starts = STARTS.iter().flat_map(|s| INSTANTS.map(|i| vec![*s, at(i)])).collect();
            out.push(Form {
                name: named(" from an instant on"),
                index,
                shapes: vec![factor(), onset()],
                starts,
                ..Form::default()
            });
            if let Some(rows) = stuck(record, index) {
                out.push(Form { name: named(" stuck"), index, rows, ..Form::default() });
            }
        }
        out
    }

    fn excludes(&self, form: &Form) -> Vec<(&'static str, String)> {
        ["", " from an instant on", " stuck"].map(|what| (self.id(), format!("rotor {}{what}", form.index + 1))).to_vec()
    }

    fn alters(&self) -> bool {
        true
    }

    fn alter(&self, flight: &Flight, form: &Form, shape: &[f64], scene: &mut Scene<'_>) {
        let t = &flight.record.t;
        match shape.first() {
            Some(factor) => {
                let from = shape.get(1).copied().unwrap_or(f64::NEG_INFINITY);
                scene.broken[form.index] = Some(Broken::Factor(*factor, from));
                scene.drive[form.index].iter_mut().zip(t).filter(|(_, t)| **t >= from).for_each(|(v, _)| *v /= factor);
            }
            None => scene.broken[form.index] = Some(Broken::Refused(form.rows.0, form.rows.1)),
        }
    }

    fn columns(&self, form: &Form, shape: &[f64], sink: &mut Sink<'_>) {
        if shape.is_empty() {
            let reads: Vec<f64> =
                (0..sink.scene.len()).map(|i| f64::from(u8::from((form.rows.0..form.rows.1).contains(&i)))).collect();
            let rpm = sink.flight.usual.rpm;
            sink.column("reads", Prior { mean: rpm, sd: rpm, sign: 0.0 }).part(Target::Speed(form.index), &reads);
        }
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        let fixed =
            |name: &str, value: f64, unit: &str| Parameter { name: name.into(), value, unit: unit.into(), ci95: [value, value] };
        let mut out = vec![fixed("channel", (found.form.index + 1) as f64, "1")];
        if found.form.shapes.is_empty() {
            let (a, b) = found.form.rows;
            let t = &found.flight.record.t;
            out.extend([found.plain("reads", "rev/min"), fixed("t0", t[a], "s"), fixed("t1", t[b - 1], "s")]);
        } else {
            out.push(found.plain("factor", "1"));
            if found.form.shapes.len() > 1 {
                out.push(found.plain("t0", "s"));
            }
        }
        out
    }
}

/// The longest stretch in the air over which a rotor's speed repeats itself, where that is no habit of the channel.
fn stuck(record: &Record, rotor: usize) -> Option<(usize, usize)> {
    let speed = &record.speed[rotor];
    let mut runs: Vec<(usize, usize)> = Vec::new();
    let mut from = 0;
    for i in 1..=speed.len() {
        if i == speed.len() || speed[i] != speed[from] {
            runs.push((from, i));
            from = i;
        }
    }
    let seconds = |r: &(usize, usize)| record.t[r.1 - 1] - record.t[r.0];
    let in_air = |r: &&(usize, usize)| record.flying[r.0..r.1].iter().filter(|f| **f).count() * 2 > r.1 - r.0;
    let longest = *runs.iter().filter(in_air).max_by(|a, b| seconds(a).total_cmp(&seconds(b)))?;
    // habit: what the other channels of the same make do
    let usual = (0..record.rotors()).filter(|k| *k != rotor).map(|k| habit(record, k)).fold(0.0, f64::max);
    (seconds(&longest) > STUCK_S.max(STUCK_TIMES * usual)).then_some(longest)
}

/// Mean time for which a channel holds a value, s.
fn habit(record: &Record, rotor: usize) -> f64 {
    let speed = &record.speed[rotor];
    let changes = speed.windows(2).filter(|w| w[0] != w[1]).count().max(1);
    (record.t.last().unwrap_or(&0.0) - record.t.first().unwrap_or(&0.0)) / changes as f64
}
