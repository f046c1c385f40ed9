//! Is anything left? Tests on a residual.
//!
//! What it is: Ljung-Box whiteness over the longest evenly sampled stretches.
//! What can go wrong: short residuals give p = 1 (nothing can be said).
//! Units: p-values.
//! Reference: Ljung & Box 1978, Biometrika 65:297; lags min(20, n/5) by specification `formats.md`.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Ljung-Box p-value of a residual given at times `t`.
///
/// Stretches in which the sampling is even within 5 % are tested together: their lag products are pooled.
#[must_use]
pub fn whiteness(t: &[f64], residual: &[f64]) -> f64 {
    let stretches = even_stretches(t);
    let n: usize = stretches.iter().map(|(a, b)| b - a).sum();
    let lags = 20.min(n / 5);
    if lags == 0 {
        return 1.0;
    }
    let mean = residual.iter().sum::<f64>() / residual.len() as f64;
    let product = |lag: usize| -> f64 {
        stretches.iter().map(|(a, b)| (a + lag..*b).map(|i| (residual[i] - mean) * (residual[i - lag] - mean)).sum::<f64>()).sum()
    };
    let variance = product(0);
    if variance <= 0.0 {
        return 1.0;
    }
    let nf = n as f64;
    let q: f64 = (1..=lags).map(|k| (product(k) / variance).powi(2) / (nf - k as f64)).sum::<f64>() * nf * (nf + 2.0);
    ChiSquared::new(lags as f64).map_or(1.0, |d| d.sf(q)).clamp(0.0, 1.0)
}

/// Stretches of even sampling that hold at least 40 samples, or the longest one: a stretch ends where a step is more than
/// half again as long as the median step (a missing sample), or shorter than half of it.
fn even_stretches(t: &[f64]) -> Vec<(usize, usize)> {
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    let usual = crate::numeric::order::median(&mut steps);
    let mut out = Vec::new();
    let mut from = 0;
    for i in 1..=t.len() {
        if i == t.len() || !(0.5 * usual..=1.5 * usual).contains(&(t[i] - t[i - 1])) {
            out.push((from, i));
            from = i;
        }
    }
    let long: Vec<(usize, usize)> = out.iter().copied().filter(|(a, b)| b - a >= 40).collect();
    if long.is_empty() { out.into_iter().max_by_key(|(a, b)| b - a).into_iter().collect() } else { long }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_is_white_and_a_wave_is_not() {
        let mut s = 9u64;
        let noise: Vec<f64> = (0..2000)
            .map(|_| {
                s ^= s << 13;
                s ^= s >> 7;
                s ^= s << 17;
                (s >> 11) as f64 / (1u64 << 53) as f64 - 0.5
            })
            .collect();
        let t: Vec<f64> = (0..2000).map(|i| f64::from(i) * 0.1).collect();
        assert!(whiteness(&t, &noise) > 0.01);
        let wave: Vec<f64> = noise.iter().zip(&t).map(|(n, t)| n + 0.4 * (0.5 * t).sin()).collect();
        assert!(whiteness(&t, &wave) < 1e-9);
    }
}
