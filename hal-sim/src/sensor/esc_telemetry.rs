//! The ESC's own sensors, and the line on which it tells what they say.
//!
//! What it is: speed by commutation, current and voltage behind a filter and with errors of their own, temperature, charge; a KISS frame of
//! ten bytes each 31 ms, or when one is asked for, on a wire that may be cut, noisy, or at another rate than the receiver's.
//! What can go wrong: what a receiver makes of another rate is sampled bit by bit: other bytes, and framing errors.
//! Units: V, A, degC, rev/min; ns.
//! Reference: KISS ESC telemetry protocol; RM0090 sections 30.3.1 and 30.3.3 (a start bit, eight data bits, a stop bit; sampled in the middle).
//! The size of the errors is assumed: BLHeli_32 states none, and current shunts of ESCs are known to some per cent.

use crate::noise::{Source, Stream};
use crate::plant::PlantState;
use firmware_rig::esc_line::LINE_ERROR;
use std::collections::VecDeque;

/// Rate of the line, baud.
pub const BAUD: u32 = 115_200;
/// Bits of a byte with its start and its stop.
const BITS: usize = 10;
/// Bytes of a frame.
const BYTES: usize = 10;

/// What an ESC's own sensors are off by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EscErrors {
    /// Current that it tells without any, A. It tells none below zero.
    pub current_offset_a: f64,
    /// Factor on the current.
    pub current_gain: f64,
    /// Factor on the voltage.
    pub voltage_gain: f64,
    /// Time constant of current and voltage, s.
    pub lag_s: f64,
    /// What its sensor reads above its temperature, K.
    pub temperature_k: f64,
    /// Relative error of its clock: of the line's rate and of the time between two frames.
    pub clock: f64,
}

impl Default for EscErrors {
    fn default() -> Self {
        Self { current_offset_a: 0.25, current_gain: 1.03, voltage_gain: 0.995, lag_s: 0.02, temperature_k: 2.0, clock: 0.004 }
    }
}

/// What becomes of the line between ESC and board.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum EscWire {
    /// Nothing.
    #[default]
    Sound,
    /// It is cut.
    Cut,
    /// A byte comes as another one, half of these with a framing error.
    Noisy {
        /// Probability of each byte.
        probability: f64,
    },
    /// The ESC sends at this rate.
    Baud(u32),
}

/// The ESC's telemetry.
#[derive(Debug, Clone)]
pub struct EscTelemetry {
    errors: EscErrors,
    pole_pairs: u32,
    /// It sends only when it is asked.
    by_request: bool,
    asked: bool,
    wire: EscWire,
    volts: f64,
    amps: f64,
    charge_as: f64,
    next_ns: u64,
    noise: Stream,
    words: VecDeque<(u64, u16)>,
}

/// Time between two frames that it sends by itself, ns.
const INTERVAL_NS: f64 = 31.0e6;

impl EscTelemetry {
    /// Of an ESC at a motor of so many pole pairs.
    #[must_use]
    pub fn new(errors: EscErrors, pole_pairs: u32, by_request: bool, seed: u64) -> Self {
        let noise = Stream::new(seed, Source::EscLine, 0);
        Self {
            errors,
            pole_pairs,
            by_request,
            asked: false,
            wire: EscWire::Sound,
            volts: 0.0,
            amps: 0.0,
            charge_as: 0.0,
            next_ns: 0,
            noise,
            words: VecDeque::new(),
        }
    }

    /// What becomes of the line from here on.
    pub fn set_wire(&mut self, wire: EscWire) {
        self.wire = wire;
    }

    /// A frame is asked for: it is sent within the next millisecond.
    pub fn ask(&mut self) {
        self.asked = true;
    }

