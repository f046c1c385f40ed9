//! Faults at the pins of the rig board.
//!
//! What it is: what can go wrong at a pin ([`Mishap`]), which fault the board must latch for it and how long it may take to notice
//! it, a seeded choice of one ([`Plan`]), and the campaign that flies them natively ([`campaign`]).
//! What can go wrong: a plan that never reaches its mishap is reported by the campaign as a failure, not as a pass.
//! Units: ms.
//! Reference: specification `rig.md`, "Protection" and "The simulator" (faults at any time).

pub mod campaign;

use crate::noise::{Source, Stream};
use frame::rig::Fault;

/// What goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Mishap {
    /// A capture line sticks at its level: the sensor is gone, or its wire.
    StuckLine {
        /// 0 beam, 1 reflective, 2 hall, 3 encoder.
        channel: u8,
    },
    /// An ADC pin sits at an end of its range.
    Saturated {
        /// 0 strain, 1 torque, 2 current, 3 voltage, 4 temperature.
        channel: u8,
        /// At the reference; otherwise at ground.
        high: bool,
    },
    /// The converter delivers nothing any more.
    NoConversions,
    /// Every frame of the host arrives damaged.
    CorruptFrames,
    /// A frame of the host arrives a second time.
    Replay,
    /// The host falls silent.
    Silence,
    /// The board's own supply falls below the voltage detector's level, but not below the reset level.
    SupplyDip,
    /// The board's own supply falls below the reset level and comes back.
    PowerLoss,
    /// The control task comes late once.
    LateTick {
        /// By how much, ms.
        ms: u8,
    },
    /// The control task does not come any more.
    Hang,
    /// The stop loop opens: the key, its wire or its plug.
    StopOpen,
}

/// Highest time from a mishap to the instant at which the board can know it, ms, and where it comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detection {
    /// The time, ms.
    pub ms: f64,
    /// Its source in words.
    pub why: &'static str,
}

/// Reaction after detection: specification, issue of 40 ms (two frames of the ESC).
pub const REACTION_MS: f64 = 40.0;
/// Time between two frames of the host that is still normal, ms: the command line and the simulated hosts ping at this rate.
pub const PING_MS: u64 = 200;

impl Mishap {
    /// Every kind once.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let mut list: Vec<Self> = (0..4).map(|channel| Self::StuckLine { channel }).collect();
        list.extend((0..5).flat_map(|channel| [true, false].map(|high| Self::Saturated { channel, high })));
        list.extend([
            Self::NoConversions,
            Self::CorruptFrames,
            Self::Replay,
            Self::Silence,
            Self::SupplyDip,
            Self::PowerLoss,
            Self::LateTick { ms: 7 },
            Self::Hang,
            Self::StopOpen,
        ]);
        list
    }

    /// The fault that must be latched and named; `None` where a reset answers.
    #[must_use]
    pub const fn fault(self) -> Option<Fault> {
        Some(match self {
            Self::StuckLine { .. } => Fault::SensorLost,
            Self::Saturated { channel: 0, .. } => Fault::LoadCellOverload,
            Self::Saturated { channel: 2, high: true } => Fault::OverCurrent,
            Self::Saturated { channel: 3, high: false } => Fault::UnderVoltage,
            Self::Saturated { .. } | Self::NoConversions => Fault::AdcLost,
            Self::CorruptFrames => Fault::LinkCorrupt,
            Self::Replay => Fault::CommandReplayed,
            Self::Silence => Fault::LinkLost,
            Self::SupplyDip => Fault::BrownOut,
            Self::LateTick { .. } => Fault::ControlStalled,
            Self::StopOpen => Fault::OperatorStop,
            Self::PowerLoss | Self::Hang => return None,
        })
    }

    /// Time to detection at a rotor speed of `rpm` with `marks` marks a revolution on the channels.
    #[must_use]
    pub fn detection(self, rpm: f64, marks: [u16; 4]) -> Detection {
        let say = |ms, why| Detection { ms, why };
        match self {
            Self::StuckLine { channel } => {
                let period = 60_000.0 / rpm / f64::from(marks.get(usize::from(channel)).copied().unwrap_or(1).max(1));
                say(3.0 * period + 70.0 + 1.0, "3 expected periods and 20 ms of silence, then 50 ms")
            }
            Self::Saturated { .. } | Self::NoConversions => say(101.0, "100 ms of the limit's time"),
            Self::CorruptFrames => say(3.0 * PING_MS as f64 + 2.0, "the third damaged frame; the host sends one each 0.2 s"),
            Self::Replay => say(2.0, "the frame's end and one tick"),
            Self::Silence => say(1001.0, "1 s after the last frame"),
            Self::SupplyDip => say(1.0, "one tick"),
            Self::PowerLoss => say(0.0, "the reset is the detection"),
            Self::LateTick { ms } => say(f64::from(ms) + 1.0, "the late tick itself"),
            Self::StopOpen => say(1.0, "one tick"),
            Self::Hang => say(38.0, "20 ms watchdog, 38 ms with the slowest oscillator"),
        }
    }

    /// The mishap in words.
    #[must_use]
    pub fn words(self) -> String {
        let channel = |n: u8| frame::rig::CAPTURE_NAMES.get(usize::from(n)).copied().unwrap_or("?");
        match self {
            Self::StuckLine { channel: n } => format!("stuck line of {}", channel(n)),
            Self::Saturated { channel: n, high } => {
                let name = frame::rig::ADC_NAMES.get(usize::from(n)).copied().unwrap_or("?");
                format!("{name} at the {} end of the converter", if high { "high" } else { "low" })
            }
            Self::NoConversions => "no conversions".to_owned(),
            Self::CorruptFrames => "every command frame damaged".to_owned(),
            Self::Replay => "a command frame replayed".to_owned(),
            Self::Silence => "host silent".to_owned(),
            Self::SupplyDip => "board supply below 2.9 V".to_owned(),
            Self::PowerLoss => "board supply lost (brown-out reset)".to_owned(),
            Self::LateTick { ms } => format!("control tick {ms} ms late"),
            Self::Hang => "control task hangs".to_owned(),
            Self::StopOpen => "stop loop open".to_owned(),
        }
    }
}

/// One run with one mishap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan {
    /// Seed of everything random in it.
    pub seed: u64,
    /// Level that is run, us.
    pub pulse_us: u32,
    /// From the start of that level to the mishap, ms.
    pub after_ms: u64,
    /// The mishap.
    pub mishap: Mishap,
}

impl Plan {
    /// The plan of a seed: kinds follow one another, so that any run of 23 seeds holds each; level and instant are drawn.
    #[must_use]
    pub fn of(seed: u64) -> Self {
        let mut draw = Stream::new(seed, Source::Phase, 77);
        let kinds = Mishap::all();
        let mishap = match kinds[(seed % kinds.len() as u64) as usize] {
            Mishap::LateTick { .. } => Mishap::LateTick { ms: 6 + (draw.uniform() * 8.0) as u8 },
            other => other,
        };
        let pulse_us = 1200 + (draw.uniform() * 500.0) as u32;
        let after_ms = 450 + (draw.uniform() * 250.0) as u64;
        Self { seed, pulse_us, after_ms, mishap }
    }
}
