//! What the filter says of itself: innovation, state of the field's gate, doubt of the bias; six axes beside nine.

use dcm::{Config, Dcm, Euler, Increment, Mat3, Measurement, STANDARD_GRAVITY, Vec3, matrix_of, rotate};

const FIELD: [f32; 3] = [20.0, 0.0, 43.0];
const DT: f32 = 1.0 / 200.0;

fn heading(yaw_deg: f32) -> Mat3 {
    matrix_of(&Euler { roll: 0.0, pitch: 0.0, yaw: yaw_deg.to_radians() })
}

/// Ideal readings of a body that turns about the vertical, in a field of its own.
fn turning(yaw_deg: f32, rate_deg_s: f32, field: [f32; 3]) -> Measurement {
    let r = heading(yaw_deg);
    Measurement {
        gyro: Some(Vec3::new(0.0, 0.0, rate_deg_s.to_radians())),
        accel: Some(Vec3::new(0.0, 0.0, -STANDARD_GRAVITY)),
        mag: Some(r.transpose() * Vec3::from(field)),
    }
}

/// Three seconds of rest, then turning at 60 deg/s for half a minute: a whole number of turns, the field is known.
fn settled() -> Dcm {
    let mut dcm = Dcm::new(Config::default());
    for _ in 0..600 {
        dcm.update(DT, &turning(0.0, 0.0, FIELD));
    }
    for k in 1..=6_000u16 {
        dcm.update(DT, &turning(60.0 * DT * f32::from(k), 60.0, FIELD));
    }
    dcm
}

#[test]
fn a_filter_without_field_runs_beside_one_with_it() {
    let (mut nine, mut six) = (Dcm::new(Config::default()), Dcm::new(Config::default()));
    for _ in 0..200 {
        let m = turning(77.0, 0.0, FIELD);
        nine.update(DT, &m);
        six.update(DT, &Measurement { mag: None, ..m });
    }
    assert!(nine.heading_is_absolute() && !six.heading_is_absolute());
    let apart = nine.heading_against(six.matrix()).to_degrees();
    assert!((apart - 77.0).abs() < 0.01, "{apart}");
}

#[test]
fn doubt_of_the_bias_shrinks_at_rest() {
    let mut dcm = Dcm::new(Config::default());
    let before = dcm.quality().bias_sigma;
    for _ in 0..1000 {
        dcm.update(DT, &turning(0.0, 0.0, FIELD));
    }
    let after = dcm.quality().bias_sigma;
    assert!((before - Config::DEFAULT.bias.limit).abs() < 1e-6 && after < 0.12 * before, "{before} {after}");
}

#[test]
fn the_gate_and_its_numbers_show_a_stronger_and_a_steeper_field() {
    let good = settled();
    assert!(good.flags().field_known && !good.flags().field_disturbed && !good.flags().startup);
    assert!(good.quality().field_norm.abs() < 1e-3 && good.quality().field_dip.abs() < 1e-3);
    for (field, norm, dip) in [(FIELD.map(|f| 1.3 * f), 0.3, 0.0f32), ([43.0, 0.0, 20.0], 0.0, -40.11)] {
        let mut dcm = good;
        for _ in 0..400 {
            dcm.update(DT, &turning(0.0, 0.0, field));
        }
        let q = dcm.quality();
        assert!(dcm.flags().field_disturbed, "{field:?}");
        assert!((q.field_norm - norm).abs() < 0.01 && (q.field_dip.to_degrees() - dip).abs() < 0.5, "{field:?}: {q:?}");
    }
}

#[test]
fn the_innovation_is_what_the_field_says_against_the_heading() {
    let mut dcm = settled();
    let turned = heading(-10.0) * Vec3::from(FIELD);
    for _ in 0..20 {
        dcm.update(DT, &turning(0.0, 0.0, turned.into()));
    }
    let off = dcm.quality().heading_error.to_degrees();
    assert!((off - 10.0).abs() < 0.5, "{off}");
}

/// Six axes: the tilt of a body that turns about all axes, and the bias, seen through gravity alone.
#[test]
fn without_field_tilt_and_bias_are_found_in_motion_and_start_up_ends() {
    let bias = Vec3::new(0.02, -0.03, 0.015);
    let (mut dcm, mut truth, mut worst) = (Dcm::new(Config::default()), heading(30.0), 0.0f32);
    for k in 0..60_000u16 {
        let t = f32::from(k) * DT;
        let rate = Vec3::new((0.9 * t).sin(), 0.8 * (0.7 * t).cos(), 1.1 * (0.4 * t).sin());
        for _ in 0..8 {
            truth = rotate(&truth, &(rate * (DT / 8.0)), Increment::Exponential);
        }
        let accel = truth.transpose() * Vec3::new(0.0, 0.0, -STANDARD_GRAVITY);
        let step = dcm.update(DT, &Measurement { gyro: Some(rate + bias), accel: Some(accel), mag: None });
        assert!(!step.mag_used && !step.bad_input);
        if k > 30_000 {
            let across = dcm.gravity().cross(&truth.row(2).transpose());
            worst = worst.max(across.dot(&across).sqrt().asin().to_degrees());
        }
    }
    let off = dcm.bias() - bias;
    println!("six axes in motion: tilt within {worst:.2} degrees, bias off by {off:?}");
    assert!(worst < 0.5 && off.abs().max() < 3e-3, "{worst} {off}");
    assert!(!dcm.flags().startup && !dcm.heading_is_absolute());
}

/// The first rest sets the attitude anew, because the bias was not known before; where the field is disturbed just then, its heading is
/// not taken.
#[test]
fn the_first_rest_beside_a_magnet_keeps_the_heading() {
    let mut dcm = Dcm::new(Config::default());
    for k in 1..=6_000u16 {
        dcm.update(DT, &turning(60.0 * DT * f32::from(k), 60.0, FIELD));
    }
    assert!(dcm.flags().field_known && !dcm.flags().field_disturbed && !dcm.flags().rest);
    let mut worst = 0.0f32;
    for _ in 0..2_000 {
        dcm.update(DT, &turning(0.0, 0.0, [20.0, 25.0, 43.0]));
        worst = worst.max(dcm.euler().yaw.abs().to_degrees());
    }
    assert!(dcm.flags().rest && dcm.flags().field_disturbed, "{:?}", dcm.flags());
    assert!(worst < 2.0, "{worst}");
    for _ in 0..12_000 {
        dcm.update(DT, &turning(0.0, 0.0, FIELD));
    }
    assert!(!dcm.flags().field_disturbed && dcm.euler().yaw.abs().to_degrees() < 0.5);
}
