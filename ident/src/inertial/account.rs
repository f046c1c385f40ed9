//! What the three sensors' traces come to: one verdict.
//!
//! What it is: predictions of every channel before and after, figures by channel, the effects with their parameters, and the word
//! for it all.
//! What can go wrong: a channel with no usable row is left out.
//! Units: those of the channels.
//! Reference: specification `formats.md`, "Verdict".

use super::Recording;
use super::least::Readings;
use super::model::{FORMAT as MODEL_FORMAT, InertialModel, Part};
use super::shown::Shown;
use crate::attribution::unexplained::{LOUD, loudest_stretch};
use crate::signal::residual::whiteness;
use crate::verdict::{
    Alternative, Channel, Channels, EffectEntry, FORMAT, Figures, Kind, NextExperiment, ScheduleStep, Unexplained, Verdict,
};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::ops::Range;

/// One sensor's trace.
#[derive(Debug, Clone)]
pub struct Sensor {
    /// Its three columns.
    pub channels: [&'static str; 3],
    /// Their unit.
    pub unit: &'static str,
    /// What the declared model predicts, row by row; not a number where it makes no claim.
    pub declared: Vec<Vector3<f64>>,
    /// The same with everything that was found.
    pub corrected: Vec<Vector3<f64>>,
    /// Noise of a reading, by axis.
    pub floor: [f64; 3],
    pub(crate) heldout_before: [f64; 3],
    pub(crate) heldout_after: [f64; 3],
    pub(crate) effects: Vec<EffectEntry>,
    /// What convinces of each, by identifier.
    pub(crate) shown: Vec<Shown>,
    pub(crate) alternatives: Vec<Alternative>,
    pub(crate) kind: Kind,
    /// What is left over, in noise floors, before and after.
    pub(crate) excess: [f64; 2],
    /// Its share of the corrected model.
    pub(crate) part: Part,
}

/// A closed loop.
#[derive(Debug, Clone)]
pub struct Closed {
    /// The verdict.
    pub verdict: Verdict,
    /// The corrected model.
    pub model: InertialModel,
    /// The traces, of the sensors that could be predicted.
    pub sensors: Vec<Sensor>,
}

/// Below this share of the excess a name explains too little.
const EXPLAINED: f64 = 0.5;
/// Residual over noise and doubt from which something is there.
const SOMETHING: f64 = 1.5;
/// Below this probability the others count as equal.
const SURE: f64 = 0.8;

/// The word for one sensor, from mean squares held out before and after, what noise and doubt explain, and the best probability.
pub(crate) fn judge(before: f64, after: f64, explained: f64, named: bool, probability: f64) -> Kind {
    let excess = (before - explained).max(0.0);
    let taken = if excess > 0.0 { (before - after) / excess } else { 1.0 };
    let left = after > SOMETHING * SOMETHING * explained;
    match named {
        false if before > SOMETHING * SOMETHING * explained => Kind::Unattributed,
        false => Kind::None,
        true if left && taken < EXPLAINED => Kind::Unattributed,
        true if probability < SURE => Kind::Ambiguous,
        true => Kind::Attributed,
    }
}

/// Root mean squares by axis of a residual that runs x, y, z, x, y, z, ...
pub(crate) fn by_axis(residual: &[f64]) -> [f64; 3] {
    std::array::from_fn(|k| {
        let own: Vec<f64> = residual.iter().skip(k).step_by(3).copied().collect();
        (Readings::square(&own) / own.len().max(1) as f64).sqrt()
    })
}

pub(crate) fn account(recording: &Recording, mut sensors: Vec<Sensor>) -> Closed {
    let mut channels = BTreeMap::new();
    for s in &sensors {
        for k in 0..3 {
            if let Some(c) = channel(recording, s, k) {
                channels.insert(s.channels[k].to_owned(), c);
            }
        }
    }
    // the sensor with the most left over speaks first
    sensors.sort_by(|a, b| b.excess[0].total_cmp(&a.excess[0]));
    let of = |kinds: &[Kind]| -> Vec<EffectEntry> {
        sensors.iter().filter(|s| kinds.contains(&s.kind)).flat_map(|s| s.effects.clone()).collect()
    };
    let (mut effects, nameless) = (of(&[Kind::Attributed, Kind::Ambiguous]), of(&[Kind::Unattributed]));
    let unsure = sensors.iter().any(|s| s.kind == Kind::Ambiguous);
    // a sensor about which nothing is known takes back no name of another
    let verdict = match (effects.is_empty(), nameless.is_empty()) {
        (true, true) => Kind::None,
        (true, false) => Kind::Unattributed,
        _ if unsure => Kind::Ambiguous,
        _ => Kind::Attributed,
    };
    effects.extend(nameless);
    let unexplained = unexplained(&channels, &effects, &|name| when(recording, &sensors, name));
    let mut alternatives = alternatives(&sensors);
    alternatives.retain(|a| a.probability >= 1e-3);
    alternatives.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    let next_experiment = (verdict == Kind::Ambiguous).then(next);
    let verdict = Verdict {
        format: FORMAT,
        run: recording.name.clone(),
        verdict,
        channels: Channels { predicted: channels, ..Channels::default() },
        effects,
        unexplained,
        alternatives,
        next_experiment,
        left_out: Vec::new(),
        set_aside: Vec::new(),
        guessed_floors: None,
        sensor_share: None,
        at_rest: false,
        held: false,
        validation: Vec::new(),
        runs: Vec::new(),
    };
    let model = InertialModel {
        format: MODEL_FORMAT.to_owned(),
        source: recording.name.clone(),
        span_s: super::span(recording),
        sensor: sensors.iter().map(|s| s.part.clone()).collect(),
    };
    Closed { verdict, model, sensors }
}

/// Whole accounts beside the one that is told: another one of one sensor, and of the others what was found.
fn alternatives(sensors: &[Sensor]) -> Vec<Alternative> {
    let found = |s: &Sensor| s.effects.iter().filter(|e| e.id != "unknown").map(|e| e.id.clone()).collect::<Vec<_>>();
    let beside = |one: usize, a: &Alternative| {
        let of = |(k, s): (usize, &Sensor)| if k == one { a.ids.clone() } else { found(s) };
        Alternative { ids: sensors.iter().enumerate().flat_map(of).collect(), probability: a.probability, change: None }
    };
    let all = sensors.iter().enumerate();
    all.flat_map(|(k, s)| s.alternatives.iter().map(move |a| beside(k, a)).collect::<Vec<_>>()).collect()
}

/// Share of a run beyond which what holds nine tenths of the squares is no part of it.
const A_PART: f64 = 0.75;

/// When most is left of a channel: the stretch that holds more than half of its squares, or the part of the run that holds nine tenths; else over
/// the whole run.
fn when(recording: &Recording, sensors: &[Sensor], name: &str) -> String {
    let axis = |s: &Sensor| s.channels.iter().position(|c| *c == name);
    let whole = || "over the whole run".to_owned();
    let Some((sensor, k)) = sensors.iter().find_map(|s| Some((s, axis(s)?))) else { return whole() };
    let left =
        recording.t.iter().zip(sensor.measured(recording)).zip(&sensor.corrected).map(|((t, m), p)| (*t, (m[k] - p[k]).powi(2)));
    let (t, squares): (Vec<f64>, Vec<f64>) = left.filter(|(_, square)| square.is_finite()).unzip();
    let (held, stretch) = loudest_stretch(&squares);
    let sum = squares.iter().sum::<f64>();
    let part = if 2.0 * held > sum { stretch } else { middle(&squares, sum) };
    match (t.get(part.start), t.get(part.end.saturating_sub(1))) {
        (Some(from), Some(to)) if (part.len() as f64) < A_PART * t.len() as f64 => format!("mostly from {from:.1} to {to:.1} s"),
        _ => whole(),
    }
}

/// What lies between the first and the last twentieth of the squares.
fn middle(squares: &[f64], sum: f64) -> Range<usize> {
    let place = |share: f64| {
        let mut so_far = 0.0;
        let reaches = |square: &f64| {
            so_far += square;
            so_far >= share * sum
        };
        squares.iter().position(reaches).unwrap_or(squares.len())
    };
    let (from, to) = (place(0.05), place(0.95));
    from..to.max(from)
}

/// The channels on which more than three noise floors are left.
fn unexplained(channels: &BTreeMap<String, Channel>, effects: &[EffectEntry], when: &dyn Fn(&str) -> String) -> Vec<Unexplained> {
    let depends_on = |name: &String| {
        let nameless = effects.iter().find(|e| e.id == "unknown" && e.channels.contains(name));
        nameless.map_or_else(Vec::new, |e| e.depends_on.clone())
    };
    let over = |c: &Channel| c.after.heldout_rms / c.noise_floor_rms;
    let loud = channels.iter().filter(|(_, c)| over(c) > LOUD);
    loud.map(|(name, c)| Unexplained {
        channel: name.clone(),
        over_floor: over(c),
        depends_on: depends_on(name),
        looks_like: format!(
            "more than the sensor's noise, {}; the attitude is off by some tenths of a degree, and that is a part of it",
            when(name)
        ),
    })
    .collect()
}

/// The motion that tells causes of an inertial unit apart. The schedule has the rig's form: the motors stay off.
fn next() -> NextExperiment {
    NextExperiment {
        why: "motors off (1000 us): rest 10 s, turn slowly about each axis for 20 s at one place, rest 10 s, do the same a metre away, rest \
              10 s: what travels with the sensor turns with it at both places, what belongs to the room does not"
            .to_owned(),
        separates: true,
        schedule: [10.0, 20.0, 10.0, 20.0, 10.0].map(|hold_s| ScheduleStep { pulse_us: 1000.0, hold_s }).to_vec(),
    }
}

fn channel(recording: &Recording, sensor: &Sensor, axis: usize) -> Option<Channel> {
    let measured = sensor.measured(recording);
    let left = |predicted: &[Vector3<f64>]| -> (Vec<f64>, Vec<f64>) {
        let rows = recording.t.iter().zip(measured.iter().zip(predicted));
        rows.map(|(t, (m, p))| (*t, m[axis] - p[axis])).filter(|(_, r)| r.is_finite()).unzip()
    };
    let figures = |predicted: &[Vector3<f64>], heldout: f64| {
        let (t, r) = left(predicted);
        let rms = (Readings::square(&r) / r.len().max(1) as f64).sqrt();
        let p = whiteness(&t, &r);
        (!r.is_empty()).then_some(Figures {
            rms,
            heldout_rms: heldout,
            across_runs_rms: None,
            whiteness_p: if p.is_finite() { p } else { 1.0 },
        })
    };
    Some(Channel {
        unit: sensor.unit.to_owned(),
        noise_floor_rms: sensor.floor[axis],
        before: figures(&sensor.declared, sensor.heldout_before[axis])?,
        after: figures(&sensor.corrected, sensor.heldout_after[axis])?,
    })
}

impl Sensor {
    /// The readings that it is about.
    #[must_use]
    pub fn measured<'r>(&self, recording: &'r Recording) -> &'r [Vector3<f64>] {
        match self.channels[0] {
            "gx" => &recording.gyro,
            "ax" => &recording.accel,
            _ => &recording.mag,
        }
    }

    /// What came of it, and how much was left over before and after, in noise floors (the attitude's own error counts as noise).
    #[must_use]
    pub fn summary(&self) -> (Kind, [f64; 2], Vec<&str>) {
        (self.kind, self.excess, self.effects.iter().map(|e| e.id.as_str()).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::Kin;
    use crate::verdict::Scope;

    #[test]
    fn a_part_of_a_run_is_where_nine_tenths_are() {
        let mut squares = vec![0.01; 100];
        squares[30..70].fill(1.0);
        let part = middle(&squares, squares.iter().sum());
        assert!(part.start >= 30 && part.end <= 70 && part.len() > 32, "{part:?}");
        assert!(middle(&[1.0; 100], 100.0).len() > 85, "all along");
        assert!(middle(&[], 0.0).is_empty());
    }

    fn sensor(channels: [&'static str; 3], id: &str, instead: &str) -> Sensor {
        let effect = EffectEntry {
            kin: Kin::Own,
            id: id.to_owned(),
            scope: Scope::Rig,
            run: None,
            channels: vec![channels[0].to_owned()],
            depends_on: Vec::new(),
            equation: String::new(),
            probability: 0.9,
            parameters: Vec::new(),
            heldout_error_reduction: 0.5,
            evidence: String::new(),
        };
        Sensor {
            channels,
            unit: "1",
            declared: Vec::new(),
            corrected: Vec::new(),
            floor: [1.0; 3],
            heldout_before: [1.0; 3],
            heldout_after: [1.0; 3],
            effects: vec![effect],
            shown: Vec::new(),
            alternatives: vec![Alternative { ids: vec![instead.to_owned()], probability: 0.1, change: None }],
            kind: Kind::Attributed,
            excess: [2.0, 1.0],
            part: Part::default(),
        }
    }

    /// What stands in the place of one sensor's cause leaves the causes of the others where they are.
    #[test]
    fn an_alternative_is_a_whole_account() {
        let sensors =
            [sensor(["gx", "gy", "gz"], "gyro_bias", "gyro_temperature"), sensor(["mx", "my", "mz"], "hard_iron", "soft_iron")];
        let ids: Vec<String> = alternatives(&sensors).into_iter().map(|a| a.ids.join("+")).collect();
        assert_eq!(ids, ["gyro_temperature+hard_iron", "gyro_bias+soft_iron"]);
    }
}
