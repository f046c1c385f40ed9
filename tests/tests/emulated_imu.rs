//! The IMU board twice: its flash image on the emulated STM32F405 and its portable half natively, on the same body and chips.
//!
//! What it is: chips with bias, scale, misalignment, noise, iron and warm-up on a body that turns and shakes; the words, the attitude and
//! the sensors' health of both runs are compared, in good order and with the bus faults of a scenario file.
//! What can go wrong: the two read a chip some microseconds apart, so a word of a moving axis may round the other way.
//! Build the image first: `cargo xtask image`

use firmware_ahrs::GyroReading;
use firmware_ahrs::{Ahrs, AhrsConfig, Inputs, Readings};
use frame::wire::Decoder;
use frame::{ImuSample, Message};
use hal_sim::Scenario;
use hal_sim::emulated::ahrs::{AhrsRun, ahrs_with};
use hal_sim::imu::{BusFault, Errors, Hidden, ImuEffectKind, ImuScheduled, Motion};
use hal_sim::native::ahrs::{ImuRig, ImuRun, run_at};
use quadrig_tests::budget::judge_tick;
use std::path::Path;

/// Turning about an oblique axis and shaken, with the accelerometer off the centre.
const MOVING: Motion = Motion {
    start: [0.3, -0.4, 1.9],
    rate: [0.35, -0.2, 0.33],
    shake_m: [0.002, 0.001, -0.003],
    shake_hz: 4.0,
    lever_m: [0.03, -0.02, 0.01],
    ..Motion::LEVEL
};

fn rig(fault: BusFault) -> ImuRig {
    ImuRig { motion: MOVING, errors: Errors::drawn(3), fault, ..ImuRig::default() }
}

fn image(rig: &ImuRig, milliseconds: u64) -> (AhrsRun, Vec<ImuSample>) {
    let run = ahrs_with(rig, milliseconds).unwrap_or_else(|e| panic!("{e}"));
    run.outcome.accesses.only(&[]).unwrap();
    let mut decoder = Decoder::default();
    let messages = run.outcome.telemetry.iter().filter_map(|b| decoder.push::<Message>(*b)).map(|r| r.message);
    let samples = messages.filter_map(|m| if let Message::Imu(s) = m { Some(s) } else { None }).collect();
    (run, samples)
}

/// The native run with its ticks where the image had them. The image's clock starts a little after power-up: the first burst of each
/// tick leaves the board 45 us after its tick (two addresses and a register at 400 kHz, and the code before them).
fn native(rig: &ImuRig, samples: &[ImuSample], run: &AhrsRun) -> ImuRun {
    let ns = |s: &ImuSample| s.at.0 * 1000 / 84;
    let lead = run.served[0].iter().zip(samples).map(|(served, s)| served.at_ns - ns(s)).min().expect("samples");
    let ticks: Vec<u64> = samples.iter().map(|s| ns(s) + lead - 50_000).collect();
    run_at(rig, &ticks).unwrap_or_else(|e| panic!("{e:?}"))
}

/// The chips' words, handed to the portable tick at the image's own instants: its telemetry, to the bit.
#[test]
fn the_portable_tick_makes_the_image_s_telemetry_of_the_same_words() {
    let (run, samples) = image(&rig(BusFault::None), 1000);
    let mut ahrs = Ahrs::new(AhrsConfig::default());
    let mut served = run.served.each_ref().map(|chip| chip.iter());
    let (mut equal, mut worst) = (0, 0u32);
    for sample in &samples {
        let mut next = |chip: usize| {
            if sample.fresh & 1 << chip != 0 { served[chip].next().map(|s| s.words) } else { None }
        };
        let gyro = next(0).map(|rate| GyroReading { temperature: sample.temperature, rate });
        let readings = Readings { gyro, accel: next(1), mag: next(2), alive: sample.alive, ..Readings::default() };
        let told = ahrs.tick(&Inputs { now: sample.at, readings }).sample.expect("sensors live");
        equal += usize::from(told == *sample);
        let apart = told.quaternion_q30.iter().zip(sample.quaternion_q30).map(|(a, b)| a.abs_diff(b)).max().unwrap_or(0);
        worst = worst.max(apart);
        let integers = |s: &ImuSample| (s.at, s.gyro, s.accel, s.mag, s.temperature, s.fresh, s.alive);
        assert_eq!(integers(&told), integers(sample));
    }
    println!("{equal} of {} samples bit-equal; quaternions apart by {worst} of 2^30 at most", samples.len());
    assert!(samples.len() >= 195);
    // single precision has 2^-24 of one: 64 units of 2^-30; each tick's rounding may differ by one
    assert!(worst <= 64 * 200, "{worst}");
}

