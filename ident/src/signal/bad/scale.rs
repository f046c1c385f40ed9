//! How far a reading may stand from the ones before it.
//!
//! What it is: the usual distance from the median of the readings before, row by row, and from how many of them on a reading is more
//! probably a bad one than a far one.
//! What can go wrong: a coarse display hardly ever moves; half its step is kept.
//! Units: the channel's.
//! Reference: Student's t with eight degrees of freedom for the good readings, any value of the channel's range alike for a bad one.

use crate::numeric::order::{median, quantum};
use std::ops::Range;

/// Readings before one that it is held against.
pub(super) const BEFORE: usize = 9;
/// Rows whose usual distance is told together, and how many such blocks on either side are asked too: a level of a staircase.
const BLOCK: usize = 32;
const BESIDE: usize = 2;
/// Last digit that is trusted, as a share of the largest usual reading.
const DIGIT: f64 = 1e-6;
/// Degrees of freedom of the good readings: an excess kurtosis of 1.5, as steady stretches of rigs show.
const FREEDOM: f64 = 8.0;
/// Share of a channel's span below which a departure does no harm.
const HARMLESS: f64 = 0.02;

/// How far readings of one channel usually are from those before them.
pub(super) struct Scale {
    blocks: Vec<f64>,
    /// Times the usual distance from which on a reading is more probably bad than good.
    pub(super) times: f64,
    /// Least departure that matters.
    pub(super) least: f64,
}

impl Scale {
    /// Of the departures `r` from what is expected and the readings `y` themselves.
    pub(super) fn of(r: &[f64], y: &[f64]) -> Self {
        let off: Vec<f64> = (0..r.len()).map(|i| (r[i] - before(r, i)).abs()).collect();
        let mut whole: Vec<f64> = off.clone();
        let mut sorted = y.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        let (low, high) = (sorted[sorted.len() / 50], sorted[sorted.len() - 1 - sorted.len() / 50]);
        let floor = (0.5 * quantum(y)).max(DIGIT * high.abs().max(low.abs())).max(0.5 * 1.4826 * median(&mut whole)).max(1e-300);
        let own: Vec<f64> = off.chunks(BLOCK).map(|c| 1.4826 * median(&mut c.to_vec())).collect();
        let around = |k: usize| median(&mut own[k.saturating_sub(BESIDE)..(k + BESIDE + 1).min(own.len())].to_vec()).max(floor);
        let blocks: Vec<f64> = (0..own.len()).map(around).collect();
        let usual = median(&mut blocks.clone());
        let span = (high - low).max(high.abs());
        Self { blocks, times: times(r.len(), span / usual), least: HARMLESS * span }
    }

    /// The usual distance at a sample.
    pub(super) fn at(&self, k: usize) -> f64 {
        self.blocks[k / BLOCK]
    }
}

/// Median of the readings before one, of those after it at the head.
pub(super) fn before(r: &[f64], k: usize) -> f64 {
    let span: Range<usize> = if k >= 3 { k.saturating_sub(BEFORE)..k } else { k + 1..(k + 1 + BEFORE).min(r.len()) };
    median(&mut r[span].to_vec())
}

/// Times the scale at which a bad reading, one expected among `n` and anywhere in a span of so many scales, is as probable as a good one.
pub(super) fn times(n: usize, span: f64) -> f64 {
    let bad = 1.0 / (n as f64 * span.max(2.0));
    // density of Student's t with eight degrees of freedom: 0.3867 (1 + z^2/8)^(-9/2)
    let at = (0.3867 / bad).powf(2.0 / (FREEDOM + 1.0));
    (FREEDOM * (at - 1.0).max(1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_longer_run_and_a_wider_span_ask_for_more() {
        let usual = times(8750, 500.0);
        assert!((12.0..16.0).contains(&usual), "{usual}");
        assert!(times(600_000, 500.0) > usual && times(8750, 5000.0) > usual && times(60, 100.0) > 5.0);
    }
}
