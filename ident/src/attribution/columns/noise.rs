//! What a channel's residual is beside the names: noise, and a discrepancy without a name.
//!
//! What it is: white noise and a wander with a memory (an Ornstein-Uhlenbeck process), the plainest Gaussian process that stands for what
//! a model does not know. A Kalman filter whitens readings and columns alike, so that slow residuals count for as little as they are worth.
//! What can go wrong: a wander as slow as the log itself could stand for any constant; its memory is at most [`SLOWEST`] of the log.
//! Units: the channel's, s.
//! Reference: Kennedy & O'Hagan 2001, J. R. Stat. Soc. B 63:425 (discrepancy); Sarkka & Solin, *Applied Stochastic Differential Equations*,
//! 2019, section 12.3 (Gaussian processes as state-space models).

use super::channel::Channel;
use crate::numeric::order::usual_step;

/// Longest memory of a wander, as a share of the log: within it the wander turns round some twenty times.
pub const SLOWEST: f64 = 0.05;
/// Least white noise, as a share of the noise floor: a floor is an estimate.
const LEAST: f64 = 0.1;
/// Factors by which wander and memory are moved while they are sought, coarse to fine.
const STEPS: [f64; 3] = [4.0, 2.0, 1.3];
/// Most moves at one of these factors.
const MOVES: usize = 12;

/// Noise of one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Standard deviation of the white part.
    pub white: f64,
    /// Standard deviation of the wander, in units of the white part.
    pub wander: f64,
    /// Memory of the wander, s.
    pub memory_s: f64,
}

impl Noise {
    /// White noise as loud as the channel's floor.
    #[must_use]
    pub fn floor(channel: &Channel) -> Self {
        Self { white: channel.floor, wander: 0.0, memory_s: usual_step(&channel.t) }
    }

    /// Standard deviation of both parts.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.white * (1.0 + self.wander * self.wander).sqrt()
    }

    /// Log likelihood of a residual, nats.
    #[must_use]
    pub fn likelihood(&self, t: &[f64], residual: &[f64]) -> f64 {
        let whitener = Whitener::new(self, t);
        let squares: f64 = whitener.apply(residual).iter().map(|e| e * e).sum();
        -0.5 * squares - whitener.log_scale() - 0.5 * residual.len() as f64 * std::f64::consts::TAU.ln()
    }

    /// The noise that makes a residual most likely, sought from this one.
    #[must_use]
    pub fn fitted(&self, channel: &Channel, residual: &[f64]) -> Self {
        let bounds = (usual_step(&channel.t), (SLOWEST * channel.seconds()).max(2.0 * usual_step(&channel.t)));
        let ask = |wander: f64, memory_s: f64| Profile::of(wander, memory_s, channel, residual);
        let mut best = ask(0.0, bounds.0);
        let from = if self.wander > 0.0 { *self } else { Self { wander: 1.0, memory_s: (bounds.0 * bounds.1).sqrt(), ..*self } };
        let mut at = ask(from.wander, from.memory_s.clamp(bounds.0, bounds.1));
        for step in STEPS {
            for _ in 0..MOVES {
                let near = [(step, 1.0), (1.0 / step, 1.0), (1.0, step), (1.0, 1.0 / step)];
                let next = near
                    .iter()
                    .map(|(w, m)| ((at.wander * w).clamp(1e-3, 1e4), (at.memory_s * m).clamp(bounds.0, bounds.1)))
                    .map(|(w, m)| ask(w, m))
                    .max_by(|a, b| a.likelihood.total_cmp(&b.likelihood));
                match next {
                    Some(next) if next.likelihood > at.likelihood + 1e-9 => at = next,
                    _ => break,
                }
            }
        }
        if at.likelihood > best.likelihood {
            best = at;
        }
        Self { white: best.white, wander: best.wander, memory_s: best.memory_s }
    }

    /// By how much the wander makes a residual more likely than white noise alone, nats.
    #[must_use]
    pub fn wander_evidence(&self, channel: &Channel, residual: &[f64]) -> f64 {
        let with = Profile::of(self.wander, self.memory_s, channel, residual);
        with.likelihood - Profile::of(0.0, self.memory_s, channel, residual).likelihood
    }
}

/// The best white noise beside a wander of given shape.
struct Profile {
    wander: f64,
    memory_s: f64,
    white: f64,
    likelihood: f64,
}

impl Profile {
    fn of(wander: f64, memory_s: f64, channel: &Channel, residual: &[f64]) -> Self {
        let unit = Noise { white: 1.0, wander, memory_s };
        let whitener = Whitener::new(&unit, &channel.t);
        let n = residual.len().max(1) as f64;
        let squares: f64 = whitener.apply(residual).iter().map(|e| e * e).sum();
        let white = (squares / n).sqrt().max(LEAST * channel.floor).max(f64::MIN_POSITIVE);
        let likelihood = -0.5 * squares / (white * white) - n * white.ln() - whitener.log_scale();
        Self { wander, memory_s, white, likelihood }
    }
}

