//! The grid that a channel's readings lie on.
//!
//! What it is: the step of a coarse reading, read off its distinct values.
//! What can go wrong: a fine grid in much noise is none.
//! Units: the channel's.
//! Reference: Widrow & Kollar 2008, Quantization Noise.

use super::Target;

/// The step of a channel whose readings all lie on a coarse grid: at least as large as the scatter between rows.
pub(crate) fn step(target: &Target) -> Option<f64> {
    lattice(target).map(|l| l.step)
}

/// A grid that readings lie on.
pub(crate) struct Lattice {
    pub(crate) step: f64,
    /// Mean distance from it, in steps.
    pub(crate) departure: f64,
}

pub(crate) fn lattice(target: &Target) -> Option<Lattice> {
    let mut values = target.y.clone();
    values.sort_unstable_by(f64::total_cmp);
    let span = values.last()? - values.first()?;
    let gaps: Vec<f64> = values.windows(2).map(|w| w[1] - w[0]).filter(|g| *g > 1e-9 * span).collect();
    let step = grid(&values, gaps.iter().copied().fold(f64::INFINITY, f64::min));
    let departure = values.iter().map(|v| (v / step - (v / step).round()).abs()).sum::<f64>() / values.len() as f64;
    // few distinct values, on a grid, and most successive readings in steady stretches repeat
    let repeats = target.y.windows(2).filter(|w| (w[0] - w[1]).abs() < 0.5 * step).count() as f64 / target.y.len() as f64;
    (step.is_finite() && span / step < 2000.0 && departure < 0.05 && repeats > 0.35).then_some(Lattice { step, departure })
}

/// The step of the grid through zero that sorted values lie on: read off the smallest gap, then off ever larger values, because
/// a log that rounds its readings a second time leaves each of them slightly off the grid.
fn grid(sorted: &[f64], smallest_gap: f64) -> f64 {
    let mut step = smallest_gap;
    let (mut cross, mut square) = (0.0, 0.0);
    let mut by_size: Vec<f64> = sorted.iter().map(|v| v.abs()).filter(|v| *v > 0.5 * step).collect();
    by_size.sort_unstable_by(f64::total_cmp);
    by_size.dedup();
    for v in by_size {
        let n = (v / step).round();
        cross += n * v;
        square += n * n;
        step = cross / square;
    }
    step
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_that_was_rounded_again_is_found() {
        let readings: Vec<f64> = [1.0, 2.0, 3.0, 8.0, 30.0].iter().map(|n: &f64| (n * 0.5748 * 100.0).round() / 100.0).collect();
        let gap = readings[1] - readings[0];
        assert!((grid(&readings, gap) - 0.5748).abs() < 0.001, "{}", grid(&readings, gap));
    }
}
