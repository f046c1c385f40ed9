//! Calibrations whose result is known in closed form, and what is refused by a hair.

use dcm::calibration::{
    Calibration, CalibrationError, Collector, GyroZero, alignment, coverage, ellipsoid, six_positions, three_positions,
};
use dcm::{Euler, Mat3, STANDARD_GRAVITY, Vec3, matrix_of};

fn near(a: f32, b: f32, share: f32) -> bool {
    (a - b).abs() <= share * b.abs()
}

#[test]
fn every_number_of_a_calibration_has_its_place() {
    let calibration = Calibration {
        gyro_offset: Vec3::new(0.1, 0.2, 0.3),
        accel_offset: Vec3::new(1.0, -2.0, 3.0),
        accel_matrix: Mat3::new(2.0, 0.0, 1.0, 0.0, 3.0, 0.0, 0.0, 0.0, 4.0),
        ..Calibration::default()
    };
    assert_eq!(calibration.gyro(&Vec3::new(1.1, 2.2, 3.3)), Vec3::new(1.1 - 0.1, 2.2 - 0.2, 3.3 - 0.3));
    assert_eq!(calibration.accel(&Vec3::new(2.0, -1.0, 5.0)), Vec3::new(2.0 + 2.0, 3.0, 8.0));
}

/// A hundred readings, half of them above and half below the zero by one.
#[test]
fn the_zero_of_a_hundred_readings_has_its_textbook_error() {
    let zero = Vec3::new(3.0, -2.0, 0.5);
    let mut collected = GyroZero::default();
    for k in 0..100u32 {
        if k == 99 {
            assert_eq!(collected.finish(2.0), Err(CalibrationError::TooFew { found: 99, needed: 100 }));
        }
        assert_eq!(collected.count(), k);
        collected.add(&(zero + Vec3::repeat(if k % 2 == 0 { 1.0 } else { -1.0 })));
    }
    collected.add(&Vec3::repeat(f32::NAN));
    assert_eq!(collected.count(), 100, "what is no number is not counted");
    let (mean, sigma) = collected.finish(2.0).unwrap();
    let known = (100f32 / 99.0).sqrt() / 10.0;
    assert!((mean - zero).abs().max() < 1e-5 && sigma.iter().all(|s| near(*s, known, 1e-4)), "{mean} {sigma}");
}

#[test]
fn a_sensor_without_noise_is_at_rest_whatever_is_allowed() {
    let mut collected = GyroZero::default();
    (0..100).for_each(|_| collected.add(&Vec3::repeat(0.25)));
    assert_eq!(collected.finish(0.0), Ok((Vec3::repeat(0.25), Vec3::zeros())));
}

/// Each axis up and down, gain 1, and what it reads across.
fn six(offset: Vec3, across: [Vec3; 6]) -> [Vec3; 6] {
    core::array::from_fn(|i| {
        let mut up = offset + across[i];
        up[i / 2] += if i % 2 == 0 { STANDARD_GRAVITY } else { -STANDARD_GRAVITY };
        up
    })
}

/// What each reading has across its axis by itself is left: six of eighteen numbers.
#[test]
fn the_residual_of_six_positions_is_what_lies_across() {
    let e = 0.3;
    let across = [Vec3::y(), -Vec3::y(), Vec3::z(), -Vec3::z(), Vec3::x(), -Vec3::x()].map(|v| v * e);
    let found = six_positions(&six(Vec3::new(0.5, -0.25, 1.0), across), 0.2).unwrap();
    assert!(near(found.residual, e / 3f32.sqrt(), 1e-4), "{}", found.residual);
    // offset and gain are half the sum and half the difference of two readings
    assert!(found.offset_sigma.iter().all(|s| near(*s, 0.2 / 2f32.sqrt(), 1e-5)), "{}", found.offset_sigma);
    assert!(found.gain_sigma.iter().all(|s| near(*s, 0.2 / 2f32.sqrt() / STANDARD_GRAVITY, 1e-5)), "{}", found.gain_sigma);
}

#[test]
fn an_offset_of_many_g_does_no_harm() {
    let offset = Vec3::new(400.0, -300.0, 200.0);
    let found = six_positions(&six(offset, [Vec3::zeros(); 6]), 0.1).unwrap();
    assert!((found.offset - offset).abs().max() < 1e-3 && (found.gain - Vec3::repeat(1.0)).abs().max() < 1e-4);
}

