//! Weighted linear least squares with covariance.
//!
//! What it is: normal equations with column scaling, Cholesky by nalgebra, a ridge of 1e-12 for columns that a log cannot tell apart.
//! What can go wrong: collinear columns give large standard errors, never a panic.
//! Units: those of the columns.
//! Reference: Bjorck, *Numerical Methods for Least Squares Problems*, 1996, section 2.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Accumulated normal equations of one target.
#[derive(Debug, Clone)]
pub struct Normal {
    gram: DMatrix<f64>,
    rhs: DVector<f64>,
    yy: f64,
    /// Rows that went in.
    pub count: usize,
}

/// A solution.
#[derive(Debug, Clone)]
pub struct Solution {
    /// One coefficient a column.
    pub coefficients: Vec<f64>,
    /// Inverse of the weighted gram matrix: multiply by the residual scale for a covariance.
    pub inverse: DMatrix<f64>,
    /// Weighted residual sum of squares.
    pub rss: f64,
}

/// Share of a column's square below which what others leave of it is rounding.
const NOTHING: f64 = 1e-10;

/// Times all that the rows say of a coefficient by which it is held where it may not go beyond.
const HELD: f64 = 1e6;

impl Normal {
    /// For `k` columns.
    #[must_use]
    pub fn new(k: usize) -> Self {
        Self { gram: DMatrix::zeros(k, k), rhs: DVector::zeros(k), yy: 0.0, count: 0 }
    }

    /// Adds one row.
    pub fn add(&mut self, row: &[f64], y: f64, weight: f64) {
        for (j, a) in row.iter().enumerate() {
            let wa = weight * a;
            for (k, b) in row.iter().enumerate().take(j + 1) {
                self.gram[(j, k)] += wa * b;
            }
            self.rhs[j] += wa * y;
        }
        self.yy += weight * y * y;
        self.count += 1;
    }

    /// Whole columns at once, all of one length: `weights` beside the readings `y`.
    #[must_use]
    pub fn of_columns(columns: &[impl std::borrow::Borrow<Vec<f64>>], y: &[f64], weights: &[f64]) -> Self {
        let mut normal = Self::new(columns.len());
        let mut weighted: Vec<f64> = Vec::with_capacity(y.len());
        for (j, column) in columns.iter().enumerate() {
            weighted.clear();
            weighted.extend(column.borrow().iter().zip(weights).map(|(a, w)| a * w));
            for (k, other) in columns.iter().enumerate().take(j + 1) {
                normal.gram[(j, k)] = dot(&weighted, other.borrow());
            }
            normal.rhs[j] = dot(&weighted, y);
        }
        normal.yy = y.iter().zip(weights).map(|(v, w)| w * v * v).sum();
        normal.count = y.len();
        normal
    }

    /// From products that are known: for each column those with the columns up to itself, and with the readings; the readings' own square
    /// sum, all weighted; and the number of rows.
    pub(crate) fn of_products(
        columns: impl ExactSizeIterator<Item = (impl Iterator<Item = f64>, f64)>,
        squares: f64,
        count: usize,
    ) -> Self {
        let mut normal = Self { yy: squares, count, ..Self::new(columns.len()) };
        for (j, (products, with_y)) in columns.enumerate() {
            products.enumerate().for_each(|(k, v)| normal.gram[(j, k)] = v);
            normal.rhs[j] = with_y;
        }
        normal
    }

    /// A polynomial in x through points (x, y, weight), in blocks: a long log need not stand in memory as columns of powers.
    #[must_use]
    pub fn of_polynomial(degree: usize, points: impl Iterator<Item = (f64, f64, f64)>) -> Self {
        const BLOCK: usize = 4096;
        let mut whole = Self::new(degree + 1);
        let mut columns = vec![Vec::with_capacity(BLOCK); degree + 1];
        let (mut y, mut weights) = (Vec::with_capacity(BLOCK), Vec::with_capacity(BLOCK));
        let mut points = points.peekable();
        while points.peek().is_some() {
            columns.iter_mut().for_each(Vec::clear);
            y.clear();
            weights.clear();
            for (x, value, weight) in points.by_ref().take(BLOCK) {
                let mut power = 1.0;
                for column in &mut columns {
                    column.push(power);
                    power *= x;
                }
                y.push(value);
                weights.push(weight);
            }
            whole.absorb(&Self::of_columns(&columns, &y, &weights));
        }
        whole
    }

