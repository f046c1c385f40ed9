//! Calibration by command on simulated chips whose errors are known: words with the chips' resolution and noise in, messages out.
//!
//! The whole portable half runs as on the board; the idle loop's work is done between two ticks, on a flash that is all ones.

use dcm::calibration::Calibration;
use dcm::{Increment, Mat3, STANDARD_GRAVITY, Vec3, rotate};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use firmware_ahrs::GyroReading;
use firmware_ahrs::console::Asked;
use firmware_ahrs::{Ahrs, AhrsConfig, Console, Heard, Inputs, Readings, Settings, line};
use frame::message::SettingsNews;
use frame::{Event, ImuCalibrated, ImuFormat, ImuRefusal, ImuReport, ImuSensor, Message, Ticks};

/// Deterministic normal noise: Box-Muller on a 64-bit linear congruential generator (Knuth's MMIX constants).
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }
    fn vector(&mut self, sigma: f64) -> Vec3 {
        Vec3::from_fn(|_, _| {
            (sigma * (-2.0 * self.uniform().ln()).sqrt() * (core::f64::consts::TAU * self.uniform()).cos()) as f32
        })
    }
}

/// A NOR flash of two pages in memory.
struct Memory(Vec<u8>);

#[derive(Debug)]
struct Never;
impl NorFlashError for Never {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}
impl ErrorType for Memory {
    type Error = Never;
}
impl ReadNorFlash for Memory {
    const READ_SIZE: usize = 1;
    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Never> {
        bytes.copy_from_slice(&self.0[offset as usize..offset as usize + bytes.len()]);
        Ok(())
    }
    fn capacity(&self) -> usize {
        self.0.len()
    }
}
impl NorFlash for Memory {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 1024;
    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Never> {
        self.0[from as usize..to as usize].fill(0xff);
        Ok(())
    }
    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Never> {
        self.0[offset as usize..].iter_mut().zip(bytes).for_each(|(cell, byte)| *cell &= byte);
        Ok(())
    }
}

/// What the chips do to the truth, body axes.
#[derive(Clone, Copy)]
struct Chips {
    gyro_offset: Vec3,
    accel_offset: Vec3,
    accel_gain: Vec3,
    iron: Vec3,
    soft: Mat3,
}

const CHIPS: Chips = Chips {
    gyro_offset: Vec3::new(-0.051, 0.117, -0.023), // -2.9, 6.7, -1.3 deg/s
    accel_offset: Vec3::new(-0.25, 0.42, -1.22),   // up to 125 mg
    accel_gain: Vec3::new(1.03, 0.98, 0.96),
    iron: Vec3::new(-12.0, 30.0, 22.0),
    soft: Mat3::new(1.08, 0.04, -0.03, 0.04, 0.95, 0.02, -0.03, 0.02, 0.99),
};

/// A board in somebody's hand.
struct Bench {
    console: Console,
    flash: Memory,
    noise: Noise,
    attitude: Mat3,
    tick: u64,
    said: Vec<Message>,
    done: Option<firmware_ahrs::Done>,
}

impl Bench {
    fn new(seed: u64) -> Self {
        let console = Console::new(AhrsConfig::default(), Ahrs::hello(168_000_000, 0, 7), None);
        let (flash, noise) = (Memory(vec![0xff; 2048]), Noise(seed));
        Self { console, flash, noise, attitude: Mat3::identity(), tick: 0, said: Vec::new(), done: None }
    }

    fn readings(&mut self, rate: &Vec3) -> Readings {
        let down = self.attitude.transpose();
        let force = CHIPS.accel_gain.component_mul(&(down * Vec3::new(0.0, 0.0, -STANDARD_GRAVITY))) + CHIPS.accel_offset;
        let field = CHIPS.soft * (down * Vec3::new(20.0, 0.0, 43.0)) + CHIPS.iron;
        // noise of a reading: 0.38 deg/s, 0.75 LSB, 0.2 uT; chip y and z are opposite to body y and z
        let mut words = |v: Vec3, scale: f32, noise: f64| -> [i16; 3] {
            let v = v * scale + self.noise.vector(noise);
            [v.x, -v.y, -v.z].map(|w| w.round() as i16)
        };
        let gyro = words(rate + CHIPS.gyro_offset, 180.0 / core::f32::consts::PI * 14.375, 0.38 * 14.375);
        let accel = words(force, 256.0 / STANDARD_GRAVITY, 0.75);
        let mag = words(field, 10.9, 0.2 * 10.9);
        Readings {
            gyro: Some(GyroReading { temperature: 0, rate: gyro }),
            accel: Some(accel),
            mag: self.tick.is_multiple_of(3).then_some(mag),
            alive: 7,
            ..Readings::default()
        }
    }

