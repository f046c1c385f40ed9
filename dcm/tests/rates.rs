//! Sensors with rates and clocks of their own, and readings at the end of a range.

use dcm::{Config, Dcm, Euler, Fresh, Increment, Mat3, Measurement, STANDARD_GRAVITY, Vec3, matrix_of, rotate};

/// North, east and down part of a field with a dip of 65 degrees, uT.
const FIELD: [f32; 3] = [20.0, 0.0, 43.0];
/// Step of the body, s.
const FINE: f32 = 0.5e-3;
const DEGREE: f32 = std::f32::consts::PI / 180.0;

/// A body that rests for three seconds, then turns about all axes and swings; in fine steps.
struct Body {
    truth: Mat3,
    k: u32,
    swing: f32,
    /// Mean rate since the last reading of the gyro, as a gyro with a filter gives it.
    turned: Vec3,
}

impl Body {
    /// `swing` is the size of its true acceleration, g.
    fn new(swing: f32) -> Self {
        Self { truth: matrix_of(&Euler { roll: 0.2, pitch: -0.1, yaw: 0.9 }), k: 0, swing, turned: Vec3::zeros() }
    }

    fn advance(&mut self, seconds: f32) {
        for _ in 0..(seconds / FINE).round() as u32 {
            self.k += 1;
            let t = self.moving();
            let rate = Vec3::new((0.9 * t).sin(), 0.8 * (0.7 * t).sin(), 1.1 * (0.4 * t).sin());
            self.truth = rotate(&self.truth, &(rate * FINE), Increment::Exponential);
            self.turned += rate * FINE;
        }
    }

    /// Time in motion, s.
    fn moving(&self) -> f32 {
        (self.k as f32 * FINE - 3.0).max(0.0)
    }

    fn rate(&mut self, dt: f32) -> Vec3 {
        std::mem::take(&mut self.turned) / dt
    }

    fn force(&self) -> Vec3 {
        let t = self.moving();
        let swing = Vec3::new((9.0 * t).sin(), (7.0 * t).sin(), (18.0 * t).sin()) * (self.swing * STANDARD_GRAVITY);
        self.truth.transpose() * (Vec3::new(0.0, 0.0, -STANDARD_GRAVITY) + swing)
    }

    fn field(&self) -> Vec3 {
        self.truth.transpose() * Vec3::from(FIELD)
    }
}

/// Angle between two attitudes, degrees.
fn between(a: &Mat3, b: &Mat3) -> f32 {
    let d = a.transpose() * b;
    let sine = Vec3::new(d.m32 - d.m23, d.m13 - d.m31, d.m21 - d.m12) / 2.0;
    sine.dot(&sine).sqrt().atan2((d.trace() - 1.0) / 2.0) / DEGREE
}

/// Largest error of the second half of a minute, in which the gyro's steps are as told and a field is there every `every` seconds; `held`
/// repeats the last field in between and leaves it to [`Fresh`] to tell.
fn worst(step: impl Fn(u32) -> f32, every: f32, held: bool) -> f32 {
    let (mut dcm, mut body, mut fresh) = (Dcm::new(Config::default()), Body::new(0.2), Fresh::default());
    let (mut t, mut next, mut last, mut worst) = (0.0f32, 0.0f32, None, 0.0f32);
    for k in 0.. {
        let dt = (step(k) / FINE).round() * FINE;
        body.advance(dt);
        t += dt;
        let mut mag = None;
        if t >= next {
            next += every;
            mag = Some(body.field());
            last = mag;
        }
        if held {
            mag = fresh.take(dt, last);
        }
        dcm.update(dt, &Measurement { gyro: Some(body.rate(dt)), accel: Some(body.force()), mag });
        if t > 30.0 {
            worst = worst.max(between(dcm.matrix(), &body.truth));
        }
        if t > 60.0 {
            break;
        }
    }
    worst
}

