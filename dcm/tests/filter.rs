//! The filter against simulated bodies whose attitude is known.

mod body;

use dcm::{
    Config, Dcm, Earth, Euler, Increment, Mat3, Measurement, STANDARD_GRAVITY, STATE_WORDS, Standard, Vec3, matrix_of, rotate,
};
use proptest::prelude::*;

/// North, east and down part of a field with a dip of 65 degrees, uT.
const FIELD: [f32; 3] = [20.0, 0.0, 43.0];
const DT: f32 = 1.0 / 200.0;

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

/// A body that turns about all axes.
struct Tumble {
    truth: Mat3,
    t: f32,
}

impl Tumble {
    fn new() -> Self {
        Self { truth: attitude(10.0, 5.0, 30.0), t: 0.0 }
    }

    /// One step; the true attitude is integrated in much finer ones.
    fn step(&mut self) -> Measurement {
        self.t += DT;
        let rate = Vec3::new((0.9 * self.t).sin(), 0.8 * (0.7 * self.t).cos(), 1.1 * (0.4 * self.t).sin());
        for _ in 0..8 {
            self.truth = rotate(&self.truth, &(rate * (DT / 8.0)), Increment::Exponential);
        }
        Measurement { gyro: Some(rate), ..at_rest(&self.truth) }
    }
}

/// Runs for a while and returns the largest error of the second half, degrees.
fn follow(dcm: &mut Dcm, body: &mut Tumble, seconds: f32, mut disturb: impl FnMut(f32, &mut Measurement)) -> f32 {
    let n = (seconds / DT) as u32;
    let mut worst: f32 = 0.0;
    for k in 0..n {
        let mut m = body.step();
        disturb(k as f32 * DT, &mut m);
        dcm.update(DT, &m);
        if k > n / 2 {
            worst = worst.max(between(dcm.matrix(), &body.truth));
        }
    }
    worst
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Start-up from any attitude: right at the first sample, no transient after it.
    #[test]
    fn starts_at_any_attitude_and_stays(roll in -180f32..180.0, pitch in -90f32..90.0, yaw in -180f32..180.0) {
        let truth = attitude(roll, pitch, yaw);
        let mut dcm = Dcm::new(Config::default());
        prop_assert!(dcm.update(DT, &at_rest(&truth)).started);
        for _ in 0..1000 {
            dcm.update(DT, &at_rest(&truth));
            prop_assert!(between(dcm.matrix(), &truth) < 0.05, "{}", between(dcm.matrix(), &truth));
        }
        prop_assert!(dcm.flags().rest && dcm.flags().heading_absolute && dcm.flags().bias_trusted);
    }
}

#[test]
fn follows_a_rotation_with_ideal_sensors() {
    let (mut dcm, mut body) = (Dcm::new(Config::default()), Tumble::new());
    let worst = follow(&mut dcm, &mut body, 60.0, |_, _| {});
    assert!(worst < 0.1, "{worst}");
}

#[test]
fn finds_the_gyro_bias_in_motion_and_at_rest() {
    let bias = Vec3::new(0.02, -0.03, 0.015);
    let (mut dcm, mut body) = (Dcm::new(Config::default()), Tumble::new());
    let worst = follow(&mut dcm, &mut body, 300.0, |_, m| m.gyro = m.gyro.map(|w| w + bias));
    println!("in motion: bias off by {:?}, attitude by {worst}", dcm.bias() - bias);
    assert!(length(&(dcm.bias() - bias)) < 1e-3 && worst < 1.0);
    assert!(dcm.flags().bias_trusted && !dcm.flags().rest);

    let mut dcm = Dcm::new(Config::default());
    let truth = attitude(20.0, 30.0, 40.0);
    for _ in 0..600 {
        dcm.update(DT, &Measurement { gyro: Some(bias), ..at_rest(&truth) });
    }
    assert!(length(&(dcm.bias() - bias)) < 2e-3, "three seconds of rest: {:?}", dcm.bias() - bias);
}

