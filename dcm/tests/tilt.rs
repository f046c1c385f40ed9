//! How fast the tilt follows the force, and what a step may be.

mod body;

use dcm::{BiasConfig, Config, Dcm, Increment, Mat3, Measurement, RestConfig, STANDARD_GRAVITY, Vec3, rotate};

const DT: f32 = 0.01;
/// What of a step a damped pair has followed after its time constant: 1 - e^-1 (cos 1 + sin 1).
const FOLLOWED: f32 = 0.4917;

/// Every force is used at once, nothing is learnt of the bias and no body rests.
fn config() -> Config {
    Config {
        tilt_window: 0.0,
        rest: RestConfig { time: 1e9, ..Config::DEFAULT.rest },
        bias: BiasConfig { tilt_gain: 0.0, ..Config::DEFAULT.bias },
        ..Config::DEFAULT
    }
}

/// A body that spins about the vertical. Its force is too long from some time on, and at last leans by a twentieth.
struct Leaning {
    dcm: Dcm,
    turned: f32,
    spin: f32,
}

impl Leaning {
    fn new(config: Config, spin: f32) -> Self {
        Self { dcm: Dcm::new(config), turned: 0.0, spin }
    }

    /// Goes on for a while with a force that is too long by `more` and leans by `lean`. Where the filter sees down, in axes that do not
    /// spin.
    fn go_on(&mut self, seconds: f32, more: f32, lean: f32) -> Vec3 {
        let about_down = |angle: f32| rotate(&Mat3::identity(), &Vec3::new(0.0, 0.0, angle), Increment::Exponential);
        for _ in 0..(seconds / DT).round() as u32 {
            self.turned = (self.turned + self.spin * DT) % std::f32::consts::TAU;
            let back = (0..8).fold(Mat3::identity(), |r, _| about_down(-self.turned / 8.0) * r);
            let force = back * Vec3::new(lean.sin(), 0.0, lean.cos()) * -(STANDARD_GRAVITY + more);
            let gyro = Some(Vec3::new(0.0, 0.0, self.spin));
            self.dcm.update(DT, &Measurement { gyro, accel: Some(force), mag: None });
        }
        let there = (0..8).fold(Mat3::identity(), |r, _| about_down(self.turned / 8.0) * r);
        there * self.dcm.gravity()
    }

    /// What of the lean the filter has followed after `seconds`.
    fn followed(&mut self, seconds: f32, more: f32) -> f32 {
        let down = self.go_on(seconds, more, 0.05);
        assert!(down.y.abs() < 1e-3, "{down}");
        down.x.atan2(down.z) / 0.05
    }
}

fn is_followed(share: f32) -> bool {
    (share - FOLLOWED).abs() < 0.02
}

#[test]
fn the_tilt_follows_with_its_time_constant() {
    let mut body = Leaning::new(config(), 0.0);
    assert!(body.go_on(10.0, 0.0, 0.0).z > 0.999_999);
    let share = body.followed(config().tilt_tau, 0.0);
    assert!(is_followed(share), "{share}");
}

/// The time constant grows by the stretch for each g of true acceleration: by three times where it is six and half a g.
#[test]
fn a_true_acceleration_stretches_the_time_constant() {
    for (stretch, longer) in [(6.0, 4.0), (2.0, 2.0), (0.0, 1.0)] {
        let config = Config { tilt_stretch: stretch, tilt_memory: 1.0, ..config() };
        let mut body = Leaning::new(config, 0.0);
        body.go_on(15.0, 0.5 * STANDARD_GRAVITY, 0.0);
        let share = body.followed(longer * config.tilt_tau, 0.5 * STANDARD_GRAVITY);
        assert!(is_followed(share), "{stretch}: {share}");
    }
}

/// Half of the stretch is left at the rate that is named for it, and a fifth at twice that rate.
#[test]
fn a_fast_turn_takes_the_stretch_back() {
    for (spin, left) in [(0.5f32, 0.5f32), (1.0, 0.2)] {
        let config = Config { tilt_rate: 0.5, tilt_memory: 1.0, ..config() };
        let more = 5.0;
        let longer = 1.0 + config.tilt_stretch * left * more / STANDARD_GRAVITY;
        let mut body = Leaning::new(config, spin);
        body.go_on(15.0, more, 0.0);
        let share = body.followed(longer * config.tilt_tau, more);
        assert!(is_followed(share), "{spin} rad/s: {share}");
    }
}

/// After the time of the memory 1 - 1/e of an acceleration counts.
#[test]
fn an_acceleration_counts_by_and_by() {
    let config = Config { tilt_tau: 0.5, tilt_memory: 50.0, ..config() };
    let half = 0.5 * STANDARD_GRAVITY;
    let longer = 1.0 + config.tilt_stretch * 0.5 * (1.0 - (-1f32).exp());
    let mut body = Leaning::new(config, 0.0);
    body.go_on(5.0, 0.0, 0.0);
    body.go_on(50.0, half, 0.0);
    let share = body.followed(longer * config.tilt_tau, half);
    assert!(is_followed(share), "{share}");
}