/// Gyros of 95 to 200 Hz with magnetometers of 25 to 100 Hz, shown when new or held in between: the same attitude.
#[test]
fn a_magnetometer_may_be_slower_than_the_gyro() {
    for gyro in [95.0, 107.0, 143.0, 200.0] {
        for mag in [25.0, 50.0, 75.0, 100.0] {
            let [new, held] = [false, true].map(|held| worst(|_| 1.0 / gyro, 1.0 / mag, held));
            assert!(new < 1.0 && held < 1.0, "gyro {gyro} Hz, magnetometer {mag} Hz: {new} {held}");
        }
    }
}

/// Steps from a third of the usual one to three times as much, and pauses of a fifth of a second.
#[test]
fn time_stamps_may_be_uneven() {
    let even = worst(|_| 0.01, 0.02, false);
    let uneven = worst(|k| 0.01 * [1.0, 0.3, 3.0, 0.5, 1.7][k as usize % 5], 0.02, false);
    let paused = worst(|k| if k % 400 == 399 { 0.2 } else { 0.01 }, 0.02, false);
    assert!(even < 1.0 && uneven < 1.5 && paused < 3.0, "{even} {uneven} {paused}");
}

/// A runner's accelerometer that ends at 2 g: where the range is known its clipped readings are left out and said; either way the tilt is
/// no worse than twice what it is with the whole force.
#[test]
fn an_accelerometer_may_clip() {
    let off = |range: f32, known: bool| {
        let accel_range = if known { range * STANDARD_GRAVITY } else { Config::DEFAULT.accel_range };
        let (mut dcm, mut body) = (Dcm::new(Config { accel_range, ..Config::DEFAULT }), Body::new(1.2));
        let (mut sum, mut n, mut said, mut clipped) = (0.0f32, 0, 0, 0);
        for k in 0..6_000 {
            body.advance(0.01);
            let whole = body.force();
            let force = whole.map(|f| f.clamp(-range * STANDARD_GRAVITY, range * STANDARD_GRAVITY));
            let step =
                dcm.update(0.01, &Measurement { gyro: Some(body.rate(0.01)), accel: Some(force), mag: Some(body.field()) });
            said += u32::from(step.overrange);
            clipped += u32::from(force != whole);
            if k > 2_000 {
                let e = between(dcm.matrix(), &body.truth);
                sum += e * e;
                n += 1;
            }
        }
        ((sum / n as f32).sqrt(), said, clipped)
    };
    let (whole, none, _) = off(16.0, true);
    let (known, said, clipped) = off(2.0, true);
    let (unknown, ..) = off(2.0, false);
    assert!(none == 0 && clipped > 300 && said == clipped, "{none} {said} {clipped}");
    println!("whole {whole}, clipped {unknown}, left out {known}");
    assert!(known < 2.0 * whole.max(1.0) && unknown < 2.0 * whole.max(1.0), "{whole} {known} {unknown}");
}

/// A spin beyond the gyro's range: it is said, the tilt is right again ten seconds later and the heading a minute later.
#[test]
fn a_gyro_may_reach_the_end_of_its_range() {
    let range = 250.0 * DEGREE;
    let (mut dcm, mut body) = (Dcm::new(Config { gyro_range: range, ..Config::DEFAULT }), Body::new(0.0));
    let mut run = |seconds: f32, spin: f32| {
        let mut said = 0;
        for _ in 0..(seconds / 0.005) as u32 {
            body.advance(0.005);
            let more = Vec3::new(spin, 0.0, 0.0);
            body.truth = rotate(&body.truth, &(more * 0.005), Increment::Exponential);
            let gyro = (body.rate(0.005) + more).map(|w| w.clamp(-range, range));
            let m = Measurement { gyro: Some(gyro), accel: Some(body.force()), mag: Some(body.field()) };
            said += u32::from(dcm.update(0.005, &m).overrange);
        }
        (said, between(dcm.matrix(), &body.truth))
    };
    run(30.0, 0.0);
    let (said, off) = run(0.5, 400.0 * DEGREE);
    assert!(said == 100 && off > 20.0, "{said} {off}");
    let (said, after) = run(10.0, 0.0);
    assert!(said == 0 && after < 20.0, "{after}");
    let (_, later) = run(60.0, 0.0);
    assert!(later < 2.0, "{later}");
}