/// What a real ITG-3200 has: several degrees a second.
#[test]
fn a_large_offset_is_found_at_rest() {
    let bias = Vec3::new(-0.051, 0.117, -0.023);
    let mut dcm = Dcm::new(Config::default());
    let truth = attitude(0.0, 0.0, 0.0);
    for _ in 0..2000 {
        dcm.update(DT, &Measurement { gyro: Some(bias), ..at_rest(&truth) });
    }
    assert!(length(&(dcm.bias() - bias)) < 1e-3, "{:?}", dcm.bias() - bias);
    assert!(between(dcm.matrix(), &truth) < 2.0, "{}", between(dcm.matrix(), &truth));
}

/// A magnet that stays where it is: the heading is frozen while it disturbs and comes back after.
#[test]
fn a_magnetic_disturbance_is_rejected_and_recovered_from() {
    let (mut dcm, mut body) = (Dcm::new(Config::default()), Tumble::new());
    follow(&mut dcm, &mut body, 60.0, |_, _| {});
    assert!(dcm.flags().field_known && !dcm.flags().field_disturbed);
    let magnet = Vec3::new(15.0, 20.0, -10.0);
    let mut worst: f32 = 0.0;
    for _ in 0..3000 {
        let m = body.step();
        let mag = m.mag.map(|f| f + body.truth.transpose() * magnet);
        dcm.update(DT, &Measurement { mag, ..m });
        worst = worst.max(between(dcm.matrix(), &body.truth));
    }
    assert!(dcm.flags().field_disturbed && worst < 2.0, "{worst}");
    let worst = follow(&mut dcm, &mut body, 60.0, |_, _| {});
    assert!(!dcm.flags().field_disturbed && worst < 1.0, "{worst}");
}

/// A magnet that travels with the sensor is found while the body turns.
#[test]
fn hard_iron_is_found_in_motion() {
    let iron = Vec3::new(3.0, -4.0, 20.0);
    let (mut dcm, mut body) = (Dcm::new(Config::default()), Tumble::new());
    follow(&mut dcm, &mut body, 120.0, |_, m| m.mag = m.mag.map(|f| f + iron));
    assert!(length(&(dcm.iron() - iron)) < 1.0, "{:?}", dcm.iron());
    let mut clean = Dcm::new(Config::default());
    follow(&mut clean, &mut Tumble::new(), 120.0, |_, _| {});
    assert!(length(&clean.iron()) < 0.5, "{:?}", clean.iron());
}

/// True accelerations average out in the earth frame: a swing of half a g at 1 Hz moves the tilt by less than a degree.
#[test]
fn translation_does_not_tilt() {
    let (mut dcm, mut body) = (Dcm::new(Config::default()), Tumble::new());
    follow(&mut dcm, &mut body, 20.0, |_, _| {});
    let mut truth = body.truth;
    let mut worst: f32 = 0.0;
    for k in 0..12_000 {
        let m = body.step();
        truth.copy_from(&body.truth);
        let push = 5.0 * (2.0 * core::f32::consts::PI * k as f32 * DT).cos(); // no net velocity
        let accel = m.accel.map(|f| f + truth.transpose() * Vec3::new(push, 0.0, 0.0));
        dcm.update(DT, &Measurement { accel, ..m });
        worst = worst.max(between(dcm.matrix(), &truth));
    }
    assert!(worst < 1.0, "{worst}");
}

/// Puts the checksum of a changed state right: FNV-1a over the words between version and checksum.
fn sealed(words: &mut [u32; STATE_WORDS]) {
    let [_, numbers @ .., sum] = words;
    *sum = numbers.iter().fold(0x811c_9dc5, |sum, word| (sum ^ word).wrapping_mul(0x0100_0193));
}

