//! How well a hypothesis explains the channels: its marginal likelihood.
//!
//! What it is: with noise and shapes given, the amplitudes are integrated out exactly against their priors. What has been added pays for
//! itself by the share of its prior that the data rule out (Occam's factor).
//! What can go wrong: columns that the data cannot tell apart keep their priors, and give large standard errors, never a failure.
//! Units: nats.
//! Reference: MacKay 2003, *Information Theory, Inference, and Learning Algorithms*, chapter 28; Rasmussen & Williams 2006, section 2.7.

use super::channel::Channel;
use super::design::{Column, Design};
use super::noise::{Noise, Whitener};
use crate::numeric::solve::dot;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Readings and columns of all channels, white and over one standard deviation, each column over its prior's.
#[derive(Debug, Clone)]
pub struct White {
    /// Of each channel.
    whiteners: Vec<Whitener>,
    /// For each channel the columns that touch it (position and values), each times its prior's standard deviation.
    columns: Vec<Vec<(usize, Vec<f64>)>>,
    /// For each channel the readings less what the priors expect.
    readings: Vec<Vec<f64>>,
    means: Vec<f64>,
    sds: Vec<f64>,
}

impl White {
    /// Of channels under their noise.
    #[must_use]
    pub fn new(channels: &[Channel], noise: &[Noise], design: &Design) -> Self {
        let whiteners: Vec<Whitener> = channels.iter().zip(noise).map(|(c, n)| Whitener::new(n, &c.t)).collect();
        let means: Vec<f64> = design.columns.iter().map(|c| c.prior.mean).collect();
        let readings = (0..channels.len())
            .map(|c| {
                let expected = design.predict(&means, c, channels[c].len());
                let news: Vec<f64> = channels[c].y.iter().zip(&expected).map(|(y, e)| y - e).collect();
                whiteners[c].apply(&news)
            })
            .collect();
        let sds = design.columns.iter().map(|c| c.prior.sd).collect();
        let columns = by_channel(&whiteners, &design.columns);
        Self { whiteners, columns, readings, means, sds }
    }

    /// The best amplitudes and the evidence; `None` when numbers are not finite.
    #[must_use]
    pub fn solve(&self) -> Option<Solved> {
        let k = self.means.len();
        let (mut precision, mut sums, mut squares) = (DMatrix::identity(k, k), DVector::zeros(k), 0.0);
        let mut count = 0;
        for (columns, y) in self.columns.iter().zip(&self.readings) {
            for (a, (i, x)) in columns.iter().enumerate() {
                sums[*i] += dot(x, y);
                for (j, z) in &columns[..=a] {
                    let product = dot(x, z);
                    precision[(*i, *j)] += product;
                    if i != j {
                        precision[(*j, *i)] += product;
                    }
                }
            }
            squares += dot(y, y);
            count += y.len();
        }
        let factor = precision.cholesky()?;
        let standard = factor.solve(&sums);
        let log_scale: f64 = self.whiteners.iter().map(Whitener::log_scale).sum();
        let evidence = -0.5 * (squares - sums.dot(&standard))
            - half_log_determinant(&factor)
            - log_scale
            - 0.5 * count as f64 * std::f64::consts::TAU.ln();
        evidence.is_finite().then(|| Solved {
            amplitudes: (0..k).map(|i| self.means[i] + self.sds[i] * standard[i]).collect(),
            evidence,
            standard,
            factor,
            sds: self.sds.clone(),
        })
    }

    /// What further columns would bring beside the solved ones, their own amplitudes integrated out, and what of them is their own.
    #[must_use]
    pub fn gain(&self, solved: &Solved, extra: &[Column]) -> Gain {
        let m = extra.len();
        let added = by_channel(&self.whiteners, extra);
        let (mut square, mut sums) = (DMatrix::<f64>::zeros(m, m), DVector::<f64>::zeros(m));
        let mut shared = DMatrix::<f64>::zeros(self.means.len(), m);
        for ((own, new), y) in self.columns.iter().zip(&added).zip(&self.readings) {
            for (i, v) in new {
                sums[*i] += dot(v, y);
                new.iter().for_each(|(j, w)| square[(*i, *j)] += dot(v, w));
                own.iter().for_each(|(k, x)| shared[(*k, *i)] += dot(x, v));
            }
        }
        let taken = solved.factor.solve(&shared);
        let explained = shared.transpose() * &taken;
        let own = &square - &explained;
        let angle = (0..m).map(|i| self.freest(&added, &taken, i)).fold(0.0, f64::max);
        let reach = (0..m).map(|i| own[(i, i)].max(0.0)).fold(0.0, f64::max);
        let Some(factor) = (own + DMatrix::identity(m, m)).cholesky() else {
            return Gain { nats: f64::NEG_INFINITY, angle: 0.0, reach: 0.0 };
        };
        let left = sums - shared.transpose() * &solved.standard;
        let nats = 0.5 * left.dot(&factor.solve(&left)) - half_log_determinant(&factor);
        Gain { nats: if nats.is_finite() { nats } else { f64::NEG_INFINITY }, angle, reach }
    }
}