    /// One tick while the board turns at `rate`; a line may be typed.
    fn step(&mut self, rate: &Vec3, typed: Option<&str>) {
        let readings = self.readings(rate);
        self.attitude = rotate(&self.attitude, &(rate * 0.005), Increment::Exponential);
        let heard = typed.map(|t| line::command(t).map_or(Heard::Unknown, Heard::Command));
        let asked = Asked { heard, done: self.done.take(), damaged: 0, cycles: 0 };
        let inputs = Inputs { now: Ticks::from_ms(5 * self.tick), readings };
        let said = &mut self.said;
        let job = self.console.tick(&inputs, &asked, &mut |_, message| said.push(*message));
        self.done = job.map(|job| job.run(&mut self.flash, 0..2048));
        self.tick += 1;
    }

    fn rest(&mut self, ticks: u32) {
        (0..ticks).for_each(|_| self.step(&Vec3::zeros(), None));
    }

    /// Turns to another attitude within half a second.
    fn turn(&mut self, by: Vec3) {
        (0..100).for_each(|_| self.step(&(by * 2.0), None));
    }

    fn type_in(&mut self, typed: &str) {
        self.step(&Vec3::zeros(), Some(typed));
    }

    /// Everything said but the stream.
    fn answers(&mut self) -> Vec<Message> {
        let all = std::mem::take(&mut self.said);
        all.into_iter().filter(|m| !matches!(m, Message::Imu(_) | Message::ImuValues(_))).collect()
    }

    fn reports(&mut self) -> Vec<ImuReport> {
        self.answers().into_iter().filter_map(|m| if let Message::ImuReport(r) = m { Some(r) } else { None }).collect()
    }

    /// The last report is of a calibration.
    fn calibrated(&mut self) -> ImuCalibrated {
        let reports = self.reports();
        let Some(ImuReport::Calibrated(found)) = reports.last() else { panic!("{reports:?}") };
        *found
    }

    /// Turns it over and over about axes that wander, as a hand does, for a minute.
    fn tumble(&mut self) {
        for k in 0..200 * 60 {
            let t = k as f32 * 0.005;
            let axis = Vec3::new((0.37 * t).sin(), (0.23 * t + 1.0).sin(), (0.31 * t + 2.0).sin());
            self.step(&(axis * 3.0), None);
        }
    }
}

/// How many of the three lie within 95 %.
fn inside(found: [f32; 3], truth: Vec3, sigma: [f32; 3]) -> u32 {
    (0..3).map(|i| u32::from((found[i] - truth[i]).abs() < 1.96 * sigma[i])).sum()
}

#[test]
fn gyro_accelerometer_and_magnetometer_come_back_within_their_intervals() {
    let (mut gyro, mut accel, mut mag, mut all) = (0, 0, 0, 0);
    for seed in 0..60u64 {
        let mut bench = Bench::new(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15)); // far apart: neighbours of this generator resemble each other
        bench.type_in("calibrate gyro");
        bench.rest(210);
        let found = bench.calibrated();
        assert_eq!((found.sensor, found.readings), (ImuSensor::Gyro, 200));
        gyro += inside(found.offset, CHIPS.gyro_offset, found.sigma);

        bench.type_in("calibrate accel");
        for k in 0..6 {
            // from one position into the next, with a pause on the way; then longer than two seconds of rest
            bench.attitude = up(k);
            bench.turn(Vec3::new(0.0, 0.0, 0.4));
            bench.attitude = up(k);
            bench.rest(450);
        }
        let found = bench.calibrated();
        assert_eq!(found.sensor, ImuSensor::Accel);
        accel += inside(found.offset, CHIPS.accel_offset, found.sigma);
        let gain_sigma = found.sigma.map(|s| s / STANDARD_GRAVITY);
        accel += inside(found.gain, CHIPS.accel_gain, gain_sigma);
        assert!(found.residual < 0.02, "{found:?}");

        bench.type_in("calibrate mag");
        bench.tumble();
        bench.type_in("finish");
        bench.rest(2);
        let found = bench.calibrated();
        assert!(found.coverage > 0.9 && found.residual < 0.5, "{found:?}");
        mag += inside(found.offset, CHIPS.iron, found.sigma);
        all += 3;

        let right = bench.console.settings().calibration;
        let force = right.accel(&(CHIPS.accel_gain.component_mul(&Vec3::new(1.0, -2.0, 9.0)) + CHIPS.accel_offset));
        assert!((force - Vec3::new(1.0, -2.0, 9.0)).abs().max() < 0.02, "{force}");
        assert_eq!(*bench.console.ahrs().calibration(), right);
    }
    println!("inside 95 %: gyro {gyro} of {all}, accelerometer {accel} of {}, magnetometer {mag} of {all}", 2 * all);
    // nominally 95 %: 180 and 360 parameters scatter by 1.6 and 1.1 %
    for (inside, of) in [(gyro, all), (accel, 2 * all), (mag, all)] {
        let share = 100.0 * f64::from(inside) / f64::from(of);
        assert!((90.0..=98.0).contains(&share), "{inside} of {of}");
    }
}

