//! The kinds of mishap in words.
//!
//! What it is: one line for each, as the tables show it.
//! What can go wrong: nothing.
//! Units: none.
//! Reference: `docs/faults.md`.

use super::{Mishap, Request};
use frame::rig::{ADC_NAMES, CAPTURE_NAMES};

fn line(n: u8) -> &'static str {
    CAPTURE_NAMES.get(usize::from(n)).copied().unwrap_or("?")
}

fn input(n: u8) -> &'static str {
    ADC_NAMES.get(usize::from(n)).copied().unwrap_or("?")
}

fn end(high: bool) -> &'static str {
    if high { "high" } else { "low" }
}

impl Mishap {
    /// The mishap in words.
    #[must_use]
    pub fn words(self) -> String {
        match self {
            Self::StuckLine { channel } => format!("stuck line of {}", line(channel)),
            Self::Stray { channel } => format!("stray edges on {}", line(channel)),
            Self::Misses { channel } => format!("{} misses marks", line(channel)),
            Self::Doubles { channel } => format!("{} sees marks twice", line(channel)),
            Self::Uneven { channel } => format!("{}: two marks not opposite", line(channel)),
            Self::Skewed { channel } => format!("{} reads a few per cent off", line(channel)),
            Self::Fast { channel } => format!("{} alone reads beyond the speed limit", line(channel)),
            Self::Screams { channel } => format!("{} screams", line(channel)),
            Self::Overwritten { channel } => format!("{}: an edge overwritten", line(channel)),
            Self::FloatingLine { channel } => format!("{} not fitted, its pin floats", line(channel)),
            Self::TwoMiss { a, b } => format!("{} and {} miss marks", line(a), line(b)),
            Self::TwoSkewed { a, b } => format!("{} and {} read off", line(a), line(b)),
            Self::TwoFast { a, b } => format!("{} and {} read beyond the speed limit", line(a), line(b)),
            Self::Saturated { channel, high } => format!("{} at the {} end of the converter", input(channel), end(high)),
            Self::Contact { channel } => format!("loose contact of {}", input(channel)),
            Self::FloatingInput { channel } => format!("{} not fitted, its pin floats", input(channel)),
            Self::Overload { up } => format!("load cell overloaded {}", if up { "upwards" } else { "downwards" }),
            Self::Twist { up } => format!("torque beyond its {} limit", end(up)),
            Self::Supply { high } => format!("ESC's supply {}", if high { "too high" } else { "too low" }),
            Self::Temperature { high } => format!("temperature beyond its {} limit", end(high)),
            Self::Partial { front } => format!("only the {} half of every command frame", if front { "front" } else { "back" }),
            Self::RotorTurns { channel } => format!("range calibration: {} sees the rotor turn", line(channel)),
            Self::Asked(request) => format!("host: {}", request.words()),
            other => other.plain().to_owned(),
        }
    }

    /// The words of a kind without a place.
    const fn plain(self) -> &'static str {
        match self {
            Self::Nothing => "nothing: a healthy rig",
            Self::NoConversions => "no conversions",
            Self::Gap => "no conversions for a short time",
            Self::OverCurrent => "current beyond its limit",
            Self::Overspeed => "throttle beyond the speed limit",
            Self::PowerCut => "ESC's battery comes off",
            Self::PulseWire => "ESC's pulse wire comes off",
            Self::CorruptFrames => "every command frame damaged",
            Self::OneCorrupt => "one command frame damaged",
            Self::Garbage => "random bytes on the line",
            Self::Echo => "the board hears itself",
            Self::Replay => "a command frame replayed",
            Self::Silence => "host silent",
            Self::LateHost => "host silent for a little less than it may",
            Self::StreamDry => "schedule runs dry",
            Self::EscNoSignal => "ESC beeps: no signal",
            Self::EscFails => "ESC beeps: self-test failed",
            Self::SupplyDip => "board supply below 2.9 V",
            Self::PowerLoss => "board supply lost (brown-out reset)",
            Self::ResetKey => "reset key",
            Self::LateTick { .. } => "control tick late",
            Self::Hang => "control task hangs",
            Self::Panic => "program panics",
            Self::HardFault => "hard fault",
            Self::CrystalFails => "crystal fails",
            Self::SaveCut => "board supply lost in the midst of a save",
            Self::StopOpen => "stop loop open",
            Self::StopBlink => "stop loop open for a millisecond",
            Self::StopHeld => "stop loop open at power-on",
            Self::CrystalDead => "crystal dead at power-on",
            Self::EscMute => "ESC never answers",
            Self::NotIdle => "range calibration: current above idle",
            Self::Unheard => "range calibration: nobody passes the beeps on",
            Self::OpenSense => "range calibration with the supply's sense wire off",
            _ => "?",
        }
    }
}

impl Request {
    /// The request in words.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Stop => "stop",
            Self::Minimum => "back to minimum",
            Self::Arm => "arm again",
            Self::Calibrate => "range calibration",
            Self::TryPanic => "self-test's panic",
            Self::TryHang => "self-test's hang",
            Self::TryLate => "self-test's late tick",
            Self::Configure => "another setting",
            Self::Apply => "a configuration that was never sent",
            Self::Save => "settings into flash",
            Self::Tare => "tare",
            Self::Clear => "clear faults",
            Self::Schedule => "a schedule that was never sent",
            Self::TooHigh => "a pulse beyond 2000 us",
        }
    }
}
