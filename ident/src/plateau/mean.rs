//! The robust mean of a stretch and its standard error under coloured noise.
//!
//! What it is: samples more than six robust standard deviations from the stretch's own line are glitches and left out; the error of
//! the mean of the rest is widened by the integrated autocorrelation time, pooled over all stretches of the run.
//! What can go wrong: fewer than three samples give no mean; a constant stretch (quantisation) gets the error of its quantum.
//! Units: the column's.
//! Reference: Geyer 1992, "Practical Markov chain Monte Carlo" (initial positive sequence); Theil 1950.

use crate::numeric::solve::dot;
use crate::signal::settle::line;

/// Farthest that a sample may lie, in robust standard deviations.
const FAR: f64 = 6.0;

/// How far neighbouring samples repeat each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Colour {
    /// Integrated autocorrelation time in samples, 1 when white.
    pub(crate) time: f64,
    /// Resolution of the column.
    quantum: f64,
}

impl Colour {
    /// Autocorrelation pooled over all stretches and their residuals, summed while neighbouring pairs of lags stay positive.
    pub(crate) fn pooled(values: &[f64], ranges: &[(usize, usize)], residuals: &[Option<Residual>]) -> Self {
        let mut quantum = f64::INFINITY;
        for (from, to) in ranges {
            for w in values[*from..*to].windows(2) {
                let d = (w[1] - w[0]).abs();
                if d > 1e-12 {
                    quantum = quantum.min(d);
                }
            }
        }
        let stretches = residuals.iter().flatten().filter(|r| r.squares > 0.0 && r.kept >= 8.0).collect();
        let longest = ranges.iter().map(|(a, b)| b - a).max().unwrap_or(0);
        let time = Correlogram { stretches, lags: Vec::new() }.time((longest / 4).clamp(1, 60));
        Self { time, quantum: if quantum.is_finite() { quantum } else { 0.0 } }
    }
}

/// What a stretch holds beside its own line.
pub(crate) struct Residual {
    /// One value a row, 0 for a glitch or a missing sample, which so takes no part in any product.
    values: Vec<f64>,
    /// Whether the row counts.
    counts: Vec<bool>,
    /// Rows that count.
    kept: f64,
    /// Sum of squares.
    squares: f64,
}

/// Pooled products of scaled residuals, lag by lag, no more of them than are asked for.
struct Correlogram<'r> {
    stretches: Vec<&'r Residual>,
    /// Sum of products, what each is short of for being taken about a line (times two over n), number of pairs.
    lags: Vec<(f64, f64, f64)>,
}

impl Correlogram<'_> {
    fn lag(&mut self, lag: usize) -> (f64, f64, f64) {
        while self.lags.len() <= lag {
            let k = self.lags.len();
            let mut sums = (0.0, 0.0, 0.0);
            for r in self.stretches.iter().filter(|r| k * 3 < r.values.len()) {
                let pairs = r.counts.iter().zip(&r.counts[k..]).filter(|(a, b)| **a && **b).count() as f64;
                // scaled to a variance of one
                let sum = dot(&r.values, &r.values[k..]) * r.kept / r.squares;
                sums = (sums.0 + sum, sums.1 + 2.0 * pairs / r.kept, sums.2 + pairs);
            }
            self.lags.push(sums);
        }
        self.lags[lag]
    }

    /// About its own line a stretch's covariance is short of the truth by two integrated variances over n: solved by iteration.
    fn time(&mut self, most: usize) -> f64 {
        let mut time = 1.0;
        for _ in 0..4 {
            let (sum, short, pairs) = self.lag(0);
            let whole = (sum + time * short) / pairs;
            let guess = time;
            time = integrated(most, |lag| {
                let (sum, short, pairs) = self.lag(lag);
                (if pairs > 20.0 { (sum + guess * short) / pairs / whole } else { 0.0 }, pairs)
            });
        }
        time
    }
}

/// Integrated autocorrelation time: pairs of lags are summed until a pair is no more than its own scatter.
fn integrated(most: usize, mut rho: impl FnMut(usize) -> (f64, f64)) -> f64 {
    let (mut time, mut lag) = (1.0, 1);
    while lag < most {
        let ((a, pairs), (b, _)) = (rho(lag), rho(lag + 1));
        if a + b <= 2.0 * (2.0 / pairs.max(1.0)).sqrt() {
            break;
        }
        time += 2.0 * (a + b);
        lag += 2;
    }
    time
}

