//! When a body is said to rest.

mod body;

use dcm::{Config, Dcm, Euler, Mat3, Measurement, RestConfig, STANDARD_GRAVITY, Vec3, matrix_of};

const DT: f32 = 0.01;
const DEGREE: f32 = std::f32::consts::PI / 180.0;

/// A level body without a field, for five seconds; rate and force may have more in them at each step. Whether it rests at last.
fn rests(dcm: &mut Dcm, more: impl Fn(u32) -> (Vec3, Vec3)) -> bool {
    for k in 0..500 {
        let (rate, push) = more(k);
        let accel = Some(Vec3::new(0.0, 0.0, -STANDARD_GRAVITY) + push);
        dcm.update(DT, &Measurement { gyro: Some(rate), accel, mag: None });
    }
    dcm.flags().rest
}

/// To and fro, five times a second.
fn alternating(size: f32) -> impl Fn(u32) -> f32 {
    move |k| if (k / 10).is_multiple_of(2) { size } else { -size }
}

/// Two degrees a second are allowed about the mean.
#[test]
fn a_rate_that_shakes_is_no_rest() {
    let shakes = |size: f32| {
        let rate = alternating(size * DEGREE);
        rests(&mut Dcm::new(Config::default()), |k| (Vec3::new(rate(k), 0.0, 0.0), Vec3::zeros()))
    };
    assert_eq!([1.0, 3.0, 10.0].map(shakes), [true, false, false]);
}

/// Half a metre per second squared is allowed about the mean.
#[test]
fn a_force_that_shakes_is_no_rest() {
    let shakes = |size: f32| {
        let push = alternating(size);
        rests(&mut Dcm::new(Config::default()), |k| (Vec3::zeros(), Vec3::new(push(k), 0.0, 0.0)))
    };
    assert_eq!([0.3, 0.7, 2.0].map(shakes), [true, false, false]);
}

/// A bias that is known: two degrees a second beside it are motion. Unknown, they may be the bias.
#[test]
fn a_slow_turn_is_motion_once_the_bias_is_known() {
    let turns = |known: bool, rate: f32| {
        let mut dcm = Dcm::new(Config::default());
        if known {
            dcm.set_bias(Vec3::new(0.0, 0.0, DEGREE), 0.0);
        }
        rests(&mut dcm, |_| (Vec3::new(0.0, 0.0, rate * DEGREE), Vec3::zeros()))
    };
    assert_eq!([2.5, 3.5, -1.5, 8.0].map(|rate| turns(true, rate)), [true, false, false, false]);
    assert_eq!([2.5, 3.5, 8.0, 11.0].map(|rate| turns(false, rate)), [true, true, true, false]);
}

/// Nothing is allowed, and nothing moves.
#[test]
fn a_sensor_without_noise_rests_whatever_is_allowed() {
    let rest = RestConfig { rate: 0.0, force: 0.0, ..Config::DEFAULT.rest };
    assert!(rests(&mut Dcm::new(Config { rest, ..Config::DEFAULT }), |_| (Vec3::new(0.0, 0.0, DEGREE), Vec3::zeros())));
}

#[test]
fn rest_is_said_after_its_time_and_anew_after_a_gap() {
    let mut dcm = Dcm::new(Config::default());
    let level = Measurement { mag: None, ..body::at_rest(&Mat3::identity(), [20.0, 0.0, 43.0]) };
    let mut waited = |first: f32| {
        dcm.update(first, &level);
        let restless = (0..1_000).take_while(|_| {
            let rests = dcm.flags().rest;
            dcm.update(DT, &level);
            !rests
        });
        restless.count() as f32 * DT
    };
    let (start, gap) = (waited(DT), waited(1.0));
    let time = Config::DEFAULT.rest.time;
    assert!((start - time).abs() < 0.06 && (gap - time).abs() < 0.06, "{start} {gap}");
}

/// The first rest sets the tilt, because nothing was known of the bias before. A later one does only where it is more than ten degrees off.
#[test]
fn a_later_rest_sets_the_tilt_only_where_it_is_far_off() {
    let mut dcm = Dcm::new(Config::default());
    let mut starts = |roll: f32| {
        let r = matrix_of(&Euler { roll: roll.to_radians(), pitch: 0.0, yaw: 0.0 });
        let rest = Measurement { mag: None, ..body::at_rest(&r, [20.0, 0.0, 43.0]) };
        (0..1_000).filter(|_| dcm.update(DT, &rest).started).count()
    };
    assert_eq!(starts(0.0), 2, "at the first force, and at the first rest");
    assert_eq!(starts(0.0), 0, "and no more");
    assert_eq!(starts(5.0), 0, "five degrees, which no gyro has told");
    assert_eq!(starts(65.0), 1, "sixty degrees");
}