    /// Adds what is known of a coefficient beforehand: that it is about zero, with a standard deviation, and within `most` of it. Weights of
    /// the rows are `unit` over a variance.
    pub(crate) fn expect(&mut self, column: usize, sd: f64, most: f64, unit: f64) {
        self.gram[(column, column)] += unit / (sd * sd);
        let Some(found) = self.solve().map(|s| s.coefficients[column]).filter(|c| c.abs() > most) else { return };
        let (held, weight) = (most.copysign(found), HELD * self.gram[(column, column)]);
        self.gram[(column, column)] += weight;
        self.rhs[column] += weight * held;
        self.yy += weight * held * held;
    }

    /// Adds what other rows have said of some columns: their coefficients, and how surely, in weights of one row.
    pub(crate) fn tell(&mut self, columns: &[usize], values: &DVector<f64>, precision: &DMatrix<f64>) {
        let pull = precision * values;
        for (a, j) in columns.iter().enumerate() {
            for (b, k) in columns.iter().enumerate().filter(|(_, k)| *k <= j) {
                self.gram[(*j, *k)] += precision[(a, b)];
            }
            self.rhs[*j] += pull[a];
        }
        self.yy += values.dot(&pull);
    }

    /// Adds what went into another of the same columns.
    pub fn absorb(&mut self, other: &Self) {
        self.gram += &other.gram;
        self.rhs += &other.rhs;
        self.yy += other.yy;
        self.count += other.count;
    }

    /// The equations of the other columns once the first `k` have been solved for whatever those are; `None` when the numbers are not finite.
    /// The Schur complement of the first block.
    pub(crate) fn without_first(&self, k: usize) -> Option<Self> {
        let n = self.rhs.len() - k;
        let head = Self {
            gram: self.gram.view((0, 0), (k, k)).into_owned(),
            rhs: self.rhs.rows(0, k).into_owned(),
            yy: self.yy,
            count: self.count,
        };
        let factor = head.factor()?;
        let beside: Vec<Vec<f64>> = (0..n).map(|j| (0..k).map(|l| self.gram[(k + j, l)]).collect()).collect();
        let own = factor.solve(&(0..k).map(|l| self.rhs[l]).collect::<Vec<f64>>())?;
        let mut out = Self { yy: self.yy - dot(&own, head.rhs.as_slice()), count: self.count, ..Self::new(n) };
        for j in 0..n {
            let explained = factor.solve(&beside[j])?;
            for (l, other) in beside.iter().enumerate().take(j + 1) {
                out.gram[(j, l)] = self.gram[(k + j, k + l)] - dot(&explained, other);
            }
            out.rhs[j] = self.rhs[k + j] - dot(&own, &beside[j]);
        }
        // a column that the first ones make up says nothing
        let made_up: Vec<usize> = (0..n).filter(|j| out.gram[(*j, *j)] <= NOTHING * self.gram[(k + *j, k + *j)]).collect();
        for j in made_up {
            (0..=j).for_each(|l| out.gram[(j, l)] = 0.0);
            (j..n).for_each(|l| out.gram[(l, j)] = 0.0);
            out.rhs[j] = 0.0;
        }
        Some(out)
    }

    /// Less a `share` of what another of the same columns holds: rows that went into both then weigh so much less.
    #[must_use]
    pub fn less(&self, other: &Self, share: f64) -> Self {
        Self {
            gram: &self.gram - &other.gram * share,
            rhs: &self.rhs - &other.rhs * share,
            yy: self.yy - other.yy * share,
            count: self.count,
        }
    }

    /// Weighted square sum that coefficients leave of the readings.
    pub(crate) fn left_by(&self, coefficients: &[f64]) -> f64 {
        let mut left = self.yy;
        for (j, a) in coefficients.iter().enumerate() {
            left -= 2.0 * a * self.rhs[j];
            for (k, b) in coefficients.iter().enumerate().take(j + 1) {
                left += if k == j { 1.0 } else { 2.0 } * a * b * self.gram[(j, k)];
            }
        }
        left.max(0.0)
    }

    /// Solves; `None` when the numbers are not finite.
    #[must_use]
    pub fn solve(&self) -> Option<Solution> {
        let k = self.rhs.len();
        if k == 0 {
            return Some(Solution { coefficients: Vec::new(), inverse: DMatrix::zeros(0, 0), rss: self.yy });
        }
        let Factor { cholesky, scale } = self.factor()?;
        let b = DVector::from_iterator(k, (0..k).map(|j| self.rhs[j] / scale[j]));
        let x = cholesky.solve(&b);
        let mut inverse = cholesky.inverse();
        for j in 0..k {
            for l in 0..k {
                inverse[(j, l)] /= scale[j] * scale[l];
            }
        }
        let coefficients: Vec<f64> = (0..k).map(|j| x[j] / scale[j]).collect();
        let rss = (self.yy - b.dot(&x)).max(0.0);
        (rss.is_finite() && coefficients.iter().all(|c| c.is_finite())).then_some(Solution { coefficients, inverse, rss })
    }

