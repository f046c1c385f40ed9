//! One script of bytes and pins, given to the flash image and to the native board: the same frames in the same order.
//!
//! What it is: constant codes at the ADC pins, the stop loop opened and closed, and the bytes of a host with everything a line can bring
//! (commands, beeps, a damaged frame, one that comes twice), the same for the emulated board and for `hal_sim::native::Board`. Once with
//! pulses, and once with DShot from the board's first configuration on: then every word on the ESC's line is compared as well.
//! What can go wrong: the image starts some milliseconds after power-up: times on the board's clock may differ by that, nothing else.
//! Build the image first: `cargo xtask image`

use esc_pwm::dshot::{EscOutput, Frame, Throttle};
use firmware_rig::{AdcBlock, Config, RigConfig};
use frame::message::{Beep, Command, ConfigPart, Event, Message, Setting};
use frame::rig::{ADC_CHANNELS, AdcVerdict};
use frame::units::{PulseWidth, Ticks};
use frame::wire::{Decoder, Encoder, MAX_WIRE};
use hal_sim::Millisecond;
use hal_sim::emulated::{Machine, Pins, Port, World, firmware, run};
use hal_sim::native::{Board, Wires};

const MS: u64 = 1_000_000;
/// Codes of the five ADC pins: 11.5 V at the ESC, nothing that moves.
const CODES: [u16; ADC_CHANNELS] = [1427, 2048, 248, 2380, 900];
/// ADC1 inputs of the same.
const ADC_INPUTS: [u8; ADC_CHANNELS] = [10, 11, 12, 13, 14];
/// Stop loop: pin of port B.
const STOP_PIN: u8 = 12;
/// The image runs this long after power-up, ms, at most.
const START_MS: u64 = 30;
const END_MS: u64 = 6_200;

/// What happens at a millisecond.
#[derive(Debug, Clone)]
enum Step {
    Say(Vec<u8>),
    StopLoop(bool),
}

/// The script: each step 40 ms behind a sample, so that a start that takes a few milliseconds moves none across one.
fn script(output: EscOutput) -> Vec<(u64, Step)> {
    let mut encoder = Encoder::default();
    let mut wire = |ms: u64, command: Command| {
        let mut bytes = [0; MAX_WIRE];
        let used = encoder.encode(Ticks::from_ms(ms), &command, &mut bytes).expect("it fits");
        bytes[..used].to_vec()
    };
    let commands = [
        Command::Identify,
        Command::SetPulse(PulseWidth::from_us(1500)), // refused: not armed
        Command::Configure(Setting::LogPeriodMs(50)),
        Command::Configure(Setting::LogPeriodMs(1001)),      // refused: no such rate
        Command::Configure(Setting::SlewNsPerMs(1_000_000)), // or the phase of the start would show in the ramp
        Command::ConfigRead { at: 32 },
        Command::Tare,
        Command::Burst { channel: 5 }, // refused: no such channel
        Command::Arm,
        Command::Beep(Beep::Long),
        Command::Beep(Beep::Cells(3)),
        Command::Beep(Beep::Ready),
        Command::SetPulse(PulseWidth::from_us(1200)),
        Command::Ping,
        Command::Identify,
        Command::Stop,
        Command::ClearFaults,
        Command::CalibrateRange { confirm: 0 }, // refused: every reason
    ];
    let mut steps = Vec::new();
    let mut ms = 140;
    let config = RigConfig { output, ..RigConfig::of(&Config::thesis_570kv()) };
    let parts: Vec<ConfigPart> = config.parts().collect();
    for part in &parts {
        steps.push((ms, Step::Say(wire(ms, Command::ConfigPart(*part)))));
        ms += 4;
    }
    let apply = Command::ConfigApply { length: parts[0].length, crc: config.digest() };
    steps.push((ms, Step::Say(wire(ms, apply))));
    ms = 340;
    for command in commands {
        steps.push((ms, Step::Say(wire(ms, command))));
        ms += 200;
    }
    let good = wire(ms, Command::Ping);
    let mut damaged = wire(ms, Command::Arm);
    damaged[3] ^= 0x55;
    steps.extend([(ms, Step::Say(good.clone())), (ms + 200, Step::Say(damaged)), (ms + 400, Step::Say(good))]);
    steps.extend([(ms + 600, Step::StopLoop(true)), (ms + 800, Step::StopLoop(false))]);
    assert!(ms + 900 < END_MS, "{ms}");
    steps
}

/// The script at the pins of the emulated board.
struct AtThePins {
    steps: Vec<(u64, Step)>,
    next: usize,
    ms: u64,
    /// Words of the ESC's line, each once until another comes.
    words: Vec<u16>,
}

impl World for AtThePins {
    fn wake(&mut self, _: u64, pins: &mut Pins<'_>) -> u64 {
        if self.ms == 0 {
            ADC_INPUTS.iter().zip(CODES).for_each(|(input, code)| pins.set_adc(*input, f64::from(code)));
            pins.drive(Port::B, STOP_PIN, false);
        }
        self.words.extend(pins.frames().iter().map(|frame| frame.word.expect("a frame")));
        self.words.dedup();
        while let Some((_, step)) = self.steps.get(self.next).filter(|(at, _)| *at <= self.ms) {
            match step {
                Step::Say(bytes) => pins.say(bytes),
                Step::StopLoop(open) => pins.drive(Port::B, STOP_PIN, *open),
            }
            self.next += 1;
        }
        self.ms += 1;
        self.ms * MS
    }
}

