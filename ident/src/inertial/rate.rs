//! The gyro while the body rests.
//!
//! What it is: at rest the rate is zero, so what the gyro reads is its offset; declared is a constant one.
//! What can go wrong: without rest nothing is claimed. The earth's own turning, 0.004 deg/s, is below what is asked.
//! Units: rad/s.
//! Reference: specification `closing-the-loop.md`, "Inertial".

use super::account::Sensor;
use super::least::{Readings, Term};
use super::model::{Part, linear};
use super::noise::{axis_level, floor, levels};
use super::search::Scene;
use super::trace::{Setting, trace};
use super::{Attitude, Recording, effects};
use nalgebra::Vector3;

/// Seconds at the end of a rest that the detector takes for rest while the body already moves; its beginning it sees late anyway.
const TRIM_S: f64 = 0.5;
/// Block, left-out stretch and cluster, s.
const CUTS: (f64, f64, f64) = (0.25, 0.5, 3.0);
/// Wandering of an offset that no cause is named for, rad/s (0.017 deg/s: in-run stability of such gyros).
const DOUBT: f64 = 3e-4;
/// Blocks of rest that are needed.
const LEAST_BLOCKS: usize = 12;
const AXES: [&str; 3] = ["offset_x", "offset_y", "offset_z"];

/// The trace, and the rates without what was found where something was; nothing without rest.
pub(crate) fn trace_rate(recording: &Recording, attitude: &Attitude) -> (Option<Sensor>, Option<Vec<Vector3<f64>>>) {
    let used = resting(recording, attitude);
    let readings = Readings::new(&recording.t, &recording.gyro, used.clone(), CUTS.0, CUTS.1, CUTS.2);
    if readings.blocks.len() < LEAST_BLOCKS {
        return (None, None);
    }
    let still: Vec<Vector3<f64>> = (0..used.len()).filter(|i| used[*i]).map(|i| recording.gyro[i]).collect();
    let per_block = still.len() as f64 / readings.blocks.len() as f64;
    let setting = Setting {
        channels: ["gx", "gy", "gz"],
        unit: "rad/s",
        floor: std::array::from_fn(|k| axis_level(&still, k)),
        noise: floor(&levels(&still, 50)) / per_block.sqrt(),
        doubt: DOUBT,
    };
    let heard = (readings.blocks[0].t, readings.blocks.last().map_or(0.0, |b| b.t));
    let scene = Scene { recording, to_earth: &attitude.to_earth, predicted: &[], turning: &[], heard };
    let Some(traced) = trace(&setting, &readings, &declared(), &effects::rate(), &scene, &used) else { return (None, None) };
    let corrected = without(recording, &traced.effect);
    (Some(traced.sensor), corrected)
}

fn declared<'a>() -> Vec<Term<'a>> {
    AXES.iter().enumerate().map(|(k, name)| Term::new(name, "rad/s", move |_| Vector3::ith(k, 1.0))).collect()
}

/// The rates without what was found, where something was.
fn without(recording: &Recording, effect: &[Vector3<f64>]) -> Option<Vec<Vector3<f64>>> {
    let changed = effect.iter().any(|e| *e != Vector3::zeros());
    changed.then(|| recording.gyro.iter().zip(effect).map(|(g, e)| g - e).collect())
}

/// The predictions of a model, and the rates without what it names.
pub(crate) fn again(recording: &Recording, attitude: &Attitude, part: &Part) -> (Vec<Vector3<f64>>, Option<Vec<Vector3<f64>>>) {
    let used = resting(recording, attitude);
    let scene = Scene { recording, to_earth: &attitude.to_earth, predicted: &[], turning: &[], heard: (0.0, 0.0) };
    let (rows, effect) = linear(part, &declared(), &effects::rate(), &scene, ["gx", "gy", "gz"], &used);
    let named = part.effect.iter().all(|e| e.variable.is_none());
    (rows, if named { without(recording, &effect) } else { None })
}

/// Rows of rest, without the end of each.
fn resting(recording: &Recording, attitude: &Attitude) -> Vec<bool> {
    let t = &recording.t;
    let mut used: Vec<bool> =
        attitude.rest.iter().zip(&recording.gyro).map(|(rest, g)| *rest && g.iter().all(|c| c.is_finite())).collect();
    let mut from = 0;
    while from < used.len() {
        let to = (from..used.len()).find(|i| used[*i] != used[from]).unwrap_or(used.len());
        if used[from] {
            for i in from..to {
                used[i] = to == used.len() || t[to] - t[i] >= TRIM_S;
            }
        }
        from = to;
    }
    used
}
