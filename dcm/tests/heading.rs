//! When the field turns the heading, how fast, and what is learnt from it.

mod body;

use dcm::{BiasConfig, Config, Dcm, Euler, FieldConfig, Mat3, Measurement, Step, Vec3, matrix_of};

/// North, east and down part of a field with a dip of 65 degrees, uT.
const FIELD: [f32; 3] = [20.0, 0.0, 43.0];
const DT: f32 = 0.04;
const DEGREE: f32 = std::f32::consts::PI / 180.0;

fn heading(degrees: f32) -> Mat3 {
    matrix_of(&Euler { roll: 0.0, pitch: 0.0, yaw: degrees * DEGREE })
}

/// A field whose level part points so many degrees east of north, `times` as strong.
fn turned(degrees: f32, times: f32) -> [f32; 3] {
    let (east, north) = (degrees * DEGREE).sin_cos();
    [FIELD[0] * north, FIELD[0] * east, FIELD[2]].map(|part| part * times)
}

/// A body at level that points to the north and stays there, with a field of the filter's time step.
fn stay(dcm: &mut Dcm, seconds: f32, field: [f32; 3]) -> Step {
    let level = body::at_rest(&Mat3::identity(), field);
    (0..(seconds / DT).round() as u32).map(|_| dcm.update(DT, &level)).last().unwrap_or_default()
}

/// A body at level that turns about the vertical.
struct Turning {
    dcm: Dcm,
    yaw: f32,
    /// Degrees a second.
    rate: f32,
}

impl Turning {
    fn new(config: Config, rate: f32) -> Self {
        Self { dcm: Dcm::new(config), yaw: 0.0, rate }
    }

    fn step(&mut self, field: [f32; 3]) -> Step {
        self.yaw = (self.yaw + self.rate * DT) % 360.0;
        let gyro = Some(Vec3::new(0.0, 0.0, self.rate * DEGREE));
        self.dcm.update(DT, &Measurement { gyro, ..body::at_rest(&heading(self.yaw), field) })
    }

    fn go_on(&mut self, seconds: f32, field: [f32; 3]) {
        (0..(seconds / DT).round() as u32).for_each(|_| {
            self.step(field);
        });
    }
}

/// Fields are summed for longer than the window, and then used.
#[test]
fn a_window_that_is_just_full_is_not_over() {
    let window = FieldConfig { window: 0.5, ..Config::DEFAULT.field };
    let mut dcm = Dcm::new(Config { field: window, ..Config::DEFAULT });
    let used = [0.25f32; 7].map(|dt| dcm.update(dt, &body::at_rest(&Mat3::identity(), FIELD)).mag_used);
    assert_eq!(used, [true, false, false, true, false, false, true]);
}

/// The first field sets the heading as the declination has it: nothing is left of it to correct.
#[test]
fn the_first_field_sets_the_true_heading() {
    let mut dcm = Dcm::new(Config { declination: 0.2, ..Config::default() });
    dcm.update(DT, &body::at_rest(&heading(30.0), FIELD));
    let (yaw, left) = (dcm.euler().yaw, dcm.quality().heading_error);
    assert!((yaw - 30.0 * DEGREE - 0.2).abs() < 1e-4 && left.abs() < 1e-4, "{yaw} {left}");
}

/// The first seconds are averaged. Then a heading that no reference backs is held for a minute, if the bias is known, and believed by half
/// after that.
#[test]
fn a_heading_without_a_reference_is_averaged_held_and_doubted() {
    let mut dcm = Dcm::new(Config::default());
    assert!(stay(&mut dcm, 3.0, FIELD).mag_used, "averaged");
    assert!(dcm.flags().rest && dcm.flags().bias_trusted && !dcm.flags().field_known);
    assert!(stay(&mut dcm, 6.0, FIELD).mag_used, "averaged");
    assert!(!stay(&mut dcm, 10.0, FIELD).mag_used, "held");
    assert!(!stay(&mut dcm, 50.0, turned(20.0, 1.0)).mag_used && dcm.euler().yaw.abs() < 1e-3, "held");
    assert!((0..250).any(|_| stay(&mut dcm, DT, turned(20.0, 1.0)).mag_used), "doubted");
    let begun = dcm.euler().yaw / DEGREE + 20.0;
    assert!((19.8..20.1).contains(&begun), "{begun}");
    stay(&mut dcm, 2.0 * Config::DEFAULT.heading_tau, turned(20.0, 1.0));
    let left = (dcm.euler().yaw / DEGREE + 20.0) / begun;
    assert!((left - (-1f32).exp()).abs() < 0.01, "once e in twice the time: {left}");
}

/// The same where the bias is not known: an unknown bias does more harm.
#[test]
fn a_heading_is_not_held_while_the_bias_is_unknown() {
    let bias = BiasConfig { trusted: 0.0, ..Config::DEFAULT.bias };
    let mut dcm = Dcm::new(Config { bias, ..Config::DEFAULT });
    assert!(stay(&mut dcm, 20.0, FIELD).mag_used && !dcm.flags().bias_trusted);
}

/// A twentieth of the field or more is a heading; a hundredth is none.
#[test]
fn a_field_that_is_nearly_vertical_turns_nothing() {
    let used = |north: f32| {
        let mut dcm = Dcm::new(Config::default());
        stay(&mut dcm, 2.0, FIELD);
        stay(&mut dcm, 0.4, [north, 0.0, 43.0]).mag_used
    };
    assert_eq!([0.43, 0.7, 1.0, 2.15].map(used), [false, false, true, true]);
}

