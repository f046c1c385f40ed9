//! Least squares in three axes with left-out stretches.
//!
//! What it is: a model that is linear in its terms, each a vector in body axes as a function of the row; solved on means over short
//! blocks of rows, with every fifth stretch predicted by a fit that did not see it, and standard errors that know the residual's
//! colour (clusters of neighbouring blocks).
//! What can go wrong: terms that a log cannot tell apart get large standard errors; a prior holds flexible terms near zero.
//! Units: those of the channel.
//! Reference: Bjorck, *Numerical Methods for Least Squares Problems*, 1996, section 2; Liang & Zeger, Biometrika 73, 1986 (clusters).

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Vector3};
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::ops::Range;

/// With more columns than this a cluster is not left out for the standard errors: each would be a factorisation.
const LEFT_OUT: usize = 64;
/// One of so many stretches is left out at a time.
pub(crate) const FOLDS: usize = 5;

/// One term of a model.
pub(crate) struct Term<'a> {
    /// Name of its coefficient; empty for one that nobody wants to read.
    pub(crate) name: String,
    /// Unit of its coefficient.
    pub(crate) unit: &'static str,
    /// Times outside which it is zero.
    pub(crate) support: (f64, f64),
    /// Standard deviation of its coefficient before anything is seen; 0 for none.
    pub(crate) prior: f64,
    /// Its value at a row.
    pub(crate) value: Box<dyn Fn(usize) -> Vector3<f64> + 'a>,
}

impl<'a> Term<'a> {
    /// A term that acts all the time and has no prior.
    pub(crate) fn new(name: &str, unit: &'static str, value: impl Fn(usize) -> Vector3<f64> + 'a) -> Self {
        let support = (f64::NEG_INFINITY, f64::INFINITY);
        Self { name: name.to_owned(), unit, support, prior: 0.0, value: Box::new(value) }
    }
}

/// A block of rows whose means are one reading.
#[derive(Debug, Clone)]
pub(crate) struct Block {
    /// Its rows.
    pub(crate) rows: Range<usize>,
    /// Its middle, s.
    pub(crate) t: f64,
}

/// Readings of a sensor in blocks.
pub(crate) struct Readings {
    pub(crate) blocks: Vec<Block>,
    /// Rows that count, all blocks in one list.
    pub(crate) used: Vec<bool>,
    /// Means, three to a block.
    y: Vec<f64>,
    fold: Vec<usize>,
    cluster: Vec<usize>,
}

/// A model's terms over the blocks.
pub(crate) struct Column {
    from: usize,
    values: Vec<f64>,
    prior: f64,
}

impl Column {
    /// Where it is not zero.
    fn span(&self) -> Range<usize> {
        self.from..self.from + self.values.len()
    }

    /// Its product with `other` over a range.
    fn dot(&self, range: &Range<usize>, other: impl Fn(usize) -> f64) -> f64 {
        let own = self.span();
        (own.start.max(range.start)..own.end.min(range.end)).map(|e| self.values[e - self.from] * other(e)).sum()
    }
}

/// A fit.
#[derive(Debug, Clone)]
pub(crate) struct Solved {
    pub(crate) coefficients: Vec<f64>,
    /// Standard errors.
    pub(crate) sigma: Vec<f64>,
    /// Residual, three to a block, each stretch predicted by a fit that did not see it.
    pub(crate) heldout: Vec<f64>,
}

impl Readings {
    /// Cuts the usable rows into blocks of `block_s`, stretches of `stretch_s` and clusters of `cluster_s`.
    pub(crate) fn new(t: &[f64], y: &[Vector3<f64>], used: Vec<bool>, block_s: f64, stretch_s: f64, cluster_s: f64) -> Self {
        let start = t.first().copied().unwrap_or(0.0);
        let mut blocks: Vec<Block> = Vec::new();
        let mut from = 0;
        while from < t.len() {
            let number = |i: usize| ((t[i] - start) / block_s) as i64;
            let to = (from..t.len()).find(|i| number(*i) != number(from)).unwrap_or(t.len());
            let count = (from..to).filter(|i| used[*i]).count();
            if count > 0 {
                let sum: f64 = (from..to).filter(|i| used[*i]).map(|i| t[i]).sum();
                blocks.push(Block { rows: from..to, t: sum / count as f64 });
            }
            from = to;
        }
        let index = |b: &Block, length: f64| ((b.t - start) / length) as usize;
        let fold = blocks.iter().map(|b| index(b, stretch_s) % FOLDS).collect();
        let cluster = blocks.iter().map(|b| index(b, cluster_s)).collect();
        let mut out = Self { blocks, used, y: Vec::new(), fold, cluster };
        out.y = out.means(0..out.blocks.len(), &|i| y[i]);
        out
    }

