//! Boxcar averages of the converter's five channels.
//!
//! What it is: adds what the DMA delivered each tick into one block a logging interval, and gives mean, rms and verdict.
//! What can go wrong: no conversion is `Missing`; all of them at the low end is `Open`, at the high end `Short`; any of them there
//! is `Saturated`. A block that would overflow its counters keeps what it has.
//! Units: counts; rms in 1/256 count. Scale: `count` reaches 65 535 and `sum` 65 535 x 4095 = 2.7e8, so a second at the
//! board's 61.8 kconv/s a channel still fits.
//! Reference: specification `rig.md`, "boxcar oversampling and decimation".

use frame::rig::{AdcCode, AdcVerdict};

/// Conversions of one channel, summed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct AdcBlock {
    /// Sum of the codes.
    pub sum: u32,
    /// Sum of their squares.
    pub sum_sq: u64,
    /// Number of conversions.
    pub count: u16,
    /// Lowest code; meaningless when `count` is 0.
    pub min: u16,
    /// Highest code; meaningless when `count` is 0.
    pub max: u16,
}

impl AdcBlock {
    /// Adds one conversion.
    #[inline]
    pub fn push(&mut self, code: u16) {
        let Some(count) = self.count.checked_add(1) else { return };
        if self.count == 0 {
            (self.min, self.max) = (code, code);
        }
        // 65 535 codes of 65 535 fit the sum exactly
        self.sum = self.sum.wrapping_add(u32::from(code));
        self.sum_sq = self.sum_sq.wrapping_add(u64::from(code) * u64::from(code));
        self.count = count;
        self.min = self.min.min(code);
        self.max = self.max.max(code);
    }

    /// Adds another block.
    pub fn add(&mut self, other: &Self) {
        if other.count == 0 {
            return;
        }
        if self.count == 0 {
            *self = *other;
            return;
        }
        let Some(count) = self.count.checked_add(other.count) else { return };
        // as in `push`: what 65 535 codes come to fits
        let (sum, sum_sq) = (self.sum.wrapping_add(other.sum), self.sum_sq.wrapping_add(other.sum_sq));
        *self = Self { sum, sum_sq, count, min: self.min.min(other.min), max: self.max.max(other.max) };
    }

    /// Mean code.
    #[must_use]
    pub fn mean(&self) -> Option<f32> {
        (self.count > 0).then(|| self.sum as f32 / f32::from(self.count))
    }

    /// Root mean square about the mean, 1/256 count, rounded down.
    #[must_use]
    pub fn rms_q8(&self) -> u32 {
        let n = u128::from(self.count);
        let spread = (n * u128::from(self.sum_sq)).saturating_sub(u128::from(self.sum) * u128::from(self.sum));
        let root = (spread << 16).isqrt();
        u32::try_from(root.checked_div(n).unwrap_or(0)).unwrap_or(u32::MAX)
    }

    /// What the channel says of these conversions, when its codes end at `top`.
    #[must_use]
    pub fn verdict(&self, top: u16, live_zero: bool) -> AdcVerdict {
        if self.count == 0 {
            AdcVerdict::Missing
        } else if self.max == 0 && live_zero {
            AdcVerdict::Open
        } else if self.min >= top {
            AdcVerdict::Short
        } else if (self.min == 0 && live_zero) || self.max >= top {
            AdcVerdict::Saturated
        } else {
            AdcVerdict::Nominal
        }
    }

    /// The raw code of one logging interval.
    #[must_use]
    pub fn code(&self, top: u16, live_zero: bool) -> AdcCode {
        AdcCode { sum: self.sum, count: self.count, rms_q8: self.rms_q8(), verdict: self.verdict(top, live_zero) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn block(codes: &[u16]) -> AdcBlock {
        let mut block = AdcBlock::default();
        codes.iter().for_each(|code| block.push(*code));
        block
    }

    #[test]
    fn verdicts() {
        assert_eq!(block(&[]).verdict(4095, true), AdcVerdict::Missing);
        assert_eq!((block(&[]).mean(), block(&[2, 4]).mean()), (None, Some(3.0)));
        assert_eq!(block(&[0, 0]).verdict(4095, true), AdcVerdict::Open);
        assert_eq!(block(&[0, 1]).verdict(4095, true), AdcVerdict::Saturated);
        assert_eq!(block(&[0, 0]).verdict(4095, false), AdcVerdict::Nominal, "an unpowered supply reads zero");
        assert_eq!(block(&[4095, 4095]).verdict(4095, false), AdcVerdict::Short);
        assert_eq!(block(&[4000, 4095]).verdict(4095, true), AdcVerdict::Saturated);
        assert_eq!(block(&[1, 4094]).verdict(4095, true), AdcVerdict::Nominal);
    }

    #[test]
    fn a_full_second_of_the_highest_code_fits() {
        let mut whole = AdcBlock::default();
        for _ in 0..1000 {
            whole.add(&block(&[4095; 11]));
        }
        assert_eq!(whole, AdcBlock { sum: 11_000 * 4095, sum_sq: 11_000 * 4095 * 4095, count: 11_000, min: 4095, max: 4095 });
        assert_eq!(whole.rms_q8(), 0);
    }

    proptest! {
        /// Any division into ticks gives the same block, and its rms is the textbook's.
        #[test]
        fn division_does_not_matter(codes in proptest::collection::vec(0u16..4096, 1..400), cut in 1usize..40) {
            let whole = block(&codes);
            let mut parts = AdcBlock::default();
            codes.chunks(cut).for_each(|part| parts.add(&block(part)));
            prop_assert_eq!(whole, parts);
            let n = codes.len() as f64;
            let values: Vec<f64> = codes.iter().map(|c| f64::from(*c)).collect();
            let mean = values.iter().sum::<f64>() / n;
            let rms = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
            prop_assert!((f64::from(whole.rms_q8()) / 256.0 - rms).abs() <= 1.0 / 256.0 + 1e-9);
            prop_assert!((f64::from(whole.mean().unwrap()) - mean).abs() < 1e-3);
        }
    }
}