impl White {
    /// Share of a further column's squares that the own columns leave, on the channel that shows most of what they leave: a channel whose own
    /// columns take it up whole says nothing of the others.
    fn freest(&self, added: &[Vec<(usize, Vec<f64>)>], taken: &DMatrix<f64>, column: usize) -> f64 {
        let mut most = (0.0, 0.0);
        for (own, new) in self.columns.iter().zip(added) {
            for (_, v) in new.iter().filter(|(i, _)| *i == column) {
                let mut left = v.clone();
                for (k, x) in own {
                    let share = taken[(*k, column)];
                    left.iter_mut().zip(x).for_each(|(l, x)| *l -= share * x);
                }
                let (left, all) = (dot(&left, &left), dot(v, v));
                if left > most.0 {
                    most = (left, left / all.max(f64::MIN_POSITIVE));
                }
            }
        }
        most.1
    }

    /// Cosine between what two columns change, with everything taken out that the own columns span.
    #[must_use]
    pub fn cosine(&self, a: &Column, b: &Column) -> f64 {
        let k = self.means.len();
        let added = by_channel(&self.whiteners, &[a.clone(), b.clone()]);
        let (mut square, mut shared, mut own) =
            (DMatrix::<f64>::zeros(2, 2), DMatrix::<f64>::zeros(k, 2), DMatrix::<f64>::identity(k, k));
        for (columns, new) in self.columns.iter().zip(&added) {
            for (i, v) in new {
                new.iter().for_each(|(j, w)| square[(*i, *j)] += dot(v, w));
                columns.iter().for_each(|(j, x)| shared[(*j, *i)] += dot(x, v));
            }
            for (i, x) in columns {
                columns.iter().for_each(|(j, y)| own[(*i, *j)] += dot(x, y));
            }
        }
        let Some(factor) = own.cholesky() else { return 0.0 };
        let left = &square - shared.transpose() * factor.solve(&shared);
        left[(0, 1)] / (left[(0, 0)] * left[(1, 1)]).max(f64::MIN_POSITIVE).sqrt()
    }
}

fn by_channel(whiteners: &[Whitener], columns: &[Column]) -> Vec<Vec<(usize, Vec<f64>)>> {
    let mut out = vec![Vec::new(); whiteners.len()];
    for (i, column) in columns.iter().enumerate().filter(|(_, c)| c.prior.sd > 0.0) {
        for (channel, values) in &column.parts {
            let mut white = whiteners[*channel].apply(values);
            white.iter_mut().for_each(|v| *v *= column.prior.sd);
            out[*channel].push((i, white));
        }
    }
    out
}

fn half_log_determinant(factor: &Cholesky<f64, Dyn>) -> f64 {
    factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum()
}

/// What further columns bring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gain {
    /// Evidence.
    pub nats: f64,
    /// Share of a column's squares that nothing else of the hypothesis spans, on the channel that shows most of it: squared sine of the angle to
    /// it; of the freest of the columns.
    pub angle: f64,
    /// Square of the signal over noise that an effect of its usual size would have beside the rest.
    pub reach: f64,
}

/// Amplitudes of a hypothesis.
#[derive(Debug, Clone)]
pub struct Solved {
    /// Best values.
    pub amplitudes: Vec<f64>,
    /// Log marginal likelihood, nats.
    pub evidence: f64,
    standard: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
    sds: Vec<f64>,
}

impl Solved {
    /// Covariance of the amplitudes.
    #[must_use]
    pub fn covariance(&self) -> DMatrix<f64> {
        let inverse = self.factor.inverse();
        DMatrix::from_fn(inverse.nrows(), inverse.ncols(), |i, j| self.sds[i] * inverse[(i, j)] * self.sds[j])
    }
}

#[cfg(test)]
mod tests {
    use super::super::design::{Owner, Prior};
    use super::*;
    use std::sync::Arc;

