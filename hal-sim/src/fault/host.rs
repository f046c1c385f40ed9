//! The far side of a flight: a host that arms, runs, asks, and hears.
//!
//! What it is: encoder and decoder of the line, and all that was told.
//! What can go wrong: a frame that does not fit is not sent.
//! Units: ms since power-up.
//! Reference: specification `formats.md`, "Telemetry".

use super::{Course, Plan, Request};
use firmware_rig::rig_config::Answers;
use frame::message::{Beep, Command, Event, Message, Setting, Trial};
use frame::rig::{CaptureVerdict, FaultSet, RigState};
use frame::schedule::{Segment, SegmentBatch, Shape};
use frame::units::{PulseWidth, Ticks};
use frame::wire::{Decoder, Encoder, MAX_WIRE};

/// The host's clock when the board is switched on: hosts count from 1970.
const SINCE_1970: Ticks = Ticks(1_764_000_000 * Ticks::HZ as u64);

/// The host.
#[derive(Default)]
pub(super) struct Host {
    encoder: Encoder,
    decoder: Decoder,
    pub(super) state: RigState,
    pub(super) faults: FaultSet,
    pub(super) last_frame: Vec<u8>,
    pub(super) sent_ms: u64,
    pub(super) refused: bool,
    /// What ended the program was told.
    pub(super) ended: bool,
    /// Verdicts of every sample.
    pub(super) verdicts: Vec<[CaptureVerdict; 4]>,
    /// State to which an answer was given already.
    pub(super) answered: Option<RigState>,
}

impl Host {
    pub(super) fn frame(&mut self, ms: u64, command: Command) -> Vec<u8> {
        let mut wire = [0; MAX_WIRE];
        let used = self.encoder.encode(Ticks(SINCE_1970.0 + Ticks::from_ms(ms).0), &command, &mut wire).unwrap_or(0);
        self.sent_ms = ms;
        self.last_frame = wire[..used].to_vec();
        self.last_frame.clone()
    }

    pub(super) fn hear(&mut self, bytes: &[u8]) {
        for byte in bytes {
            match self.decoder.push::<Message>(*byte).map(|r| r.message) {
                Some(Message::Event(event)) => self.take(event),
                Some(Message::Rig(sample)) => {
                    self.state = sample.state;
                    self.faults = FaultSet(self.faults.0 | sample.faults.0);
                    self.verdicts.push(sample.rpm.map(|code| code.verdict));
                }
                _ => {}
            }
        }
    }

    fn take(&mut self, event: Event) {
        match event {
            Event::State { to, .. } => self.state = to,
            Event::Faults { faults, .. } => self.faults = FaultSet(self.faults.0 | faults.0),
            Event::Refused(_) => self.refused = true,
            Event::Panicked { .. } | Event::Crashed(_) => self.ended = true,
            _ => {}
        }
    }
}

/// The beep that an ESC gives in a state of the arming machine; `None` where the state waits for none.
#[must_use]
pub fn arming_beep(state: RigState, answers: Answers) -> Option<Beep> {
    match (state, answers) {
        (RigState::ArmHoldMin, Answers::LongCellsReady | Answers::LongReady) => Some(Beep::Long),
        (RigState::ArmCells, Answers::LongCellsReady) => Some(Beep::Cells(3)),
        (RigState::ArmReady, Answers::LongCellsReady | Answers::LongReady) => Some(Beep::Ready),
        _ => None,
    }
}

/// Segments of a plan's schedule: seven drawn ones of `each_ms` and a last one of a minute.
fn segments(plan: &Plan, each_ms: u32) -> [Segment; 8] {
    core::array::from_fn(|n| {
        let up = (plan.seed >> n) & 1 == 1;
        let pulse = PulseWidth::from_us(if up { plan.pulse_us } else { 1250 });
        let shape = match (plan.seed >> (n + 8)) % 3 {
            0 => Shape::Line { from: None },
            1 => Shape::Steered { low: PulseWidth::from_us(1200), high: PulseWidth::from_us(1750) },
            _ => Shape::Hold,
        };
        Segment { pulse, length_ms: if n == 7 { 60_000 } else { each_ms }, shape: if n == 0 { Shape::Hold } else { shape } }
    })
}

impl Plan {
    /// What the host sends to begin its course, frame by frame.
    #[must_use]
    pub fn beginning(&self) -> Vec<Command> {
        let pulse = PulseWidth::from_us(self.pulse_us);
        match self.course {
            Course::Level | Course::Steps => vec![Command::SetPulse(pulse)],
            Course::Ramp => {
                let (from, to) = (PulseWidth::from_us(1200), pulse.max(PulseWidth::from_us(1300)));
                vec![Command::RunRamp { from, to, length_ms: 30_000 }]
            }
            Course::Chirp => {
                let centre = PulseWidth::from_us(self.pulse_us.clamp(1300, 1600));
                let amplitude = PulseWidth(60_000);
                vec![Command::RunChirp { centre, amplitude, from_millihertz: 500, to_millihertz: 4000, length_ms: 60_000 }]
            }
            Course::Segments if self.mishap == super::Mishap::StreamDry => {
                let all = segments(self, (self.stream_ms() / 4) as u32);
                let batch = SegmentBatch { last: false, ..SegmentBatch::of(0, &all[..4]) };
                vec![Command::Segments(batch), Command::RunSchedule]
            }
            Course::Segments => vec![Command::Segments(SegmentBatch::of(0, &segments(self, 150))), Command::RunSchedule],
        }
    }

    /// Length of a stream that runs dry, ms.
    #[must_use]
    pub const fn stream_ms(&self) -> u64 {
        self.after_ms / 4 * 4
    }

    /// The next level of the course, `since` ms after its beginning.
    #[must_use]
    pub fn next_level(&self, since: u64) -> Option<Command> {
        let due = self.course == Course::Steps && since > 0 && since.is_multiple_of(170);
        due.then(|| {
            let place = crate::noise::chance(self.seed, since);
            Command::SetPulse(PulseWidth::from_us(1200 + (500.0 * place) as u32))
        })
    }
}

impl Request {
    /// The command on the line.
    #[must_use]
    pub const fn command(self) -> Command {
        match self {
            Self::Stop => Command::Stop,
            Self::Minimum => Command::SetPulse(PulseWidth::MIN),
            Self::Arm => Command::Arm,
            Self::Calibrate => Command::CalibrateRange { confirm: Command::CALIBRATE_CONFIRM },
            Self::TryPanic => Command::SelfTest { confirm: Command::SELF_TEST_CONFIRM, trial: Trial::Panic },
            Self::TryHang => Command::SelfTest { confirm: Command::SELF_TEST_CONFIRM, trial: Trial::Hang },
            Self::TryLate => Command::SelfTest { confirm: Command::SELF_TEST_CONFIRM, trial: Trial::Late },
            Self::Configure => Command::Configure(Setting::Marks([1, 1, 1, 1])),
            Self::Apply => Command::ConfigApply { length: 100, crc: 0 },
            Self::Save => Command::SaveSettings,
            Self::Tare => Command::Tare,
            Self::Clear => Command::ClearFaults,
            Self::Schedule => Command::RunSchedule,
            Self::TooHigh => Command::SetPulse(PulseWidth::from_us(2500)),
        }
    }
}
