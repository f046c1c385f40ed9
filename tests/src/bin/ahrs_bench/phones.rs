//! Trials of the phones: walking and running with three phones, with and without magnets.
//!
//! What it is: reads the second set in place: sensor files with rates of their own, the day's calibration, the cameras' attitude at
//! 60 Hz, and the rotations between phone, cameras and magnetic north. One sample per gyro reading; accelerometer and magnetometer
//! hold their newest reading until the next one comes.
//! What can go wrong: a missing folder, a damaged file, a number that is none: one line with file and line.
//! Units: s, rad/s, m/s^2, uT.
//! Reference: README of the data (`ahrs-phones`); Michel et al., *On Attitude Estimation with Smartphones*, PerCom 2017. The data are
//! under CeCILL 2.1 and stay where they are.

use super::trial::{Sample, Trial, Truth};
use crate::run::Failure;
use serde_json::Value;
use std::io::Read;
use std::path::Path;

/// Nothing is scored before this camera time, s.
const SCORED_FROM: f64 = 5.0;
/// What an iPhone calls one g, with gravity's sign, m/s^2.
const IPHONE_G: f64 = -9.806_65;

/// Whether the gyro's bias of the day is taken off beforehand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Gyro {
    /// It is.
    Own,
    /// It is not: 1 to 6 deg/s.
    Raw,
}

/// A trial and where it belongs.
#[derive(Debug, Clone)]
pub(crate) struct Phone {
    pub(crate) trial: Trial,
    pub(crate) device: String,
    pub(crate) magnets: bool,
    pub(crate) running: bool,
}

type Quaternion = [f64; 4];

/// Reads every trial that `meta.json` names and the folder has, in its order.
pub(crate) fn phones(folder: &Path, gyro: Gyro) -> Result<Vec<Phone>, Failure> {
    let path = folder.join("meta.json");
    let text = std::fs::read_to_string(&path).map_err(|e| Failure(format!("{}: {e}", path.display())))?;
    let meta: Value = serde_json::from_str(&text).map_err(|e| Failure(format!("{}: {e}", path.display())))?;
    let listed = meta["trials"].as_array().map_or(&[][..], Vec::as_slice);
    let there = listed.iter().filter(|t| folder.join(t["name"].as_str().unwrap_or_default()).is_dir());
    let all: Vec<Phone> = there.map(|t| phone(folder, &meta, t, gyro)).collect::<Result<_, _>>()?;
    if all.is_empty() {
        return Err(Failure(format!("{}: none of its trials is there", path.display())));
    }
    Ok(all)
}

fn phone(root: &Path, meta: &Value, about: &Value, gyro: Gyro) -> Result<Phone, Failure> {
    let name = about["name"].as_str().unwrap_or_default();
    let device = about["dev"].as_str().unwrap_or_default();
    let folder = root.join(name);
    let own = &meta["calibrations"][about["cal"].as_str().unwrap_or_default()];
    let zero = if gyro == Gyro::Own { vector(&own["gb"]) } else { [0.0; 3] };
    let mut rates = rows(&folder.join("gyroscope.txt.gz"))?;
    let mut forces = rows(&folder.join("accelerometer.txt.gz"))?;
    let mut fields = rows(&folder.join("magnetometer.txt.gz"))?;
    if device.starts_with("iPhone") {
        let boot = boot_time(&folder.join("description.txt"))?;
        [&mut rates, &mut forces, &mut fields].into_iter().flatten().for_each(|(t, _)| *t -= boot);
        forces.iter_mut().for_each(|(_, f)| *f = f.map(|c| c * IPHONE_G));
    }
    let unit = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    corrected(&mut rates, zero, unit);
    corrected(&mut forces, vector(&own["ab"]), matrix(&own["aM"]));
    corrected(&mut fields, vector(&own["mb"]), matrix(&own["mM"]));
    let mut samples = held(&rates, &forces, &fields);
    let (Some(start), Some(end)) = (samples.first().map(|s| s.t), samples.last().map(|s| s.t)) else {
        return Err(Failure(format!("{}: its sensors have no time in common", folder.display())));
    };
    let shift = number_in(&folder.join("timeAlignment.txt"))? - about["dt"].as_f64().unwrap_or(0.0);
    let device_meta = &meta["devices"][device];
    let to_enu = cameras_to_enu(vector2(&meta["tilt_deg"]), device_meta["heading_deg"].as_f64().unwrap_or(0.0));
    let to_body = conjugate(of_rotation_vector(vector(&device_meta["mount_rotvec_deg"]).map(f64::to_radians)));
    let bad: Vec<[f64; 2]> = about["bad"].as_array().map_or(&[][..], Vec::as_slice).iter().map(vector2).collect();
    let mut scored = Vec::new();
    for (t, q) in attitudes(&folder.join("truth.csv.gz"))? {
        let seen = t >= SCORED_FROM && !bad.iter().any(|[from, to]| (*from..=*to).contains(&t));
        let at = t - shift;
        if seen && at > start && at < end {
            scored.push((at, product(product(to_enu, q), to_body)));
        }
    }
    let mut next = scored.into_iter().peekable();
    for s in &mut samples {
        // several only in a gap of the gyro; the newest one stands for them
        while let Some((at, q)) = next.next_if(|(at, _)| *at <= s.t) {
            s.truth = Some(Truth { q, before: s.t - at });
        }
        s.t -= start;
    }
    let motion = about["motion"].as_str().unwrap_or_default();
    Ok(Phone {
        trial: Trial { name: name.to_owned(), samples },
        device: device.to_owned(),
        magnets: about["dist"].as_bool().unwrap_or(false),
        running: motion.starts_with("running"),
    })
}

