//! DShot: throttle as a number of 11 bits with a checksum, in place of the width of a pulse.
//!
//! What it is: the throttle of a pulse ([`Throttle::of`]), the frame of 16 bits that carries it ([`Frame`]), and the frame as slots of a
//! timer ([`FrameTimer`]), in integers only.
//! What can go wrong: a clock that gives no exact bit, or none fine enough, is refused ([`TimerError`]); a word whose checksum is wrong is no
//! frame ([`Frame::from_word`]).
//! Units: nanoseconds of pulse, throttle 0 and 48 to 2047, timer ticks.
//! Reference: Betaflight, "DSHOT ESC Protocol"; BLHeli_S manual, "DShot". A bit of DShot600 takes 1.67 us, its high part 0.625 us for 0
//! and 1.25 us for 1; everything of DShot300 takes twice as long. RM0090 section 18.4.

use crate::timer::TimerError;
use crate::units::PulseWidth;

/// Bits of a frame, the most significant first.
pub const BITS: usize = 16;
/// Slots of a frame's period: its bits, and two in which the line is low.
pub const SLOTS: usize = BITS + 2;
/// Frames a second: one for each control tick.
pub const FRAME_HZ: u32 = 1000;
/// Fewest ticks of a bit: three eighths and six eighths of it stay within a twentieth of what they should be.
const FEWEST_TICKS: u32 = 16;
/// Most ticks of a slot: a reload register of 16 bits holds one less.
const MOST_TICKS: u32 = 1 << 16;

/// In which form the ESC is told its throttle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EscOutput {
    /// Pulses of 1000 to 2000 us, fifty a second.
    #[default]
    Pwm,
    /// Frames at 300 kbit/s, a thousand a second.
    DShot300,
    /// Frames at 600 kbit/s, a thousand a second.
    DShot600,
}

impl EscOutput {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Pwm, Self::DShot300, Self::DShot600];

    /// Bits a second of its frames; `None` of pulses.
    #[must_use]
    pub const fn bit_hz(self) -> Option<u32> {
        match self {
            Self::Pwm => None,
            Self::DShot300 => Some(300_000),
            Self::DShot600 => Some(600_000),
        }
    }

    /// Numbers instead of pulses: there is no throttle range to calibrate.
    #[must_use]
    pub const fn is_digital(self) -> bool {
        self.bit_hz().is_some()
    }
}

/// A throttle that a frame may carry: 0, or 48 to 2047. The numbers between are an ESC's special commands, and no value of this type is one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Throttle(u16);

impl Throttle {
    /// The motor stands.
    pub const STOP: Self = Self(0);
    /// The lowest at which it turns.
    pub const LOWEST: Self = Self(48);
    /// All there is.
    pub const HIGHEST: Self = Self(2047);

    /// The throttle of a pulse: 0 at minimum and below, above it evenly from 48 to 2047 at maximum, rounded to the nearest.
    #[must_use]
    pub const fn of(pulse: PulseWidth) -> Self {
        let pulse = pulse.clamped();
        if !pulse.is_live() {
            return Self::STOP;
        }
        let above = (pulse.0 - PulseWidth::MIN.0) as u64;
        let range = (PulseWidth::MAX.0 - PulseWidth::MIN.0) as u64;
        let steps = (Self::HIGHEST.0 - Self::LOWEST.0) as u64;
        Self(Self::LOWEST.0 + ((above * steps + range / 2) / range) as u16)
    }

    /// The throttle of a number; `None` of a special command and of what 11 bits do not hold.
    #[must_use]
    pub const fn new(number: u16) -> Option<Self> {
        if number == Self::STOP.0 || (number >= Self::LOWEST.0 && number <= Self::HIGHEST.0) { Some(Self(number)) } else { None }
    }

    /// The number.
    #[must_use]
    pub const fn get(self) -> u16 {
        self.0
    }

    /// The pulse that means the same, rounded to the nearest nanosecond. The lowest throttle is 1 ns above the minimum pulse.
    #[must_use]
    pub const fn pulse(self) -> PulseWidth {
        if self.0 < Self::LOWEST.0 {
            return PulseWidth::MIN;
        }
        let range = (PulseWidth::MAX.0 - PulseWidth::MIN.0) as u64;
        let steps = (Self::HIGHEST.0 - Self::LOWEST.0) as u64;
        let above = ((self.0 - Self::LOWEST.0) as u64 * range + steps / 2) / steps;
        PulseWidth(PulseWidth::MIN.0 + if above == 0 { 1 } else { above as u32 })
    }
}