/// The same scenario on both, each with its own bus.
#[test]
fn the_native_bus_gives_what_the_emulated_one_gives() {
    let rig = rig(BusFault::None);
    let (run, samples) = image(&rig, 1500);
    let native = native(&rig, &samples, &run);
    assert_eq!(native.samples.len(), samples.len());
    assert_eq!(native.hello.present, 0b111);
    for (name, words) in [
        ("gyro", (|s| s.gyro) as fn(&ImuSample) -> [i16; 3]),
        ("accelerometer", |s| s.accel),
        ("magnetometer", |s| s.mag),
        ("temperature", |s| [s.temperature; 3]),
    ] {
        let pairs = || samples.iter().zip(&native.samples).flat_map(|(a, b)| words(a).into_iter().zip(words(b)));
        let equal = pairs().filter(|(a, b)| a == b).count();
        let worst = pairs().map(|(a, b)| a.abs_diff(b)).max().expect("words");
        println!("{name}: {equal} of {} words bit-equal, {worst} LSB apart at most", pairs().count());
        assert!(worst <= 1 && equal * 100 >= pairs().count() * 97, "{name}");
    }
    let flags = |s: &ImuSample| (s.fresh, s.alive);
    assert!(samples.iter().zip(&native.samples).all(|(a, b)| flags(a) == flags(b)));
    // twice the distance of the quaternions, for small angles; single precision does not keep their length for an arc cosine
    let angle = |(a, b): (&ImuSample, &ImuSample)| {
        let apart = a.quaternion_q30.iter().zip(b.quaternion_q30).map(|(a, b)| f64::from(*a) - f64::from(b));
        (2.0 * apart.map(|d| d * d).sum::<f64>().sqrt() / 2f64.powi(30)).to_degrees()
    };
    // up to the first word that rounds the other way the runs are one; such a word of the first samples then weighs 1/n in the start,
    // and a step of the accelerometer is 0.22 degrees
    let same = |(a, b): (&ImuSample, &ImuSample)| (a.gyro, a.accel, a.mag) == (b.gyro, b.accel, b.mag);
    let first = samples.iter().zip(&native.samples).position(|pair| !same(pair)).unwrap_or(samples.len());
    let worst = |from: usize, to: usize| samples[from..to].iter().zip(&native.samples[from..to]).map(angle).fold(0.0, f64::max);
    let (before, after) = (worst(0, first), worst(first, samples.len()));
    println!("attitudes apart by {before:.6} deg at most before the first word differs (sample {first}), {after:.6} after it");
    assert!(before < 0.001 && after < 0.05, "{before} {after}");
}

/// What is hidden about the sensors acts on both boards, word by word.
#[test]
fn hidden_effects_are_the_same_on_both() {
    let plain = image(&rig(BusFault::None), 1000).1;
    let mut acted = Vec::new();
    for id in ImuEffectKind::IDS {
        let effect = ImuEffectKind::draw(id, 5, 1.0).expect("an effect");
        let hidden = Hidden::new(&[ImuScheduled { from_s: None, until_s: None, effect }]);
        let rig = ImuRig { hidden, ..rig(BusFault::None) };
        let (run, samples) = image(&rig, 1000);
        let native = native(&rig, &samples, &run);
        let words = |s: &ImuSample| [s.gyro, s.accel, s.mag, [s.temperature; 3]].into_iter().flatten();
        let pairs = || samples.iter().zip(&native.samples).flat_map(|(a, b)| words(a).zip(words(b)));
        let equal = pairs().filter(|(a, b)| a == b).count();
        let worst = pairs().map(|(a, b)| a.abs_diff(b)).max().expect("words");
        let moved = samples.iter().zip(&plain).filter(|(a, b)| words(a).ne(words(b))).count();
        println!(
            "{id}: {equal} of {} words bit-equal, {worst} LSB apart at most; {moved} samples changed by it",
            pairs().count()
        );
        assert!(worst <= 1 && equal * 100 >= pairs().count() * 97, "{id}");
        if moved > 0 {
            acted.push(*id);
        }
    }
    // some begin later than the run ends
    assert!(acted.len() * 3 >= ImuEffectKind::IDS.len() * 2, "{acted:?}");
}

/// A scenario file's bus faults reach both boards, and both tell the same of them.
#[test]
fn the_bus_faults_of_a_scenario_are_the_same_on_both() {
    let cases = [
        ("i2c_nack", "chip = 1\nfrom_s = 0.2\nuntil_s = 0.4", 1600, 0b010),
        ("i2c_nack", "chip = 2\nfrom_s = 0.3\nuntil_s = 0.5", 1600, 0b100),
        ("i2c_stuck", "from_s = 0.2\nuntil_s = 0.3", 600, 0),
    ];
    for (id, keys, milliseconds, dies) in cases {
        let text = format!("[[fault]]\nid = \"{id}\"\n{keys}\n");
        let scenario = Scenario::parse(&text, Path::new("bus.toml")).unwrap_or_else(|e| panic!("{e}"));
        let rig = rig(BusFault::of(&scenario));
        assert_ne!(rig.fault, BusFault::None);
        let (run, samples) = image(&rig, milliseconds);
        let native = native(&rig, &samples, &run);
        let flags = |s: &ImuSample| (s.fresh, s.alive);
        let differ = samples.iter().zip(&native.samples).filter(|(a, b)| flags(a) != flags(b)).count();
        let lost = |samples: &[ImuSample]| samples.iter().filter(|s| s.fresh & 3 != 3).count();
        println!(
            "{id} {keys:?}: {} samples, {} and {} with a reading lost, flags of {differ} differ, {} and {} clocks on a held bus",
            samples.len(),
            lost(&samples),
            lost(&native.samples),
            run.outcome.world.clocks_seen,
            native.clocks_seen
        );
        assert!(differ <= 1, "the fault may begin between the two reads of a tick");
        let died = |samples: &[ImuSample]| samples.iter().fold(0, |bits, s| bits | (!s.alive & 0b111));
        assert_eq!((died(&samples), died(&native.samples)), (dies, dies));
        assert_eq!(run.outcome.world.clocks_seen, native.clocks_seen);
        assert!(samples.last().is_some_and(|s| s.alive == 0b111), "it heals");
    }
}

#[test]
fn instructions_per_tick_stay_in_their_budget() {
    let count = |milliseconds| image(&rig(BusFault::None), milliseconds).0.outcome.instructions;
    judge_tick("ahrs", "tick", (count(900) - count(300)) as f64 / 120.0, 840_000.0);
}