/// Forced divergence, from the most wrong attitudes: times are printed, and stated in docs/ahrs.md.
#[test]
fn recovers_from_a_forced_divergence() {
    for wrong in [attitude(180.0, 0.0, 0.0), attitude(0.0, 0.0, 180.0), attitude(90.0, 60.0, -120.0)] {
        let (mut dcm, mut body) = (Dcm::new(Config::default()), Tumble::new());
        follow(&mut dcm, &mut body, 60.0, |_, _| {});
        let mut words = dcm.save();
        let turned = *dcm.matrix() * wrong;
        for (word, value) in words.iter_mut().skip(1).zip(turned.iter()) {
            *word = value.to_bits();
        }
        sealed(&mut words);
        dcm.restore(&words).unwrap();
        assert!(between(dcm.matrix(), &body.truth) > 50.0);
        let (mut tilt_s, mut all_s) = (0.0, 0.0);
        for k in 0..40_000u32 {
            dcm.update(DT, &body.step());
            let tilt = dcm.gravity().dot(&body.truth.row(2).transpose()).clamp(-1.0, 1.0).acos().to_degrees();
            if tilt > 5.0 {
                tilt_s = k as f32 * DT;
            }
            if between(dcm.matrix(), &body.truth) > 5.0 {
                all_s = k as f32 * DT;
            }
        }
        println!("in motion: tilt within 5 degrees after {tilt_s:.1} s, attitude after {all_s:.1} s");
        assert!(tilt_s < 6.0 && all_s < 60.0);
    }
    // at rest the tilt is set anew after 1.5 s
    let truth = attitude(0.0, 0.0, 0.0);
    let mut dcm = Dcm::new(Config::default());
    dcm.update(DT, &at_rest(&attitude(120.0, 10.0, 90.0)));
    for _ in 0..(3.0 / DT) as u32 {
        dcm.update(DT, &at_rest(&truth));
    }
    assert!(between(dcm.matrix(), &truth) < 0.1, "{}", between(dcm.matrix(), &truth));
}

#[test]
fn a_saved_state_continues_with_the_same_bits() {
    let (mut one, mut body) = (Dcm::new(Config::default()), Tumble::new());
    follow(&mut one, &mut body, 30.0, |_, m| m.gyro = m.gyro.map(|w| w + Vec3::repeat(0.01)));
    let words = one.save();
    let mut two = Dcm::new(Config::default());
    two.restore(&words).unwrap();
    assert_eq!(two.save(), words);
    for _ in 0..2000 {
        let m = body.step();
        assert_eq!(one.update(DT, &m), two.update(DT, &m));
        assert_eq!(one.save(), two.save());
    }
}

#[test]
fn sensors_with_rates_of_their_own_give_the_same_attitude() {
    let (mut apart, mut body) = (Dcm::new(Config::default()), Tumble::new());
    let mut worst: f32 = 0.0;
    for k in 0..12_000u32 {
        let m = body.step();
        apart.update_gyro(DT, &m.gyro.unwrap());
        if k.is_multiple_of(2) {
            apart.update_accel(0.0, &m.accel.unwrap());
        }
        if k.is_multiple_of(13) {
            apart.update_mag(0.0, &m.mag.unwrap());
        }
        worst = worst.max(if k > 6000 { between(apart.matrix(), &body.truth) } else { 0.0 });
    }
    assert!(worst < 0.2, "{worst}");
}

#[test]
fn without_a_magnetometer_heading_is_relative_and_can_be_set() {
    let truth = attitude(-20.0, 35.0, 77.0);
    let mut dcm = Dcm::new(Config::default());
    for _ in 0..2000 {
        assert!(!dcm.update(DT, &Measurement { mag: None, ..at_rest(&truth) }).mag_used);
    }
    assert!(!dcm.heading_is_absolute() && dcm.euler().yaw.abs() < 1e-3);
    dcm.set_heading(1.0);
    for _ in 0..2000 {
        dcm.update(DT, &Measurement { mag: None, ..at_rest(&truth) });
    }
    let e = dcm.euler();
    assert!(
        (e.yaw - 1.0).abs() < 1e-3 && (e.roll.to_degrees() + 20.0).abs() < 0.01 && (e.pitch.to_degrees() - 35.0).abs() < 0.01
    );
    assert!(dcm.update(DT, &at_rest(&truth)).started, "the first field sets the heading at once");
    assert!((dcm.euler().yaw.to_degrees() - 77.0).abs() < 0.1);
}