/// A position may lean by thirty degrees and no further.
#[test]
fn a_position_that_leans_is_refused_by_its_number() {
    let leaning = |level: f32, up: f32| {
        let mut readings = [Vec3::x(), -Vec3::x(), Vec3::y(), -Vec3::y(), Vec3::z(), -Vec3::z()].map(|v| v * 3.0);
        (readings[2], readings[3]) = (Vec3::new(0.0, up, level), Vec3::new(0.0, -up, -level));
        six_positions(&readings, 0.1).map(|_| ())
    };
    let refused = Err(CalibrationError::Position { index: 2 });
    assert_eq!([leaning(1.0, 3.0), leaning(3f32.sqrt(), 3.0), leaning(1.8, 3.0)], [Ok(()), Ok(()), refused]);
    assert_eq!(leaning(2.5, 3.0), refused);
    let mut upside_down = six(Vec3::zeros(), [Vec3::zeros(); 6]);
    upside_down.swap(4, 5);
    assert_eq!(six_positions(&upside_down, 0.1), Err(CalibrationError::Position { index: 4 }));
}

#[test]
fn a_board_at_45_degrees_has_no_axis_up() {
    let at = |x: f32| three_positions(&[Vec3::new(x, 0.0, 1.0), Vec3::x(), Vec3::y()]).map(|_| ());
    assert_eq!([at(0.9), at(1.0)], [Ok(()), Err(CalibrationError::Position { index: 0 })]);
}

#[test]
fn the_collector_keeps_what_is_as_far_apart_as_it_asks() {
    let mut store = Collector::new(100.0);
    assert!(store.add(&Vec3::zeros()) && !store.add(&Vec3::new(20.0, 0.0, 0.0)));
    assert!(store.add(&Vec3::new(0.21 * 100.0, 0.0, 0.0)), "12 degrees of a hundred");
}

/// A component of nothing counts as one that is positive.
#[test]
fn directions_on_a_border_count_once() {
    let share = |vectors: &[[f32; 3]]| 24.0 * coverage(vectors.iter().map(|v| Vec3::from(*v)));
    assert_eq!(share(&[[1.0, 0.5, 0.2], [1.0, 0.5, 0.0]]), 1.0);
    assert_eq!(share(&[[1.0, 0.5, -0.2], [1.0, 0.5, 0.0]]), 2.0);
    assert_eq!(share(&[[1.0, 0.5, -0.2], [1.0, 0.5, 0.2], [1.0, 0.5, 0.0]]), 2.0);
}

/// Attitudes of many kinds, with what a magnetometer with true axes reads at each of the dips.
fn pairs(dips: &[f32]) -> Vec<(Vec3, Vec3)> {
    let attitudes = [(0.0, 0.0), (90.0, 0.0), (180.0, 0.0), (-90.0, 0.0), (0.0, 60.0), (0.0, -60.0), (45.0, 30.0), (-45.0, 30.0)];
    let angle = |k: usize| 70f32.to_radians() * k as f32;
    let all = attitudes.iter().enumerate().flat_map(|(k, (roll, pitch))| dips.iter().map(move |dip| (k, roll, pitch, dip)));
    all.map(|(k, roll, pitch, dip)| {
        let r = matrix_of(&Euler { roll: f32::to_radians(*roll), pitch: f32::to_radians(*pitch), yaw: angle(k) });
        let (down, north) = dip.to_radians().sin_cos();
        (r.transpose() * Vec3::new(0.0, 0.0, -STANDARD_GRAVITY), r.transpose() * Vec3::new(north, 0.0, down))
    })
    .collect()
}

/// Every attitude once with a dip too large and once with one too small: no rotation explains it, and it is left.
#[test]
fn the_residual_of_an_alignment_is_an_error_of_the_dip() {
    let off = 0.5f32;
    let found = alignment(&pairs(&[60.0 - off, 60.0 + off])).unwrap();
    assert!(near(found.residual.to_degrees(), off, 0.01), "{}", found.residual.to_degrees());
    assert!(found.angle.abs().max() < 2e-3, "{found:?}");
}

#[test]
fn eight_attitudes_are_enough_and_seven_too_few() {
    let pairs = pairs(&[60.0]);
    assert!(alignment(&pairs).is_ok());
    assert_eq!(alignment(&pairs[1..]), Err(CalibrationError::TooFew { found: 7, needed: 8 }));
}

