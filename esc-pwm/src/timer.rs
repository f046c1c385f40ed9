//! Pulse widths as whole ticks of a timer.
//!
//! What it is: the prescaler, the period and the compare value of a PWM timer for 50 Hz ESC pulses, in integers only.
//! What can go wrong: a clock that cannot give exactly 20 ms, or not 1 us of resolution, is refused ([`TimerError`]).
//! Units: Hz, ticks, nanoseconds.
//! Reference: Beharie 2013, section 3.2.3 (errata: 2.5 ns and 600 000 ticks are arithmetic only); RM0090 section 18.4.

use crate::units::PulseWidth;

/// ESC frames a second (Beharie 2013, section 3.2).
pub const FRAME_HZ: u32 = 50;
const NS_PER_S: u64 = 1_000_000_000;

/// Why a timer cannot give ESC pulses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum TimerError {
    /// No divider of this clock gives exactly 20 ms within the counter's range.
    NoExactPeriod {
        /// The clock in question, Hz.
        clock_hz: u32,
    },
    /// The counter would advance slower than once a microsecond.
    TooCoarse {
        /// The best counter frequency that fits, Hz.
        counter_hz: u32,
    },
}

impl core::fmt::Display for TimerError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NoExactPeriod { clock_hz } => {
                write!(f, "no divider of {clock_hz} Hz gives the period exactly: choose another clock")
            }
            Self::TooCoarse { counter_hz } => {
                write!(f, "the counter advances at {counter_hz} Hz: too coarse, choose a faster clock")
            }
        }
    }
}

impl core::error::Error for TimerError {}

/// A timer set up for 50 Hz pulses: dividing exactly, so pulse and period never drift apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PulseTimer {
    divider: u32,
    counter_hz: u32,
    period: u32,
}

impl PulseTimer {
    /// The finest exact setting of a timer of `bits` counter bits (16 or 32) and a 16-bit prescaler on `clock_hz`.
    ///
    /// # Errors
    /// [`TimerError`] when no prescaler gives exactly 50 Hz with at least 1 us of resolution.
    pub const fn new(clock_hz: u32, bits: u32) -> Result<Self, TimerError> {
        let refused = Err(TimerError::NoExactPeriod { clock_hz });
        if clock_hz == 0 || !clock_hz.is_multiple_of(FRAME_HZ) {
            return refused;
        }
        let cycles = clock_hz / FRAME_HZ;
        let most: u64 = if bits >= 32 { 1 << 32 } else { 1 << bits };
        let mut divider = (cycles as u64).div_ceil(most) as u32;
        while divider <= 1 << 16 && divider <= cycles {
            if cycles.is_multiple_of(divider) {
                let period = cycles / divider;
                let counter_hz = period * FRAME_HZ;
                if counter_hz < 1_000_000 {
                    return Err(TimerError::TooCoarse { counter_hz });
                }
                return Ok(Self { divider, counter_hz, period });
            }
            divider += 1;
        }
        refused
    }

    /// Clock divider; the prescaler register takes one less.
    #[must_use]
    pub const fn divider(self) -> u32 {
        self.divider
    }

    /// Ticks of one 20 ms period; the auto-reload register takes one less.
    #[must_use]
    pub const fn period(self) -> u32 {
        self.period
    }

    /// Counter frequency, Hz.
    #[must_use]
    pub const fn counter_hz(self) -> u32 {
        self.counter_hz
    }

    /// Ticks of a pulse, rounded to the nearest; the pulse is brought into 1000 to 2000 us first.
    #[must_use]
    pub const fn ticks(self, pulse: PulseWidth) -> u32 {
        let ns = pulse.clamped().0 as u64;
        ((ns * self.counter_hz as u64 + NS_PER_S / 2) / NS_PER_S) as u32
    }