/// One sample per rate for which there are readings of both other sensors before and after.
fn held(rates: &[Row], forces: &[Row], fields: &[Row]) -> Vec<Sample> {
    let newest = |rows: &[Row], t: f64| {
        let n = rows.partition_point(|(at, _)| *at <= t);
        (n > 0 && rows.last().is_some_and(|(end, _)| t <= *end)).then(|| rows[n - 1].1)
    };
    let narrow = |v: [f64; 3]| v.map(|c| c as f32);
    let sample = |(t, rate): &Row| {
        let (force, field) = (newest(forces, *t)?, newest(fields, *t)?);
        Some(Sample { t: *t, gyro: narrow(*rate), accel: narrow(force), mag: narrow(field), truth: None })
    };
    rates.iter().filter_map(sample).collect()
}

/// Time and three readings.
type Row = (f64, [f64; 3]);

fn corrected(rows: &mut [Row], offset: [f64; 3], matrix: [[f64; 3]; 3]) {
    for (_, v) in rows {
        let free: [f64; 3] = std::array::from_fn(|i| v[i] - offset[i]);
        *v = matrix.map(|row| row[0] * free[0] + row[1] * free[1] + row[2] * free[2]);
    }
}

fn unpacked(path: &Path) -> Result<String, Failure> {
    let fail = |e: std::io::Error| Failure(format!("{}: {e}", path.display()));
    let mut text = String::new();
    flate2::read::GzDecoder::new(std::fs::File::open(path).map_err(fail)?).read_to_string(&mut text).map_err(fail)?;
    Ok(text)
}

/// The first four numbers of each line.
fn rows(path: &Path) -> Result<Vec<Row>, Failure> {
    let row = |(n, line): (usize, &str)| {
        let v: Vec<f64> = line.split_whitespace().take(4).filter_map(|w| w.parse().ok()).collect();
        match v.as_slice() {
            [t, x, y, z] => Ok((*t, [*x, *y, *z])),
            _ => Err(Failure(format!("{}:{}: expected four numbers, found {line:?}", path.display(), n + 1))),
        }
    };
    unpacked(path)?.lines().enumerate().filter(|(_, l)| !l.trim().is_empty()).map(row).collect()
}

/// Camera time and attitude, where the markers were seen.
fn attitudes(path: &Path) -> Result<Vec<(f64, Quaternion)>, Failure> {
    let mut out = Vec::new();
    for (n, line) in unpacked(path)?.lines().enumerate().skip(1) {
        let v: Result<Vec<f64>, _> = line.split(',').take(5).map(str::parse).collect();
        let Ok(&[t, w, x, y, z]) = v.as_deref() else {
            return Err(Failure(format!("{}:{}: expected time and attitude, found {line:?}", path.display(), n + 1)));
        };
        if [w, x, y, z].iter().all(|c| c.is_finite()) {
            out.push((t, [w, x, y, z]));
        }
    }
    Ok(out)
}

