//! Single steps of the classic filter, whose result is known.

use dcm::{Classic, ClassicConfig, Euler, Gains, Increment, Mat3, Measurement, STANDARD_GRAVITY, Vec3, matrix_of};

const DT: f32 = 0.01;

fn attitude(roll: f32, pitch: f32, yaw: f32) -> Mat3 {
    matrix_of(&Euler { roll: roll.to_radians(), pitch: pitch.to_radians(), yaw: yaw.to_radians() })
}

/// A force of `g` times gravity and a field, at rest at `r`.
fn rest(r: &Mat3, g: f32) -> Measurement {
    Measurement {
        gyro: None,
        accel: Some(r.transpose() * Vec3::new(0.0, 0.0, -g * STANDARD_GRAVITY)),
        mag: Some(r.transpose() * Vec3::new(20.0, 0.0, 43.0)),
    }
}

fn started(config: ClassicConfig, r: &Mat3) -> Classic {
    let mut classic = Classic::new(config);
    assert!(!classic.is_started());
    classic.update(DT, &rest(r, 1.0));
    assert!(classic.is_started());
    classic
}

#[test]
fn a_force_starts_it_and_a_field_alone_does_not() {
    let mut classic = Classic::new(ClassicConfig::TUNED);
    assert!(!classic.update(DT, &Measurement { accel: None, ..rest(&Mat3::identity(), 1.0) }).started);
    assert!(!classic.is_started());
    classic.update(DT, &rest(&Mat3::identity(), 1.0));
    assert!(classic.is_started());
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
        let found = started(ClassicConfig::TUNED, &r).quaternion();
        assert!(found.iter().zip(known).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?} {known:?}");
    }
}

#[test]
fn a_heading_is_counted_from_another_attitude() {
    for (own, other, known) in [(50.0, 20.0, 30.0), (-170.0, 170.0, 20.0), (10.0, 150.0, -140.0), (3.0, 3.0, 0.0)] {
        let classic = started(ClassicConfig::TUNED, &attitude(20.0, -30.0, own));
        let found = classic.heading_against(&attitude(20.0, -30.0, other)).to_degrees();
        assert!((found - known).abs() < 1e-2, "{own} {other}: {found}");
    }
}

/// Where the force is 1 g it counts in full, where it is half a g off or more not at all.
#[test]
fn the_razor_believes_a_force_by_its_length() {
    let turned = |config: ClassicConfig, g: f32| {
        let mut classic = started(config, &Mat3::identity());
        classic.update(DT, &Measurement { mag: None, ..rest(&attitude(2.0, 0.0, 0.0), g) });
        classic.euler().roll / turned_at_one(config)
    };
    fn turned_at_one(config: ClassicConfig) -> f32 {
        let mut classic = started(config, &Mat3::identity());
        classic.update(DT, &Measurement { mag: None, ..rest(&attitude(2.0, 0.0, 0.0), 1.0) });
        classic.euler().roll
    }
    for (g, share) in [(1.0, 1.0), (0.75, 0.5), (1.25, 0.5), (0.9, 0.8), (0.5, 0.0), (0.2, 0.0), (1.6, 0.0), (3.0, 0.0)] {
        let found = turned(ClassicConfig::RAZOR, g);
        assert!((found - share).abs() < 0.01, "{g} g: {found}");
        let always = turned(ClassicConfig::TUNED, g);
        assert!((always - 1.0).abs() < 0.01, "{g} g: {always}, tuned: always");
    }
}

/// The tuned gains are slow in tilt and heading: the Razor's take off more than 99 % in four seconds, the tuned ones leave half.
#[test]
fn the_tuned_heading_is_slow() {
    let left = |config: ClassicConfig| {
        let mut classic = started(config, &attitude(0.0, 0.0, 20.0));
        (0..400).for_each(|_| {
            classic.update(DT, &rest(&Mat3::identity(), 1.0));
        });
        classic.euler().yaw.to_degrees() / 20.0
    };
    let (razor, tuned) = (left(ClassicConfig::RAZOR), left(ClassicConfig::TUNED));
    assert!(razor.abs() < 0.01 && tuned > 0.5, "{razor} {tuned}");
    let gains = |kp: f32| ClassicConfig { yaw: Gains { kp, ki: 0.0 }, ..ClassicConfig::TUNED };
    assert!((left(gains(0.25)) - (-1f32).exp()).abs() < 0.01, "a gain of a quarter: once e in four seconds");
}

/// One radian in a step is a turn, and more is none.
#[test]
fn a_turn_of_more_than_a_radian_is_none() {
    let turn = |rate: f32| {
        let config = ClassicConfig { increment: Increment::Exponential, ..ClassicConfig::TUNED };
        let mut classic = started(config, &Mat3::identity());
        let step = classic.update(0.25, &Measurement { gyro: Some(Vec3::new(0.0, 0.0, rate)), ..Measurement::default() });
        assert_eq!(step.bad_input, !step.gyro_used);
        (step.gyro_used, classic.euler().yaw)
    };
    let (used, yaw) = turn(4.0);
    assert!(used && (yaw - 1.0).abs() < 1e-3, "{used} {yaw}");
    assert_eq!(turn(4.8), (false, 0.0));
    assert_eq!(turn(6.0), (false, 0.0));
}

#[test]
fn the_longest_step_is_no_gap() {
    let longest = ClassicConfig::TUNED.max_dt;
    let gap = |dt: f32| started(ClassicConfig::TUNED, &Mat3::identity()).update(dt, &rest(&Mat3::identity(), 1.0)).started;
    assert_eq!([gap(longest), gap(1.01 * longest)], [false, true]);
}

#[test]
fn a_bias_beyond_its_limit_is_cut_to_it() {
    let mut classic = Classic::new(ClassicConfig { bias_limit: 0.1, ..ClassicConfig::TUNED });
    classic.set_bias(Vec3::new(0.3, -0.3, 0.05));
    assert_eq!(classic.bias(), Vec3::new(0.1, -0.1, 0.05));
    classic.set_bias(Vec3::new(0.1, -0.1, f32::NAN));
    assert_eq!(classic.bias(), Vec3::new(0.1, -0.1, 0.0));
}
