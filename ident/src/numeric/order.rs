//! Order statistics: the middle of a list, and the step between its values.
//!
//! What it is: medians and quanta, which no glitch moves.
//! What can go wrong: an empty list has no median (NaN).
//! Units: those of the values.
//! Reference: Huber 1981, Robust Statistics.

/// Median of a slice, which it reorders; NaN for an empty one.
#[must_use]
pub fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let n = values.len();
    let (_, mid, _) = values.select_nth_unstable_by(n / 2, f64::total_cmp);
    let mid = *mid;
    if n % 2 == 1 {
        mid
    } else {
        let low = values[..n / 2].iter().copied().fold(f64::NEG_INFINITY, f64::max);
        0.5 * (low + mid)
    }
}

/// Smallest non-zero step between sorted distinct values: the resolution of the log.
#[must_use]
pub fn quantum(y: &[f64]) -> f64 {
    let mut v: Vec<f64> = y.iter().copied().take(20_000).collect();
    v.sort_unstable_by(f64::total_cmp);
    let mut steps: Vec<f64> = v.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 1e-12).collect();
    if steps.len() < 8 {
        return 0.0;
    }
    steps.sort_unstable_by(f64::total_cmp);
    steps[steps.len() / 20]
}

/// Usual distance of two readings, s; one of a single reading.
pub(crate) fn usual_step(t: &[f64]) -> f64 {
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    if steps.is_empty() { 1.0 } else { median(&mut steps) }
}
