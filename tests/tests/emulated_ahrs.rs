//! The flash image of the IMU board, run on the emulated STM32F405 with three sensor models on its bus.
//!
//! Build the image first: `cargo xtask image`

use frame::message::BoardId;
use frame::wire::{Decoder, LinkStats};
use frame::{Hello, ImuSample, Message, TestAccel, Ticks};
use hal_sim::emulated::ahrs::{AhrsRun, BusFault, ChipKind, Motion, Served, ahrs};

/// Registers that the emulator stores without a model and that the image is known to touch.
const STORED_ONLY: [&str; 0] = [];

/// 30 deg/s about an oblique axis, from an oblique attitude: every word moves and has its own value.
const OBLIQUE: Motion = Motion { start: [0.3, -0.4, 1.9], rate: [0.35, -0.2, 0.33], ..Motion::LEVEL };

fn decoded(run: &AhrsRun) -> (Hello, Vec<ImuSample>, LinkStats) {
    let mut decoder = Decoder::default();
    let messages: Vec<Message> =
        run.outcome.telemetry.iter().filter_map(|b| decoder.push::<Message>(*b)).map(|r| r.message).collect();
    let Some(Message::Hello(hello)) = messages.first() else { panic!("the first message is not Hello: {messages:?}") };
    let samples = messages.iter().filter_map(|m| if let Message::Imu(s) = m { Some(*s) } else { None }).collect();
    (*hello, samples, decoder.stats())
}

fn run(motion: Motion, fitted: &[ChipKind], milliseconds: u64) -> AhrsRun {
    run_with(motion, fitted, BusFault::None, milliseconds)
}

/// Runs the image; it touches nothing undefined, is never reset, and refuses the last byte of every read.
fn run_with(motion: Motion, fitted: &[ChipKind], fault: BusFault, milliseconds: u64) -> AhrsRun {
    let run = ahrs(motion, fitted, fault, milliseconds).unwrap_or_else(|error| panic!("{error}"));
    run.outcome.accesses.only(&STORED_ONLY).unwrap();
    assert_eq!(run.unfinished, 0, "reads whose last byte was acknowledged");
    run
}

/// The board lies flat: chip y and z are opposite to body y and z.
fn body(served: &Served) -> [i16; 3] {
    let [x, y, z] = served.words;
    [x, -y, -z]
}

/// Every word that was sent as fresh is the word that the chip handed out, in order, none left out.
fn words_match(samples: &[ImuSample], served: &[Vec<Served>; 3]) {
    for (n, served) in served.iter().enumerate() {
        let fresh: Vec<[i16; 3]> =
            samples.iter().filter(|s| s.fresh & 1 << n != 0).map(|s| [s.gyro, s.accel, s.mag][n]).collect();
        let handed: Vec<[i16; 3]> = served.iter().take(fresh.len()).map(body).collect();
        assert_eq!(fresh, handed, "sensor {n}");
        assert!(served.len() <= fresh.len() + 2, "sensor {n}: the last readings may still be on the line, no more");
    }
}