    fn means(&self, blocks: Range<usize>, value: &dyn Fn(usize) -> Vector3<f64>) -> Vec<f64> {
        let mut out = Vec::with_capacity(3 * blocks.len());
        for b in &self.blocks[blocks] {
            let rows = b.rows.clone().filter(|i| self.used[*i]);
            let (sum, n) = rows.fold((Vector3::zeros(), 0.0), |(s, n), i| (s + value(i), n + 1.0));
            out.extend((sum / f64::max(n, 1.0)).iter());
        }
        out
    }

    /// A term over the blocks.
    pub(crate) fn column(&self, term: &Term<'_>) -> Column {
        let from = self.blocks.partition_point(|b| b.t < term.support.0);
        let to = self.blocks.partition_point(|b| b.t <= term.support.1);
        Column { from: 3 * from, values: self.means(from..to.max(from), &term.value), prior: term.prior }
    }

    /// Stretches that can be left out: how many independent looks there are.
    pub(crate) fn looks(&self) -> f64 {
        let changes = self.fold.windows(2).filter(|w| w[0] != w[1]).count();
        3.0 * (changes + 1) as f64
    }

    /// Sum of squares of a residual.
    pub(crate) fn square(residual: &[f64]) -> f64 {
        residual.iter().map(|r| r * r).sum()
    }

    /// Residual sum of squares of the fit that saw everything: what a scan over shapes compares.
    pub(crate) fn quick(&self, columns: &[&Column], noise: f64) -> f64 {
        let (gram, rhs) = self.normal(columns);
        let all = (gram.iter().fold(DMatrix::zeros(columns.len(), columns.len()), |a, g| a + g), sum(&rhs));
        let Some((x, _, _)) = solve(all.0, &all.1, columns, noise) else { return Self::square(&self.y) };
        Self::square(&self.left(columns, &x))
    }

    fn left(&self, columns: &[&Column], x: &DVector<f64>) -> Vec<f64> {
        let mut left = self.y.clone();
        for (column, c) in columns.iter().zip(x.iter()) {
            for (l, v) in left[column.from..].iter_mut().zip(&column.values) {
                *l -= c * v;
            }
        }
        left
    }

    /// Normal equations of each fold.
    fn normal(&self, columns: &[&Column]) -> ([DMatrix<f64>; FOLDS], [DVector<f64>; FOLDS]) {
        let k = columns.len();
        let mut gram: [DMatrix<f64>; FOLDS] = std::array::from_fn(|_| DMatrix::zeros(k, k));
        let mut rhs: [DVector<f64>; FOLDS] = std::array::from_fn(|_| DVector::zeros(k));
        for (i, a) in columns.iter().enumerate() {
            let end = a.from + a.values.len();
            for e in a.from..end {
                rhs[self.fold[e / 3]][i] += a.values[e - a.from] * self.y[e];
            }
            for (j, b) in columns.iter().enumerate().take(i + 1) {
                let mut sums = [0.0; FOLDS];
                for e in a.from.max(b.from)..end.min(b.from + b.values.len()) {
                    sums[self.fold[e / 3]] += a.values[e - a.from] * b.values[e - b.from];
                }
                for (g, s) in gram.iter_mut().zip(sums) {
                    g[(i, j)] = s;
                    g[(j, i)] = s;
                }
            }
        }
        (gram, rhs)
    }