/// Nobody learns the first field at rest: whatever the gyro's offset, a body does not turn that rests.
#[test]
fn a_bias_is_no_turning() {
    let field = FieldConfig { new_rate: 6.0 * DEGREE, ..Config::DEFAULT.field };
    let known = |bias: f32, rate: f32| {
        let mut body = Turning::new(Config { field, ..Config::DEFAULT }, rate);
        body.dcm.set_bias(Vec3::new(0.0, 0.0, bias * DEGREE), 0.0);
        for _ in 0..(8.0 / DT) as u32 {
            body.yaw = (body.yaw + rate * DT) % 360.0;
            let gyro = Some(Vec3::new(0.0, 0.0, (rate + bias) * DEGREE));
            body.dcm.update(DT, &Measurement { gyro, ..body::at_rest(&heading(body.yaw), FIELD) });
        }
        body.dcm.flags().field_known
    };
    assert_eq!([known(4.0, 0.0), known(-4.0, 0.0), known(0.0, 8.0), known(-4.0, 8.0)], [false, false, true, true]);
}

/// Time counts towards a new field above the rate that is named, and not at it.
#[test]
fn a_rate_at_its_limit_is_no_turning() {
    let bias = BiasConfig { heading_gain: 0.0, tilt_gain: 0.0, ..Config::DEFAULT.bias };
    let field = FieldConfig { new_rate: 0.5, ..Config::DEFAULT.field };
    let known = |rate: f32| {
        let mut dcm = Dcm::new(Config { bias, field, ..Config::DEFAULT });
        for k in 0..(10.0 / DT) as u32 {
            let truth = heading(rate * DT * k as f32 / DEGREE);
            let gyro = Some(Vec3::new(0.0, 0.0, rate));
            dcm.update(DT, &Measurement { gyro, ..body::at_rest(&truth, FIELD) });
        }
        dcm.flags().field_known
    };
    assert_eq!([0.5, 0.51].map(known), [false, true]);
}

/// A body that rests sees its gyro's offset. What the field says then is no drift.
#[test]
fn at_rest_the_field_says_nothing_of_the_bias() {
    let mut dcm = Dcm::new(Config::default());
    stay(&mut dcm, 6.0, FIELD);
    assert!(dcm.flags().rest);
    stay(&mut dcm, 4.0, turned(8.0, 1.0));
    assert!(dcm.euler().yaw < -DEGREE, "it turns the heading: {}", dcm.euler().yaw);
    assert!(dcm.bias().abs().max() < 1e-7, "{}", dcm.bias());
}

/// A new place whose heading is nearly that of the old one: of the age of the heading goes the share that its difference is of two dips'
/// tolerances. So long it averages anew.
#[test]
fn a_new_place_leaves_the_heading_what_agrees_with_it() {
    let config = Config::DEFAULT;
    for degrees in [5.0, 10.0] {
        let mut body = Turning::new(config, 60.0);
        body.go_on(40.0, FIELD);
        assert!(body.dcm.flags().field_known && !body.dcm.flags().startup);
        let place = turned(degrees, 1.4);
        let held = (0..1_000).take_while(|_| {
            body.step(place);
            !body.dcm.flags().startup
        });
        let held = held.count() as f32 * DT;
        assert!((held - config.field.new_time).abs() < 1.0, "{held} s until the place is known");
        let anew = (0..1_000).take_while(|_| {
            body.step(place);
            body.dcm.flags().startup
        });
        let (anew, known) = (anew.count() as f32 * DT, config.heading_tau * 0.5 * degrees * DEGREE / config.field.dip);
        assert!((anew - known).abs() < 0.2, "{degrees} degrees: {anew} s, {known}");
    }
}

/// A body at rest whose field differs from the one that is known: its gyro holds the heading better, however long it lasts. In motion the
/// field is believed by half after a minute.
#[test]
fn a_gyro_at_rest_is_believed_more_than_a_strange_field() {
    let mut body = Turning::new(Config::default(), 60.0);
    body.go_on(40.0, FIELD);
    let strange = turned(30.0, 1.4);
    let (mut moving, mut resting) = (body.dcm, body.dcm);
    let truth = heading(body.yaw);
    let mut used = 0;
    for _ in 0..(100.0 / DT) as u32 {
        used += u32::from(resting.update(DT, &body::at_rest(&truth, strange)).mag_used);
    }
    assert!(resting.flags().rest && resting.flags().field_disturbed && used == 0, "{used}");
    assert!(resting.heading_against(&truth).abs() < 2.0 * DEGREE, "{}", resting.heading_against(&truth));
    // a turn below the rate of a new place, so that none is learnt
    let mut last = Step::default();
    for k in 0..(70.0 / DT) as u32 {
        let truth = heading(body.yaw + 10.0 * DT * k as f32);
        let gyro = Some(Vec3::new(0.0, 0.0, 10.0 * DEGREE));
        last = moving.update(DT, &Measurement { gyro, ..body::at_rest(&truth, strange) });
    }
    assert!(moving.flags().field_disturbed && !moving.flags().rest && last.mag_used, "{:?}", moving.flags());
}