/// Attitude with the axis of position `k` up.
fn up(k: usize) -> Mat3 {
    let quarter = core::f32::consts::FRAC_PI_2;
    let turn = |v: [f32; 3]| rotate(&Mat3::identity(), &(Vec3::from(v) * (quarter / 2.0)), Increment::Exponential);
    let by = |v: [f32; 3]| turn(v) * turn(v);
    match k {
        0 => by([0.0, 1.0, 0.0]),
        1 => by([0.0, -1.0, 0.0]),
        2 => by([-1.0, 0.0, 0.0]),
        3 => by([1.0, 0.0, 0.0]),
        4 => by([1.0, 0.0, 0.0]) * by([1.0, 0.0, 0.0]),
        _ => Mat3::identity(),
    }
}

#[test]
fn positions_are_taken_in_any_order_once_each_and_a_missing_one_is_named() {
    let mut bench = Bench::new(1);
    bench.type_in("calibrate accel");
    for k in [5, 2, 5, 0] {
        bench.attitude = up(k);
        bench.turn(Vec3::new(0.2, 0.3, 0.4));
        bench.attitude = up(k);
        bench.rest(600);
    }
    bench.type_in("finish");
    let sensor = ImuSensor::Accel;
    let taken = |index, count| ImuReport::Taken { sensor, index, count };
    let missing = ImuReport::Refused { sensor, why: ImuRefusal::Position { index: 1 } };
    assert_eq!(bench.reports(), [taken(5, 1), taken(2, 2), taken(0, 3), missing]);
    assert_eq!(bench.console.settings().calibration, Calibration::default(), "the one before stays in force");
}

#[test]
fn the_magnetometer_s_axes_come_back_from_many_attitudes_at_rest() {
    let mut bench = Bench::new(3);
    // iron first: axes are found from a round field only
    bench.type_in("calibrate accel");
    for k in 0..6 {
        bench.attitude = up(k);
        bench.turn(Vec3::new(0.1, 0.2, 0.4));
        bench.attitude = up(k);
        bench.rest(450);
    }
    bench.type_in("calibrate mag");
    bench.tumble();
    bench.type_in("finish");
    bench.rest(2);
    bench.type_in("calibrate align");
    for k in 0..18 {
        let t = k as f32;
        bench.turn(Vec3::new((1.7 * t).sin(), (2.3 * t).cos(), (0.9 * t).sin()) * 1.2);
        bench.rest(420);
    }
    bench.type_in("finish");
    bench.rest(2);
    let found = bench.calibrated();
    assert_eq!(found.sensor, ImuSensor::Alignment);
    println!(
        "angle {:?} +- {:?} rad from {} attitudes, residual {:.4} rad",
        found.offset, found.sigma, found.readings, found.residual
    );
    assert!(found.readings >= 8 && found.residual < 0.01, "{found:?}");
    // the chips' axes are parallel here but for what the symmetric soft iron leaves
    assert!(found.offset.iter().zip(found.sigma).all(|(a, s)| a.abs() < 3.0 * s + 0.004), "{found:?}");
}