/// One frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Frame {
    /// What the ESC is to give.
    pub throttle: Throttle,
    /// The ESC is asked for one frame of its telemetry.
    pub telemetry: bool,
}

impl Frame {
    /// The motor stands, and nothing is asked.
    pub const STOP: Self = Self { throttle: Throttle::STOP, telemetry: false };

    /// The frame as it is sent: throttle (11 bits), request, checksum (4 bits).
    #[must_use]
    pub const fn word(self) -> u16 {
        let content = self.throttle.get() << 1 | self.telemetry as u16;
        content << 4 | checksum(content)
    }

    /// A frame from its word; `None` where the checksum is wrong, and of a special command.
    #[must_use]
    pub const fn from_word(word: u16) -> Option<Self> {
        let content = word >> 4;
        match Throttle::new(content >> 1) {
            Some(throttle) if checksum(content) == word & 0xf => Some(Self { throttle, telemetry: content & 1 != 0 }),
            _ => None,
        }
    }
}

/// Exclusive or of the three groups of four bits.
const fn checksum(content: u16) -> u16 {
    (content ^ content >> 4 ^ content >> 8) & 0xf
}

/// One period of the counter: how long, and how long the line is high from its beginning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Slot {
    /// Ticks of the period, 2 to 65 536; the auto-reload register takes one less.
    pub period: u32,
    /// Ticks for which the line is high: the compare value.
    pub high: u16,
}

impl Slot {
    /// What the auto-reload register takes.
    #[must_use]
    pub const fn reload(self) -> u16 {
        self.period.saturating_sub(1) as u16
    }
}

/// Frames as slots of a timer: sixteen bits, and a pause that fills the millisecond exactly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FrameTimer {
    bit: u32,
    pause: [u32; 2],
}

impl FrameTimer {
    /// The slots of `bit_hz` bits a second on a timer of 16 bits that counts at `clock_hz`.
    ///
    /// # Errors
    /// [`TimerError`] when the clock gives no exact bit or no exact millisecond, or too few ticks a bit.
    pub const fn new(clock_hz: u32, bit_hz: u32) -> Result<Self, TimerError> {
        let refused = Err(TimerError::NoExactPeriod { clock_hz });
        if bit_hz == 0 || clock_hz == 0 || !clock_hz.is_multiple_of(bit_hz) || !clock_hz.is_multiple_of(FRAME_HZ) {
            return refused;
        }
        let bit = clock_hz / bit_hz;
        if bit < FEWEST_TICKS {
            return Err(TimerError::TooCoarse { counter_hz: clock_hz });
        }
        let (frame, period) = (bit.saturating_mul(BITS as u32), clock_hz / FRAME_HZ);
        if bit > MOST_TICKS || frame.saturating_add(2 * bit) > period || period - frame > 2 * MOST_TICKS {
            return refused;
        }
        // the first part as long as can be, the second not shorter than a bit
        let pause = period - frame;
        let first = if pause - bit < MOST_TICKS { pause - bit } else { MOST_TICKS };
        Ok(Self { bit, pause: [first, pause - first] })
    }

    /// Ticks of a bit.
    #[must_use]
    pub const fn bit(self) -> u32 {
        self.bit
    }

    /// The slot of a bit: high for six eighths of it, or for three, rounded to the nearest tick.
    #[must_use]
    pub const fn slot(self, one: bool) -> Slot {
        let eighths = if one { 6 } else { 3 };
        Slot { period: self.bit, high: ((self.bit * eighths + 4) / 8) as u16 }
    }

    /// The two slots after a frame, in which the line is low.
    #[must_use]
    pub const fn pause(self) -> [Slot; 2] {
        let [first, second] = self.pause;
        [Slot { period: first, high: 0 }, Slot { period: second, high: 0 }]
    }

    /// The slots of a word, its most significant bit first, and of the pause after it.
    pub fn slots(self, word: u16) -> impl Iterator<Item = Slot> {
        (0..BITS).rev().map(move |bit| self.slot(word >> bit & 1 != 0)).chain(self.pause())
    }
}
