//! What the filter says of itself and what can be set in it.

mod body;

use dcm::{Config, Dcm, Euler, Mat3, Measurement, STATE_WORDS, StateError, Vec3, matrix_of};

/// North, east and down part of a field with a dip of 65 degrees, uT.
const FIELD: [f32; 3] = [20.0, 0.0, 43.0];
const DT: f32 = 0.01;

fn attitude(roll: f32, pitch: f32, yaw: f32) -> Mat3 {
    matrix_of(&Euler { roll: roll.to_radians(), pitch: pitch.to_radians(), yaw: yaw.to_radians() })
}

fn started(r: &Mat3) -> Dcm {
    let mut dcm = Dcm::new(Config::default());
    dcm.update(DT, &body::at_rest(r, FIELD));
    dcm
}

#[test]
fn a_force_starts_it_and_a_field_alone_does_not() {
    let mut dcm = Dcm::new(Config::default());
    let whole = body::at_rest(&Mat3::identity(), FIELD);
    dcm.update(DT, &Measurement { accel: None, ..whole });
    assert!(!dcm.is_started() && !dcm.flags().started);
    dcm.update(DT, &whole);
    assert!(dcm.is_started() && dcm.flags().started);
}

/// A turn by 90 degrees about the vertical has the quaternion cos 45 and sin 45.
#[test]
fn the_quaternion_is_that_of_the_attitude() {
    let half = 0.5f32.sqrt();
    for (r, known) in [
        (attitude(0.0, 0.0, 90.0), [half, 0.0, 0.0, half]),
        (attitude(0.0, 0.0, -90.0), [half, 0.0, 0.0, -half]),
        (attitude(90.0, 0.0, 0.0), [half, half, 0.0, 0.0]),
    ] {
        let found = started(&r).quaternion();
        assert!(found.iter().zip(known).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?} {known:?}");
    }
}

/// What is told of the doubt is what was set, up to the largest bias there is.
#[test]
fn the_doubt_of_a_bias_that_is_set_is_told() {
    let limit = Config::DEFAULT.bias.limit;
    let mut dcm = Dcm::new(Config::default());
    for (sigma, told) in [(0.001, 0.001), (0.05, 0.05), (limit, limit), (1.0, limit), (0.0, 0.0)] {
        dcm.set_bias(Vec3::new(0.01, 0.0, 0.0), sigma);
        let found = dcm.quality().bias_sigma;
        assert!((found - told).abs() < 1e-6 * told.max(1.0), "{sigma}: {found}");
    }
}

#[test]
fn a_heading_is_set_from_any_other() {
    for (before, asked) in [(50.0, 70.0), (50.0, -120.0), (-10.0, 10.0)] {
        let mut dcm = started(&attitude(10.0, -20.0, before));
        dcm.set_heading(f32::to_radians(asked));
        let e = dcm.euler();
        assert!((e.yaw.to_degrees() - asked).abs() < 0.01, "{before} {asked}: {}", e.yaw.to_degrees());
        assert!((e.roll.to_degrees() - 10.0).abs() < 0.01 && (e.pitch.to_degrees() + 20.0).abs() < 0.01, "{e:?}");
    }
}

/// A body that turns about the vertical and about its nose, with iron on its sensor.
fn settled() -> Dcm {
    let (mut dcm, mut r) = (Dcm::new(Config::default()), Mat3::identity());
    for k in 0..6_000 {
        let t = k as f32 * DT;
        let rate = Vec3::new((0.9 * t).sin(), 0.8 * (0.7 * t).cos(), 1.1 * (0.4 * t).sin());
        r = dcm::rotate(&r, &(rate * DT), dcm::Increment::Exponential);
        let rest = body::at_rest(&r, FIELD);
        dcm.update(DT, &Measurement { gyro: Some(rate), mag: rest.mag.map(|m| m + Vec3::new(0.0, 0.0, 15.0)), ..rest });
    }
    dcm
}

#[test]
fn what_was_learnt_of_the_field_can_be_forgotten() {
    let mut dcm = settled();
    assert!(dcm.flags().field_known && !dcm.flags().startup && dcm.quality().iron > 10.0, "{:?}", dcm.quality());
    let before = *dcm.matrix();
    dcm.forget_field();
    assert!(!dcm.flags().field_known && dcm.flags().startup && dcm.flags().heading_absolute);
    assert_eq!((dcm.iron(), dcm.quality().iron), (Vec3::zeros(), 0.0));
    assert_eq!(*dcm.matrix(), before, "the attitude stays");
}

/// Twice the time of the tilt's average, and once that of the heading where there is a field.
#[test]
fn start_up_lasts_as_long_as_the_averages_fill() {
    let config = Config::DEFAULT;
    for (field, until) in [(true, config.heading_tau), (false, 2.0 * config.tilt_tau)] {
        let mut dcm = Dcm::new(config);
        let mut rest = body::at_rest(&attitude(5.0, 6.0, 7.0), FIELD);
        if !field {
            rest.mag = None;
        }
        // the first rest sets the tilt anew; without it the averages fill once
        rest.gyro = None;
        let mut last = 0.0;
        for k in 1..2_000 {
            dcm.update(DT, &rest);
            if dcm.flags().startup {
                last = k as f32 * DT;
            }
        }
        let more = last - until;
        assert!((-0.1..2.0).contains(&more), "{field}: {last} s");
    }
}

/// A state with this matrix, and with the checksum that belongs to it (FNV-1a).
fn with_matrix(words: &[u32; STATE_WORDS], matrix: &Mat3) -> [u32; STATE_WORDS] {
    let mut words = *words;
    words.iter_mut().skip(1).zip(matrix.iter()).for_each(|(word, number)| *word = number.to_bits());
    let [_, numbers @ .., sum] = &mut words;
    *sum = numbers.iter().fold(0x811c_9dc5, |sum, word| (sum ^ *word).wrapping_mul(0x0100_0193));
    words
}

/// Up to a hundredth, and not at it, a matrix is taken for a rotation; a mirror is none.
#[test]
fn a_matrix_that_is_sheared_by_a_hundredth_is_no_rotation() {
    let mut dcm = started(&Mat3::identity());
    let words = dcm.save();
    let sheared = |by: f32| Mat3::new(1.0, by, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    assert_eq!(dcm.restore(&with_matrix(&words, &sheared(0.0099))), Ok(()));
    assert_eq!(dcm.restore(&with_matrix(&words, &sheared(0.01))), Err(StateError::NoRotation));
    let mirror = Mat3::from_diagonal(&Vec3::new(1.0, 1.0, -1.0));
    assert_eq!(dcm.restore(&with_matrix(&words, &mirror)), Err(StateError::NoRotation));
}
