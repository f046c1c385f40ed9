//! What the pattern of one channel's periods says of its sensor.
//!
//! What it is: a window of up to eight periods moves over the edges of a reading and looks for a period that is too long between two
//! short ones (a mark was missed), pairs that share the time of one (marks were seen twice, up to three in a row), and, for two marks,
//! periods that are long and short by turns.
//! What can go wrong: a rotor that speeds up changes all periods the same way and matches none of these; the newest period has
//! one neighbour only and is judged in the next reading.
//! Units: ticks; ratios.
//! Reference: specification `rig.md`, "missed- and double-pulse detection, alternating-period detection"; Beharie 2013,
//! Fig. 5.14 and 5.27.

use frame::rig::CaptureVerdict;

/// A period this many tenths of both neighbours hides a missed mark.
const MISSED_TENTHS: u64 = 16;
/// Two periods that together stay below this many tenths of both neighbours are one mark seen twice.
const DOUBLED_TENTHS: u64 = 13;
/// Difference between even and odd periods, in per cent of their mean, that counts as alternating.
const ALTERNATING_PERCENT: u64 = 10;
/// Fewest periods that show a pattern of two.
const ALTERNATING_PERIODS: usize = 6;
/// Of the bends between three periods in a row the least is at least this many tenths of the largest, where two marks alternate. A mark that
/// is missed now and then bends one by twice as much as its neighbours.
const ALIKE_TENTHS: u64 = 6;

/// Periods whose spread is less than this part of their mean, in per cent, are even.
const EVEN_PERCENT: u64 = 30;
/// Marks in a row that are each seen twice, at the most, between two that are seen once.
const CLUSTER: usize = 3;
/// Periods kept: those of the longest cluster and the two beside it, and a power of two.
const KEPT: usize = 8;
const _: () = assert!(2 * CLUSTER + 2 <= KEPT && KEPT.is_power_of_two());

/// The periods looked at last.
#[derive(Default)]
struct Window {
    ring: [u32; KEPT],
    seen: usize,
}

impl Window {
    fn put(&mut self, period: u32) {
        if let Some(slot) = self.ring.get_mut(self.seen % KEPT) {
            *slot = period;
        }
        self.seen += 1;
    }

    /// The period `back` places before the last one.
    fn at(&self, back: usize) -> u64 {
        let place = self.seen.wrapping_sub(back + 1) % KEPT;
        self.ring.get(place).map_or(0, |period| u64::from(*period))
    }

    /// Whether marks that were seen twice end here, between two periods of marks that were seen once.
    fn doubled(&self) -> bool {
        let after = self.at(0);
        let (mut shortest, mut longest, mut together) = (u64::MAX, 0, 0);
        for marks in 1..=CLUSTER {
            let (first, second) = (self.at(2 * marks), self.at(2 * marks - 1));
            let share = first + second;
            // two periods of one mark against the marks beside it; nearly always the answer is here
            if self.seen < 2 * marks + 2 || 10 * share >= DOUBLED_TENTHS * after {
                return false;
            }
            (shortest, longest) = (shortest.min(first.min(second)), longest.max(first.max(second)));
            together += share;
            // even periods in a row between two long ones are marks beside two that were missed
            let even = 200 * marks as u64 * (longest - shortest) < EVEN_PERCENT * together;
            if 10 * share < DOUBLED_TENTHS * self.at(2 * marks + 1) && (marks == 1 || !even) {
                return true;
            }
        }
        false
    }
}

/// Judges `periods`, the latest first, of a channel with `marks` marks a revolution.
pub fn judge(marks: u16, periods: impl Iterator<Item = u32>) -> CaptureVerdict {
    let mut window = Window::default();
    let mut by_turns = marks == 2;
    // how far a period stands out between the two beside it: a steady change of speed has no part in it
    let (mut least, mut most) = (1u64 << 34, 0u64); // none of three periods of 32 bits bends by so much
    let mut sums = [0u64; 2];
    let mut found = CaptureVerdict::Nominal;
    for period in periods {
        window.put(period);
        let [even, odd] = &mut sums;
        *(if window.seen.is_multiple_of(2) { even } else { odd }) += u64::from(period);
        if window.seen >= 3 {
            let (before, middle, after) = (window.at(2), window.at(1), window.at(0));
            if by_turns {
                by_turns = (before < middle) == (after < middle);
                let bend = (before + after).abs_diff(2 * middle);
                (least, most) = (least.min(bend), most.max(bend));
            }
            if 10 * middle > MISSED_TENTHS * before.max(after) {
                found = CaptureVerdict::Missed;
            }
            if window.doubled() {
                found = CaptureVerdict::Doubled;
            }
        }
    }
    let [even, odd] = sums;
    let uneven = 100 * even.abs_diff(odd) > ALTERNATING_PERCENT * (even + odd) / 2;
    let enough = window.seen >= ALTERNATING_PERIODS && window.seen.is_multiple_of(2);
    let alike = 10 * least >= ALIKE_TENTHS * most;
    if by_turns && uneven && alike && enough { CaptureVerdict::Alternating } else { found }
}

