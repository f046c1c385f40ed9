//! Noise that hangs together from sample to sample, and how many of its samples count.
//!
//! What it is: the share of independent samples in a residual, by itself and along a change that has a colour of its own.
//! What can go wrong: of a noise without power, or a change of nothing, every sample counts.
//! Units: lags in samples, shares 0 to 1.
//! Reference: Bartlett 1935, J. Royal Statistical Society 98:536; Newey & West 1987, Econometrica 55:703.

/// One over the integrated autocorrelation time of the scaled residual, in samples: 1 when white.
///
/// The autocorrelation is taken at lags 1, 2, 4, 8, ... and integrated in between until it falls below 0.05.
pub(crate) fn effective_share(residual: &[f64]) -> f64 {
    let c0: f64 = residual.iter().map(|r| r * r).sum();
    let (mut time, mut last, mut lag) = (1.0, 1.0, 1usize);
    while c0 > 0.0 && lag < residual.len() / 4 {
        let rho = residual.iter().zip(&residual[lag..]).map(|(a, b)| a * b).sum::<f64>() / c0;
        if rho < 0.05 {
            break;
        }
        let width = if lag == 1 { 1.0 } else { (lag / 2) as f64 };
        time += 2.0 * width * if lag == 1 { rho } else { 0.5 * (rho + last) };
        last = rho;
        lag *= 2;
    }
    1.0 / time
}

/// A noise and how it hangs together from sample to sample.
pub(crate) struct Colour<'n> {
    noise: &'n [f64],
    /// Sum of its squares.
    power: f64,
    /// Lags, in samples, and its autocorrelation at each, until that falls below 0.05.
    lags: Vec<(usize, f64)>,
}

impl<'n> Colour<'n> {
    /// Of a noise: every lag up to 32, then each tenth further.
    pub(crate) fn of(noise: &'n [f64]) -> Self {
        let power = at_lag(noise, 0);
        let next = |lag: &usize| Some(if *lag < DENSE { lag + 1 } else { lag + 1 + lag / 10 });
        let lags = std::iter::successors(Some(1), next).take_while(|lag| power > 0.0 && *lag < noise.len() / 4);
        let lags = lags.map(|lag| (lag, at_lag(noise, lag) / power)).take_while(|(_, rho)| *rho >= 0.05).collect();
        Self { noise, power, lags }
    }

    /// Share of independent samples along a change that has a colour of its own: the variance of their product's sum were all samples
    /// independent, over what it is.
    ///
    /// That variance once by the product of both autocorrelations (Bartlett 1935), and once by the products
    /// themselves (Newey and West 1987), which count that the noise may be largest where the change is. The larger one counts.
    pub(crate) fn share_along(&self, change: &[f64]) -> f64 {
        let of_change = at_lag(change, 0);
        if of_change <= 0.0 || self.power <= 0.0 {
            return 1.0;
        }
        let products: Vec<f64> = self.noise.iter().zip(change).map(|(n, c)| n * c).collect();
        let independent = self.power * of_change / self.noise.len() as f64;
        let alike = self.time(1.0, |lag, rho| rho * at_lag(change, lag) / of_change);
        let together = self.time(at_lag(&products, 0) / independent, |lag, _| at_lag(&products, lag) / independent);
        1.0 / alike.max(together).max(1.0)
    }

    /// A correlation summed over all lags to both sides: what lies between two that are known is on a straight line.
    fn time(&self, at_none: f64, at: impl Fn(usize, f64) -> f64) -> f64 {
        let (mut time, mut last, mut before) = (at_none, at_none, 0);
        for &(lag, rho) in &self.lags {
            let now = at(lag, rho);
            time += 2.0 * (now + 0.5 * (lag - before - 1) as f64 * (now + last));
            (last, before) = (now, lag);
        }
        time
    }
}

/// Sum of the products of samples that lie so far apart.
fn at_lag(v: &[f64], lag: usize) -> f64 {
    v.iter().zip(v.get(lag..).unwrap_or(&[])).map(|(a, b)| a * b).sum()
}

/// Lags up to which each is looked at.
const DENSE: usize = 32;

#[cfg(test)]
mod tests {
    use super::*;

    /// A noise that wanders over a hundred samples leaves a change that wanders as slowly few independent samples, and one that alternates all.
    #[test]
    fn what_steps_shows_through_a_noise_that_wanders() {
        let n = 4000;
        let mut state = 1_u64;
        let mut chance = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / f64::from(1_u32 << 30) - 1.0
        };
        let mut last = 0.0;
        let noise: Vec<f64> = (0..n)
            .map(|_| {
                last = 0.99 * last + chance();
                last
            })
            .collect();
        let slow: Vec<f64> = (0..n).map(|i| (i as f64 / n as f64 * std::f64::consts::TAU).sin()).collect();
        let steps: Vec<f64> = (0..n).map(|i| if i / 20 % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let plain = effective_share(&noise);
        assert!(plain < 0.02, "{plain}");
        let colour = Colour::of(&noise);
        let [along_slow, along_steps] = [&slow, &steps].map(|change| colour.share_along(change));
        assert!(along_slow < 1.4 * plain, "{along_slow} {plain}");
        // half a period of 20 samples, in which the noise hardly moves
        assert!(along_steps > 5.0 * plain, "{along_steps} {plain}");
        assert_eq!(colour.share_along(&vec![0.0; n]), 1.0);
        // white, and ten times as large where the change is
        let loud: Vec<f64> = (0..n).map(|i| chance() * if i / 20 % 10 == 0 { 10.0 } else { 1.0 }).collect();
        let there: Vec<f64> = (0..n).map(|i| if i / 20 % 10 == 0 { 1.0 } else { 0.0 }).collect();
        let along_loud = Colour::of(&loud).share_along(&there);
        assert!((along_loud - 0.11).abs() < 0.04, "{along_loud}");
    }
}
