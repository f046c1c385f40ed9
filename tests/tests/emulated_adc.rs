//! Effective bits of the strain channel on the emulated board: the flash image, five channels, a constant input, the converter's
//! 12-bit quantisation, and noise drawn at every single conversion.

use frame::message::{Command, Message, Setting};
use frame::rig::{ADC_NAMES, AdcVerdict, RigSample};
use frame::units::Ticks;
use frame::wire::{Decoder, Encoder, MAX_WIRE};
use hal_sim::emulated::{Machine, Pins, Port, World, firmware, run};

/// Levels of the five channels, counts, none of them on a code.
const LEVELS: [f64; 5] = [1427.31, 2048.77, 248.05, 2379.5, 900.23];

/// Constant levels, and one command at the beginning.
struct Constant {
    noise: f64,
    command: Option<Command>,
    next_ms: u64,
    read: usize,
    decoder: Decoder,
    samples: Vec<RigSample>,
}

impl World for Constant {
    fn wake(&mut self, now_ns: u64, pins: &mut Pins<'_>) -> u64 {
        pins.set_adc_noise(self.noise);
        for (n, level) in LEVELS.iter().enumerate() {
            pins.set_adc(10 + n as u8, *level);
        }
        pins.drive(Port::B, 12, false);
        if now_ns > 60_000_000
            && let Some(command) = self.command.take()
        {
            let mut wire = [0; MAX_WIRE];
            let used = Encoder::default().encode(Ticks(1), &command, &mut wire).expect("it fits");
            pins.say(&wire[..used]);
        }
        let bytes = pins.heard();
        for byte in &bytes[self.read..] {
            if let Some(received) = self.decoder.push::<Message>(*byte)
                && let Message::Rig(sample) = received.message
            {
                self.samples.push(sample);
            }
        }
        self.read = bytes.len();
        self.next_ms += 1;
        self.next_ms * 1_000_000
    }
}

fn measure(log_ms: u16, noise: f64, milliseconds: u64) -> Vec<RigSample> {
    let elf = firmware("firmware-rig").unwrap_or_else(|e| panic!("{e}"));
    let command = (log_ms != 100).then_some(Command::Configure(Setting::LogPeriodMs(log_ms)));
    let world = Constant { noise, command, next_ms: 0, read: 0, decoder: Decoder::default(), samples: Vec::new() };
    let machine = Machine::new().unwrap_or_else(|e| panic!("{e}"));
    let (outcome, _) = run(&elf, machine, world, milliseconds * 1_000_000).unwrap_or_else(|e| panic!("{e}"));
    let samples = outcome.world.samples;
    // the first ones were taken at another rate
    samples.into_iter().skip(6).collect()
}

/// Most ticks of 84 MHz by which two samples may be further apart or nearer than the log period: a microsecond.
const JITTER: u64 = 84;

/// Effective bits by the specification: log2(full scale / (rms of the means x sqrt 12)).
fn bits(samples: &[RigSample], channel: usize) -> (f64, f64) {
    let means: Vec<f64> = samples.iter().map(|s| f64::from(s.adc[channel].sum) / f64::from(s.adc[channel].count)).collect();
    let n = means.len() as f64;
    let mean = means.iter().sum::<f64>() / n;
    let rms = (means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    ((4096.0 / (rms * 12f64.sqrt())).log2(), mean)
}

fn check(log_ms: u16, noise: f64, milliseconds: u64) {
    let samples = measure(log_ms, noise, milliseconds);
    let due = Ticks::from_ms(u64::from(log_ms)).0;
    let off: Vec<i64> = samples.windows(2).map(|w| w[1].at.since(w[0].at).0.cast_signed() - due.cast_signed()).collect();
    let jitter = off.iter().map(|t| t.unsigned_abs()).max().unwrap_or(u64::MAX);
    println!("{log_ms} ms: jitter {jitter} ticks of 84 MHz");
    assert!(jitter <= JITTER, "{off:?}");
    for (channel, name) in ADC_NAMES.iter().enumerate() {
        let fewest = samples.iter().map(|s| s.adc[channel].count).min().unwrap_or(0);
        let (bits, mean) = bits(&samples, channel);
        let off = mean - LEVELS[channel];
        println!(
            "{log_ms} ms, {noise} LSB: {name:>9} {bits:.2} bits from {fewest} conversions, {} samples, mean off by {off:+.4} counts",
            samples.len()
        );
        assert!(fewest >= 1024, "{name}: {fewest} conversions");
        assert!(bits >= 16.0, "{name}: {bits} bits");
        // white noise of each conversion, the quantisation's own twelfth included, averaged over all of them: anything more (a slow
        // drift, a correlation between conversions) would show as fewer bits than these
        let ideal = (4096.0 / ((noise * noise + 1.0 / 12.0) / fewest as f64).sqrt() / 12f64.sqrt()).log2();
        // bits from the scatter of n means have a standard error of 1 / (ln 2 sqrt(2 (n - 1)))
        let error = 1.0 / (std::f64::consts::LN_2 * (2.0 * (samples.len() as f64 - 1.0)).sqrt());
        assert!((bits - ideal).abs() < 4.0 * error, "{name}: {bits} bits, white noise gives {ideal} +- {error}");
        assert!(off.abs() < 0.02, "{name}: the mean is {off} counts off");
        for sample in &samples {
            assert_eq!(sample.adc[channel].verdict, AdcVerdict::Nominal);
            let rms = f64::from(sample.adc[channel].rms_q8) / 256.0;
            let truth = (noise * noise + 1.0 / 12.0).sqrt();
            assert!((rms / truth - 1.0).abs() < 0.1, "{name}: rms {rms}, put in {truth}");
        }
    }
}

/// The default rate, with the noise of the simulated bench (1.2 LSB rms). The 6180 conversions of a sample give 16.2 bits, and it takes
/// some 150 samples to measure that to less than a tenth of a bit: from 60 of them the scatter read 15.99 to 16.3.
#[test]
fn sixteen_bits_at_ten_samples_a_second() {
    check(100, 1.2, 16_000);
}

/// The highest rate, with the least noise that the specification asks for.
#[test]
fn sixteen_bits_at_a_hundred_samples_a_second() {
    check(10, 0.5, 1_100);
}
