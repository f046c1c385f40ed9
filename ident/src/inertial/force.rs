//! The specific force.
//!
//! What it is: declared is gravity, as the attitude has it, and a constant offset. What is over is first asked for a lever arm, which
//! a few constants describe; then for accelerations, which are smooth in earth axes and average out because the speed is bounded;
//! then for vibration, which is faster than a body can be carried.
//! What can go wrong: the attitude's tilt comes from this very sensor's average over some seconds, so accelerations slower than that
//! are in the attitude and not in the residual.
//! Units: m/s^2.
//! Reference: specification `closing-the-loop.md`, "Inertial".

use super::account::{Sensor, by_axis, judge};
use super::least::{Readings, Term};
use super::model::{Part, linear};
use super::noise::{axis_level, floor, levels};
use super::search::{Scene, descending, evidence, parameter, reductions};
use super::shown::Shown;
use super::trace::{Setting, Traced, trace};
use super::{Attitude, Recording, effects, smooth, vibration};
use crate::verdict::Scope;
use crate::verdict::{EffectEntry, Kin, Kind};
use nalgebra::{Matrix3, Vector3};

/// Block, left-out stretch and cluster, s.
const CUTS: (f64, f64, f64) = (0.01, 0.02, 3.0);
/// Error of the predicted vertical, rad, one axis (0.25 degrees): gravity times it is 0.04 m/s^2.
const DOUBT: f64 = 0.0043;
/// Widths of the bell that are tried, s.
const WIDTHS: [f64; 4] = [0.02, 0.05, 0.1, 0.2];
const GRAVITY: f64 = 9.806_65;
/// Smooth accelerations must be this many times noise and doubt.
const SMOOTH: f64 = 1.5;
/// Evidence that they need, nats.
const NAMED: f64 = 9.0;

/// The trace.
pub(crate) fn trace_force(recording: &Recording, attitude: &Attitude) -> Option<Sensor> {
    let t = &recording.t;
    let known = |i: usize| recording.accel[i].iter().all(|c| c.is_finite()) && attitude.to_earth[i].m11.is_finite();
    let used: Vec<bool> = (0..t.len()).map(known).collect();
    let readings = Readings::new(t, &recording.accel, used.clone(), CUTS.0, CUTS.1, CUTS.2);
    let heard: Vec<Vector3<f64>> = (0..t.len()).filter(|i| used[*i]).map(|i| recording.accel[i]).collect();
    let level = levels(&heard, 50);
    let per_block = heard.len() as f64 / readings.blocks.len().max(1) as f64;
    let setting = Setting {
        channels: ["ax", "ay", "az"],
        unit: "m/s^2",
        floor: std::array::from_fn(|k| axis_level(&heard, k)),
        noise: floor(&level) / per_block.sqrt(),
        doubt: DOUBT * GRAVITY,
    };
    let turning = turning(recording);
    let scene = Scene {
        recording,
        to_earth: &attitude.to_earth,
        predicted: &[],
        turning: &turning,
        heard: (readings.blocks.first()?.t, readings.blocks.last()?.t),
    };
    let to_earth = &attitude.to_earth;
    let base = declared(to_earth);
    let mut traced = trace(&setting, &readings, &base, &effects::force(), &scene, &used)?;
    let nameless = traced.sensor.clone();
    let (mut named, with, part) = std::mem::take(&mut traced.named);
    traced.sensor.corrected = with;
    traced.sensor.part = part;
    if let Some(entry) = accelerate(recording, to_earth, &readings, &setting, &used, &mut traced) {
        named.push(entry);
    }
    if let Some(entry) = vibration::shake(recording, &used, &setting, &mut traced.sensor) {
        named.push(entry);
    }
    if named.is_empty() {
        return Some(nameless);
    }
    let sensor = &mut traced.sensor;
    let excess = sensor.excess[0] * at_rows(recording, &sensor.corrected) / at_rows(recording, &sensor.declared).max(1e-300);
    // names that leave more than half of the excess give way, but knocks that nobody can predict are still knocks
    let shaken = named.iter().any(|e| e.id == "vibration");
    sensor.kind = match judge(sensor.excess[0].powi(2), excess.powi(2), 1.0, true, 1.0) {
        Kind::Unattributed if !shaken => return Some(nameless),
        _ => Kind::Attributed,
    };
    sensor.excess[1] = excess;
    at_its_axis(recording, sensor, &mut named);
    sensor.effects = named;
    // every prediction of a row comes from its neighbours or from a few constants: what is left at the rows is held out
    sensor.heldout_before = by_axis(&flat(recording, &sensor.declared));
    sensor.heldout_after = by_axis(&flat(recording, &sensor.corrected));
    Some(traced.sensor)
}