    /// The factors of the columns alone, for many readings; `None` when the numbers are not finite.
    #[must_use]
    pub fn factor(&self) -> Option<Factor> {
        let k = self.rhs.len();
        let scale: Vec<f64> = (0..k).map(|j| self.gram[(j, j)].sqrt()).map(|s| if s > 1e-150 { s } else { 1.0 }).collect();
        let mut a = DMatrix::zeros(k, k);
        for j in 0..k {
            for l in 0..=j {
                let v = self.gram[(j, l)] / (scale[j] * scale[l]);
                a[(j, l)] = v;
                a[(l, j)] = v;
            }
            a[(j, j)] += 1e-12;
            if self.gram[(j, j)].sqrt() <= 1e-150 {
                a[(j, j)] = 1.0;
            }
        }
        Some(Factor { cholesky: a.cholesky()?, scale })
    }
}

/// Normal equations whose columns are factored.
#[derive(Debug, Clone)]
pub struct Factor {
    cholesky: Cholesky<f64, Dyn>,
    scale: Vec<f64>,
}

impl Factor {
    /// Coefficients for weighted sums of the readings with each column; `None` when they are not finite.
    #[must_use]
    pub fn solve(&self, sums: &[f64]) -> Option<Vec<f64>> {
        let scaled = DVector::from_iterator(sums.len(), sums.iter().zip(&self.scale).map(|(s, scale)| s / scale));
        let x = self.cholesky.solve(&scaled);
        let coefficients: Vec<f64> = x.iter().zip(&self.scale).map(|(x, scale)| x / scale).collect();
        coefficients.iter().all(|c| c.is_finite()).then_some(coefficients)
    }
}

/// Scalar product in eight independent sums, so that it does not wait for each addition; the order is fixed.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a, b) = (&a[..n], &b[..n]);
    let mut sums = [0.0; 8];
    let (head_a, tail_a) = a.as_chunks::<8>();
    let (head_b, tail_b) = b.as_chunks::<8>();
    for (x, y) in head_a.iter().zip(head_b) {
        for (s, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *s += x * y;
        }
    }
    let tail: f64 = tail_a.iter().zip(tail_b).map(|(x, y)| x * y).sum();
    sums.iter().sum::<f64>() + tail
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_comes_back() {
        let mut normal = Normal::new(2);
        for i in 0..10 {
            let x = f64::from(i);
            normal.add(&[1.0, x], 3.0 - 2.0 * x, 1.0);
        }
        let s = normal.solve().unwrap();
        assert!((s.coefficients[0] - 3.0).abs() < 1e-9 && (s.coefficients[1] + 2.0).abs() < 1e-9);
        assert!(s.rss < 1e-8);
    }

    #[test]
    fn columns_give_what_rows_give() {
        let columns: Vec<Vec<f64>> = (0..3).map(|k| (0..29).map(|i| f64::from(i * (k + 1) % 7) + 0.5).collect()).collect();
        let y: Vec<f64> = (0..29).map(|i| f64::from(i % 5)).collect();
        let weights: Vec<f64> = (0..29).map(|i| 1.0 + f64::from(i % 3)).collect();
        let mut rows = Normal::new(3);
        for i in 0..29 {
            rows.add(&[columns[0][i], columns[1][i], columns[2][i]], y[i], weights[i]);
        }
        let (a, b) = (rows.solve().unwrap(), Normal::of_columns(&columns, &y, &weights).solve().unwrap());
        assert!((a.rss - b.rss).abs() < 1e-9);
        assert!(a.coefficients.iter().zip(&b.coefficients).all(|(p, q)| (p - q).abs() < 1e-9));
    }

    #[test]
    fn a_polynomial_in_blocks_comes_back() {
        let points = (0..10_000).map(|i| f64::from(i) / 5000.0).map(|x| (x, 1.0 - 3.0 * x + 0.5 * x * x, 1.0 + x));
        let normal = Normal::of_polynomial(2, points);
        let s = normal.solve().unwrap();
        assert_eq!(normal.count, 10_000);
        for (c, truth) in s.coefficients.iter().zip([1.0, -3.0, 0.5]) {
            assert!((c - truth).abs() < 1e-8, "{:?}", s.coefficients);
        }
    }

    #[test]
    fn twin_columns_do_no_harm() {
        let mut normal = Normal::new(2);
        for i in 0..10 {
            normal.add(&[f64::from(i), f64::from(i)], f64::from(i), 1.0);
        }
        let s = normal.solve().unwrap();
        assert!((s.coefficients[0] + s.coefficients[1] - 1.0).abs() < 1e-6);
    }
}