    /// Solves; `noise` is the standard deviation of a block's mean, against which priors count.
    pub(crate) fn solve(&self, columns: &[&Column], noise: f64) -> Option<Solved> {
        let k = columns.len();
        let (gram, rhs) = self.normal(columns);
        let all = gram.iter().fold(DMatrix::zeros(k, k), |a, g| a + g);
        let all_rhs = sum(&rhs);
        let (x, cholesky, scale) = solve(all.clone(), &all_rhs, columns, noise)?;
        let residual = self.left(columns, &x);
        let mut heldout = residual.clone();
        for f in 0..FOLDS {
            let (x, _, _) = solve(&all - &gram[f], &(&all_rhs - &rhs[f]), columns, noise)?;
            let left = self.left(columns, &x);
            for (e, (h, l)) in heldout.iter_mut().zip(left).enumerate() {
                if self.fold[e / 3] == f {
                    *h = l;
                }
            }
        }
        let sigma = self.sigma(columns, &residual, &cholesky, &scale);
        Some(Solved { coefficients: x.iter().copied().collect(), sigma, heldout })
    }

    /// Standard errors: the larger of those from clusters of neighbouring blocks, which know the residual's colour but are too small where
    /// few clusters say something of a term, and those of a white residual of its size. Each cluster is judged by what the fit without
    /// it would say (the jackknife), as its own fit has made its residual too small. Student's law for so many clusters is in them, so
    /// that 1.96 of them are a 95 % interval.
    fn sigma(&self, columns: &[&Column], residual: &[f64], cholesky: &Cholesky<f64, Dyn>, scale: &DVector<f64>) -> Vec<f64> {
        let k = columns.len();
        let mut numbers = self.cluster.clone();
        numbers.dedup();
        let clusters = numbers.len();
        let mut spread = DMatrix::<f64>::zeros(k, clusters);
        for (n, number) in numbers.iter().enumerate() {
            let blocks = self.cluster.partition_point(|c| c < number)..self.cluster.partition_point(|c| c <= number);
            let own = 3 * blocks.start..3 * blocks.end;
            let score = DVector::from_fn(k, |i, _| columns[i].dot(&own, |e| residual[e]) / scale[i]);
            let without = (k <= LEFT_OUT).then(|| cholesky.l() * cholesky.l().transpose() - gram(columns, &own, scale));
            let change = match without.and_then(DMatrix::cholesky) {
                Some(others) => others.solve(&score),
                None => cholesky.solve(&score),
            };
            spread.set_column(n, &change.component_div(scale));
        }
        let few = if k <= LEFT_OUT { 1.0 } else { clusters as f64 / (clusters as f64 - 1.0).max(1.0) };
        let white = Self::square(residual) / (residual.len() as f64 - k as f64).max(1.0);
        let inverse = cholesky.inverse();
        let wide = student(clusters as f64 - 1.0) / 1.96;
        let one = |i: usize| {
            let clustered = few * spread.row(i).norm_squared();
            let plain = white * inverse[(i, i)] / (scale[i] * scale[i]);
            wide * clustered.max(plain).sqrt()
        };
        (0..k).map(one).collect()
    }
}

/// Scaled normal matrix of a range.
fn gram(columns: &[&Column], range: &Range<usize>, scale: &DVector<f64>) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(columns.len(), columns.len());
    for (i, a) in columns.iter().enumerate() {
        for (j, b) in columns.iter().enumerate().take(i + 1) {
            let both = b.span();
            let both = both.start.max(range.start)..both.end.min(range.end);
            let sum = a.dot(&both, |e| b.values[e - b.from]) / (scale[i] * scale[j]);
            out[(i, j)] = sum;
            out[(j, i)] = sum;
        }
    }
    out
}

/// The 97.5 % point of Student's law.
fn student(freedom: f64) -> f64 {
    StudentsT::new(0.0, 1.0, freedom.max(1.0)).map_or(1.96, |law| law.inverse_cdf(0.975))
}

fn sum(parts: &[DVector<f64>; FOLDS]) -> DVector<f64> {
    let zero = DVector::zeros(parts[0].len());
    parts.iter().fold(zero, |a, r| a + r)
}

/// A solution of scaled normal equations, with what their inverse needs: the factor and the scales.
type Factored = (DVector<f64>, Cholesky<f64, Dyn>, DVector<f64>);