/// The declared model's terms.
fn declared<'a>(to_earth: &'a [Matrix3<f64>]) -> Vec<Term<'a>> {
    let mut base = vec![Term::new("gravity", "m/s^2", move |i: usize| -to_earth[i].row(2).transpose())];
    for k in 0..3 {
        base.push(Term::new(["offset_x", "offset_y", "offset_z"][k], "m/s^2", move |_| Vector3::ith(k, 1.0)));
    }
    base
}

/// The predictions of a model.
pub(crate) fn again(recording: &Recording, attitude: &Attitude, part: &Part) -> Vec<Vector3<f64>> {
    let known = |i: usize| recording.accel[i].iter().all(|c| c.is_finite()) && attitude.to_earth[i].m11.is_finite();
    let used: Vec<bool> = (0..recording.t.len()).map(known).collect();
    let readings = Readings::new(&recording.t, &recording.accel, used.clone(), CUTS.0, CUTS.1, CUTS.2);
    let (turning, to_earth) = (turning(recording), &attitude.to_earth);
    let scene = Scene { recording, to_earth, predicted: &[], turning: &turning, heard: (0.0, 0.0) };
    let (mut rows, _) = linear(part, &declared(to_earth), &effects::force(), &scene, ["ax", "ay", "az"], &used);
    if let Some(width) = part.carried_width_s {
        let (t, y) = over(recording, to_earth, &readings, &used, &rows);
        let back = smooth::predict(&t, &y, CUTS.1, width);
        rows = carried(recording, to_earth, &rows, &t, &back);
    }
    if let Some(hz) = part.line_hz {
        vibration::add_line(recording, &used, &mut rows, hz);
    }
    rows
}

/// What a prediction leaves over, in earth axes, at each block's middle.
fn over(
    recording: &Recording,
    to_earth: &[Matrix3<f64>],
    readings: &Readings,
    used: &[bool],
    from: &[Vector3<f64>],
) -> (Vec<f64>, Vec<Vector3<f64>>) {
    let mean_of = |b: &super::least::Block| {
        let rows = b.rows.clone().filter(|i| used[*i]);
        let (sum, n) =
            rows.fold((Vector3::zeros(), 0.0), |(s, n), i| (s + to_earth[i] * (recording.accel[i] - from[i]), n + 1.0));
        (b.t, sum / f64::max(n, 1.0))
    };
    readings.blocks.iter().map(mean_of).unzip()
}

/// A prediction with smooth accelerations in earth axes on top.
fn carried(
    recording: &Recording,
    to_earth: &[Matrix3<f64>],
    from: &[Vector3<f64>],
    t: &[f64],
    back: &[Vector3<f64>],
) -> Vec<Vector3<f64>> {
    (0..recording.t.len()).map(|i| from[i] + to_earth[i].tr_mul(&smooth::between(t, back, recording.t[i]))).collect()
}

/// What each name is worth at the rows of its axis, where the errors are told too.
fn at_its_axis(recording: &Recording, sensor: &Sensor, named: &mut [EffectEntry]) {
    for e in named {
        let Some(shown) = sensor.shown.iter().find(|s| s.id == e.id) else { continue };
        let rows = recording.accel.iter().zip(&sensor.corrected).zip(&shown.added);
        let (with, without): (Vec<f64>, Vec<f64>) = rows
            .map(|((m, p), added)| (m[shown.axis] - p[shown.axis], m[shown.axis] - p[shown.axis] + added))
            .filter(|r| r.0.is_finite() && r.1.is_finite())
            .unzip();
        let share = Readings::square(&with) / Readings::square(&without).max(1e-300);
        e.heldout_error_reduction = (1.0 - share.sqrt()).max(0.0);
    }
}

/// Residual at the claimed rows, x, y, z, x, y, z, ...
fn flat(recording: &Recording, predicted: &[Vector3<f64>]) -> Vec<f64> {
    let left = recording.accel.iter().zip(predicted).map(|(m, p)| m - p).filter(|r| r.iter().all(|c| c.is_finite()));
    left.flat_map(|r| [r.x, r.y, r.z]).collect()
}

/// Its root mean square.
fn at_rows(recording: &Recording, predicted: &[Vector3<f64>]) -> f64 {
    let r = flat(recording, predicted);
    (Readings::square(&r) / r.len().max(1) as f64).sqrt()
}

