//! Physical quantities as newtypes.
//!
//! What it is: one tuple struct a unit, so that a thrust cannot be passed for a torque. What limits and pulses are made of is
//! [`esc_pwm::units`]'; beside it stands the board's time.
//! What can go wrong: nothing; these are plain numbers. NaN is kept, and each consumer states what it does with it.
//! Units: stated on each type.
//! Reference: SI brochure; rev/min is the field's unit for rotor speed.

pub use esc_pwm::units::{Ampere, Celsius, Newton, NewtonMetre, PulseWidth, RevPerMin, Volt};
use serde::{Deserialize, Serialize};

/// An instant on the board: ticks of the capture timer since reset, extended to 64 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Ticks(pub u64);

impl Ticks {
    /// Frequency of the capture timer on both boards, Hz: APB1 timer clock of the STM32F405 at 168 MHz (RM0090 section 7.2).
    pub const HZ: u32 = 84_000_000;

    /// Ticks in a number of milliseconds.
    #[must_use]
    pub const fn from_ms(ms: u64) -> Self {
        Self(ms * (Self::HZ as u64 / 1000))
    }

    /// Whole milliseconds.
    #[must_use]
    pub const fn as_ms(self) -> u64 {
        self.0 / (Self::HZ as u64 / 1000)
    }

    /// Seconds, for logs.
    #[must_use]
    #[inline]
    pub fn as_s(self) -> f64 {
        self.0 as f64 / f64::from(Self::HZ)
    }

    /// The next instant at which the low 32 bits of the time are `counter`: what the capture timer reads at most one of its turns (51.1 s at
    /// [`Self::HZ`]) after this instant.
    #[must_use]
    pub const fn counted(self, counter: u32) -> Self {
        Self(self.0.wrapping_add(counter.wrapping_sub(self.0 as u32) as u64))
    }

    /// Time elapsed since `earlier`; zero when `earlier` is later.
    #[must_use]
    pub const fn since(self, earlier: Self) -> Self {
        Self(self.0.saturating_sub(earlier.0))
    }
}
