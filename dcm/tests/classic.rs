//! The classic filter against simulated bodies whose attitude is known.

mod body;

use dcm::{Classic, ClassicConfig, Euler, Increment, Mat3, Measurement, Vec3, matrix_of, rotate};
use proptest::prelude::*;

/// Horizontal and vertical part of a field with a dip of 65 degrees, gauss.
const FIELD: [f32; 3] = [0.2, 0.0, 0.43];
const DT: f32 = 1.0 / 200.0;

/// What ideal sensors of a body at rest at `r` read.
fn at_rest(r: &Mat3) -> Measurement {
    body::at_rest(r, FIELD)
}

fn length(v: &Vec3) -> f32 {
    v.dot(v).sqrt()
}

/// Angle between two attitudes, degrees (from the sine for small ones, where the trace is blind).
fn between(a: &Mat3, b: &Mat3) -> f32 {
    let d = a.transpose() * b;
    let sine = length(&Vec3::new(d.m32 - d.m23, d.m13 - d.m31, d.m21 - d.m12)) / 2.0;
    sine.atan2((d.trace() - 1.0) / 2.0).to_degrees()
}

fn attitude(roll: f32, pitch: f32, yaw: f32) -> Mat3 {
    matrix_of(&Euler { roll: roll.to_radians(), pitch: pitch.to_radians(), yaw: yaw.to_radians() })
}

#[test]
fn starts_at_a_known_static_attitude_and_stays() {
    let truth = attitude(25.0, -40.0, 130.0);
    let mut dcm = Classic::new(ClassicConfig::TUNED);
    let step = dcm.update(DT, &at_rest(&truth));
    assert!(step.started && dcm.heading_is_absolute());
    for _ in 0..2000 {
        assert!(!dcm.update(DT, &at_rest(&truth)).bad_input);
    }
    assert!(between(dcm.matrix(), &truth) < 0.01, "{}", between(dcm.matrix(), &truth));
    let e = dcm.euler();
    assert!((e.pitch.to_degrees() + 40.0).abs() < 0.01 && (e.yaw.to_degrees() - 130.0).abs() < 0.01);
}

#[test]
fn level_at_rest_is_zero_with_specific_force_up() {
    // Beharie 2013 Eq. 4.3 corrected: FRD, level, at rest: f = (0, 0, -9.81); the printed sign would read as upside down.
    let mut dcm = Classic::new(ClassicConfig::TUNED);
    dcm.update(DT, &Measurement { accel: Some(Vec3::new(0.0, 0.0, -9.81)), ..Measurement::default() });
    assert!(between(dcm.matrix(), &Mat3::identity()) < 1e-3);
}

/// From the most wrong attitudes (upside down, heading reversed) the Razor gains need a few seconds.
#[test]
fn converges_from_any_wrong_attitude() {
    for wrong in [attitude(180.0, 0.0, 0.0), attitude(0.0, 0.0, 180.0), attitude(90.0, 60.0, -120.0), attitude(0.0, 180.0, 0.0)] {
        let truth = attitude(0.0, 0.0, 0.0);
        let mut dcm = Classic::new(ClassicConfig::RAZOR);
        dcm.update(DT, &at_rest(&wrong));
        for _ in 0..(8.0 / DT) as u32 {
            dcm.update(DT, &at_rest(&truth));
        }
        // the integrators have learned a false bias on the way and give it back slowly
        assert!(between(dcm.matrix(), &truth) < 12.0, "8 s: {}", between(dcm.matrix(), &truth));
        for _ in 0..(120.0 / DT) as u32 {
            dcm.update(DT, &at_rest(&truth));
        }
        assert!(between(dcm.matrix(), &truth) < 1.0, "{}", between(dcm.matrix(), &truth));
    }
}

/// A body that turns about all axes; the true attitude is integrated in much finer steps than the filter's.
fn follow(config: ClassicConfig, bias: Vec3, mag_every: u32, seconds: f32) -> (f32, Classic) {
    let mut truth = attitude(10.0, 5.0, 30.0);
    let mut dcm = Classic::new(config);
    dcm.update(DT, &at_rest(&truth));
    let mut worst: f32 = 0.0;
    for k in 1..=(seconds / DT) as u32 {
        let t = k as f32 * DT;
        let rate = Vec3::new((0.9 * t).sin(), 0.8 * (0.7 * t).cos(), 1.1 * (0.4 * t).sin());
        for _ in 0..8 {
            truth = rotate(&truth, &(rate * (DT / 8.0)), Increment::Exponential);
        }
        let mut m = at_rest(&truth);
        m.gyro = Some(rate + bias);
        m.mag = m.mag.filter(|_| k.is_multiple_of(mag_every));
        dcm.update(DT, &m);
        if t > seconds / 2.0 {
            worst = worst.max(between(dcm.matrix(), &truth));
        }
    }
    (worst, dcm)
}