fn on_the_image(steps: Vec<(u64, Step)>) -> (Vec<u8>, Vec<u16>) {
    let elf = firmware("firmware-rig").unwrap_or_else(|e| panic!("{e}"));
    let machine = Machine::new().unwrap_or_else(|e| panic!("{e}"));
    let world = AtThePins { steps, next: 0, ms: 0, words: Vec::new() };
    let (outcome, _) = run(&elf, machine, world, END_MS * MS).unwrap_or_else(|e| panic!("{e}"));
    (outcome.telemetry, outcome.world.words)
}

fn natively(steps: &[(u64, Step)]) -> (Vec<u8>, Vec<u16>) {
    let mut words = Vec::new();
    let mut board = Board::new(Config::thesis_570kv());
    let mut sent = board.sent();
    let mut wires = Wires::SOUND;
    let adc = CODES.map(|code| {
        let mut block = AdcBlock::default();
        (0..62).for_each(|_| block.push(code));
        block
    });
    let gathered = Millisecond { adc, ..Millisecond::default() };
    for ms in 1..END_MS {
        for (_, step) in steps.iter().filter(|(at, _)| *at + 1 == ms) {
            match step {
                Step::Say(bytes) => board.hear(bytes),
                Step::StopLoop(open) => wires.stop_open = *open,
            }
        }
        board.millisecond(Ticks::from_ms(ms), &gathered, wires);
        sent.append(&mut board.sent());
        words.extend(board.frame().map(Frame::word));
        words.dedup();
    }
    (sent, words)
}

/// A message without what the two hosts cannot share: the instant of the start, how many conversions there were, what a processor measures
/// of itself. `at` is the time that it tells.
fn shared(message: Message) -> (Option<Ticks>, String) {
    let (at, message) = match message {
        Message::Rig(mut sample) => {
            for code in &mut sample.adc {
                code.sum = (f64::from(code.sum) / f64::from(code.count)).round() as u32;
                (code.count, code.rms_q8) = (1, 0);
            }
            let at = core::mem::take(&mut sample.at);
            (Some(at), Message::Rig(sample))
        }
        Message::Event(Event::State { from, to, at }) => (Some(at), Message::Event(Event::State { from, to, at: Ticks(0) })),
        Message::Event(Event::Faults { faults, at }) => (Some(at), Message::Event(Event::Faults { faults, at: Ticks(0) })),
        Message::Event(Event::StopLoop { open, at }) => (Some(at), Message::Event(Event::StopLoop { open, at: Ticks(0) })),
        Message::Event(Event::Clock(mut clock)) => {
            assert!(clock.measured_hz.abs_diff(clock.crystal_hz) <= clock.crystal_hz / 10, "{clock:?}");
            clock.measured_hz = 0;
            (None, Message::Event(Event::Clock(clock)))
        }
        Message::Hello(mut hello) => {
            hello.reset_cause = 0;
            (None, Message::Hello(hello))
        }
        other => (None, other),
    };
    (at, format!("{message:?}"))
}

fn told(bytes: &[u8]) -> Vec<(Option<Ticks>, String)> {
    let mut decoder = Decoder::default();
    let messages = bytes.iter().filter_map(|b| decoder.push::<Message>(*b)).map(|r| r.message);
    let told = messages.filter(|m| !matches!(m, Message::Health(_))).map(shared).collect();
    assert_eq!((decoder.stats().damaged, decoder.stats().missing), (0, 0));
    told
}

#[test]
fn the_same_bytes_and_pins_give_the_same_frames_natively_and_on_the_image() {
    let (_, words) = judge(EscOutput::Pwm);
    assert!(words.is_empty(), "pulses are no frames");
}

#[test]
fn with_dshot_the_words_on_the_line_are_the_same_too() {
    let (native, image) = judge(EscOutput::DShot300);
    assert_eq!(image, native);
    let level = Frame { throttle: Throttle::of(PulseWidth::from_us(1200)), telemetry: false }.word();
    assert_eq!(image, [Frame::STOP.word(), level, Frame::STOP.word()], "zero, the run at once, and the stop");
}

/// Plays the script to both; the words on their lines, the native board's first.
fn judge(output: EscOutput) -> (Vec<u16>, Vec<u16>) {
    let steps = script(output);
    let ((image, heard), (native, given)) = (on_the_image(steps.clone()), natively(&steps));
    let (image, native) = (told(&image), told(&native));
    for (n, ((at, a), (then, b))) in image.iter().zip(&native).enumerate() {
        assert_eq!(a, b, "message {n}: the image says the first, the native board the second");
        if let (Some(at), Some(then)) = (at, then) {
            let apart = at.0.abs_diff(then.0) / Ticks::from_ms(1).0;
            assert!(apart <= START_MS, "message {n}: {apart} ms apart");
        }
    }
    assert!(image.len().abs_diff(native.len()) <= 1, "{} and {}", image.len(), native.len());
    let all = |word: &str| image.iter().filter(|(_, m)| m.contains(word)).count();
    println!("{} messages, {} samples, {} events", image.len(), all("Rig(RigSample"), all("Event("));
    for word in ["Running", "Refused", "StopLoop", "1200000", "Calibration", "ConfigPart"] {
        assert!(all(word) > 0, "the script shows no {word}");
    }
    assert!(image.iter().any(|(_, m)| m.contains(&format!("{:?}", AdcVerdict::Nominal))), "conversions were read");
    (given, heard)
}