    /// A millisecond that ends at `now_ns`. `awake`: the ESC has power and has started.
    pub fn millisecond(&mut self, now_ns: u64, awake: bool, plant: &PlantState, temperature_c: f64) {
        if !awake {
            (self.volts, self.amps, self.charge_as) = (0.0, 0.0, 0.0);
            self.asked = false;
            return;
        }
        let share = 1.0e-3 / (self.errors.lag_s + 1.0e-3);
        self.volts += share * (plant.voltage_v - self.volts);
        self.amps += share * (plant.current_a - self.amps);
        self.charge_as += self.told_a() * 1.0e-3;
        let due = std::mem::take(&mut self.asked) || !self.by_request && now_ns >= self.next_ns;
        if !due {
            return;
        }
        self.next_ns = now_ns + (INTERVAL_NS / (1.0 + self.errors.clock)) as u64;
        let frame = frame([
            (temperature_c + self.errors.temperature_k).round().clamp(0.0, 255.0) as u16,
            hundredths(self.volts * self.errors.voltage_gain),
            hundredths(self.told_a()),
            (self.charge_as / 3.6) as u16,
            (plant.rpm * f64::from(self.pole_pairs) / 100.0).round() as u16,
        ]);
        self.send(now_ns, &frame);
    }

    fn told_a(&self) -> f64 {
        (self.amps * self.errors.current_gain + self.errors.current_offset_a).max(0.0)
    }

    fn send(&mut self, from_ns: u64, frame: &[u8; BYTES]) {
        let rate = |baud: u32| f64::from(baud) * (1.0 + self.errors.clock);
        let byte_ns = 1.0e9 * BITS as f64 / rate(BAUD);
        let end = |n: usize| from_ns + (byte_ns * (n + 1) as f64) as u64;
        match self.wire {
            EscWire::Cut => {}
            EscWire::Sound => self.words.extend(frame.iter().enumerate().map(|(n, byte)| (end(n), u16::from(*byte)))),
            EscWire::Noisy { probability } => {
                for (n, byte) in frame.iter().enumerate() {
                    let hit = self.noise.uniform() < probability;
                    let other = (self.noise.uniform() * 256.0) as u16;
                    let error = if self.noise.uniform() < 0.5 { LINE_ERROR } else { 0 };
                    self.words.push_back((end(n), if hit { other.min(255) | error } else { u16::from(*byte) }));
                }
            }
            EscWire::Baud(baud) => {
                let heard = sampled(frame, rate(baud));
                self.words.extend(heard.into_iter().map(|(s, word)| (from_ns + (1.0e9 * s) as u64, word)));
            }
        }
    }

    /// The next byte that has ended by `until_ns`, marked where it came with an error of the line.
    pub fn word(&mut self, until_ns: u64) -> Option<u16> {
        let due = self.words.front().is_some_and(|(end, _)| *end <= until_ns);
        if due { self.words.pop_front().map(|(_, word)| word) } else { None }
    }
}

fn hundredths(value: f64) -> u16 {
    (100.0 * value).round().clamp(0.0, 65_535.0) as u16
}

/// A frame of temperature (one byte), voltage, current, charge and speed (two each), with the remainder of its division by x^8 + x^2 + x + 1.
fn frame([temperature, rest @ ..]: [u16; 5]) -> [u8; BYTES] {
    let mut bytes = [temperature as u8; BYTES];
    for (pair, value) in bytes[1..].chunks_exact_mut(2).zip(rest) {
        pair.copy_from_slice(&value.to_be_bytes());
    }
    // the long division bit by bit, with eight zeros behind the nine bytes
    let mut remainder = 0u32;
    for bit in (0..8 * BYTES).map(|n| if n / 8 < BYTES - 1 { bytes[n / 8] >> (7 - n % 8) & 1 } else { 0 }) {
        remainder = remainder << 1 | u32::from(bit);
        if remainder & 0x100 != 0 {
            remainder ^= 0x107;
        }
    }
    bytes[BYTES - 1] = remainder as u8;
    bytes
}

