//! Linear least squares with standard errors.
//!
//! What it is: normal equations of up to a dozen unknowns, built row by row; nalgebra's Cholesky factors solve them.
//! What can go wrong: rows that do not determine the unknowns: no solution.
//! Units: those of the rows.
//! Reference: Golub & Van Loan, *Matrix Computations*, section 4.2.

use libm::sqrtf;
use nalgebra::{SMatrix, SVector};

/// Share of an unknown's square below which what the others leave of it is rounding.
const NOTHING: f32 = 1e-6;

/// The equations.
#[derive(Debug, Clone, Copy)]
pub(super) struct Normal<const N: usize> {
    matrix: SMatrix<f32, N, N>,
    right: SVector<f32, N>,
    square: f32,
    rows: f32,
}

/// A solution.
#[derive(Debug, Clone, Copy)]
pub(super) struct Solution<const N: usize> {
    /// The unknowns.
    pub(super) x: [f32; N],
    /// Their standard errors.
    pub(super) sigma: [f32; N],
    /// Root mean square of what is left of the rows.
    pub(super) rms: f32,
}

impl<const N: usize> Normal<N> {
    pub(super) fn new() -> Self {
        Self { matrix: SMatrix::zeros(), right: SVector::zeros(), square: 0.0, rows: 0.0 }
    }

    /// Adds the row `sum a_i x_i = value`.
    pub(super) fn add(&mut self, a: &[f32; N], value: f32) {
        let a = SVector::from(*a);
        self.matrix += a * a.transpose();
        self.right += a * value;
        self.square += value * value;
        self.rows += 1.0;
    }

    /// The same with its diagonal raised by a share of itself (Levenberg, Marquardt).
    pub(super) fn damped(&self, share: f32) -> Self {
        let raised = self.matrix + SMatrix::from_diagonal(&(self.matrix.diagonal() * share));
        Self { matrix: raised, ..*self }
    }

    /// Solves; `None` when the rows do not determine every unknown.
    pub(super) fn solve(&self) -> Option<Solution<N>> {
        let factor = self.matrix.cholesky()?;
        let pivots = factor.l_dirty().diagonal();
        if pivots.iter().zip(self.matrix.diagonal().iter()).any(|(pivot, own)| pivot * pivot <= NOTHING * own) {
            return None;
        }
        let x = factor.solve(&self.right);
        let left = (self.square - x.dot(&self.right)).max(0.0);
        let free = (self.rows - N as f32).max(1.0);
        let variance = left / free;
        let sigma = factor.inverse().diagonal().map(|own| sqrtf((variance * own).max(0.0)));
        let good = x.iter().chain(sigma.iter()).all(|v| v.is_finite());
        good.then_some(Solution { x: x.into(), sigma: sigma.into(), rms: sqrtf(left / self.rows) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_points_with_its_errors() {
        let mut normal = Normal::<2>::new();
        for k in 0..100 {
            let x = k as f32 / 10.0;
            let noise = if k % 2 == 0 { 0.1 } else { -0.1 };
            normal.add(&[1.0, x], 3.0 - 2.0 * x + noise);
        }
        let s = normal.solve().unwrap();
        assert!((s.x[0] - 3.0).abs() < 0.02 && (s.x[1] + 2.0).abs() < 0.005, "{:?}", s.x);
        // slope of n points, spacing h: sigma / sqrt(n^3 h^2/12)
        let known = 0.1 / (100.0f32.powi(3) * 0.01 / 12.0).sqrt();
        assert!((s.sigma[1] - known).abs() < 0.05 * known, "{} {known}", s.sigma[1]);
        assert!((s.rms - 0.1).abs() < 0.002);
    }

    #[test]
    fn undetermined_rows_have_no_solution() {
        let mut normal = Normal::<2>::new();
        for _ in 0..10 {
            normal.add(&[1.0, 2.0], 3.0);
        }
        assert!(normal.solve().is_none());
    }

    /// A share on top of the diagonal: one unknown becomes as much smaller.
    #[test]
    fn damping_shortens_the_step() {
        let mut normal = Normal::<1>::new();
        normal.add(&[2.0], 6.0);
        let step = |share: f32| normal.damped(share).solve().unwrap().x[0];
        assert!((step(0.0) - 3.0).abs() < 1e-6 && (step(0.5) - 2.0).abs() < 1e-6 && (step(2.0) - 1.0).abs() < 1e-6);
    }

    /// The standard error of a mean: that of one reading, of n - 1 free ones, over the root of n.
    #[test]
    fn a_mean_of_three_has_its_textbook_error() {
        let mut normal = Normal::<1>::new();
        [0.0, 1.0, 2.0].iter().for_each(|value| normal.add(&[1.0], *value));
        let s = normal.solve().unwrap();
        assert!((s.x[0] - 1.0).abs() < 1e-6 && (s.sigma[0] - (1.0f32 / 3.0).sqrt()).abs() < 1e-6, "{s:?}");
    }

    /// Two columns that are nearly the same, in any unit.
    #[test]
    fn what_the_others_determine_but_for_rounding_has_no_solution() {
        for unit in [1e-3f32, 1.0, 1e3] {
            let solved = |apart: f32| {
                let mut normal = Normal::<2>::new();
                [1.0, -1.0, 1.0, -1.0].iter().for_each(|sign| normal.add(&[unit, unit * (1.0 + sign * apart)], unit));
                normal.solve().is_some()
            };
            assert!(!solved(5e-4) && solved(5e-3), "{unit}");
        }
    }
}
