//! Physical quantities as newtypes.
//!
//! What it is: one tuple struct a unit, so that a thrust cannot be passed for a torque.
//! What can go wrong: nothing; these are plain numbers. NaN is kept, and each consumer states what it does with it.
//! Units: stated on each type.
//! Reference: SI brochure; rev/min is the field's unit for rotor speed.

macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident, $unit:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;

    #[test]
    fn a_quantity_says_its_unit() {
        assert_eq!(Newton(3.5).to_string(), "3.5 N");
        assert_eq!(std::format!("{:.1}", RevPerMin(4000.04)), "4000.0 rev/min");
        assert_eq!(Celsius::UNIT, "degC");
    }

    /// 1000 and 2000 us are pulses; minimum alone does not turn the rotor, and is what there is without a word.
    #[test]
    fn a_pulse_is_1000_to_2000_us() {
        assert_eq!((PulseWidth::from_us(1500).0, PulseWidth(1_500_250).as_us()), (1_500_000, 1500.25));
        for (ns, clamped) in
            [(0, 1_000_000), (999_999, 1_000_000), (1_000_001, 1_000_001), (2_000_000, 2_000_000), (2_000_001, 2_000_000)]
        {
            assert_eq!(PulseWidth(ns).clamped().0, clamped);
        }
        assert_eq!(PulseWidth::default(), PulseWidth::MIN);
        assert!(!PulseWidth::MIN.is_live() && !PulseWidth(0).is_live() && PulseWidth(1_000_001).is_live());
        assert_eq!(PulseWidth::from_us(u32::MAX).clamped(), PulseWidth::MAX, "no width of 32 bits wraps to a shorter one");
    }
}