#[test]
fn accelerations_come_out_of_the_specific_force() {
    let truth = attitude(30.0, -20.0, 110.0);
    let mut dcm = Dcm::new(Config::default());
    dcm.update(DT, &at_rest(&truth));
    let push = Vec3::new(1.0, -2.0, 0.5);
    let force = truth.transpose() * (push - Vec3::new(0.0, 0.0, STANDARD_GRAVITY));
    assert!(length(&(dcm.earth_acceleration(&force, Earth::Ned) - push)) < 1e-3);
    assert!(length(&(dcm.earth_acceleration(&force, Earth::Enu) - Vec3::new(-2.0, 1.0, -0.5))) < 1e-3);
    assert!(length(&(dcm.linear_acceleration(&force) - truth.transpose() * push)) < 1e-3);
}

#[test]
fn declination_turns_magnetic_into_true_heading() {
    let mut dcm = Dcm::new(Config { declination: 10.0f32.to_radians(), ..Config::default() });
    for _ in 0..1000 {
        dcm.update(DT, &at_rest(&attitude(0.0, 0.0, 30.0))); // 30 degrees from magnetic north
    }
    assert!((dcm.euler().yaw.to_degrees() - 40.0).abs() < 0.01, "{}", dcm.euler().yaw.to_degrees());
}