#[test]
fn the_image_boots_finds_three_sensors_and_streams_their_words() {
    let run = run(OBLIQUE, &ChipKind::ALL, 1000);
    let (hello, samples, link) = decoded(&run);

    assert_eq!((hello.board, hello.core_hz, hello.present), (BoardId::Ahrs, 168_000_000, 0b111));
    assert_eq!((link.damaged, link.missing, link.foreign), (0, 0, 0));
    words_match(&samples, &run.served);

    // 200 Hz, to the tick of the timestamp clock but for the interrupt latency
    assert!((195..=200).contains(&samples.len()), "{} samples in a second", samples.len());
    for pair in samples.windows(2) {
        let step = pair[1].at.since(pair[0].at);
        assert!(step.0.abs_diff(Ticks::from_ms(5).0) <= 84, "{} ticks", step.0);
    }
    let fresh = |bit: u8| samples.iter().filter(|s| s.fresh & bit != 0).count();
    assert_eq!((fresh(1), fresh(2)), (samples.len(), samples.len()), "gyro and accelerometer on every tick");
    assert_eq!(fresh(4), samples.len().div_ceil(3), "magnetometer on every third");
    assert!(samples.iter().all(|s| s.alive == 0b111 && s.temperature == -13_200));

    // and the words are what the physics says, not merely what the models said: a chip in a wrong range or asleep shows here
    assert!(samples.iter().all(|s| s.gyro == [288, -165, 272]), "0.35, -0.2, 0.33 rad/s at 14.375 LSB per deg/s");
    let length = |words: [i16; 3]| words.iter().map(|w| f64::from(*w).powi(2)).sum::<f64>().sqrt();
    assert!(samples.iter().all(|s| (length(s.accel) - 256.0).abs() < 1.0), "1 g at 256 LSB");
    assert!(samples.iter().all(|s| (length(s.mag) - 0.4833 * 1090.0).abs() < 1.0), "0.4833 G at 1090 LSB");
    let distinct: std::collections::BTreeSet<_> = samples.iter().map(|s| s.accel).collect();
    assert!(distinct.len() > 100, "the body turns, so the words change: {}", distinct.len());
}

