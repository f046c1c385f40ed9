//! Strong magnets beside the sensor: refused while they are there, forgotten soon after.

mod body;

use dcm::{Config, Dcm, Euler, Increment, Mat3, Measurement, STANDARD_GRAVITY, Vec3, matrix_of, rotate};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;

/// North, east and down part of a field with a dip of 65 degrees, uT.
const FIELD: [f32; 3] = [20.0, 0.0, 43.0];
const DT: f32 = 1.0 / 100.0;
/// Time of undisturbed motion after which all must be well, s.
const RECOVERY: f32 = 30.0;
/// Largest error then, degrees, where the field and the offset of the gyro were known before.
const KNOWN: f32 = 6.0;
/// The same where the filter started beside the magnet: the gyro's offset, up to 1 deg/s, is unknown too.
const UNKNOWN: f32 = 12.0;

/// When a magnet comes.
#[derive(Debug, Clone, Copy, PartialEq)]
enum When {
    /// It is there when the filter starts, in motion.
    AtStart,
    /// After a minute of motion.
    Moving,
    /// After a minute of motion, while the body rests.
    Resting,
}

/// A magnet that is brought near, stays and is taken away.
#[derive(Debug, Clone, Copy)]
struct Magnet {
    /// What it adds to the Earth's field, uT in earth axes.
    field: [f32; 3],
    /// s.
    lasts: f32,
    /// Time of coming and of going, s.
    ramp: f32,
    when: When,
}

impl Magnet {
    /// Whether a filter can tell it from a place: by a field that no place has, because it is gone before a place would be known, or because
    /// the body does not turn in it.
    fn is_none_of_a_place(&self) -> bool {
        let whole = Vec3::from(self.field) + Vec3::from(FIELD);
        let field = Config::DEFAULT.field;
        whole.dot(&whole) > field.strongest * field.strongest || self.lasts < field.new_time || self.when == When::Resting
    }
}

/// A body that turns about all axes or rests, with a gyro of its own offset and noise.
struct Body {
    truth: Mat3,
    t: f32,
    bias: Vec3,
    noise: u32,
}

impl Body {
    fn new(bias: [f32; 3]) -> Self {
        let truth = matrix_of(&Euler { roll: 0.2, pitch: -0.1, yaw: 0.9 });
        Self { truth, t: 0.0, bias: Vec3::from(bias), noise: 1 }
    }

    /// Even noise in [-1, 1]: Numerical Recipes' quick congruential generator.
    fn noise(&mut self) -> f32 {
        self.noise = self.noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.noise >> 8) as f32 / (1u32 << 23) as f32 - 1.0
    }

    fn noises(&mut self, size: f32) -> Vec3 {
        Vec3::new(self.noise(), self.noise(), self.noise()) * size
    }

    /// One step in a field with this magnet's part.
    fn step(&mut self, moving: bool, magnet: Vec3) -> Measurement {
        self.t += DT;
        let t = self.t;
        let rate = Vec3::new((0.9 * t).sin(), 0.8 * (0.7 * t).cos(), 1.1 * (0.4 * t).sin()) * if moving { 1.0 } else { 0.0 };
        for _ in 0..4 {
            self.truth = rotate(&self.truth, &(rate * (DT / 4.0)), Increment::Exponential);
        }
        let swing = Vec3::new((6.0 * t).sin(), (5.0 * t).cos(), 0.0) * if moving { 0.15 * STANDARD_GRAVITY } else { 0.0 };
        let ideal = body::at_rest(&self.truth, FIELD);
        let field = self.truth.transpose() * (Vec3::from(FIELD) + magnet);
        Measurement {
            gyro: Some(rate + self.bias + self.noises(0.01)),
            accel: ideal.accel.map(|f| f + self.truth.transpose() * swing + self.noises(0.05)),
            mag: Some(field + self.noises(0.5)),
        }
    }
}

/// Angle between two attitudes, degrees.
fn between(a: &Mat3, b: &Mat3) -> f32 {
    let d = a.transpose() * b;
    let sine = Vec3::new(d.m32 - d.m23, d.m13 - d.m31, d.m21 - d.m12) / 2.0;
    sine.dot(&sine).sqrt().atan2((d.trace() - 1.0) / 2.0).to_degrees()
}

/// The largest error while the magnet was there (none at the start: nothing is known then), and that after [`RECOVERY`].
fn through(magnet: &Magnet, bias: [f32; 3]) -> (f32, f32) {
    let (mut dcm, mut body) = (Dcm::new(Config::default()), Body::new(bias));
    let mut run = |seconds: f32, moving: bool, magnet: &dyn Fn(f32) -> Vec3| {
        let mut worst: f32 = 0.0;
        for k in 0..(seconds / DT) as u32 {
            dcm.update(DT, &body.step(moving, magnet(k as f32 * DT)));
            worst = worst.max(between(dcm.matrix(), &body.truth));
        }
        (worst, between(dcm.matrix(), &body.truth))
    };
    if magnet.when != When::AtStart {
        run(2.0, false, &|_| Vec3::zeros());
        run(60.0, true, &|_| Vec3::zeros());
    }
    let near = |t: f32| {
        let (come, go) = (t / magnet.ramp, (magnet.lasts - t) / magnet.ramp);
        let come = if magnet.when == When::AtStart { 1.0 } else { come };
        Vec3::from(magnet.field) * come.min(go).clamp(0.0, 1.0)
    };
    let (worst, _) = run(magnet.lasts, magnet.when != When::Resting, &near);
    let (_, after) = run(RECOVERY, true, &|_| Vec3::zeros());
    (if magnet.when == When::AtStart { 0.0 } else { worst }, after)
}

