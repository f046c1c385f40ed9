//! Input, settings and saved states that no sensor and no sane caller gives: the filter stays a filter.

mod body;

use dcm::{BiasConfig, Classic, ClassicConfig, Config, Dcm, Euler, Mat3, Measurement, STATE_WORDS, StateError, Vec3, matrix_of};
use proptest::prelude::*;

const FIELD: [f32; 3] = [20.0, 0.0, 43.0];
const DT: f32 = 1.0 / 200.0;

fn at_rest(r: &Mat3) -> Measurement {
    body::at_rest(r, FIELD)
}

fn heading(degrees: f32) -> Mat3 {
    matrix_of(&Euler { roll: 0.0, pitch: 0.0, yaw: degrees.to_radians() })
}

/// Rows of unit length at right angles; false where a number is none.
fn is_rotation(m: &Mat3) -> bool {
    (m * m.transpose() - Mat3::identity()).iter().all(|e| e.abs() < 1e-3)
}

/// Readings that turn over from one to the next have no mean, and so no heading: none is made up.
#[test]
fn fields_that_cancel_are_no_heading() {
    let mut dcm = Dcm::new(Config::default());
    let level = at_rest(&Mat3::identity());
    dcm.update(DT, &level);
    for k in 0..2_000 {
        let mag = Vec3::new(if k % 2 == 0 { 20.0 } else { -20.0 }, 0.0, 0.0);
        dcm.update(DT, &Measurement { mag: Some(mag), ..level });
        assert!(is_rotation(dcm.matrix()), "step {k}: {}", dcm.matrix());
        let q = dcm.quality();
        assert!([q.heading_error, q.field_norm, q.field_dip].iter().all(|v| v.is_finite()), "step {k}: {q:?}");
    }
    assert!((0..3).all(|i| dcm.bias()[i].is_finite()));
    for _ in 0..4_000 {
        dcm.update(DT, &level);
    }
    assert!(dcm.euler().yaw.abs().to_degrees() < 1.0, "{}", dcm.euler().yaw.to_degrees());
}

/// A heading counts as an angle, however many turns are in it.
#[test]
fn a_heading_of_many_turns_is_the_same_heading() {
    for (asked, seen) in [(370.0f32, 10.0f32), (-3_590.0, 10.0), (36_010.0, 10.0), (-190.0, 170.0)] {
        let mut dcm = Dcm::new(Config::default());
        dcm.update(DT, &Measurement { mag: None, ..at_rest(&heading(0.0)) });
        dcm.set_heading(asked.to_radians());
        let off = (dcm.euler().yaw.to_degrees() - seen).abs();
        assert!(off < 0.01, "{asked}: {}", dcm.euler().yaw.to_degrees());
    }
    let mut dcm = Dcm::new(Config::default());
    dcm.update(DT, &at_rest(&heading(0.0)));
    for yaw in [f32::MAX, f32::MIN, 1e9, f32::NAN, f32::INFINITY] {
        dcm.set_heading(yaw);
        assert!(is_rotation(dcm.matrix()), "{yaw}: {}", dcm.matrix());
    }
}

/// A limit that is none (negative, zero, not a number) stops nothing.
#[test]
fn limits_that_are_none_do_not_panic() {
    for limit in [-1.0, 0.0, f32::NAN, f32::INFINITY] {
        let mut dcm = Dcm::new(Config { bias: BiasConfig { limit, ..Config::DEFAULT.bias }, ..Config::DEFAULT });
        let mut classic = Classic::new(ClassicConfig { bias_limit: limit, ..ClassicConfig::RAZOR });
        for sigma in [0.0, -1.0, f32::NAN] {
            dcm.set_bias(Vec3::new(0.1, -0.1, f32::NAN), sigma);
            classic.set_bias(Vec3::new(0.1, -0.1, f32::NAN));
            for _ in 0..10 {
                dcm.update(DT, &at_rest(&heading(10.0)));
                classic.update(DT, &at_rest(&heading(10.0)));
            }
        }
    }
}

#[test]
fn words_that_are_no_state_are_refused() {
    let mut dcm = Dcm::new(Config::default());
    dcm.update(DT, &at_rest(&heading(3.0)));
    let (good, before) = (dcm.save(), dcm);
    let mut words = good;
    words[0] ^= 1;
    assert_eq!(dcm.restore(&words), Err(StateError::Version(words[0])));
    words = good;
    words[7] = f32::NAN.to_bits();
    assert_eq!(dcm.restore(&words), Err(StateError::NotFinite(7)));
    words = good;
    words[1] = 0.5f32.to_bits();
    assert_eq!(dcm.restore(&words), Err(StateError::NoRotation));
    words = good;
    words[60] ^= 1;
    assert_eq!(dcm.restore(&words), Err(StateError::Damaged));
    assert_eq!(dcm, before);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// Everything that the sensors' ranges allow, rails and zeros among it: a rotation all along, and right again after it.
    #[test]
    fn readings_within_the_ranges_poison_nothing(
        steps in proptest::collection::vec((0u8..4, -1f32..=1.0, -1f32..=1.0, -1f32..=1.0, 0u8..8), 1..400),
    ) {
        let truth = heading(30.0);
        let mut dcm = Dcm::new(Config::default());
        dcm.update(DT, &at_rest(&truth));
        for (kind, x, y, z, missing) in steps {
            // as drawn, at the rails, nothing at all, one axis alone
            let v = match kind {
                0 => Vec3::new(x, y, z),
                1 => Vec3::new(x.signum(), y.signum(), z.signum()),
                2 => Vec3::zeros(),
                _ => Vec3::new(x, 0.0, 0.0),
            };
            let part = |bit: u8, range: f32| (missing & bit == 0).then_some(v * range);
            let measured = Measurement { gyro: part(1, 34.9), accel: part(2, 156.9), mag: part(4, 1000.0) };
            dcm.update(DT, &measured);
            prop_assert!(is_rotation(dcm.matrix()), "{measured:?}: {}", dcm.matrix());
        }
        prop_assert!(dcm.save()[1..STATE_WORDS - 1].iter().all(|w| f32::from_bits(*w).is_finite()));
        // a field that is taken for disturbed is held for a minute, then believed by half
        let rest = at_rest(&truth);
        for _ in 0..40_000 {
            dcm.update(DT, &rest);
        }
        let off = dcm.heading_against(&truth).abs().to_degrees();
        prop_assert!(off < 1.0 && dcm.gravity().z > 0.999, "{off} {}", dcm.gravity());
    }
}