/// Solves scaled normal equations.
fn solve(mut a: DMatrix<f64>, rhs: &DVector<f64>, columns: &[&Column], noise: f64) -> Option<Factored> {
    let k = rhs.len();
    let scale = DVector::from_fn(k, |i, _| if a[(i, i)] > 1e-200 { a[(i, i)].sqrt() } else { 1.0 });
    for i in 0..k {
        if columns[i].prior > 0.0 {
            a[(i, i)] += (noise / columns[i].prior).powi(2);
        }
        for j in 0..k {
            a[(i, j)] /= scale[i] * scale[j];
        }
        a[(i, i)] += if a[(i, i)] > 0.0 { 1e-9 } else { 1.0 };
    }
    let cholesky = a.cholesky()?;
    let x = cholesky.solve(&rhs.component_div(&scale)).component_div(&scale);
    x.iter().all(|c| c.is_finite()).then_some((x, cholesky, scale))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_fixed_vector_comes_back_and_left_out_stretches_are_predicted() {
        let t: Vec<f64> = (0..4000).map(|i| f64::from(i) * 0.01).collect();
        let truth = Vector3::new(1.0, -2.0, 0.5);
        let wave = |i: usize| Vector3::new((0.7 * t[i]).sin(), (0.9 * t[i]).cos(), (1.3 * t[i]).sin());
        let y: Vec<Vector3<f64>> = (0..t.len()).map(|i| truth + 3.0 * wave(i)).collect();
        let readings = Readings::new(&t, &y, vec![true; t.len()], 0.05, 0.5, 4.0);
        let mut terms: Vec<Term<'_>> = (0..3).map(|k| Term::new("e", "1", move |_| Vector3::ith(k, 1.0))).collect();
        terms.push(Term::new("w", "1", wave));
        let columns: Vec<Column> = terms.iter().map(|c| readings.column(c)).collect();
        let s = readings.solve(&columns.iter().collect::<Vec<_>>(), 0.1).unwrap();
        for (c, want) in s.coefficients.iter().zip([1.0, -2.0, 0.5, 3.0]) {
            assert!((c - want).abs() < 1e-6, "{:?}", s.coefficients);
        }
        assert!(Readings::square(&s.heldout) < 1e-9);
    }

    /// Normal deviates of a fixed seed.
    struct Deviates(u64);

    impl Deviates {
        fn next(&mut self) -> f64 {
            let mut uniform = || {
                self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                ((self.0 >> 11) as f64 + 0.5) / (1u64 << 53) as f64
            };
            let (u, v) = (uniform(), uniform());
            (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
        }
    }

    #[test]
    fn intervals_hold_the_truth_although_few_clusters_say_something_of_a_term() {
        let t: Vec<f64> = (0..600).map(|i| 0.02 * f64::from(i)).collect();
        // twelve clusters; what tells the slope happens in the last three
        let lever = |i: usize| (t[i] - 9.0).max(0.0);
        let mut noise = Deviates(5);
        let draws = 400;
        let inside = (0..draws)
            .filter(|_| {
                let shift: Vec<f64> = (0..12).map(|_| noise.next()).collect();
                let y: Vec<Vector3<f64>> = (0..t.len())
                    .map(|i| Vector3::new(1.0 + 2.0 * lever(i) + shift[i / 50] + 0.1 * noise.next(), 0.0, 0.0))
                    .collect();
                let readings = Readings::new(&t, &y, vec![true; t.len()], 0.1, 0.4, 1.0);
                let terms = [
                    Term::new("level", "1", |_| Vector3::new(1.0, 0.0, 0.0)),
                    Term::new("slope", "1", |i| Vector3::new(lever(i), 0.0, 0.0)),
                ];
                let columns: Vec<Column> = terms.iter().map(|term| readings.column(term)).collect();
                let solved = readings.solve(&columns.iter().collect::<Vec<_>>(), 0.1).expect("a fit");
                (solved.coefficients[1] - 2.0).abs() < 1.96 * solved.sigma[1]
            })
            .count();
        let share = inside as f64 / f64::from(draws);
        assert!((0.92..0.99).contains(&share), "{share}");
    }
}