    fn channel(y: Vec<f64>) -> Channel {
        Channel { name: "a".into(), unit: "1", t: (0..y.len()).map(|i| 0.1 * i as f64).collect(), y, floor: 0.3 }
    }

    fn column(sd: f64, mean: f64, parts: Vec<(usize, Vec<f64>)>) -> Column {
        let parts = parts.into_iter().map(|(c, v)| (c, Arc::new(v))).collect();
        Column { owner: Owner::Declared, name: "x", prior: Prior { mean, sd, sign: 0.0 }, parts }
    }

    /// The evidence is the density of the readings under their whole covariance, and a gain the difference of two evidences.
    #[test]
    fn the_evidence_is_the_density_of_the_readings() {
        let channels = [channel(vec![1.0, 2.5, 2.9, 4.2]), channel(vec![0.4, -0.1, 0.3, 0.9])];
        let noise = [Noise { white: 0.3, wander: 1.5, memory_s: 0.2 }, Noise { white: 0.5, wander: 0.0, memory_s: 1.0 }];
        let first = column(2.0, 0.5, vec![(0, vec![1.0, 2.0, 3.0, 4.0]), (1, vec![0.2; 4])]);
        let second = column(0.7, 0.0, vec![(1, vec![1.0, -1.0, 2.0, 0.0])]);
        let design = Design { columns: vec![first.clone(), second.clone()] };
        let solved = White::new(&channels, &noise, &design).solve().unwrap();
        let value = |c: &Column, i: usize| c.parts.iter().filter(|p| p.0 == i / 4).map(|p| p.1[i % 4]).sum::<f64>();
        let covariance = DMatrix::from_fn(8, 8, |i, j| {
            let (a, b) = (noise[i / 4], channels[i / 4].t[i % 4] - channels[i / 4].t[j % 4]);
            let wander = if i / 4 == j / 4 { (a.white * a.wander).powi(2) * (-b.abs() / a.memory_s).exp() } else { 0.0 };
            let white = if i == j { a.white * a.white } else { 0.0 };
            white + wander + design.columns.iter().map(|c| c.prior.sd.powi(2) * value(c, i) * value(c, j)).sum::<f64>()
        });
        let y = DVector::from_fn(8, |i, _| channels[i / 4].y[i % 4] - 0.5 * value(&first, i));
        let density = -0.5 * y.dot(&covariance.clone().cholesky().unwrap().solve(&y))
            - 0.5 * covariance.determinant().ln()
            - 4.0 * std::f64::consts::TAU.ln();
        assert!((solved.evidence - density).abs() < 1e-9, "{} {density}", solved.evidence);
        let alone = White::new(&channels, &noise, &Design { columns: vec![first] });
        let before = alone.solve().unwrap();
        let gain = alone.gain(&before, &[second]);
        assert!((gain.nats - (solved.evidence - before.evidence)).abs() < 1e-9);
        assert!((0.0..=1.0).contains(&gain.angle) && gain.reach > 0.0);
    }

    #[test]
    fn a_column_that_is_there_already_has_no_angle() {
        let channels = [channel((0..40).map(f64::from).collect())];
        let ramp: Vec<f64> = (0..40).map(f64::from).collect();
        let white = White::new(
            &channels,
            &[Noise::floor(&channels[0])],
            &Design { columns: vec![column(5.0, 0.0, vec![(0, ramp.clone())])] },
        );
        let solved = white.solve().unwrap();
        assert!(white.gain(&solved, &[column(1.0, 0.0, vec![(0, ramp)])]).angle < 1e-4);
        assert!(white.gain(&solved, &[column(1.0, 0.0, vec![(0, vec![1.0; 40])])]).angle > 0.2);
    }

    /// A change that one channel's own columns take up whole, however large it is there, is still told by another channel.
    #[test]
    fn a_column_is_as_free_as_on_the_channel_that_shows_it() {
        let ramp: Vec<f64> = (0..40).map(f64::from).collect();
        let wave: Vec<f64> = (0..40).map(|i| (0.7 * f64::from(i)).sin()).collect();
        let channels = [channel(ramp.clone()), channel(wave.clone())];
        let noise = channels.each_ref().map(Noise::floor);
        let white = White::new(&channels, &noise, &Design { columns: vec![column(1e6, 0.0, vec![(0, ramp.clone())])] });
        let solved = white.solve().unwrap();
        let large = ramp.iter().map(|v| 1e3 * v).collect();
        assert!(white.gain(&solved, &[column(1.0, 0.0, vec![(0, large), (1, wave)])]).angle > 0.9);
    }
}