#[test]
fn motion_poor_coverage_and_impatience_are_refused() {
    let mut bench = Bench::new(7);
    bench.type_in("calibrate gyro");
    (0..200 * 21).for_each(|k| bench.step(&Vec3::new((k as f32 * 0.1).sin(), 0.0, 0.0), None));
    let refused = bench.reports();
    assert!(
        matches!(refused[..], [ImuReport::Refused { sensor: ImuSensor::Gyro, why: ImuRefusal::Moving { scatter } }] if scatter > 0.1)
    );

    bench.type_in("calibrate mag");
    // on the table: about one axis only
    bench.attitude = Mat3::identity();
    (0..200 * 20).for_each(|_| bench.step(&Vec3::new(0.0, 0.0, 1.0), None));
    bench.type_in("finish");
    bench.rest(2);
    let refused = bench.reports();
    let why = |r: &[ImuReport]| if let [ImuReport::Refused { why, .. }] = r { Some(*why) } else { None };
    let found = why(&refused);
    assert!(matches!(found, Some(ImuRefusal::Coverage { .. } | ImuRefusal::TooFew { .. } | ImuRefusal::NoFit)), "{refused:?}");

    bench.type_in("calibrate mag");
    bench.type_in("finish");
    bench.rest(2);
    assert!(matches!(why(&bench.reports()), Some(ImuRefusal::TooFew { needed: 40, .. })));
    bench.type_in("finish");
    bench.type_in("nonsense");
    let answers = bench.answers();
    assert!(answers.iter().all(|m| matches!(m, Message::Event(Event::Refused(_)))) && answers.len() == 2, "{answers:?}");
    assert_eq!(bench.console.settings().calibration, Calibration::default());
}

#[test]
fn saved_settings_are_loaded_and_the_factory_s_come_back() {
    let mut bench = Bench::new(9);
    for typed in ["calibrate gyro", "send both", "stream off"] {
        bench.type_in(typed);
    }
    bench.rest(210);
    bench.type_in("save");
    let saved = *bench.console.settings();
    assert!((saved.calibration.gyro_offset - CHIPS.gyro_offset).abs().max() < 0.003);
    bench.type_in("reset");
    assert_eq!(*bench.console.settings(), Settings::default());
    bench.type_in("load");
    bench.type_in("stream off");
    assert_eq!(*bench.console.settings(), saved);
    let news: Vec<SettingsNews> =
        bench.answers().iter().filter_map(|m| if let Message::Event(Event::Settings(n)) = m { Some(*n) } else { None }).collect();
    assert_eq!(news, [SettingsNews::Saved, SettingsNews::Loaded]);
    assert_eq!(settings_store::save(&mut bench.flash, 0..2048, &Stale), SettingsNews::Saved);
    bench.type_in("load");
    bench.rest(1);
    let answers = bench.answers();
    assert_eq!(answers, [Message::Event(Event::Settings(SettingsNews::Damaged))], "stale");
    assert_eq!(*bench.console.settings(), saved, "what was in force stays");
}

/// What another version of the firmware stored.
#[derive(PartialEq)]
struct Stale;

impl settings_store::Stored for Stale {
    const VERSION: u8 = 77;
    fn write(&self, content: &mut [u8]) -> Option<usize> {
        content.get_mut(..100)?.fill(0);
        Some(100)
    }
    fn read(_: &[u8]) -> Option<Self> {
        Some(Self)
    }
}

#[test]
fn the_stream_is_what_was_asked_for() {
    let mut bench = Bench::new(11);
    let kinds = |bench: &mut Bench| {
        bench.answers();
        bench.rest(5);
        let raw = bench.said.iter().filter(|m| matches!(m, Message::Imu(_))).count();
        (raw, bench.said.iter().filter(|m| matches!(m, Message::ImuValues(_))).count())
    };
    assert_eq!(kinds(&mut bench), (5, 0));
    for (typed, wanted) in [("send calibrated", (0, 5)), ("send both", (5, 5)), ("send raw", (5, 0)), ("stream off", (0, 0))] {
        bench.type_in(typed);
        assert_eq!(kinds(&mut bench), wanted, "{typed}");
    }
    bench.type_in("once");
    assert_eq!(kinds(&mut bench), (1, 0), "one frame on request");
    bench.type_in("format text");
    assert_eq!(bench.console.settings().format, ImuFormat::Text);
    bench.answers();
    bench.type_in("errors");
    let answers = bench.answers();
    assert!(
        matches!(answers[..], [Message::ImuReport(ImuReport::Errors(e))] if e.alive == 7 && e.tick_span == [420_000; 2]),
        "{answers:?}"
    );
}