/// The classic first-order step is the largest single error: with ideal sensors it costs 0.2 degrees, the series 0.0005.
#[test]
fn follows_a_rotation() {
    let (classic, _) = follow(ClassicConfig::TUNED, Vec3::zeros(), 3, 60.0);
    assert!((0.05..0.3).contains(&classic), "{classic}");
    let (series, _) = follow(ClassicConfig::default(), Vec3::zeros(), 3, 60.0);
    assert!(series < 0.005, "{series}");
}

#[test]
fn finds_the_gyro_bias_in_motion() {
    let bias = Vec3::new(0.02, -0.03, 0.015);
    let (worst, dcm) = follow(ClassicConfig::RAZOR, bias, 3, 600.0);
    assert!(length(&(dcm.bias() - bias)) < 2e-3, "{}", dcm.bias());
    assert!(worst < 1.0, "{worst}");
}

#[test]
fn the_magnetometer_rate_does_not_change_the_gain() {
    // the same heading error decays alike when the field comes at every step and at every tenth
    let decay = |every: u32| {
        let mut dcm = Classic::new(ClassicConfig { yaw: dcm::Gains { kp: 0.5, ki: 0.0 }, ..ClassicConfig::TUNED });
        dcm.update(DT, &at_rest(&attitude(0.0, 0.0, 20.0)));
        for k in 1..=400u32 {
            let mut m = at_rest(&attitude(0.0, 0.0, 0.0));
            m.mag = m.mag.filter(|_| k.is_multiple_of(every));
            dcm.update(DT, &m);
        }
        dcm.euler().yaw.to_degrees()
    };
    let (every, tenth) = (decay(1), decay(10));
    assert!((7.0..8.0).contains(&every), "20 deg e^-1 is 7.4: {every}");
    assert!((every - tenth).abs() < 0.2, "{every} {tenth}");
}

#[test]
fn irregular_steps_give_the_same_rotation() {
    let turn = |steps: &[f32]| {
        let mut dcm = Classic::new(ClassicConfig { increment: Increment::Exponential, ..ClassicConfig::TUNED });
        let level = at_rest(&Mat3::identity());
        dcm.update(DT, &level);
        for dt in steps {
            dcm.update(*dt, &Measurement { gyro: Some(Vec3::new(0.0, 0.0, 1.0)), ..Measurement::default() });
        }
        dcm.euler().yaw
    };
    let regular = turn(&[0.005; 200]);
    let ragged: Vec<f32> = (0..200).map(|k| if k % 2 == 0 { 0.002 } else { 0.008 }).collect();
    assert!((regular - 1.0).abs() < 1e-4, "{regular}");
    assert!((turn(&ragged) - regular).abs() < 1e-4);
}

#[test]
fn without_a_magnetometer_heading_is_relative_and_tilt_is_right() {
    let truth = attitude(-20.0, 35.0, 77.0);
    let mut dcm = Classic::new(ClassicConfig::TUNED);
    for _ in 0..2000 {
        let step = dcm.update(DT, &Measurement { mag: None, ..at_rest(&truth) });
        assert!(!step.mag_used);
    }
    let e = dcm.euler();
    assert!((e.roll.to_degrees() + 20.0).abs() < 0.01 && (e.pitch.to_degrees() - 35.0).abs() < 0.01);
    assert!(!dcm.heading_is_absolute() && e.yaw.abs() < 1e-3);
    assert!(dcm.update(DT, &at_rest(&truth)).started, "the first field sets the heading at once");
    assert!((dcm.euler().yaw.to_degrees() - 77.0).abs() < 0.1 && dcm.heading_is_absolute());
}