#[test]
fn the_attitude_on_the_wire_is_that_of_the_body() {
    let run = run(OBLIQUE, &ChipKind::ALL, 1000);
    let (_, samples, _) = decoded(&run);
    let mut worst = 0.0f64;
    for (sample, served) in samples.iter().zip(&run.served[0]) {
        let [w, x, y, z] = sample.quaternion_q30.map(|q| f64::from(q) / f64::from(1 << 30));
        let told = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ];
        let truth = OBLIQUE.attitude(served.at_ns);
        let trace: f64 = (0..3).flat_map(|i| (0..3).map(move |j| (i, j))).map(|(i, j)| told[i][j] * truth[i][j]).sum();
        worst = worst.max(((trace - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees());
    }
    // the words are rounded to 0.22 degrees of tilt and 0.26 of heading, and the start is taken from one of them
    println!("worst attitude error {worst:.3} deg");
    assert!(worst < 0.5, "{worst}");
}

#[test]
fn a_missing_sensor_is_absent_in_hello_and_the_rest_streams() {
    for (missing, name) in ChipKind::ALL.iter().enumerate() {
        let fitted: Vec<ChipKind> = ChipKind::ALL.into_iter().filter(|kind| kind != name).collect();
        let run = run(Motion::LEVEL, &fitted, 300);
        let (hello, samples, _) = decoded(&run);
        let expected = 0b111 & !(1 << missing);
        assert_eq!(hello.present, expected, "{name:?} is missing");
        assert!(samples.len() >= 55, "{} samples", samples.len());
        assert!(samples.iter().all(|s| s.alive == expected && s.fresh & 1 << missing == 0));
        words_match(&samples, &run.served);
    }
}

/// Oblique, so that every word has its own value; none of the tests above fits the test accelerometer, and that is no fault there.
#[test]
fn the_test_accelerometer_is_found_and_its_words_arrive() {
    let fitted: Vec<ChipKind> = ChipKind::ALL.into_iter().chain([ChipKind::Lis3dh]).collect();
    let run = run(OBLIQUE, &fitted, 600);
    let (hello, samples, link) = decoded(&run);
    assert_eq!((hello.present, link.damaged, link.missing), (0b1111, 0, 0));
    assert!(samples.iter().all(|s| s.alive == 0b1111));
    words_match(&samples, &run.served);
    let mut decoder = Decoder::default();
    let messages = run.outcome.telemetry.iter().filter_map(|b| decoder.push::<Message>(*b)).map(|r| r.message);
    let told: Vec<TestAccel> = messages.filter_map(|m| if let Message::TestAccel(t) = m { Some(t) } else { None }).collect();
    assert!((38..=40).contains(&told.len()), "every third tick of 600 ms: {}", told.len());
    // the chip's twelve bits sit left justified in its registers
    let handed: Vec<[i16; 3]> = run.test_served.iter().take(told.len()).map(|s| body(s).map(|w| w >> 4)).collect();
    assert_eq!(told.iter().map(|t| t.words).collect::<Vec<_>>(), handed);
    let length = |w: [i16; 3]| w.iter().map(|w| f64::from(*w).powi(2)).sum::<f64>().sqrt() * 0.012;
    assert!(told.iter().all(|t| (length(t.words) - 1.0).abs() < 0.01), "1 g at 12 mg a digit");
    let distinct: std::collections::BTreeSet<_> = told.iter().map(|t| t.words).collect();
    assert!(distinct.len() > 10, "the body turns, so the words change: {}", distinct.len());
}

#[test]
fn with_no_sensor_at_all_the_board_says_hello_and_stays_alive() {
    let run = run(Motion::LEVEL, &[], 300);
    let (hello, samples, link) = decoded(&run);
    assert_eq!((hello.present, samples.len(), link.good), (0, 0, 3), "the greeting, that no settings are stored, and the clock");
}

#[test]
fn the_run_is_the_same_every_time() {
    let once = || run(Motion::LEVEL, &ChipKind::ALL, 100).outcome;
    let (a, b) = (once(), once());
    assert_eq!((a.telemetry, a.instructions), (b.telemetry, b.instructions));
}

#[test]
fn a_loose_plug_is_told_and_heals() {
    let plug = BusFault::LoosePlug { nth: 1, off_ns: 200_000_000, back_ns: 400_000_000 };
    let run = run_with(OBLIQUE, &ChipKind::ALL, plug, 1600);
    let (_, samples, link) = decoded(&run);
    assert_eq!((link.damaged, link.missing), (0, 0));
    let told = |ms: u64| samples.iter().find(|s| s.at.as_ms() >= ms).map(|s| (s.alive, s.fresh & 3)).unwrap();
    assert_eq!(told(190), (0b111, 0b11));
    assert_eq!(told(205), (0b111, 0b01), "a reading is lost, the sensor not yet");
    assert_eq!(told(240), (0b101, 0b01), "after five lost readings it is");
    assert_eq!(told(1550), (0b111, 0b11), "back within a second of the plug");
}

#[test]
fn a_held_data_line_is_clocked_free() {
    let held = BusFault::HeldData { from_ns: 201_000_000, clocks: 5 };
    let run = run_with(OBLIQUE, &ChipKind::ALL, held, 400);
    let (_, samples, link) = decoded(&run);
    assert_eq!((link.damaged, link.missing), (0, 0));
    assert_eq!(run.outcome.world.clocks_seen, 5);
    let lost: Vec<_> = samples.iter().filter(|s| s.fresh & 3 != 3).collect();
    assert!(lost.len() <= 1, "one reading is the price: {lost:?}");
    assert!(samples.iter().all(|s| s.alive == 0b111));
    assert!(samples.last().unwrap().at.as_ms() > 390);
}

#[test]
fn a_bus_that_stays_held_costs_the_sensors_and_not_the_board() {
    let held = BusFault::HeldData { from_ns: 201_000_000, clocks: 0 };
    let run = run_with(OBLIQUE, &ChipKind::ALL, held, 700);
    let (_, samples, link) = decoded(&run);
    assert_eq!((link.damaged, link.missing), (0, 0));
    let last = samples.last().unwrap();
    // 5 failed reads of the magnetometer take 15 ticks; then nothing lives and there is nothing to say
    assert!((200..300).contains(&last.at.as_ms()), "{last:?}");
    assert!(run.outcome.world.clocks_seen >= 9 * 5, "{} clocks", run.outcome.world.clocks_seen);
}

#[test]
fn a_missing_image_says_how_to_build_it() {
    let error = hal_sim::emulated::firmware("firmware-none").unwrap_err().to_string();
    assert!(error.contains("firmware-none") && error.contains("cargo xtask image"), "{error}");
    assert_eq!(error.lines().count(), 1);
}
