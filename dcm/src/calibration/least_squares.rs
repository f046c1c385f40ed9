//! Linear least squares with standard errors.
//!
//! What it is: normal equations of up to a dozen unknowns, built row by row, solved by Cholesky's factors.
//! What can go wrong: rows that do not determine the unknowns: no solution.
//! Units: those of the rows.
//! Reference: Golub & Van Loan, *Matrix Computations*, section 4.2.

use libm::sqrtf;

/// The equations.
#[derive(Debug, Clone, Copy)]
pub(super) struct Normal<const N: usize> {
    matrix: [[f32; N]; N],
    right: [f32; N],
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
        Self { matrix: [[0.0; N]; N], right: [0.0; N], square: 0.0, rows: 0.0 }
    }

    /// Adds the row `sum a_i x_i = value`.
    pub(super) fn add(&mut self, a: &[f32; N], value: f32) {
        for ((line, right), left) in self.matrix.iter_mut().zip(&mut self.right).zip(a) {
            for (slot, other) in line.iter_mut().zip(a) {
                *slot += left * other;
            }
            *right += left * value;
        }
        self.square += value * value;
        self.rows += 1.0;
    }

    /// The same with its diagonal raised by a share of itself (Levenberg, Marquardt).
    pub(super) fn damped(&self, share: f32) -> Self {
        let mut out = *self;
        for (k, line) in out.matrix.iter_mut().enumerate() {
            if let Some(diagonal) = line.get_mut(k) {
                *diagonal *= 1.0 + share;
            }
        }
        out
    }

    /// Solves; `None` when the rows do not determine every unknown.
    pub(super) fn solve(&self) -> Option<Solution<N>> {
        let factor = self.factor()?;
        let x = substitute(&factor, &self.right);
        let explained: f32 = x.iter().zip(&self.right).map(|(a, b)| a * b).sum();
        let left = (self.square - explained).max(0.0);
        let free = (self.rows - N as f32).max(1.0);
        let variance = left / free;
        let mut sigma = [0.0; N];
        for (k, slot) in sigma.iter_mut().enumerate() {
            let mut unit = [0.0; N];
            if let Some(one) = unit.get_mut(k) {
                *one = 1.0;
            }
            let column = substitute(&factor, &unit);
            *slot = sqrtf((variance * column.get(k)?).max(0.0));
        }
        let good = x.iter().chain(&sigma).all(|v| v.is_finite());
        good.then_some(Solution { x, sigma, rms: sqrtf(left / self.rows) })
    }

    /// Lower Cholesky factor.
    fn factor(&self) -> Option<[[f32; N]; N]> {
        let mut l = [[0.0f32; N]; N];
        for i in 0..N {
            for j in 0..=i {
                let (above, below) = l.split_at(i);
                let row_i = below.first()?;
                let row_j = if i == j { row_i } else { above.get(j)? };
                let dot: f32 = row_i.iter().zip(row_j).take(j).map(|(a, b)| a * b).sum();
                let rest = self.matrix.get(i)?.get(j)? - dot;
                let value = if i == j {
                    let largest = self.matrix.get(i)?.get(i)?;
                    if rest.is_nan() || rest <= 1e-6 * largest {
                        return None;
                    }
                    sqrtf(rest)
                } else {
                    rest / row_j.get(j)?
                };
                *l.get_mut(i)?.get_mut(j)? = value;
            }
        }
        Some(l)
    }
}

/// Solves L L^T x = b.
fn substitute<const N: usize>(l: &[[f32; N]; N], b: &[f32; N]) -> [f32; N] {
    let mut y = [0.0f32; N];
    for (i, (line, right)) in l.iter().zip(b).enumerate() {
        let dot: f32 = line.iter().zip(&y).take(i).map(|(a, b)| a * b).sum();
        if let (Some(slot), Some(pivot)) = (y.get_mut(i), line.get(i)) {
            *slot = (right - dot) / pivot;
        }
    }
    let mut x = [0.0f32; N];
    for i in (0..N).rev() {
        let dot: f32 = l.iter().zip(&x).skip(i + 1).filter_map(|(line, x)| Some(line.get(i)? * x)).sum();
        if let (Some(slot), Some(y), Some(pivot)) = (x.get_mut(i), y.get(i), l.get(i).and_then(|line| line.get(i))) {
            *slot = (y - dot) / pivot;
        }
    }
    x
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
}