/// Twice the error of the dips, half of what is found of the certainty that is asked for.
#[test]
fn an_alignment_that_is_uncertain_is_refused_by_how_much() {
    let found = |off: f32| match alignment(&pairs(&[60.0 - off, 60.0 + off])) {
        Err(CalibrationError::Coverage { found }) => found,
        other => panic!("{off}: {other:?}"),
    };
    let (once, twice) = (found(1.0), found(2.0));
    assert!((0.1..1.0).contains(&once) && near(twice, once / 2.0, 0.05), "{once} {twice}");
}

/// The 48 points whose coordinates are 2, 3 and 6 in any order and with any sign: a sphere of radius 7, two in each of the 24 parts.
fn lattice() -> Vec<Vec3> {
    let orders = [[2, 3, 6], [2, 6, 3], [3, 2, 6], [3, 6, 2], [6, 2, 3], [6, 3, 2]];
    let signs = (0..8).map(|k| [1, 2, 4].map(|bit| if k & bit == 0 { 1.0 } else { -1.0 }));
    signs.flat_map(|s| orders.map(|o| Vec3::new(s[0] * o[0] as f32, s[1] * o[1] as f32, s[2] * o[2] as f32))).collect()
}

#[test]
fn a_sphere_of_whole_numbers_is_found() {
    let found = ellipsoid(&lattice()).unwrap();
    assert!(found.offset.abs().max() < 1e-5 && (found.matrix - Mat3::identity()).abs().max() < 1e-5, "{found:?}");
    assert!(near(found.norm, 7.0, 1e-5) && found.residual < 1e-4 && found.coverage == 1.0, "{found:?}");
}

/// Readings with an error each, more of them on one side.
fn uneven() -> Vec<Vec3> {
    let mut readings = lattice();
    readings.extend(lattice().into_iter().filter(|m| m.z > 5.0).flat_map(|m| [m; 9]));
    let error = |k: usize| 1.0 + 0.02 * ((k * k) as f32 * 0.7).sin();
    readings.iter().enumerate().map(|(k, m)| m * error(k) + Vec3::new(4.0, 5.0, 6.0)).collect()
}

/// A power of two in front of all readings is in front of all that has their unit, bit by bit.
#[test]
fn the_unit_of_the_readings_does_not_matter() {
    let one = ellipsoid(&uneven()).unwrap();
    for unit in [2f32.powi(56), 2f32.powi(-40)] {
        let readings: Vec<Vec3> = uneven().iter().map(|m| m * unit).collect();
        let found = ellipsoid(&readings).unwrap();
        assert_eq!((found.offset, found.offset_sigma), (one.offset * unit, one.offset_sigma * unit));
        assert_eq!((found.norm, found.residual), (one.norm * unit, one.residual * unit));
        assert_eq!((found.matrix, found.matrix_sigma, found.coverage), (one.matrix, one.matrix_sigma, one.coverage));
    }
}

/// What is said of the distance from the sphere is what the readings say.
#[test]
fn the_residual_of_an_ellipsoid_is_the_distance_from_its_sphere() {
    let readings = uneven();
    let found = ellipsoid(&readings).unwrap();
    let length = |m: &Vec3| {
        let u = found.matrix * (m - found.offset);
        u.dot(&u).sqrt()
    };
    let square: f32 = readings.iter().map(|m| (length(m) - found.norm).powi(2)).sum();
    let known = (square / readings.len() as f32).sqrt();
    assert!(near(found.residual, known, 1e-3) && known > 0.02, "{} {known}", found.residual);
}

#[test]
fn forty_readings_are_enough() {
    let some: Vec<Vec3> = lattice().into_iter().skip(8).collect();
    assert!(ellipsoid(&some).is_ok(), "{:?}", ellipsoid(&some));
    assert_eq!(ellipsoid(&some[1..]), Err(CalibrationError::TooFew { found: 39, needed: 40 }));
}

#[test]
fn what_lies_on_no_ellipsoid_is_refused() {
    let shells: Vec<Vec3> = lattice().into_iter().flat_map(|m| [m, m * 2.0]).collect();
    assert_eq!(ellipsoid(&shells), Err(CalibrationError::NoFit));
    assert_eq!(ellipsoid(&[Vec3::x(); 100]), Err(CalibrationError::NoFit), "a point");
}