/// Makes readings white: what is new in each, over its standard deviation.
#[derive(Debug, Clone)]
pub struct Whitener {
    /// For each reading: share of the news that the state takes, what of the state is left at it, and 1/(standard deviation).
    rows: Vec<[f64; 3]>,
    log_scale: f64,
}

impl Whitener {
    /// For a noise and times.
    #[must_use]
    pub fn new(noise: &Noise, t: &[f64]) -> Self {
        let stationary = noise.wander * noise.wander;
        let (mut variance, mut log_scale) = (stationary, 0.0);
        let mut rows = Vec::with_capacity(t.len());
        let mut decays = (f64::NAN, 0.0);
        for (i, at) in t.iter().enumerate() {
            let mut kept = 0.0;
            if stationary > 0.0 && i > 0 {
                let step = at - t[i - 1];
                if step != decays.0 {
                    decays = (step, (-step / noise.memory_s).exp());
                }
                kept = decays.1;
                variance = kept * kept * variance + (1.0 - kept * kept) * stationary;
            }
            let news = variance + 1.0;
            let scale = news.sqrt() * noise.white;
            rows.push([variance / news, kept, 1.0 / scale]);
            log_scale += scale.ln();
            variance /= news;
        }
        Self { rows, log_scale }
    }

    /// Sum of the logarithms of the standard deviations of the news.
    #[must_use]
    pub fn log_scale(&self) -> f64 {
        self.log_scale
    }

    /// The news in `values`.
    #[must_use]
    pub fn apply(&self, values: &[f64]) -> Vec<f64> {
        let mut state = 0.0;
        let whiten = |(value, [gain, kept, inverse]): (&f64, &[f64; 3])| {
            state *= kept;
            let news = value - state;
            state += gain * news;
            news * inverse
        };
        values.iter().zip(&self.rows).map(whiten).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    fn noise_of(seed: u64, n: usize) -> Vec<f64> {
        let mut s = seed;
        let mut uniform = move || {
            s ^= s << 13;
            s ^= s >> 7;
            s ^= s << 17;
            (s >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..n).map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect()
    }

    fn channel(t: Vec<f64>, y: Vec<f64>) -> Channel {
        Channel { name: "a".into(), unit: "1", t, y, floor: 0.5 }
    }

    /// The filter gives what the covariance matrix gives, uneven times and a gap included.
    #[test]
    fn the_likelihood_is_that_of_the_covariance() {
        let t = [0.0f64, 0.1, 0.25, 0.3, 1.9, 2.0];
        let y = [0.3, -0.2, 0.9, 1.1, -0.7, 0.2];
        let noise = Noise { white: 0.4, wander: 1.7, memory_s: 0.3 };
        let covariance = DMatrix::from_fn(6, 6, |i, j| {
            let wander = (0.4f64 * 1.7).powi(2) * (-(t[i] - t[j]).abs() / 0.3).exp();
            wander + if i == j { 0.16 } else { 0.0 }
        });
        let y = DVector::from_row_slice(&y);
        let solved = covariance.clone().cholesky().unwrap().solve(&y);
        let wanted = -0.5 * y.dot(&solved) - 0.5 * covariance.determinant().ln() - 3.0 * std::f64::consts::TAU.ln();
        assert!((noise.likelihood(&t, y.as_slice()) - wanted).abs() < 1e-9);
    }

    #[test]
    fn white_stays_white_and_a_wander_is_found() {
        let t: Vec<f64> = (0..2000).map(|i| 0.04 * f64::from(i)).collect();
        let white: Vec<f64> = noise_of(5, 2000).iter().map(|e| 0.5 * e).collect();
        let plain = channel(t.clone(), white.clone());
        let found = Noise::floor(&plain).fitted(&plain, &white);
        assert!((found.total() / 0.5 - 1.0).abs() < 0.06, "{found:?}");
        assert!(found.wander_evidence(&plain, &white) < 5.0);
        let mut state = 0.0;
        let kept = (-0.04f64 / 0.4).exp();
        let wandering: Vec<f64> = noise_of(77, 2000)
            .iter()
            .zip(&white)
            .map(|(e, w)| {
                state = kept * state + (1.0 - kept * kept).sqrt() * e;
                state + w
            })
            .collect();
        let found = Noise::floor(&plain).fitted(&plain, &wandering);
        assert!((0.2..0.8).contains(&found.memory_s) && (0.4..0.6).contains(&found.white), "{found:?}");
        assert!(found.wander_evidence(&plain, &wandering) > 100.0);
    }
}