fn text_of(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path).map_err(|e| Failure(format!("{}: {e}", path.display())))
}

fn number_in(path: &Path) -> Result<f64, Failure> {
    let text = text_of(path)?;
    text.trim().parse().map_err(|_| Failure(format!("{}: {:?} is no number", path.display(), text.trim())))
}

/// Uptime of an iPhone at the recording's zero: the first number after `BootTime =`.
fn boot_time(path: &Path) -> Result<f64, Failure> {
    let text = text_of(path)?;
    let after = text.split_once("BootTime").and_then(|(_, rest)| rest.split_once('='));
    let word = after.and_then(|(_, rest)| rest.split_whitespace().next());
    word.and_then(|w| w.parse().ok()).ok_or_else(|| Failure(format!("{}: no BootTime", path.display())))
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn vector(value: &Value) -> [f64; 3] {
    std::array::from_fn(|i| number(&value[i]))
}

fn vector2(value: &Value) -> [f64; 2] {
    std::array::from_fn(|i| number(&value[i]))
}

fn matrix(value: &Value) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| vector(&value[i]))
}

/// From the cameras' axes to east, north (magnetic), up: their vertical is a little tilted, their north is not the magnetic one.
fn cameras_to_enu(tilt_deg: [f64; 2], heading_deg: f64) -> Quaternion {
    let [x, y] = tilt_deg.map(|d| d.to_radians().tan());
    let long = (x * x + y * y).sqrt();
    // the shortest turn that puts (x, y, 1) upright: about (y, -x, 0), by the angle whose tangent is its length
    let angle = long.atan();
    let upright = if long > 0.0 { of_rotation_vector([y / long * angle, -x / long * angle, 0.0]) } else { [1.0, 0.0, 0.0, 0.0] };
    product(of_rotation_vector([0.0, 0.0, heading_deg.to_radians()]), upright)
}

fn of_rotation_vector([x, y, z]: [f64; 3]) -> Quaternion {
    let angle = (x * x + y * y + z * z).sqrt();
    let share = if angle > 1e-12 { (angle / 2.0).sin() / angle } else { 0.5 };
    [(angle / 2.0).cos(), x * share, y * share, z * share]
}

fn conjugate([w, x, y, z]: Quaternion) -> Quaternion {
    [w, -x, -y, -z]
}

fn product([aw, ax, ay, az]: Quaternion, [bw, bx, by, bz]: Quaternion) -> Quaternion {
    [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_reading_is_held_and_the_ends_are_cut() {
        let row = |t: f64, v: f64| (t, [v; 3]);
        let (rates, forces) = ([row(0.0, 1.0), row(1.0, 2.0), row(2.0, 3.0)], [row(0.5, 4.0), row(1.5, 5.0)]);
        let samples = held(&rates, &forces, &[row(0.9, 6.0), row(1.9, 7.0)]);
        assert_eq!(samples.len(), 1, "one rate lies within both");
        assert_eq!((samples[0].t, samples[0].gyro[0], samples[0].accel[0], samples[0].mag[0]), (1.0, 2.0, 4.0, 6.0));
    }

    /// A tilt of the cameras' vertical is taken out: their up becomes up.
    #[test]
    fn the_cameras_vertical_becomes_the_vertical() {
        let q = cameras_to_enu([2.0, -3.0], 40.0);
        let (x, y) = (2f64.to_radians().tan(), (-3f64).to_radians().tan());
        let [_, east, north, up] = product(product(q, [0.0, x, y, 1.0]), conjugate(q));
        assert!(east.abs() < 1e-12 && north.abs() < 1e-12 && up > 1.0);
        // seen from above, 90 degrees of heading turn the cameras' x from east to north
        let q = cameras_to_enu([0.0; 2], 90.0);
        let [_, east, north, _] = product(product(q, [0.0, 1.0, 0.0, 0.0]), conjugate(q));
        assert!(east.abs() < 1e-12 && (north - 1.0).abs() < 1e-12);
    }
}
