//! Conversions of a millisecond, side by side.
//!
//! What it is: eight conversions of every channel at once, from the noise's random words and the levels to what a block sums of the codes.
//! What can go wrong: nothing; the vectors are as wide as the processor has them, chosen as it runs, and the numbers are the same with all.
//! Units: counts.
//! Reference: Fog, "Optimizing software in C++", section 12 (one loop over arrays of structure's members); see [`super::adc`].

use super::adc::CODES;
use crate::noise::quick;
use firmware_rig::AdcBlock;
use frame::rig::ADC_CHANNELS;
use multiversion::multiversion;

/// Conversions of a channel that are made side by side.
pub(super) const EIGHT: usize = 8;
/// Pairs of a channel's conversions: a random word holds the noise of two.
const PAIRS: usize = EIGHT / 2;
/// Pairs of all channels.
const ALL: usize = PAIRS * ADC_CHANNELS;
/// 2^52: a double of this size has no fraction.
const ROUNDING: f64 = 4_503_599_627_370_496.0;

/// Eight conversions of every channel, pair by pair. The places are kept: clearing them costs as much as filling them.
#[derive(Debug, Clone, Default)]
pub(super) struct Pairs {
    words: [u64; ALL],
    first: [f64; ALL],
    second: [f64; ALL],
    sum: [f64; ALL],
    squares: [f64; ALL],
    min: [f64; ALL],
    max: [f64; ALL],
}

impl Pairs {
    /// Random words of `channel`.
    pub(super) fn words(&mut self, channel: usize) -> impl Iterator<Item = &mut u64> {
        self.words[channel * PAIRS..][..PAIRS].iter_mut()
    }

    /// Levels of `channel`, counts; those of a pair's two conversions together.
    pub(super) fn levels(&mut self, channel: usize) -> impl Iterator<Item = (&mut f64, &mut f64)> {
        let own = channel * PAIRS..(channel + 1) * PAIRS;
        self.first[own.clone()].iter_mut().zip(&mut self.second[own])
    }

    /// Makes all conversions, with `noise_counts` as the standard deviation of the converter's own noise.
    pub(super) fn convert(&mut self, noise_counts: f64) {
        convert(self, noise_counts);
    }

    /// What the conversions of `channel` come to.
    pub(super) fn sums(&self, channel: usize) -> Sums {
        let of = |all: &[f64; ALL], join: fn(f64, f64) -> f64| {
            let [a, b, c, d] = core::array::from_fn(|pair| all[channel * PAIRS + pair]);
            join(join(a, b), join(c, d))
        };
        Sums {
            sum: of(&self.sum, |a, b| a + b),
            squares: of(&self.squares, |a, b| a + b),
            min: of(&self.min, lower),
            max: of(&self.max, higher),
        }
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn convert(pairs: &mut Pairs, noise_counts: f64) {
    for i in 0..ALL {
        let [now, next] = quick(pairs.words[i]);
        let a = whole_code(pairs.first[i] + noise_counts * now + 0.5);
        let b = whole_code(pairs.second[i] + noise_counts * next + 0.5);
        pairs.sum[i] = a + b;
        pairs.squares[i] = a * a + b * b;
        pairs.min[i] = lower(a, b);
        pairs.max[i] = higher(a, b);
    }
}

/// The ideal converter's code for a level: truncated, at its ends clipped. As a float, so that many go side by side; sums of codes and
/// of their squares are exact in it.
#[inline]
pub(super) fn whole_code(noisy: f64) -> f64 {
    let inside = if noisy > 0.0 { noisy } else { 0.0 };
    let inside = if inside < CODES - 1.0 { inside } else { CODES - 1.0 };
    let nearest = (inside + ROUNDING) - ROUNDING;
    nearest - if nearest > inside { 1.0 } else { 0.0 }
}

#[inline]
fn lower(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

#[inline]
fn higher(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Sums over the conversions of a block.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sums {
    sum: f64,
    squares: f64,
    min: f64,
    max: f64,
}

impl Sums {
    /// Takes one conversion more.
    pub(super) fn one(&mut self, code: f64) {
        self.sum += code;
        self.squares += code * code;
        self.min = lower(code, self.min);
        self.max = higher(code, self.max);
    }

    /// The block of these `count` conversions.
    pub(super) fn block(&self, count: u16) -> AdcBlock {
        // a whole number below 2^52 stands in the lowest bits of itself plus 2^52
        let whole = |x: f64| (x + ROUNDING).to_bits() ^ ROUNDING.to_bits();
        AdcBlock {
            sum: whole(self.sum) as u32,
            sum_sq: whole(self.squares),
            count,
            min: whole(self.min) as u16,
            max: whole(self.max) as u16,
        }
    }
}