/// Unevenness of the marks: half the spread of the periods of one revolution about their neighbours' mean, relative. Two marks
/// whose periods are long and short by turns give the difference of the two over their mean. A rotor that speeds up steadily
/// gives none, because each period is compared with the mean of the two beside it.
pub fn unevenness(marks: u16, periods: impl Iterator<Item = u32>) -> Option<f32> {
    const MOST: usize = 4;
    let marks = usize::from(marks);
    if !(2..=MOST).contains(&marks) {
        return None;
    }
    let mut sums = [(0.0f32, 0u16); MOST];
    let mut window = [0.0f32; 3];
    let (mut total, mut seen) = (0.0f32, 0usize);
    for period in periods {
        let [_, a, b] = window;
        window = [a, b, period as f32];
        total += period as f32;
        seen += 1;
        if seen >= 3 {
            let [before, middle, after] = window;
            if let Some((sum, n)) = sums.get_mut(seen % marks) {
                *sum += middle - 0.5 * (before + after);
                *n += 1;
            }
        }
    }
    let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
    for (sum, n) in sums.iter().take(marks) {
        if *n == 0 {
            return None;
        }
        let mean = sum / f32::from(*n);
        (low, high) = (low.min(mean), high.max(mean));
    }
    Some(0.5 * (high - low) * seen as f32 / total)
}

#[cfg(test)]
mod tests {
    use super::*;
    use CaptureVerdict::{Alternating, Doubled, Missed, Nominal};
    use proptest::prelude::*;
    use std::vec::Vec;

    fn of(marks: u16, periods: &[u32]) -> CaptureVerdict {
        judge(marks, periods.iter().copied())
    }

    #[test]
    fn one_of_each() {
        assert_eq!(of(2, &[100; 10]), Nominal);
        assert_eq!(of(25, &[100, 100, 200, 100, 100]), Missed);
        assert_eq!(of(1, &[100, 100, 30, 70, 100, 100]), Doubled);
        assert_eq!(of(1, &[100, 30, 70, 55, 45, 100]), Doubled, "two marks in a row");
        assert_eq!(of(25, &[100, 100, 200, 100, 100, 100, 100, 200, 100, 100]), Missed, "two marks, five apart");
        assert_eq!(of(1, &[100, 30, 70, 55, 45, 80, 20, 100]), Doubled, "three marks in a row");
        assert_eq!(of(2, &[90, 110, 90, 110, 90, 110]), Alternating);
        assert_eq!(of(2, &[35, 65, 35, 65, 35, 65]), Alternating, "two marks far from opposite, and no missed ones");
        assert_eq!(of(2, &[100, 101, 99, 200, 100, 101, 99, 200]), Missed, "one mark of five, and no two that alternate");
        assert_eq!(of(2, &[101, 200, 100, 102, 101, 200, 99, 101]), Missed, "the same from another mark on");
        assert_eq!(of(2, &[30, 60, 28, 56, 26, 52, 24, 48]), Alternating, "while the rotor speeds up");
        assert_eq!(of(2, &[98, 102, 98, 102, 98, 102]), Nominal, "within the tolerance of a magnet glued by hand");
        assert_eq!(of(1, &[90, 110, 90, 110, 90, 110]), Nominal, "one mark cannot alternate by itself");
        assert_eq!(of(2, &[]), Nominal);
    }