/// Rate of change of the rate, from differences over five rows.
fn turning(recording: &Recording) -> Vec<Vector3<f64>> {
    let (t, g) = (&recording.t, &recording.gyro);
    (0..t.len())
        .map(|i| {
            let (a, b) = (i.saturating_sub(2), (i + 2).min(t.len() - 1));
            let slope = (g[b] - g[a]) / (t[b] - t[a]).max(1e-9);
            if slope.iter().all(|c| c.is_finite()) { slope } else { Vector3::zeros() }
        })
        .collect()
}

/// Accelerations that are smooth in earth axes; the trace takes them over where they are there.
fn accelerate(
    recording: &Recording,
    to_earth: &[Matrix3<f64>],
    readings: &Readings,
    setting: &Setting,
    used: &[bool],
    traced: &mut Traced,
) -> Option<EffectEntry> {
    let (t, y) = over(recording, to_earth, readings, used, &traced.sensor.corrected);
    let square = |v: &dyn Fn(usize) -> Vector3<f64>| (0..y.len()).map(|i| v(i).norm_squared()).sum::<f64>();
    let now = square(&|i| y[i]);
    let (width, back) = WIDTHS
        .iter()
        .map(|w| (*w, smooth::predict(&t, &y, CUTS.1, *w)))
        .min_by(|a, b| square(&|i| y[i] - a.1[i]).total_cmp(&square(&|i| y[i] - b.1[i])))?;
    let left = square(&|i| y[i] - back[i]);
    let n = 3.0 * y.len() as f64;
    let slack = n * setting.doubt.powi(2);
    // neighbours within the bell are one look
    let looks = n * (t[1] - t[0]) / (2.0 * width).max(t[1] - t[0]);
    let nats = evidence(looks, now, left, slack);
    let size = ((now - left).max(0.0) / n).sqrt();
    let explained = (setting.noise.powi(2) + setting.doubt.powi(2)).sqrt();
    if nats < NAMED || size < SMOOTH * explained {
        return None;
    }
    let with = carried(recording, to_earth, &traced.sensor.corrected, &t, &back);
    let added: Vec<Vector3<f64>> = with.iter().zip(&traced.sensor.corrected).map(|(w, c)| w - c).collect();
    let axes = descending(reductions(&flat(recording, &traced.sensor.corrected), &flat(recording, &with)));
    traced.sensor.shown.push(Shown::over_time("linear_acceleration", axes[0], &added));
    traced.sensor.corrected = with;
    traced.sensor.part.carried_width_s = Some(width);
    let axis = |k: usize| (back.iter().map(|v| v[k] * v[k]).sum::<f64>() / back.len() as f64).sqrt();
    let spread = |v: f64| v / (2.0 * looks / 3.0).sqrt();
    let slow = slow_share(&t, &back);
    Some(EffectEntry {
        kin: Kin::Own,
        id: "linear_acceleration".to_owned(),
        scope: Scope::Run,
        run: None,
        channels: axes.map(|k| setting.channels[k].to_owned()).to_vec(),
        depends_on: vec!["t_s".to_owned()],
        equation: "f += R^T a(t), a smooth in earth axes with bounded speed".to_owned(),
        probability: 1.0 / (1.0 + (-nats).exp()),
        parameters: ["rms_north", "rms_east", "rms_down"]
            .iter()
            .enumerate()
            .map(|(k, name)| parameter(name, axis(k), "m/s^2", spread(axis(k))))
            .chain([parameter("width", width, "s", 0.5 * width / 1.96)])
            .collect(),
        heldout_error_reduction: 1.0 - (left / now.max(1e-300)).sqrt(),
        evidence: format!(
            "neighbours predict {:.0} % of the variance of left-out stretches; means over five seconds are {:.0} % of it: the speed stays bounded",
            100.0 * (1.0 - left / now),
            100.0 * slow
        ),
    })
}

/// Share of the mean square that stays in means over five seconds: small where the speed is bounded.
fn slow_share(t: &[f64], a: &[Vector3<f64>]) -> f64 {
    let (mut slow, mut all) = (0.0, 1e-300);
    let mut from = 0;
    while from < t.len() {
        let to = (from..t.len()).find(|i| t[*i] >= t[from] + 5.0).unwrap_or(t.len());
        let n = (to - from) as f64;
        let mean = a[from..to].iter().sum::<Vector3<f64>>() / n;
        slow += n * mean.norm_squared();
        all += a[from..to].iter().map(Vector3::norm_squared).sum::<f64>();
        from = to;
    }
    slow / all
}