fn magnets() -> impl Strategy<Value = Magnet> {
    let direction = (0.0f32..std::f32::consts::TAU, -1.0f32..1.0);
    let when = prop_oneof![Just(When::AtStart), Just(When::Moving), Just(When::Resting)];
    (100f32..400.0, direction, 2f32.ln()..180f32.ln(), 0.2f32..3.0, when).prop_map(|(size, (turn, down), lasts, ramp, when)| {
        let level = (1.0 - down * down).sqrt();
        let field = [size * level * turn.cos(), size * level * turn.sin(), size * down];
        Magnet { field, lasts: lasts.exp(), ramp, when }
    })
}

/// 100 to 400 uT for two seconds to three minutes, in motion, at rest and while the filter starts: refused while it is there, unless
/// it looks like a new place, and forgotten after 30 s of motion in any case.
#[test]
fn a_strong_magnet_is_refused_and_forgotten() {
    let mut drawn = TestRunner::deterministic();
    let mut like_a_place = 0;
    for _ in 0..1200 {
        let magnet = magnets().new_tree(&mut drawn).expect("a magnet").current();
        let bias = prop::array::uniform3(-0.01f32..0.01).new_tree(&mut drawn).expect("an offset").current();
        let (worst, after) = through(&magnet, bias);
        let told = magnet.is_none_of_a_place();
        like_a_place += u32::from(!told);
        assert!(worst < KNOWN || !told, "{worst:.1} degrees off beside {magnet:?}, offset {bias:?}");
        let most = if magnet.when == When::AtStart { UNKNOWN } else { KNOWN };
        assert!(after < most, "{after:.1} degrees off {RECOVERY} s after {magnet:?}, offset {bias:?}");
    }
    assert!(like_a_place < 20, "{like_a_place} of them cannot be told from a place");
}

/// A body that has not moved since the start knows no field to compare with. The one that it started in was turned by 30 degrees for half a
/// minute: when it is gone, the heading comes to the one that stays.
#[test]
fn a_body_that_has_only_rested_follows_the_field() {
    let (mut dcm, mut body) = (Dcm::new(Config::default()), Body::new([0.004, -0.006, 0.005]));
    let (east, north) = 30f32.to_radians().sin_cos();
    let turned = Vec3::new(FIELD[0] * north, FIELD[0] * east, FIELD[2]) - Vec3::from(FIELD);
    let mut rest = |seconds: f32, field: Vec3| {
        (0..(seconds / DT) as u32).for_each(|_| {
            dcm.update(DT, &body.step(false, field));
        });
        between(dcm.matrix(), &body.truth)
    };
    let before = rest(30.0, turned);
    assert!(before > 25.0, "{before:.1} degrees off: the first field does not count in this test");
    let after = rest(180.0, Vec3::zeros());
    assert!(after < 2.0, "{after:.1} degrees off");
}

/// In motion beside a magnet whose field and the Earth's together look like a place's: it becomes the reference. Away from it the Earth's
/// is one again and the heading is set anew.
#[test]
fn a_magnet_that_looks_like_a_place_is_forgotten_too() {
    for (east, lasts) in [(-60.0, 120.0), (60.0, 120.0), (-60.0, 25.0)] {
        let magnet = Magnet { field: [-30.0, east, -75.0], lasts, ramp: 0.5, when: When::Moving };
        assert!(!magnet.is_none_of_a_place());
        let (worst, after) = through(&magnet, [0.004, -0.006, 0.005]);
        assert!(worst > 30.0, "{worst:.1} degrees off: it is no new place in this test");
        assert!(after < KNOWN, "{after:.1} degrees off {RECOVERY} s after {magnet:?}");
    }
}

/// The same while the filter starts, for as long as a first reference takes: what the magnet's field and the Earth's differ by is not
/// taken for iron on the sensor.
#[test]
fn the_change_from_a_magnet_to_the_earth_is_no_iron() {
    for lasts in [7.0, 9.0, 11.0, 13.0] {
        for towards in 0..12 {
            let (east, north) = (std::f32::consts::PI / 6.0 * towards as f32).sin_cos();
            let magnet = Magnet { field: [70.0 * north, 70.0 * east, -75.0], lasts, ramp: 1.5, when: When::AtStart };
            let (_, after) = through(&magnet, [0.004, -0.006, 0.005]);
            assert!(after < UNKNOWN, "{after:.1} degrees off {RECOVERY} s after {magnet:?}");
        }
    }
}
