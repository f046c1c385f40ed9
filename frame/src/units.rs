//! Physical quantities as newtypes.
//!
//! What it is: one tuple struct a unit, so that a thrust cannot be passed for a torque.
//! What can go wrong: nothing; these are plain numbers. NaN is kept, and each consumer states what it does with it.
//! Units: stated on each type.
//! Reference: SI brochure; rev/min is the field's unit for rotor speed.

use serde::{Deserialize, Serialize};

macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident, $unit:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, Serialize, Deserialize)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub struct $name(pub f32);

        impl $name {
            /// The unit's symbol, as it is printed.
            pub const UNIT: &'static str = $unit;
        }

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                core::fmt::Display::fmt(&self.0, f)?;
                f.write_str(concat!(" ", $unit))
            }
        }
    };
}

quantity!(
    /// Force, newton.
    Newton, "N"
);
quantity!(
    /// Torque, newton metre.
    NewtonMetre, "N.m"
);
quantity!(
    /// Electric current, ampere.
    Ampere, "A"
);
quantity!(
    /// Electric potential, volt.
    Volt, "V"
);
quantity!(
    /// Temperature, degree Celsius.
    Celsius, "degC"
);
quantity!(
    /// Rotor speed, revolutions a minute.
    RevPerMin, "rev/min"
);

/// Width of an ESC pulse in whole nanoseconds.
///
/// An integer, so that schedules, slew limits and timer arithmetic are exact: 1 us is 1000, the thesis'
/// 0.25 % step of a 20 ms period is 50 000.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PulseWidth(pub u32);

impl PulseWidth {
    /// Minimum throttle, 1000 us (Beharie 2013, section 3.2: 5 % of 20 ms).
    pub const MIN: Self = Self(1_000_000);
    /// Maximum throttle, 2000 us (Beharie 2013, section 3.2: 10 % of 20 ms).
    pub const MAX: Self = Self(2_000_000);

    /// A pulse of a whole number of microseconds.
    #[must_use]
    pub const fn from_us(us: u32) -> Self {
        Self(us.saturating_mul(1000))
    }

    /// Width in microseconds, for logs.
    #[must_use]
    pub fn as_us(self) -> f64 {
        f64::from(self.0) / 1000.0
    }

    /// The nearest pulse that an ESC understands: 1000 to 2000 us.
    #[must_use]
    pub const fn clamped(self) -> Self {
        if self.0 < Self::MIN.0 {
            Self::MIN
        } else if self.0 > Self::MAX.0 {
            Self::MAX
        } else {
            self
        }
    }

    /// Above minimum throttle: this pulse would turn the rotor.
    #[must_use]
    pub const fn is_live(self) -> bool {
        self.0 > Self::MIN.0
    }
}

impl Default for PulseWidth {
    fn default() -> Self {
        Self::MIN
    }
}

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

    /// Time elapsed since `earlier`; zero when `earlier` is later.
    #[must_use]
    pub const fn since(self, earlier: Self) -> Self {
        Self(self.0.saturating_sub(earlier.0))
    }
}
