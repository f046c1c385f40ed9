//! The magnetic field.
//!
//! What it is: declared is a field that is constant in earth axes. The attitude knows no north, so its heading starts anywhere and
//! drifts slowly: that drift is a curve with knots far apart, fitted beside the field and beside every cause.
//! What can go wrong: a sensor that repeats old readings is heard only when it changes.
//! Units: uT, s.
//! Reference: specification `closing-the-loop.md`, "Inertial".

use super::account::Sensor;
use super::least::{Column, Readings, Term};
use super::model::{Part, linear};
use super::noise::{axis_level, floor, levels};
use super::search::Scene;
use super::trace::{Setting, trace};
use super::{Attitude, Recording, effects};
use nalgebra::{Matrix3, Rotation3, Vector3};

/// Block, left-out stretch and cluster, s.
const CUTS: (f64, f64, f64) = (0.05, 0.4, 4.0);
/// Knots of the heading's drift, s.
const KNOT_S: f64 = 20.0;
/// Error of the predicted direction, rad, one axis (0.35 degrees; the filter's inclination is good to 0.7, `docs/ahrs.md`).
const DOUBT: f64 = 0.006;
/// Turns of the Gauss-Newton method for the heading's drift.
const TURNS: usize = 6;
/// Iron on the sensor that the heading must not take for north, uT.
const IRON_UT: f64 = 20.0;
/// Causes that multiply the predicted field, and how often they are asked again with a better one.
const MULTIPLIES: [&str; 2] = ["soft_iron", "channel_delay"];
const AGAIN: usize = 2;
/// Fewest blocks.
const LEAST_BLOCKS: usize = 200;

/// Heading over time: a value at each knot.
struct Heading {
    from: f64,
    knots: Vec<f64>,
}

impl Heading {
    fn at(&self, t: f64) -> f64 {
        let x = ((t - self.from) / KNOT_S).clamp(0.0, (self.knots.len() - 1) as f64);
        let k = (x as usize).min(self.knots.len() - 2);
        self.knots[k] + (self.knots[k + 1] - self.knots[k]) * (x - k as f64)
    }
}

/// What was heard of the field.
struct Heard {
    /// Rows with field and attitude.
    claimed: Vec<bool>,
    readings: Readings,
    from: f64,
    to: f64,
}

/// Nothing without a magnetometer or with too little of it.
fn hear(recording: &Recording, attitude: &Attitude) -> Option<Heard> {
    let t = &recording.t;
    let known = |i: usize| recording.mag[i].iter().all(|c| c.is_finite()) && attitude.to_earth[i].m11.is_finite();
    if recording.mag.is_empty() {
        return None;
    }
    let claimed: Vec<bool> = (0..t.len()).map(known).collect();
    let mut used = claimed.clone();
    for (used, pair) in used.iter_mut().skip(1).zip(recording.mag.windows(2)) {
        *used &= pair[1] != pair[0];
    }
    let readings = Readings::new(t, &recording.mag, used, CUTS.0, CUTS.1, CUTS.2);
    if readings.blocks.len() < LEAST_BLOCKS {
        return None;
    }
    let (from, to) = (readings.blocks.first()?.t, readings.blocks.last()?.t);
    Some(Heard { claimed, readings, from, to })
}

/// The trace; nothing without a magnetometer or with too little of it.
pub(crate) fn trace_field(recording: &Recording, attitude: &Attitude) -> Option<Sensor> {
    let t = &recording.t;
    let Heard { claimed, readings, from, to } = hear(recording, attitude)?;
    let fresh: Vec<Vector3<f64>> = (0..t.len()).filter(|i| readings.used[*i]).map(|i| recording.mag[i]).collect();
    let noise = floor(&levels(&fresh, 50)) / (fresh.len() as f64 / readings.blocks.len() as f64).sqrt();
    let (mut heading, mut earth) = north(recording, attitude, &readings, noise)?;
    let floor = std::array::from_fn(|k| axis_level(&fresh, k));
    let once = |heading: &Heading, earth: Vector3<f64>| {
        let to_earth = turned(recording, attitude, heading);
        let predicted: Vec<Vector3<f64>> = to_earth.iter().map(|r| r.tr_mul(&earth)).collect();
        let scene = Scene { recording, to_earth: &to_earth, predicted: &predicted, turning: &[], heard: (from, to) };
        let setting = Setting { channels: ["mx", "my", "mz"], unit: "uT", floor, noise, doubt: DOUBT * earth.norm() };
        let base = declared(t, &to_earth, earth, (from, to));
        trace(&setting, &readings, &base, &effects::field(), &scene, &claimed).map(|traced| traced.sensor)
    };
    let mut sensor = once(&heading, earth)?;
    // what a cause multiplies is the field that the declared model had before the cause was known: again with the one after
    for _ in 0..AGAIN {
        if !sensor.part.effect.iter().any(|e| MULTIPLIES.contains(&e.id.as_str())) {
            break;
        }
        let [north, down, drift @ ..] = sensor.part.declared.as_slice() else { break };
        let field = Vector3::new(*north, 0.0, *down);
        let knots = heading.knots.iter().zip(drift).map(|(k, d)| k + d.clamp(-0.5, 0.5)).collect();
        let better = Heading { from, knots };
        let Some(next) = once(&better, field) else { break };
        (heading, earth, sensor) = (better, field, next);
    }
    sensor.part.earth_ut = earth.iter().copied().collect();
    sensor.part.heading_rad = heading.knots;
    Some(sensor)
}