/// Three quarters of all directions, and one part less.
#[test]
fn three_quarters_of_all_directions_are_enough() {
    let seen = |parts: usize| -> Vec<Vec3> {
        // a part has an axis that is the longest, and three signs
        let part = |m: &Vec3| {
            let axis = (0..3).find(|axis| m[*axis].abs() == 6.0).unwrap_or(0);
            (0..3).filter(|k| m[*k] < 0.0).fold(axis, |part, k| part + (3 << k))
        };
        lattice().into_iter().filter(|m| part(m) < parts).flat_map(|m| [m; 2]).collect()
    };
    assert_eq!(ellipsoid(&seen(18)).map(|found| found.coverage), Ok(0.75));
    assert_eq!(ellipsoid(&seen(17)).map(|found| found.coverage), Err(CalibrationError::Coverage { found: 17.0 / 24.0 }));
}

/// Points at these angles about the vertical, degrees, so high above its middle.
fn circle(angles: &[f32], high: f32) -> impl Iterator<Item = Vec3> {
    let level = (1.0 - high * high).sqrt();
    angles.iter().map(move |angle| Vec3::new(level * angle.to_radians().cos(), level * angle.to_radians().sin(), high))
}

/// Two circles lie on many ellipsoids. Where they show three quarters of all directions none is missing, and still there is no fit.
#[test]
fn circles_are_refused_for_what_they_lack() {
    let all = [10.0, 170.0, 190.0, 350.0, 80.0, 100.0, 260.0, 280.0, 45.0, 135.0, 225.0, 315.0];
    let some = [10.0, 190.0, 80.0, 100.0, 260.0, 280.0];
    let away = Vec3::new(40.0, 20.0, -60.0);
    let fit = |points: &mut dyn Iterator<Item = Vec3>| ellipsoid(&points.map(|m| m * 8.0 + away).collect::<Vec<_>>());
    let pairs = circle(&all, 0.6).chain(circle(&all, -0.6));
    assert_eq!(fit(&mut pairs.flat_map(|m| [m; 2])), Err(CalibrationError::NoFit), "all directions");
    let pairs = circle(&some, 0.6).flat_map(|m| [m; 2]).chain(circle(&all, -0.6));
    assert_eq!(fit(&mut pairs.flat_map(|m| [m; 2])), Err(CalibrationError::NoFit), "three quarters of them");
    let flat = circle(&all, 0.0).flat_map(|m| [m; 4]);
    assert_eq!(fit(&mut flat.into_iter()), Err(CalibrationError::Coverage { found: 8.0 / 24.0 }), "a table");
}

/// What a sensor reads whose axes are as long as these, in directions that are even.
fn stretched(axes: [f32; 3], readings: usize) -> (Mat3, Vec<Vec3>) {
    let turn = matrix_of(&Euler { roll: 0.5, pitch: 0.6, yaw: 0.7 });
    let soft = turn * Mat3::from_diagonal(&Vec3::from(axes)) * turn.transpose();
    let direction = |k: usize| {
        let down = 1.0 - (2 * k + 1) as f32 / readings as f32;
        let (north, east) = (2.399_963_2 * k as f32).sin_cos(); // the golden angle
        Vec3::new(north, east, 0.0) * (1.0 - down * down).sqrt() + Vec3::z() * down
    };
    (soft, (0..readings).map(|k| soft * direction(k) * 48.0 + Vec3::new(10.0, -20.0, 30.0)).collect())
}

/// Discs and cigars, down to a fifth: nothing is left but rounding.
#[test]
fn an_ellipsoid_without_noise_is_found_whatever_its_shape() {
    for axes in [[1.0, 1.0, 0.5], [1.0, 1.0, 0.2], [1.0, 0.5, 0.5], [1.0, 0.2, 0.2], [1.0, 0.5, 0.25], [1.0, 0.1, 0.1]] {
        for n in [60, 200] {
            let (soft, readings) = stretched(axes, n);
            let found = ellipsoid(&readings).unwrap();
            let round = found.matrix * soft;
            assert!((round / round.m11 - Mat3::identity()).abs().max() < 2e-6, "{axes:?} {n}: {round}");
            assert!(near(found.norm, 48.0 * (axes[0] * axes[1] * axes[2]).cbrt(), 1e-5), "{axes:?} {n}: {}", found.norm);
            assert!(found.residual < 5e-7 * found.norm, "{axes:?} {n}: {}", found.residual / found.norm);
        }
    }
}
