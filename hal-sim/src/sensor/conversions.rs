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
pub(super) const PAIRS: usize = EIGHT / 2;
/// Pairs of all channels.
pub(super) const ALL: usize = PAIRS * ADC_CHANNELS;
/// Sums of nine codes stay below this, 2^16, and those of their squares times it below 2^44: both go in one double, exactly.
const SQUARES: f64 = 65_536.0;
/// 2^52: a double of this size has no fraction.
const ROUNDING: f64 = 4_503_599_627_370_496.0;

/// Eight conversions of every channel, pair by pair. The places are kept: clearing them costs as much as filling them.
#[derive(Debug, Clone, Default)]
pub(super) struct Pairs {
    /// Random words, those of a channel side by side.
    pub(super) words: [[u8; 8]; ALL],
    first: [f64; ALL],
    second: [f64; ALL],
    /// Codes, and their squares in units of [`SQUARES`].
    sums: [f64; ALL],
    min: [f64; ALL],
    max: [f64; ALL],
    /// Noise of a ninth conversion of each channel.
    pub(super) ninth: [f64; ADC_CHANNELS],
}

impl Pairs {
    /// Makes the conversions of a millisecond at the levels of `level`, with the noise that stands in `words` and `ninth`.
    pub(super) fn convert(&mut self, level: &Levels, noise_counts: f64, out: &mut [AdcBlock; ADC_CHANNELS]) {
        for ((first, second), reading) in self.first.iter_mut().zip(&mut self.second).zip(level.first.chunks_exact(2)) {
            (*first, *second) = (reading[0], reading[1]);
        }
        convert(self, level, noise_counts, out);
    }
}

impl Pairs {
    /// The codes of `channel` one by one, of the same words: nine places, of which the last counts where there is a ninth.
    pub(super) fn codes(&self, channel: usize, level: &Levels, noise_counts: f64) -> [u16; EIGHT + 1] {
        let at = |n: usize| if channel == 0 { level.first[n] } else { level.all[channel] };
        let code = |level: f64, noise: f64| whole_code(level + noise_counts * noise + 0.5) as u16;
        let mut codes = [0; EIGHT + 1];
        for pair in 0..PAIRS {
            let [now, next] = quick(u64::from_le_bytes(self.words[channel * PAIRS + pair]));
            codes[2 * pair] = code(at(2 * pair), now);
            codes[2 * pair + 1] = code(at(2 * pair + 1), next);
        }
        codes[EIGHT] = code(level.all[channel], self.ninth[channel]);
        codes
    }
}

/// What stands at the pins in a millisecond, counts.
pub(super) struct Levels {
    /// The eight levels of the first channel.
    pub(super) first: [f64; EIGHT],
    /// The level of each of the other channels, and in the place of the first that of its ninth conversion.
    pub(super) all: [f64; ADC_CHANNELS],
    /// Whether there is a ninth.
    pub(super) nine: bool,
}

#[multiversion(targets("x86_64+avx2"))]
fn convert(pairs: &mut Pairs, level: &Levels, noise_counts: f64, out: &mut [AdcBlock; ADC_CHANNELS]) {
    // as wide as they are read again: narrower ones would have to reach memory first
    for (channel, level) in level.all.iter().enumerate().skip(1) {
        pairs.first[channel * PAIRS..][..PAIRS].fill(*level);
        pairs.second[channel * PAIRS..][..PAIRS].fill(*level);
    }
    for i in 0..ALL {
        let [now, next] = quick(u64::from_le_bytes(pairs.words[i]));
        let a = whole_code(pairs.first[i] + noise_counts * now + 0.5);
        let b = whole_code(pairs.second[i] + noise_counts * next + 0.5);
        pairs.sums[i] = (a + b) + SQUARES * (a * a + b * b);
        pairs.min[i] = lower(a, b);
        pairs.max[i] = higher(a, b);
    }
    let own = |all: &[f64; ALL], channel: usize, join: fn(f64, f64) -> f64| {
        let at = |pair: usize| all[channel * PAIRS + pair];
        join(join(at(0), at(1)), join(at(2), at(3)))
    };
    for (channel, block) in out.iter_mut().enumerate() {
        let mut sums = own(&pairs.sums, channel, |a, b| a + b);
        let (mut min, mut max) = (own(&pairs.min, channel, lower), own(&pairs.max, channel, higher));
        if level.nine {
            let code = whole_code(level.all[channel] + noise_counts * pairs.ninth[channel] + 0.5);
            sums += code + SQUARES * (code * code);
            (min, max) = (lower(code, min), higher(code, max));
        }
        let sums = bits(sums);
        *block = AdcBlock {
            sum: (sums % SQUARES as u64) as u32,
            sum_sq: sums / SQUARES as u64,
            count: EIGHT as u16 + u16::from(level.nine),
            min: bits(min) as u16,
            max: bits(max) as u16,
        };
    }
}

/// A whole number below 2^52: it stands in the lowest bits of itself plus 2^52.
#[inline]
fn bits(whole: f64) -> u64 {
    (whole + ROUNDING).to_bits() ^ ROUNDING.to_bits()
}

/// The ideal converter's code for a level: truncated, at its ends clipped. As a float, so that many go side by side; sums of codes and
/// of their squares are exact in it.
#[inline]
fn whole_code(noisy: f64) -> f64 {
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