/// Readings at 1 kHz, each used at once: the start is already what the average begins with.
#[test]
fn a_fast_sensor_starts_without_a_transient() {
    let mut dcm = Dcm::new(config());
    let level = Measurement { mag: None, ..body::at_rest(&Mat3::identity(), [20.0, 0.0, 43.0]) };
    for k in 0..100 {
        dcm.update(0.001, &level);
        assert!(dcm.gravity().z > 0.999_99, "step {k}: {}", dcm.gravity());
    }
}

/// Half a radian a step, and no force that would set it right.
#[test]
fn a_fast_turn_without_forces_stays_a_rotation() {
    let mut dcm = Dcm::new(Config::default());
    dcm.update(DT, &body::at_rest(&Mat3::identity(), [20.0, 0.0, 43.0]));
    for k in 0..1_000 {
        dcm.update_gyro(0.02, &Vec3::new(20.0, -10.0, 12.0));
        let m = dcm.matrix();
        let off = (m * m.transpose() - Mat3::identity()).abs().max();
        assert!(off < 2e-4, "step {k}: {off}");
    }
}

/// The body whose longest step this is, at level with this rate about the vertical.
fn turned(dt: f32, rate: f32) -> (dcm::Step, f32) {
    let mut dcm = Dcm::new(Config::default());
    dcm.update(DT, &Measurement { mag: None, ..body::at_rest(&Mat3::identity(), [20.0, 0.0, 43.0]) });
    (dcm.update_gyro(dt, &Vec3::new(0.0, 0.0, rate)), dcm.euler().yaw)
}

#[test]
fn a_turn_of_more_than_a_radian_is_none() {
    let (step, yaw) = turned(0.25, 4.0);
    assert!(step.gyro_used && !step.bad_input && (yaw - 1.0).abs() < 1e-3, "{step:?} {yaw}");
    let (step, yaw) = turned(0.25, 4.1);
    assert!(!step.gyro_used && step.bad_input && yaw == 0.0, "{step:?} {yaw}");
}

#[test]
fn the_longest_step_is_no_gap_and_the_longest_number_no_time() {
    let gap = |dt: f32| {
        let mut dcm = Dcm::new(Config::default());
        let level = body::at_rest(&Mat3::identity(), [20.0, 0.0, 43.0]);
        dcm.update(DT, &level);
        (dcm.update(dt, &level).started, dcm.update(dt, &level).bad_input)
    };
    let longest = Config::DEFAULT.max_dt;
    assert_eq!([gap(longest), gap(1.01 * longest), gap(f32::MAX)], [(false, false), (true, false), (false, true)]);
}

/// A force at the end of the range is left out, and one just below it is taken.
#[test]
fn the_end_of_a_range_belongs_to_what_is_beyond() {
    let range = Config::DEFAULT.accel_range;
    let step = |long: f32| Dcm::new(Config::default()).update_accel(DT, &Vec3::new(0.0, 0.0, -long));
    assert!(step(range).overrange && !step(range).started);
    assert!(!step(0.999 * range).overrange && step(0.999 * range).started);
}

/// A gyro that ends at half a radian a second: a faster rate is flagged and cut to it.
#[test]
fn a_rate_beyond_a_small_range_is_cut() {
    let mut dcm = Dcm::new(Config { gyro_range: 0.5, ..Config::default() });
    dcm.update(DT, &Measurement { mag: None, ..body::at_rest(&Mat3::identity(), [20.0, 0.0, 43.0]) });
    let step = dcm.update_gyro(0.1, &Vec3::new(0.0, 0.0, 0.8));
    assert!(step.overrange && (dcm.euler().yaw - 0.05).abs() < 1e-4, "{step:?} {}", dcm.euler().yaw);
    assert!(!dcm.update_gyro(0.1, &Vec3::new(0.0, 0.0, 0.49)).overrange);
}

/// What common chips give at most: 2000 degrees a second and 16 g.
#[test]
fn the_ranges_are_those_of_the_chips() {
    let beyond = |turns: f32, g: f32| {
        let mut dcm = Dcm::new(Config::default());
        let gyro = Some(Vec3::new(0.0, turns.to_radians(), 0.0));
        dcm.update(DT, &Measurement { gyro, accel: Some(Vec3::new(0.0, 0.0, -g * STANDARD_GRAVITY)), mag: None }).overrange
    };
    assert_eq!([beyond(1990.0, 1.0), beyond(-2010.0, 1.0), beyond(0.0, 15.9), beyond(0.0, 16.1)], [false, true, false, true]);
}
