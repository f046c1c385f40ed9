//! Runs a filter over a trial and scores it.
//!
//! What it is: BROAD's measure: the error quaternion in earth axes, split into heading and inclination, root mean square over
//! the scored samples.
//! What can go wrong: nothing; the filter sees one sample after the other, and nothing is fitted.
//! Units: degrees.
//! Reference: `broad_utils.py` of dlaidig/broad; README of the data, "Protocol".

use super::trial::Sample;
use dcm::{Classic, Dcm, Earth, Fresh, Mat3, Measurement, Vec3, quaternion_of};

/// Root mean square errors, degrees.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Score {
    pub(crate) total: f64,
    pub(crate) heading: f64,
    pub(crate) inclination: f64,
}

impl Score {
    pub(crate) fn mean<'a>(all: impl Iterator<Item = &'a Self>) -> Self {
        let (mut sum, mut n) = (Self::default(), 0.0);
        for s in all {
            sum.total += s.total;
            sum.heading += s.heading;
            sum.inclination += s.inclination;
            n += 1.0;
        }
        Self { total: sum.total / n, heading: sum.heading / n, inclination: sum.inclination / n }
    }
}

/// Errors of one sample, degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Error {
    pub(crate) t: f64,
    pub(crate) heading: f64,
    pub(crate) inclination: f64,
}

/// Anything that takes a measurement and has an attitude.
pub(crate) trait Filter {
    fn step(&mut self, dt: f32, measured: &Measurement);
    fn matrix(&self) -> Mat3;
}

impl Filter for Dcm {
    fn step(&mut self, dt: f32, measured: &Measurement) {
        self.update(dt, measured);
    }
    fn matrix(&self) -> Mat3 {
        *Dcm::matrix(self)
    }
}

impl Filter for Classic {
    fn step(&mut self, dt: f32, measured: &Measurement) {
        self.update(dt, measured);
    }
    fn matrix(&self) -> Mat3 {
        *Classic::matrix(self)
    }
}

/// The score, and the error of every scored sample for the plots.
pub(crate) fn run(filter: &mut dyn Filter, samples: &[Sample], mut each: impl FnMut(Error)) -> Score {
    let (mut total, mut heading, mut inclination, mut n) = (0.0, 0.0, 0.0, 0.0);
    let mut before = None;
    for (s, dt, measured) in steps(samples) {
        filter.step(dt, &measured);
        let estimate = || quaternion_of(&Earth::Enu.from_ned(&filter.matrix())).map(f64::from);
        // an instant before the next sample is between this estimate and the next one
        let now = estimate();
        let Some(truth) = s.truth else {
            before = Some(now);
            continue;
        };
        let share = truth.before / f64::from(dt);
        let (h, i, t) = errors(between(now, before.unwrap_or(now), share), truth.q);
        before = Some(now);
        heading += h * h;
        inclination += i * i;
        total += t * t;
        n += 1.0;
        each(Error { t: s.t - truth.before, heading: h, inclination: i });
    }
    let rms = |sum: f64| (sum / n).sqrt();
    Score { total: rms(total), heading: rms(heading), inclination: rms(inclination) }
}

/// What the filter is shown: each sample with the time since the one before; a reading that repeats is none.
pub(crate) fn steps(samples: &[Sample]) -> impl Iterator<Item = (&Sample, f32, Measurement)> {
    let mut last = samples.first().map_or(0.0, |s| s.t) - samples.get(1).map_or(0.01, |s| s.t - samples[0].t);
    let (mut forces, mut fields) = (Fresh::default(), Fresh::default());
    samples.iter().map(move |s| {
        let dt = (s.t - last) as f32;
        last = s.t;
        let (accel, mag) = (forces.take(dt, Some(Vec3::from(s.accel))), fields.take(dt, Some(Vec3::from(s.mag))));
        (s, dt, Measurement { gyro: Some(Vec3::from(s.gyro)), accel, mag })
    })
}

/// The attitude that lies between two near ones, `share` of the way from `a` to `b`. (The chord: right to 1e-4 degrees for steps of five.)
fn between(a: [f64; 4], b: [f64; 4], share: f64) -> [f64; 4] {
    let along: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
    let share_b = share.copysign(along);
    std::array::from_fn(|i| a[i] * (1.0 - share) + b[i] * share_b)
}

/// A vector in body axes seen in the axes that `q` maps to.
pub(crate) fn turned(q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let [w, x, y, z] = q;
    let t = [2.0 * (y * v[2] - z * v[1]), 2.0 * (z * v[0] - x * v[2]), 2.0 * (x * v[1] - y * v[0])];
    [v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2], v[2] + w * t[2] + x * t[1] - y * t[0]]
}

/// Heading (signed), inclination and total error of an estimate, degrees.
pub(crate) fn errors(a: [f64; 4], b: [f64; 4]) -> (f64, f64, f64) {
    let [aw, ax, ay, az] = a;
    let [bw, bx, by, bz] = b;
    // a times the conjugate of b
    let w = aw * bw + ax * bx + ay * by + az * bz;
    let x = -aw * bx + ax * bw - ay * bz + az * by;
    let y = -aw * by + ax * bz + ay * bw - az * bx;
    let z = -aw * bz - ax * by + ay * bx + az * bw;
    let norm = (w * w + x * x + y * y + z * z).sqrt();
    let (w, z) = (w / norm, z / norm);
    let degrees = |half: f64| 2.0 * half.to_degrees();
    let cosine = (w * w + z * z).sqrt().min(1.0);
    (degrees((z / w).atan()), degrees(cosine.acos()), degrees(w.abs().min(1.0).acos()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_instant_between_two_samples_is_between_their_attitudes() {
        let turned = |deg: f64| [(deg / 2.0).to_radians().cos(), 0.0, 0.0, (deg / 2.0).to_radians().sin()];
        let (h, ..) = errors(between(turned(4.0), turned(0.0).map(|c| -c), 0.25), turned(0.0));
        assert!((h - 3.0).abs() < 1e-3, "{h}");
    }

    #[test]
    fn turns_about_the_vertical_are_heading_and_others_inclination() {
        let half = 5.0f64.to_radians();
        let one = [1.0, 0.0, 0.0, 0.0];
        let (h, i, t) = errors([half.cos(), 0.0, 0.0, half.sin()], one);
        assert!((h - 10.0).abs() < 1e-9 && i < 1e-5 && (t - 10.0).abs() < 1e-9);
        let (h, i, t) = errors([half.cos(), half.sin(), 0.0, 0.0], one);
        assert!(h.abs() < 1e-9 && (i - 10.0).abs() < 1e-9 && (t - 10.0).abs() < 1e-9);
    }
}