#[test]
fn irregular_steps_give_the_same_rotation() {
    let turn = |steps: &[f32]| {
        let mut dcm = Dcm::new(Config::default());
        dcm.update(DT, &at_rest(&Mat3::identity()));
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
fn a_gap_starts_the_tilt_anew_and_keeps_heading_and_bias() {
    let mut dcm = Dcm::new(Config::default());
    dcm.update(DT, &at_rest(&attitude(0.0, 0.0, 50.0)));
    dcm.set_bias(Vec3::new(0.01, 0.02, 0.03), 0.001);
    let now = attitude(30.0, 0.0, 50.0);
    assert!(dcm.update(2.0, &Measurement { mag: None, ..at_rest(&now) }).started);
    assert!(between(dcm.matrix(), &now) < 0.01);
    assert_eq!(dcm.bias(), Vec3::new(0.01, 0.02, 0.03));
}

#[test]
fn bad_and_saturated_readings_are_flagged_and_change_nothing() {
    let truth = attitude(5.0, 6.0, 7.0);
    let mut dcm = Dcm::new(Config::default());
    dcm.update(DT, &at_rest(&truth));
    let nan = Vec3::new(0.0, f32::NAN, 0.0);
    for bad in [
        Measurement { gyro: Some(nan), ..Measurement::default() },
        Measurement { gyro: Some(Vec3::repeat(f32::NEG_INFINITY)), ..Measurement::default() },
        Measurement { accel: Some(nan), ..Measurement::default() },
        Measurement { mag: Some(nan), ..Measurement::default() },
        Measurement { accel: Some(Vec3::zeros()), ..Measurement::default() },
        Measurement { mag: Some(Vec3::zeros()), ..Measurement::default() },
        Measurement { accel: Some(Vec3::repeat(1e30)), ..Measurement::default() },
        Measurement { accel: Some(Vec3::new(157.0, 0.0, -9.8)), ..Measurement::default() },
        Measurement { mag: Some(Vec3::repeat(1e30)), ..Measurement::default() },
    ] {
        let before = *dcm.matrix();
        let step = dcm.update(DT, &bad);
        assert!(step.bad_input || step.overrange, "{bad:?}");
        assert!(between(&before, dcm.matrix()) < 1e-3, "{bad:?}");
    }
    let step = dcm.update(DT, &Measurement { gyro: Some(Vec3::repeat(f32::MAX)), ..Measurement::default() });
    assert!(step.overrange, "a rate beyond the range is cut to it");
    for dt in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(dcm.update(dt, &at_rest(&truth)).bad_input);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Whatever bits arrive, the state stays a rotation, and the filter comes back.
    #[test]
    fn no_input_poisons_the_state(words in proptest::collection::vec(any::<[u32; 10]>(), 1..40)) {
        let truth = attitude(5.0, 6.0, 7.0);
        let mut dcm = Dcm::new(Config::default());
        dcm.update(DT, &at_rest(&truth));
        for w in words {
            let f = w.map(f32::from_bits);
            let v = |i: usize| Some(Vec3::new(f[i], f[i + 1], f[i + 2]));
            dcm.update(f[9], &Measurement { gyro: v(0), accel: v(3), mag: v(6) });
            let m = dcm.matrix();
            prop_assert!((m * m.transpose() - Mat3::identity()).abs().max() < 1e-3, "{m}");
            prop_assert!(dcm.save()[1..STATE_WORDS - 1].iter().all(|w| f32::from_bits(*w).is_finite()));
        }
        for _ in 0..8_000 {
            dcm.update(DT, &at_rest(&truth));
        }
        prop_assert!(between(dcm.matrix(), &truth) < 3.0, "{}", between(dcm.matrix(), &truth));
    }
}

/// The states hold no pointer: they take the same on the board.
#[test]
fn the_states_take_little_memory() {
    let [ours, classic] = [size_of::<Dcm<Standard>>(), size_of::<dcm::Classic>()];
    println!("state: ours {ours} bytes, the thesis' {classic}; a configuration held by value {} more", size_of::<Dcm>() - ours);
    assert!(ours <= 400 && classic <= 112, "{ours} {classic}");
}

/// The configuration's numbers known to the compiler, or held by value: the same bits.
#[test]
fn a_filter_with_a_fixed_configuration_gives_the_same() {
    let (mut fixed, mut held, mut body) = (Dcm::new(Standard), Dcm::new(Config::default()), Tumble::new());
    for k in 0..8_000 {
        let mut m = body.step();
        if k % 3 != 0 {
            m.mag = None;
        }
        fixed.update(DT, &m);
        held.update(DT, &m);
        assert_eq!(fixed.save(), held.save(), "step {k}");
    }
}

/// A strong magnet passes by a sensor that turns: what it adds is refused, and is neither iron on the sensor nor a drift of the gyro.
#[test]
fn a_field_that_is_refused_teaches_neither_iron_nor_bias() {
    let (mut dcm, mut body) = (Dcm::new(Config::default()), Tumble::new());
    follow(&mut dcm, &mut body, 60.0, |_, _| {});
    let (iron, bias) = (dcm.iron(), dcm.bias());
    let (mut refused, mut learnt, mut drifted) = (0, 0.0f32, 0.0f32);
    for _ in 0..(15.0 / DT) as u32 {
        let mut m = body.step();
        let magnet = body.truth.transpose() * Vec3::new(60.0, 150.0, -90.0);
        m.mag = m.mag.map(|field| field + magnet);
        dcm.update(DT, &m);
        refused += u32::from(dcm.flags().field_disturbed);
        learnt = learnt.max(length(&(dcm.iron() - iron)));
        drifted = drifted.max(length(&(dcm.bias() - bias)));
    }
    assert!(refused > (14.0 / DT) as u32, "{refused}");
    assert!(learnt < 0.5 && drifted < 2e-4, "iron by {learnt} uT, bias by {drifted} rad/s");
}

/// A walker's swing of 0.6 g: the longer average that it calls for leaves less of it in the tilt.
#[test]
fn the_average_is_longer_while_true_accelerations_swing() {
    let swung = |stretch: f32| {
        let config = Config { tilt_stretch: stretch, ..Config::default() };
        let (mut dcm, truth) = (Dcm::new(config), attitude(10.0, 5.0, 30.0));
        let mut worst: f32 = 0.0;
        for k in 0..(120.0 / DT) as u32 {
            let t = k as f32 * DT;
            let push = truth.transpose() * Vec3::new(0.6 * STANDARD_GRAVITY * (5.0 * t).sin(), 0.0, 0.0);
            let mut m = at_rest(&truth);
            m.accel = m.accel.map(|force| force + push);
            dcm.update(DT, &m);
            if t > 60.0 {
                worst = worst.max(between(dcm.matrix(), &truth));
            }
        }
        worst
    };
    let (longer, fixed) = (swung(Config::default().tilt_stretch), swung(0.0));
    println!("{longer} and {fixed} degrees");
    assert!(longer < 0.7 * fixed, "{longer} and {fixed}");
}