/// The predictions of a model.
pub(crate) fn again(recording: &Recording, attitude: &Attitude, part: &Part) -> Option<Vec<Vector3<f64>>> {
    let Heard { claimed, from, to, .. } = hear(recording, attitude)?;
    let earth = Vector3::from_row_slice(part.earth_ut.get(..3)?);
    let heading = Heading { from, knots: part.heading_rad.clone() };
    if heading.knots.len() < 2 {
        return None;
    }
    let to_earth = turned(recording, attitude, &heading);
    let predicted: Vec<Vector3<f64>> = to_earth.iter().map(|r| r.tr_mul(&earth)).collect();
    let scene = Scene { recording, to_earth: &to_earth, predicted: &predicted, turning: &[], heard: (from, to) };
    let base = declared(&recording.t, &to_earth, earth, (from, to));
    Some(linear(part, &base, &effects::field(), &scene, ["mx", "my", "mz"], &claimed).0)
}

/// The attitude turned to the field's north all along.
fn turned(recording: &Recording, attitude: &Attitude, heading: &Heading) -> Vec<Matrix3<f64>> {
    let about =
        |(t, body): (&f64, &Matrix3<f64>)| Rotation3::from_axis_angle(&Vector3::z_axis(), -heading.at(*t)).into_inner() * body;
    recording.t.iter().zip(&attitude.to_earth).map(about).collect()
}

/// The declared model's terms: a constant field in earth axes, and a heading that drifts slowly.
fn declared<'a>(t: &'a [f64], to_earth: &'a [Matrix3<f64>], earth: Vector3<f64>, heard: (f64, f64)) -> Vec<Term<'a>> {
    let axis = |k: usize, name: &str| Term::new(name, "uT", move |i: usize| to_earth[i].row(k).transpose());
    let mut terms = vec![axis(0, "north"), axis(2, "down")];
    let sideways = Vector3::z().cross(&earth);
    let count = ((heard.1 - heard.0) / KNOT_S).ceil() as usize + 1;
    for knot in 0..count {
        let centre = heard.0 + knot as f64 * KNOT_S;
        let value = move |i: usize| {
            let share = (1.0 - (t[i] - centre).abs() / KNOT_S).max(0.0);
            share * to_earth[i].tr_mul(&sideways)
        };
        let support = (centre - KNOT_S, centre + KNOT_S);
        terms.push(Term { support, prior: 0.5, ..Term::new("", "rad", value) });
    }
    terms
}

/// Where the field's north is in the attitude's axes all along, and the field in earth axes.
fn north(recording: &Recording, attitude: &Attitude, readings: &Readings, noise: f64) -> Option<(Heading, Vector3<f64>)> {
    let t = &recording.t;
    let heard = (readings.blocks.first()?.t, readings.blocks.last()?.t);
    let mut heading = first_guess(recording, attitude, readings, heard);
    let mut earth = Vector3::new(20.0, 0.0, 40.0);
    let mut to_earth = turned(recording, attitude, &heading);
    for turn in 0..=TURNS {
        let found = once(t, &to_earth, earth, heard, readings, noise, turn > 0)?;
        earth = Vector3::new(found[0], 0.0, found[1]);
        if turn > 0 {
            // the field seen in earth axes is turned by the coefficient: turn the body back
            for (k, d) in heading.knots.iter_mut().zip(&found[2..]) {
                *k += d.clamp(-0.5, 0.5);
            }
            to_earth = turned(recording, attitude, &heading);
        }
    }
    Some((heading, earth))
}

/// North and down of the field and, where asked for, the turn of each knot, from one linear fit.
fn once(
    t: &[f64],
    to_earth: &[Matrix3<f64>],
    earth: Vector3<f64>,
    heard: (f64, f64),
    readings: &Readings,
    noise: f64,
    turning: bool,
) -> Option<Vec<f64>> {
    let base = declared(t, to_earth, earth, heard);
    let own = if turning { base.len() } else { 2 };
    // a constant in body axes beside the field, or iron on the sensor would pull the heading after it
    let iron = (0..3).map(|k| Term { prior: IRON_UT, ..Term::new("", "uT", move |_| Vector3::ith(k, 1.0)) });
    let terms: Vec<Term<'_>> = base.into_iter().take(own).chain(iron).collect();
    let columns: Vec<Column> = terms.iter().map(|c| readings.column(c)).collect();
    let mut found = readings.solve(&columns.iter().collect::<Vec<_>>(), noise)?.coefficients;
    found.truncate(own);
    Some(found)
}

/// Heading of the mean field about each knot.
fn first_guess(recording: &Recording, attitude: &Attitude, readings: &Readings, heard: (f64, f64)) -> Heading {
    let count = (((heard.1 - heard.0) / KNOT_S).ceil() as usize + 1).max(2);
    let mut sums = vec![Vector3::zeros(); count];
    for (i, t) in recording.t.iter().enumerate().filter(|(i, _)| readings.used[*i]) {
        let k = ((t - heard.0) / KNOT_S).round().clamp(0.0, (count - 1) as f64) as usize;
        sums[k] += attitude.to_earth[i] * recording.mag[i];
    }
    let mut knots: Vec<f64> = Vec::with_capacity(count);
    for s in sums {
        let before = knots.last().copied().unwrap_or(0.0);
        let seen = if s.xy().norm() > 0.0 { s.y.atan2(s.x) } else { before };
        let turns = ((before - seen) / std::f64::consts::TAU).round();
        knots.push(seen + turns * std::f64::consts::TAU);
    }
    Heading { from: heard.0, knots }
}