/// Residual about the stretch's own line, glitches left out; `None` for fewer than three samples.
pub(crate) fn residual(z: &[f64]) -> Option<Residual> {
    let (level, slope, spread) = line(z)?;
    let centre = (z.len() as f64 - 1.0) / 2.0;
    let mut values: Vec<f64> = z.iter().enumerate().map(|(i, v)| v - level - slope * (i as f64 - centre)).collect();
    // false for a missing sample too
    let counts: Vec<bool> = values.iter().map(|r| r.abs() <= FAR * spread).collect();
    let kept = counts.iter().filter(|c| **c).count() as f64;
    let mean = values.iter().zip(&counts).map(|(v, c)| if *c { *v } else { 0.0 }).sum::<f64>() / kept;
    values.iter_mut().zip(&counts).for_each(|(v, c)| *v = if *c { *v - mean } else { 0.0 });
    let squares = dot(&values, &values);
    (kept >= 3.0).then_some(Residual { values, counts, kept, squares })
}

/// Mean of a stretch and its standard error.
pub(crate) fn mean_of(z: &[f64], r: &Residual, colour: &Colour) -> (f64, f64) {
    let n = r.kept;
    let mean = z.iter().zip(&r.counts).map(|(v, c)| if *c { *v } else { 0.0 }).sum::<f64>() / n;
    let variance = r.squares / (n - 2.0 * colour.time).max(0.3 * n);
    let independent = (n / colour.time).max(1.0);
    let few = few(independent - 1.0);
    // what rounding hides does not average out
    let floor = colour.quantum * colour.quantum / 12.0 / independent;
    (mean, few * (variance / independent + if variance <= 1e-24 { floor } else { 0.0 }).sqrt())
}

/// By how much a standard error that few independent samples gave must be widened so that 1.96 of it hold 95 %: the ratio of the
/// t quantile to the normal one (Cornish-Fisher to third order; Abramowitz & Stegun 26.7.5).
fn few(freedom: f64) -> f64 {
    let z: f64 = 1.959_964;
    let v = freedom.max(1.0);
    let g1 = (z.powi(3) + z) / 4.0;
    let g2 = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0;
    let g3 = (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0;
    (z + g1 / v + g2 / (v * v) + g3 / (v * v * v)) / z
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sum of twelve uniform numbers: standard normal to a few per cent.
    fn noise(seed: &mut u64) -> f64 {
        (0..12)
            .map(|_| {
                *seed ^= *seed << 13;
                *seed ^= *seed >> 7;
                *seed ^= *seed << 17;
                (*seed >> 11) as f64 / (1u64 << 53) as f64
            })
            .sum::<f64>()
            - 6.0
    }

    /// The error that is stated is the error that is made, for white and for coloured noise.
    #[test]
    fn the_standard_error_holds() {
        for rho in [0.0, 0.6, 0.85] {
            let mut seed = 0x1234_5678_9ABC_DEF1;
            let (mut inside, mut all, mut squares) = (0, 0, 0.0);
            for _ in 0..40 {
                let mut s = 0.0;
                let values: Vec<f64> = (0..2400)
                    .map(|_| {
                        s = rho * s + (1.0_f64 - rho * rho).sqrt() * noise(&mut seed);
                        s
                    })
                    .collect();
                let ranges: Vec<(usize, usize)> = (0..12).map(|k| (200 * k, 200 * k + 190)).collect();
                for (mean, se) in super::super::means_over(&values, &ranges).into_iter().flatten() {
                    all += 1;
                    inside += usize::from(mean.abs() < 1.96 * se);
                    squares += (mean / se).powi(2);
                }
            }
            let share = f64::from(inside as u32) / f64::from(all);
            assert!((0.92..0.98).contains(&share), "rho {rho}: {share}");
            assert!((0.8..1.25).contains(&(squares / f64::from(all))), "rho {rho}: {}", squares / f64::from(all));
        }
    }

    /// A speed in steps of 65 rev/min stands still but for a few wild readings.
    #[test]
    fn glitches_of_a_coarse_channel_do_not_move_its_mean() {
        let mut z = vec![1040.0; 140];
        for (at, v) in [(20, 18_000.0), (61, 16_640.0), (62, 0.0)] {
            z[at] = v;
        }
        let (mean, _) = mean_of(&z, &residual(&z).unwrap(), &Colour { time: 1.0, quantum: 65.0 });
        assert_eq!(mean, 1040.0);
        // steps between two codes are no glitches
        let z: Vec<f64> = (0..140).map(|i| if i % 4 == 0 { 1105.0 } else { 1040.0 }).collect();
        let (mean, _) = mean_of(&z, &residual(&z).unwrap(), &Colour { time: 1.0, quantum: 65.0 });
        assert!((mean - 1056.25).abs() < 1e-9, "{mean}");
    }

    #[test]
    fn glitches_do_not_move_a_mean() {
        let mut seed = 99;
        let mut z: Vec<f64> = (0..100).map(|_| 5.0 + 0.1 * noise(&mut seed)).collect();
        z[40] = 500.0;
        z[41] = f64::NAN;
        let (mean, se) = mean_of(&z, &residual(&z).unwrap(), &Colour { time: 1.0, quantum: 0.0 });
        assert!((mean - 5.0).abs() < 4.0 * se && se < 0.02, "{mean} {se}");
    }
}