#[test]
fn declination_turns_magnetic_into_true_heading() {
    let mut dcm = Classic::new(ClassicConfig { declination: 10.0f32.to_radians(), ..ClassicConfig::TUNED });
    for _ in 0..100 {
        dcm.update(DT, &at_rest(&attitude(0.0, 0.0, 30.0))); // 30 degrees from magnetic north
    }
    assert!((dcm.euler().yaw.to_degrees() - 40.0).abs() < 0.01, "{}", dcm.euler().yaw.to_degrees());
}

#[test]
fn through_the_pole_the_matrix_is_smooth() {
    let mut truth = attitude(0.0, 80.0, 20.0);
    let mut dcm = Classic::new(ClassicConfig::TUNED);
    dcm.update(DT, &at_rest(&truth));
    let rate = Vec3::new(0.0, 0.5, 0.0);
    for _ in 0..(0.7 / DT) as u32 {
        truth = rotate(&truth, &(rate * DT), Increment::Exponential);
        let before = *dcm.matrix();
        dcm.update(DT, &Measurement { gyro: Some(rate), ..at_rest(&truth) });
        assert!(between(&before, dcm.matrix()) < 0.3);
        assert!(between(dcm.matrix(), &truth) < 0.05);
        let e = dcm.euler();
        assert!(e.roll.is_finite() && e.pitch.is_finite() && e.yaw.is_finite());
    }
}

#[test]
fn a_gap_starts_the_tilt_anew_and_keeps_heading_and_bias() {
    let mut dcm = Classic::new(ClassicConfig::TUNED);
    dcm.update(DT, &at_rest(&attitude(0.0, 0.0, 50.0)));
    dcm.set_bias(Vec3::new(0.01, 0.02, 0.03));
    let now = attitude(30.0, 0.0, 50.0);
    let step = dcm.update(2.0, &Measurement { mag: None, ..at_rest(&now) });
    assert!(step.started);
    assert!(between(dcm.matrix(), &now) < 0.01);
    assert_eq!(dcm.bias(), Vec3::new(0.01, 0.02, 0.03));
}

#[test]
fn bad_readings_are_flagged_and_change_nothing() {
    let truth = attitude(5.0, 6.0, 7.0);
    let mut dcm = Classic::new(ClassicConfig::TUNED);
    dcm.update(DT, &at_rest(&truth));
    let nan = Vec3::new(0.0, f32::NAN, 0.0);
    for bad in [
        Measurement { gyro: Some(nan), ..Measurement::default() },
        Measurement { accel: Some(nan), ..Measurement::default() },
        Measurement { mag: Some(nan), ..Measurement::default() },
        Measurement { accel: Some(Vec3::zeros()), ..Measurement::default() },
        Measurement { mag: Some(Vec3::zeros()), ..Measurement::default() },
        Measurement { gyro: Some(Vec3::repeat(f32::MAX)), ..Measurement::default() },
    ] {
        let before = *dcm.matrix();
        assert!(dcm.update(DT, &bad).bad_input, "{bad:?}");
        assert!(between(&before, dcm.matrix()) < 1e-3, "{bad:?}");
    }
    for dt in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(dcm.update(dt, &at_rest(&truth)).bad_input);
    }
    assert!(between(dcm.matrix(), &truth) < 0.01);
}

proptest! {
    /// Whatever bits arrive, the state stays a rotation.
    #[test]
    fn no_input_poisons_the_state(words in proptest::collection::vec(any::<[u32; 10]>(), 1..40)) {
        let truth = attitude(5.0, 6.0, 7.0);
        let mut dcm = Classic::new(ClassicConfig { bias_limit: 0.02, ..ClassicConfig::RAZOR });
        dcm.update(DT, &at_rest(&truth));
        for w in words {
            let f = w.map(f32::from_bits);
            let v = |i: usize| Some(Vec3::new(f[i], f[i + 1], f[i + 2]));
            dcm.update(f[9], &Measurement { gyro: v(0), accel: v(3), mag: v(6) });
            let m = dcm.matrix();
            prop_assert!((m * m.transpose() - Mat3::identity()).abs().max() < 1e-3, "{m}");
            prop_assert!(dcm.bias().iter().all(|b| b.abs() <= 0.02));
            prop_assert!(dcm.quaternion().iter().all(|q| q.is_finite()));
        }
        // and it comes back by itself, as far as the false bias that it may have learned lets it
        for _ in 0..4_000 {
            dcm.update(DT, &at_rest(&truth));
        }
        prop_assert!(between(dcm.matrix(), &truth) < 3.0);
    }
}