/// What a receiver at [`BAUD`] makes of a frame that is sent at `baud`: bytes with the time of their end, s.
fn sampled(frame: &[u8; BYTES], baud: f64) -> Vec<(f64, u16)> {
    let bits: Vec<bool> =
        frame.iter().flat_map(|byte| (0..BITS).map(move |n| n == 9 || n > 0 && byte >> (n - 1) & 1 != 0)).collect();
    let level = |s: f64| bits.get((s * baud) as usize).copied().unwrap_or(true);
    let bit_s = 1.0 / f64::from(BAUD);
    let mut words = Vec::new();
    let mut from = 0; // bits of the sender that are behind the receiver
    while let Some(start) = (from..bits.len()).find(|n| !bits[*n] && (*n == 0 || bits[*n - 1])) {
        let begin = start as f64 / baud;
        let at = |n: usize| level(begin + (n as f64 + 0.5) * bit_s);
        if at(0) {
            from = start + 1; // no start bit: too short
            continue;
        }
        let byte = (0..8).fold(0, |byte, n| byte | u16::from(at(n + 1)) << n);
        words.push((begin + BITS as f64 * bit_s, if at(9) { byte } else { byte | LINE_ERROR }));
        from = (((begin + 9.5 * bit_s) * baud) as usize).max(start + 1);
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use firmware_rig::esc_line::figures;

    fn awake(wire: EscWire, ms: u64) -> (EscTelemetry, Vec<u16>) {
        let mut esc = EscTelemetry::new(EscErrors::default(), 11, false, 5);
        esc.set_wire(wire);
        let plant = PlantState { rpm: 4_105.0, voltage_v: 11.48, current_a: 12.0, ..PlantState::default() };
        let mut words = Vec::new();
        for n in 1..=ms {
            esc.millisecond(n * 1_000_000, n > 100, &plant, 38.6);
            words.extend(std::iter::from_fn(|| esc.word(n * 1_000_000)));
        }
        (esc, words)
    }

    #[test]
    fn its_frames_check_and_carry_what_its_own_sensors_say() {
        let (_, words) = awake(EscWire::Sound, 1_100);
        assert_eq!(words.len(), 10 * 33, "a frame in 31 ms");
        let frames: Vec<_> = words.chunks(10).map(|w| std::array::from_fn(|n| w[n] as u8)).collect();
        let told: Vec<_> = frames.iter().map(|bytes| figures(bytes).expect("it checks")).collect();
        let last = told.last().expect("frames");
        assert_eq!((last.temperature, last.voltage, last.current, last.speed), (41, 1142, 1261, 452));
        assert!(told[0].current < 200 && last.charge == 3, "behind its filter, and with its charge: {told:?}");
    }

    #[test]
    fn what_the_wire_does_is_heard() {
        let sound = awake(EscWire::Sound, 1_100).1;
        assert!(awake(EscWire::Cut, 1_100).1.is_empty());
        let noisy = awake(EscWire::Noisy { probability: 0.2 }, 1_100).1;
        let other = sound.iter().zip(&noisy).filter(|(a, b)| a != b).count();
        assert!((40..90).contains(&other), "{other} of 330");
        assert_eq!(awake(EscWire::Baud(BAUD), 1_100).1, sound, "the right rate, sampled bit by bit");
        assert_eq!(awake(EscWire::Baud(117_000), 1_100).1, sound, "1.6 % off is no matter");
        for baud in [19_200, 57_600, 230_400] {
            let heard = awake(EscWire::Baud(baud), 1_100).1;
            let errors = heard.iter().filter(|w| **w & LINE_ERROR != 0).count();
            assert!(heard.len() > 60 && heard != sound, "{baud}: {} bytes", heard.len());
            assert!(errors > 0 || baud > BAUD, "{baud}: {errors} framing errors");
        }
    }

    #[test]
    fn one_that_has_to_be_asked_sends_a_frame_a_question() {
        let mut esc = EscTelemetry::new(EscErrors::default(), 11, true, 5);
        let mut words = 0;
        for n in 1..=300u64 {
            if n % 100 == 50 {
                esc.ask();
            }
            esc.millisecond(n * 1_000_000, true, &PlantState::default(), 20.0);
            words += std::iter::from_fn(|| esc.word(n * 1_000_000)).count();
        }
        assert_eq!(words, 30);
    }
}