    /// Where each pattern begins: what is on the edge is none yet.
    #[test]
    fn what_is_not_quite_a_pattern() {
        assert_eq!(of(25, &[100, 160, 100]), Nominal, "1.6 times its neighbours");
        assert_eq!(of(25, &[100, 161, 100]), Missed);
        assert_eq!(of(1, &[100, 60, 70, 101]), Nominal, "two periods that take 1.3 times the one before");
        assert_eq!(of(1, &[100, 60, 69, 101]), Doubled);
        assert_eq!(of(2, &[95, 105, 95, 105, 95, 105]), Nominal, "ten per cent");
        assert_eq!(of(2, &[94, 106, 94, 106, 94, 106]), Alternating);
        assert_eq!(of(2, &[90, 110, 90, 110]), Nominal, "too few periods");
        assert_eq!(of(2, &[90, 110, 90, 110, 90, 110, 90]), Nominal, "one more of the one than of the other");
        assert_eq!(of(2, &[100, 100, 60, 80, 60, 80]), Nominal, "two alike do not alternate");
        assert_eq!(of(2, &[80, 60, 80, 60, 100, 100]), Nominal, "two alike at the end");
        assert_eq!(of(2, &[100, 120, 100, 200, 100, 120]), Missed, "uneven marks, and one of them missed");
    }

    /// Even periods between two long ones are marks beside two that were missed, uneven ones are marks that were seen twice.
    #[test]
    fn marks_between_two_missed_ones_are_not_seen_twice() {
        assert_eq!(of(25, &[100, 100, 200, 100, 100, 100, 100, 200]), Missed);
        assert_eq!(of(25, &[100, 100, 200, 95, 105, 100, 95, 200]), Missed, "with the error of an encoder");
        assert_eq!(of(25, &[200, 86, 115, 100, 100, 200]), Nominal, "spread by less than 30 %");
        assert_eq!(of(25, &[200, 85, 115, 100, 100, 200]), Doubled, "by 30 %");
        assert_eq!(of(1, &[100, 30, 70, 50, 50, 100]), Doubled, "the second mark of two in its middle");
    }

    #[test]
    fn unevenness_is_the_difference_of_two_and_none_of_a_ramp() {
        let uneven = |marks, periods: &[u32]| unevenness(marks, periods.iter().copied());
        assert!((uneven(2, &[950, 1050, 950, 1050, 950, 1050]).unwrap() - 0.1).abs() < 1e-6);
        assert!(uneven(2, &[1000, 1020, 1040, 1060, 1080, 1100]).unwrap() < 1e-6);
        assert!(uneven(3, &[950, 1050, 1000, 950, 1050, 1000, 950, 1050]).unwrap() > 0.05);
        assert_eq!(uneven(1, &[1000; 9]), None);
        assert_eq!(uneven(25, &[1000; 90]), None);
        assert_eq!(uneven(2, &[1000; 3]), None, "one position was not seen");
    }

    proptest! {
        /// A rotor that speeds up or slows down steadily, with the electrical error of an encoder, is not at fault.
        #[test]
        fn steady_change_is_nominal(
            first in 1000u32..1_000_000,
            per_mille in -200i64..200,
            jitter in proptest::collection::vec(-60i64..60, 8..60),
            marks in prop_oneof![Just(1u16), Just(2), Just(25)],
        ) {
            let mut period = i64::from(first);
            let periods: Vec<u32> = jitter.iter().map(|j| {
                period = (period + period * per_mille / 1000).clamp(100, 1 << 30);
                let jitter = if marks == 25 { period * j / 1000 } else { 0 };
                (period + jitter) as u32
            }).collect();
            prop_assert_eq!(of(marks, &periods), Nominal);
        }

        /// One mark left out, anywhere but at the ends, is found at any speed.
        #[test]
        fn a_missed_mark_is_found(period in 100u32..1_000_000, n in 3usize..40, at in 1usize..39) {
            prop_assume!(at + 1 < n);
            let mut periods = std::vec![period; n];
            periods[at] = 2 * period;
            prop_assert_eq!(of(25, &periods), Missed);
        }

        #[test]
        fn a_doubled_mark_is_found(period in 100u32..1_000_000, n in 4usize..40, at in 1usize..38, split in 1u32..100) {
            prop_assume!(at + 2 < n);
            let mut periods = std::vec![period; n];
            periods[at] = period * split / 100;
            periods[at + 1] = period - periods[at];
            prop_assert_eq!(of(25, &periods), Doubled);
        }
    }
}
