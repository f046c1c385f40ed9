//! A burst on the flash image: every conversion of one channel, without a gap, beside the samples.
//!
//! What it is: a strain that swings as two sines and the converter's own noise; the burst is asked for over the line, its parts are put
//! together, and the swings are found in it where they are.
//! What can go wrong: a conversion that is left out between two ticks would shift the phase of everything behind it: the sine that is
//! fitted to the first half must go on through the second.
//! Build the image first: `cargo xtask image`

use firmware_rig::burst::LENGTH;
use frame::message::{BURST_PART, BurstPart, Command, Event, Health, Message, Setting};
use frame::units::Ticks;
use frame::wire::{Decoder, Encoder, LinkStats, MAX_WIRE};
use hal_sim::emulated::{Machine, Pins, Port, World, firmware, run};
use quadrig_tests::budget;
use std::f64::consts::TAU;

/// Mean of the strain, counts; amplitude and frequency of its two swings: a beam's first mode, and the pass of two blades at 4100 rev/min.
const MEAN: f64 = 1427.3;
const SWINGS: [(f64, f64); 2] = [(60.0, 41.9), (25.0, 2.0 * 4100.0 / 60.0)];
/// How often the pin's level is renewed, ns.
const RENEWED_NS: u64 = 100_000;
const MS: u64 = 1_000_000;

/// The swinging strain, and a host that sends each command at its time.
struct Swinging {
    script: Vec<(u64, Command)>,
    encoder: Encoder,
    read: usize,
    decoder: Decoder,
    parts: Vec<BurstPart>,
    refused: usize,
    samples: usize,
    health: Option<Health>,
}

impl World for Swinging {
    fn wake(&mut self, now_ns: u64, pins: &mut Pins<'_>) -> u64 {
        if now_ns == 0 {
            pins.set_adc_noise(1.2);
            [2048.0, 248.0, 2380.0, 900.0].iter().enumerate().for_each(|(n, level)| pins.set_adc(11 + n as u8, *level));
            pins.drive(Port::B, 12, false);
        }
        let t = now_ns as f64 * 1e-9;
        pins.set_adc(10, MEAN + SWINGS.iter().map(|(counts, hz)| counts * (TAU * hz * t).sin()).sum::<f64>());
        if let Some(&(_, command)) = self.script.first().filter(|(ms, _)| now_ns >= ms * MS) {
            let mut wire = [0; MAX_WIRE];
            let used = self.encoder.encode(Ticks(now_ns), &command, &mut wire).expect("it fits");
            pins.say(&wire[..used]);
            self.script.remove(0);
        }
        let bytes = pins.heard();
        for byte in &bytes[self.read..] {
            match self.decoder.push::<Message>(*byte).map(|r| r.message) {
                Some(Message::BurstPart(part)) => self.parts.push(part),
                Some(Message::Rig(_)) => self.samples += 1,
                Some(Message::Health(health)) => self.health = Some(health),
                Some(Message::Event(Event::Refused(_))) => self.refused += 1,
                _ => {}
            }
        }
        self.read = bytes.len();
        now_ns + RENEWED_NS
    }
}

fn recorded(script: Vec<(u64, Command)>, milliseconds: u64) -> (Swinging, LinkStats) {
    let elf = firmware("firmware-rig").unwrap_or_else(|e| panic!("{e}"));
    let world = Swinging {
        script,
        encoder: Encoder::default(),
        read: 0,
        decoder: Decoder::default(),
        parts: Vec::new(),
        refused: 0,
        samples: 0,
        health: None,
    };
    let machine = Machine::new().unwrap_or_else(|e| panic!("{e}"));
    let (outcome, _) = run(&elf, machine, world, milliseconds * MS).unwrap_or_else(|e| panic!("{e}"));
    let stats = outcome.world.decoder.stats();
    (outcome.world, stats)
}

/// Amplitude and phase of a swing of `hz` in `codes`, and their mean, by least squares over a stretch that begins at `from`.
fn swing(codes: &[f64], from: usize, rate: f64, hz: f64) -> (f64, f64) {
    let mean = codes.iter().sum::<f64>() / codes.len() as f64;
    let (mut re, mut im) = (0.0, 0.0);
    for (n, code) in codes.iter().enumerate() {
        let phase = TAU * hz * (from + n) as f64 / rate;
        // a window without which the other swing would leak in
        let window = 1.0 - (TAU * (n as f64 + 0.5) / codes.len() as f64).cos();
        re += window * (code - mean) * phase.cos();
        im += window * (code - mean) * phase.sin();
    }
    let n = codes.len() as f64;
    (2.0 * re.hypot(im) / n, re.atan2(im))
}

/// Length of a recording, ms: a report of the health, which comes once a second, is in it.
const END_MS: u64 = 1_200;

#[test]
fn every_conversion_of_one_channel_arrives_in_order_beside_the_samples() {
    for (log_ms, rate_wanted, budget) in [(100u16, 61_764.7, "tick_cycles"), (1, 155_555.6, "tick_cycles_at_1_khz")] {
        let script = vec![
            (60, Command::Configure(Setting::LogPeriodMs(log_ms))),
            (200, Command::Burst { channel: 0 }),
            (210, Command::Burst { channel: 9 }),
        ];
        let (heard, stats) = recorded(script, END_MS);
        println!("{log_ms} ms: {} samples, {} parts, {} refused; {stats:?}", heard.samples, heard.parts.len(), heard.refused);
        assert_eq!((stats.damaged, stats.missing), (0, 0), "no frame is lost for it");
        assert_eq!(heard.refused, 1, "there is no tenth channel");
        let parts = &heard.parts;
        assert!(parts.iter().all(|p| p.channel == 0 && usize::from(p.length) == LENGTH), "{:?}", parts.first());
        let places: Vec<usize> = parts.iter().map(|p| usize::from(p.at)).collect();
        assert_eq!(places, (0..LENGTH).step_by(BURST_PART).collect::<Vec<_>>(), "every part, once and in order");
        let rate = f64::from(parts[0].rate_hz);
        assert!((rate / rate_wanted - 1.0).abs() < 1e-5, "{rate}");
        let codes: Vec<f64> = parts.iter().flat_map(|p| p.codes.iter().flatten().map(|c| f64::from(*c))).take(LENGTH).collect();
        let halves = [(0, &codes[..LENGTH / 2]), (LENGTH / 2, &codes[LENGTH / 2..])];
        for (counts, hz) in SWINGS {
            let [(a, p), (b, q)] = halves.map(|(from, half)| swing(half, from, rate, hz));
            let turned = (p - q + 1.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
            println!("{log_ms} ms, {hz:.1} Hz of {counts}: {a:.2} and {b:.2} counts, turned by {turned:.4} rad");
            if LENGTH as f64 / 2.0 / rate * hz > 6.0 {
                assert!((a / counts - 1.0).abs() < 0.03 && (b / counts - 1.0).abs() < 0.03, "{a} and {b} of {counts} counts");
                // a conversion left out is 2 pi hz / rate
                assert!(turned.abs() < 0.02, "{turned} rad");
            }
        }
        let wanted = (END_MS - 100) / u64::from(log_ms);
        assert!(heard.samples as u64 + 10 >= wanted, "{} samples of {wanted}", heard.samples);
        let cycles = heard.health.expect("a report").tick_cycles;
        println!("{log_ms} ms: at most {cycles} cycles a tick");
        assert!((1..=budget::rig(budget)).contains(&cycles), "{cycles} cycles, {budget} = {}", budget::rig(budget));
    }
}
