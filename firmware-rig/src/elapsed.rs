//! Whole milliseconds since an instant.
//!
//! What it is: a count that goes on from where it was asked last, so that a tick costs a comparison and no division of 64 bits.
//! What can go wrong: a clock that goes back stands still.
//! Units: ticks of the capture timer in, milliseconds out.
//! Reference: RM0090 section 18 (the timer); the Cortex-M4 has no division of 64 bits.

use frame::units::Ticks;

/// Milliseconds since an instant, counted on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Elapsed {
    /// Instant up to which whole milliseconds are counted.
    counted: Ticks,
    ms: u64,
}

impl Elapsed {
    /// Started at `then`.
    pub(crate) const fn since(then: Ticks) -> Self {
        Self { counted: then, ms: 0 }
    }

    /// Whole milliseconds of `per_ms` ticks up to `now`.
    pub(crate) fn ms(&mut self, now: Ticks, per_ms: u32) -> u64 {
        let per_ms = u64::from(per_ms);
        let ahead = now.since(self.counted).0;
        if ahead >= per_ms {
            let passed = if ahead < 2 * per_ms { 1 } else { ahead.checked_div(per_ms).unwrap_or(0) };
            self.ms += passed;
            self.counted.0 += passed * per_ms;
        }
        self.ms
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn it_is_the_division_where_a_millisecond_begins() {
        for per_ms in [1, 2, 3, 84_000] {
            let edges = (0..4).flat_map(|n| (n * u64::from(per_ms)).saturating_sub(1)..=n * u64::from(per_ms) + 1);
            for ahead in edges {
                let mut elapsed = Elapsed::since(Ticks(7));
                assert_eq!(elapsed.ms(Ticks(7 + ahead), per_ms), ahead / u64::from(per_ms), "{ahead} of {per_ms}");
            }
        }
    }

    proptest! {
        /// However often it is asked: the whole milliseconds of the time that has passed.
        #[test]
        fn it_is_the_division(per_ms in 1u32..200_000, start in any::<u32>(), steps in proptest::collection::vec(0u64..600_000, 1..200)) {
            let begin = Ticks(u64::from(start) << 20);
            let (mut elapsed, mut now) = (Elapsed::since(begin), begin);
            for step in steps {
                now.0 += step;
                prop_assert_eq!(elapsed.ms(now, per_ms), (now.0 - begin.0) / u64::from(per_ms));
            }
            prop_assert_eq!(elapsed.ms(begin, per_ms), (now.0 - begin.0) / u64::from(per_ms), "it does not go back");
        }
    }
}
