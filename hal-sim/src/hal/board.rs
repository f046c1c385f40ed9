//! The rig board's program over the back ends.
//!
//! What it is: what the flash image does with registers (`firmware-rig/src/main.rs`), in the same order: twice a millisecond a look for a
//! stop, once a millisecond [`Rig::tick`] with what queues, converter and line hold, its pulse to the timer, the watchdog fed, its telemetry
//! onto the line. Everything that decides is the portable firmware's.
//! What can go wrong: a half tick that is not called is a program that hangs: the watchdog then resets the pins.
//! Units: ns since power-up; ticks of 84 MHz.
//! Reference: specification `rig.md`; house rule 1 (ticks without I/O).

use super::{CaptureTimer, PulsePin, RigPins, ScanConverter, SerialEnd, Watchdog};
use embedded_hal::pwm::SetDutyCycle;
use embedded_io::{Read, ReadReady, Write};
use esc_pwm::{PulseTimer, TimerError};
use firmware_rig::queue::EdgeQueue;
use firmware_rig::{CommandLine, Config, Inputs, Rig, StopWatch};
use frame::calibration::Calibration;
use frame::message::{Command, Message};
use frame::rig::CAPTURE_CHANNELS;
use frame::units::{PulseWidth, Ticks};
use frame::wire::{Encoder, MAX_WIRE};

/// Clock of the pulse timer, Hz, and the bits of its counter.
const PULSE_CLOCK: (u32, u32) = (84_000_000, 16);
/// The board's watchdog, ns.
const WATCHDOG_NS: u64 = 20_000_000;

/// The board from a reset on, with any pulse output and any serial line.
pub struct RigBoard<P, L> {
    rig: Rig,
    timer: PulseTimer,
    pulse: P,
    line: L,
    captures: CaptureTimer,
    queues: [EdgeQueue; CAPTURE_CHANNELS],
    converter: ScanConverter,
    watchdog: Watchdog,
    commands: CommandLine,
    encoder: Encoder,
    stops: StopWatch,
    now: Ticks,
    told: Calibration,
    reset_cause: u8,
}

impl RigBoard<PulsePin, SerialEnd> {
    /// The program's start after a reset: peripherals, then who speaks.
    ///
    /// # Errors
    /// [`TimerError`] where the pulse timer cannot give 50 Hz.
    pub fn start(pins: &RigPins, line: SerialEnd, config: Config) -> Result<Self, TimerError> {
        let timer = PulseTimer::new(PULSE_CLOCK.0, PULSE_CLOCK.1)?;
        let rig = Rig::new(config);
        let mut board = Self {
            timer,
            pulse: PulsePin::start(pins, timer, timer.ticks(PulseWidth::MIN) as u16),
            line,
            captures: CaptureTimer::start(pins),
            queues: Default::default(),
            converter: ScanConverter::start(pins, rig.config().sampling_cycles()),
            watchdog: Watchdog::start(pins, WATCHDOG_NS),
            commands: CommandLine::new(),
            encoder: Encoder::default(),
            stops: StopWatch::default(),
            now: Ticks(0),
            told: rig.calibration(),
            reset_cause: pins.reset_cause(),
            rig,
        };
        let hello = Message::Hello(board.rig.hello(board.reset_cause));
        board.tell(&hello);
        board.tell(&Message::Calibration(board.told));
        Ok(board)
    }
}

impl<P: SetDutyCycle, L: Read + ReadReady + Write> RigBoard<P, L> {
    /// The portable firmware, for reading.
    #[must_use]
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// What the board's timer interrupt does every half millisecond.
    pub fn half_tick(&mut self) {
        let mut byte = [0];
        while matches!(self.line.read_ready(), Ok(true)) && matches!(self.line.read(&mut byte), Ok(1)) {
            self.commands.take(byte[0]);
        }
        let half = self.stops.half(false, self.commands.stop_waits());
        if half.minimum {
            self.give(PulseWidth::MIN);
        }
        if half.tick {
            self.tick();
        }
    }

    fn tick(&mut self) {
        let over_capture = self.captures.serve(&self.queues);
        let edges = self.queues.each_ref().map(|queue| core::iter::from_fn(|| queue.take()).collect::<Vec<u32>>());
        let counter = self.captures.counter();
        self.now = Ticks(self.now.0 + u64::from(counter.wrapping_sub(self.now.0 as u32)));
        let (command, line) = self.commands.next_command();
        let outputs = self.rig.tick(&Inputs {
            now: self.now,
            edges: edges.each_ref().map(Vec::as_slice),
            over_capture,
            adc: self.converter.drain(),
            command,
            line,
            stop_input: self.stops.take(),
            brown_out: false,
            paused: false,
        });
        self.give(outputs.pulse);
        self.watchdog.feed();
        if let Some(sample) = outputs.sample {
            self.tell(&Message::Rig(sample));
        }
        if let Some(event) = outputs.event {
            self.tell(&Message::Event(event));
        }
        let identify = command == Some(Command::Identify);
        if identify {
            let hello = Message::Hello(self.rig.hello(self.reset_cause));
            self.tell(&hello);
        }
        let calibration = self.rig.calibration();
        if identify || calibration != self.told {
            self.told = calibration;
            self.tell(&Message::Calibration(calibration));
        }
    }

    /// A pulse from the next period on. The pin of the simulation cannot fail; one that does leaves the last pulse.
    fn give(&mut self, pulse: PulseWidth) {
        let _ = self.pulse.set_duty_cycle(self.timer.ticks(pulse) as u16);
    }

    /// A message onto the line; what does not fit or cannot be sent is a gap in the sequence, as on the board.
    fn tell(&mut self, message: &Message) {
        let mut wire = [0; MAX_WIRE];
        if let Ok(count) = self.encoder.encode(self.now, message, &mut wire) {
            let _ = self.line.write_all(&wire[..count]);
        }
    }
}