    /// The pulse that `ticks` give, rounded to the nearest nanosecond.
    #[must_use]
    pub const fn pulse(self, ticks: u32) -> PulseWidth {
        let hz = self.counter_hz as u64;
        let ns = (ticks as u64 * NS_PER_S + hz / 2) / hz;
        PulseWidth(if ns > u32::MAX as u64 { u32::MAX } else { ns as u32 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_board_timer() {
        let timer = PulseTimer::new(84_000_000, 16).unwrap();
        assert_eq!((timer.divider(), timer.period(), timer.counter_hz()), (28, 60_000, 3_000_000));
        assert_eq!(timer.ticks(PulseWidth::MIN), 3000);
        assert_eq!(timer.ticks(PulseWidth::MAX), 6000);
        assert_eq!(timer.ticks(PulseWidth(0)), 3000, "never below minimum: silence is no stop");
        assert_eq!(timer.ticks(PulseWidth(u32::MAX)), 6000);
    }

    /// A tick of the board's timer is a third of a microsecond; what no 32 bits of nanoseconds hold is told as the most that they do.
    #[test]
    fn ticks_become_the_nearest_nanosecond() {
        let timer = PulseTimer::new(84_000_000, 16).unwrap();
        assert_eq!([3000, 3001, 3002].map(|ticks| timer.pulse(ticks).0), [1_000_000, 1_000_333, 1_000_667]);
        assert_eq!(timer.pulse(u32::MAX), PulseWidth(u32::MAX));
    }

    #[test]
    fn a_refusal_says_which_clock_and_what_to_do() {
        extern crate std;
        use std::string::ToString;
        let said = |clock_hz| PulseTimer::new(clock_hz, 16).unwrap_err().to_string();
        assert_eq!(said(84_000_001), "no divider of 84000001 Hz gives the period exactly: choose another clock");
        assert_eq!(said(800_000), "the counter advances at 800000 Hz: too coarse, choose a faster clock");
    }

    /// Beharie 2013, section 3.2.3: a 2.5 ns tick gives 600 000 ticks for 1.5 ms.
    #[test]
    fn the_thesis_tick() {
        let timer = PulseTimer::new(400_000_000, 32).unwrap();
        assert_eq!(timer.divider(), 1);
        assert_eq!(timer.ticks(PulseWidth::from_us(1500)), 600_000);
        assert_eq!(timer.period(), 8_000_000);
    }

    #[test]
    fn impossible_clocks_are_refused() {
        assert_eq!(PulseTimer::new(84_000_001, 16), Err(TimerError::NoExactPeriod { clock_hz: 84_000_001 }));
        assert_eq!(PulseTimer::new(0, 16), Err(TimerError::NoExactPeriod { clock_hz: 0 }));
        assert_eq!(PulseTimer::new(800_000, 16), Err(TimerError::TooCoarse { counter_hz: 800_000 }));
    }

    proptest! {
        /// Whatever the clock: the period is exactly 20 ms, the resolution 1 us or better, the pulse within half a tick.
        #[test]
        fn exact_for_any_clock(khz in 1000u32..400_000, wide in any::<bool>(), ns in 1_000_000u32..=2_000_000) {
            let clock = khz * 1000;
            if let Ok(timer) = PulseTimer::new(clock, if wide { 32 } else { 16 }) {
                prop_assert_eq!(u64::from(timer.period()) * u64::from(timer.divider()) * 50, u64::from(clock));
                prop_assert!(wide || timer.period() <= 65_536);
                prop_assert!(timer.counter_hz() >= 1_000_000);
                let ticks = timer.ticks(PulseWidth(ns));
                let error = i64::from(timer.pulse(ticks).0) - i64::from(ns);
                prop_assert!(error.unsigned_abs() <= NS_PER_S.div_ceil(2 * u64::from(timer.counter_hz())));
                prop_assert_eq!(timer.ticks(timer.pulse(ticks)), ticks, "reading back what was set changes nothing");
            }
        }

        /// A longer pulse never has fewer ticks.
        #[test]
        fn monotone(a in 0u32..3_000_000, b in 0u32..3_000_000) {
            let timer = PulseTimer::new(84_000_000, 16).unwrap();
            prop_assert!((a <= b) == (timer.ticks(PulseWidth(a)) <= timer.ticks(PulseWidth(b))) || timer.ticks(PulseWidth(a)) == timer.ticks(PulseWidth(b)));
        }
    }
}
