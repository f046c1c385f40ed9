//! Is the crystal what the firmware takes it for?
//!
//! What it is: the frequency of the crystal, measured in ticks of the internal oscillator, and the list of crystals that boards carry.
//! What can go wrong: the internal oscillator is known to some per cent only ([`LOW_PER_MILLE`], [`HIGH_PER_MILLE`]): crystals closer
//! together than that cannot be told apart, so the list holds none.
//! Units: Hz; periods of the crystal; ticks of the internal oscillator.
//! Reference: RM0090 section 7.2.11 (a rough indication of the external crystal by TIM11 channel 1); STM32F405 datasheet DS8626, HSI
//! oscillator characteristics (-8 % to +4.5 % from -40 to 105 degrees C).

use frame::message::ClockNews;

/// Crystals that the boards carry, Hz: 8 MHz on most, 12 MHz on some (Feather STM32F405, Pyboard 1.1).
pub const KNOWN: [u32; 2] = [8_000_000, 12_000_000];
/// The internal oscillator, Hz. RM0090 section 7.2.2.
pub const INTERNAL_HZ: u32 = 16_000_000;
/// A known crystal reads at least this part of its frequency: the internal oscillator is at most 4.5 % fast (1/1.045), and 0.2 % for
/// counting whole ticks.
pub const LOW_PER_MILLE: u32 = 955;
/// And at most this part: the internal oscillator is at most 8 % slow (1/0.92), and 0.2 %.
pub const HIGH_PER_MILLE: u32 = 1089;

/// What was counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Measurement {
    /// Periods of the crystal.
    pub periods: u32,
    /// Ticks of the internal oscillator in the same time.
    pub ticks: u32,
}

impl Measurement {
    /// Frequency of the crystal, Hz; 0 where nothing was counted.
    #[must_use]
    pub fn hz(self) -> u32 {
        let product = u64::from(INTERNAL_HZ) * u64::from(self.periods);
        let hz = product.checked_div(u64::from(self.ticks)).unwrap_or(0);
        u32::try_from(hz).unwrap_or(u32::MAX)
    }
}

/// The known crystal that reads `measured_hz`.
#[must_use]
pub fn known(measured_hz: u32) -> Option<u32> {
    let parts = u64::from(measured_hz) * 1000;
    let is = |hz: &u32| (u64::from(*hz) * u64::from(LOW_PER_MILLE)..=u64::from(*hz) * u64::from(HIGH_PER_MILLE)).contains(&parts);
    KNOWN.into_iter().find(is)
}

/// What the clock is built on; `None` of a crystal that did not start, or whose periods did not come.
#[must_use]
pub fn judge(measured: Option<Measurement>) -> ClockNews {
    let measured_hz = measured.map_or(0, Measurement::hz);
    ClockNews { crystal_hz: known(measured_hz).unwrap_or(0), measured_hz }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What the board counts of a crystal of `hz` in 16 captures of 8 periods of the crystal over 31, with the internal oscillator off
    /// by `per_mille`.
    fn counted(hz: u32, per_mille: i64) -> Option<Measurement> {
        let internal = i64::from(INTERNAL_HZ) * (1000 + per_mille) / 1000;
        let periods = 16 * 8 * 31;
        Some(Measurement { periods, ticks: (internal as u64 * u64::from(periods) / u64::from(hz)) as u32 })
    }

    #[test]
    fn each_known_crystal_is_recognised_over_the_tolerance_of_the_internal_oscillator() {
        for hz in KNOWN {
            for per_mille in -80..=45 {
                let news = judge(counted(hz, per_mille));
                assert_eq!(news.crystal_hz, hz, "{per_mille} per mille: {news:?}");
            }
        }
    }

    #[test]
    fn no_other_crystal_passes_at_room_temperature() {
        // at 25 degrees C the internal oscillator is within 1 % (DS8626)
        for hz in [4_000_000, 6_000_000, 7_372_800, 10_000_000, 11_059_200, 16_000_000, 24_000_000, 25_000_000, 26_000_000] {
            for per_mille in -10..=10 {
                assert_eq!(judge(counted(hz, per_mille)).crystal_hz, 0, "{hz} Hz, {per_mille} per mille");
            }
        }
    }

    #[test]
    fn a_crystal_is_never_taken_for_another_known_one() {
        let [low, high] = KNOWN;
        assert!(low * HIGH_PER_MILLE / 1000 < high / 1000 * LOW_PER_MILLE, "the windows are apart");
        assert_eq!(judge(counted(12_000_000, 0)).crystal_hz, 12_000_000, "not 8 MHz with pulses of two thirds");
    }

    #[test]
    fn silence_is_told_as_such() {
        assert_eq!(judge(None), ClockNews { crystal_hz: 0, measured_hz: 0 });
        assert_eq!(Measurement { periods: 3968, ticks: 0 }.hz(), 0);
    }

    proptest! {
        #[test]
        fn any_count_gives_a_verdict(periods: u32, ticks: u32) {
            let news = judge(Some(Measurement { periods, ticks }));
            prop_assert!(news.crystal_hz == 0 || KNOWN.contains(&news.crystal_hz));
        }
    }
}
