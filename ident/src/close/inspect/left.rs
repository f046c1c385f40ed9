//! Step 3: is there anything?
//!
//! What it is: tests of each channel's residual, lines that turn with the rotor among them, with the family-wise rate of false
//! alarms held by Bonferroni's bound.
//! What can go wrong: short channels pass; a period shorter than two samples is seen only where it belongs to an order of the rotor.
//! Units: p-values; s for the period.
//! Reference: Ljung & Box 1978; Wald & Wolfowitz 1940 (runs); Fisher 1929 (largest peak of a periodogram).

use super::orders::order_p;
use super::{Content, Start, rms};
use crate::numeric::digits::number;
use crate::signal::residual::whiteness;
use statrs::distribution::{ContinuousCDF, Normal};

/// Family-wise rate of false alarms.
const FAMILY: f64 = 0.01;
/// Tests of a channel that give a p-value.
const TESTS: f64 = 5.0;
/// Samples of the longest even stretch that the periodogram takes.
const MOST: usize = 2048;

/// The table.
pub(super) fn anything(start: &Start) -> Content {
    let targets = &start.context.targets;
    let level = FAMILY / (TESTS * targets.len().max(1) as f64);
    let rows = targets.iter().zip(&start.residuals).enumerate().map(|(k, (target, r))| {
        let t: Vec<f64> = target.rows.iter().map(|i| start.context.t[*i]).collect();
        let (white, runs, (period, peak)) = (whiteness(&t, r), runs(r), strongest(&t, r));
        let orders = [1.0, start.blades].map(|order| order_p(start, k, order));
        let lines = orders.iter().flatten().copied().fold(1.0, f64::min);
        let [once, blade] = orders.map(|p| p.map_or_else(|| "-".to_owned(), |p| format!("{p:.2e}")));
        let verdict = if white.min(runs).min(peak).min(lines) < level { "something" } else { "nothing" };
        vec![
            target.name.to_owned(),
            format!("{:.2}", rms(r.iter().copied()) / target.noise.rms),
            format!("{white:.2e}"),
            format!("{runs:.2e}"),
            number(period),
            format!("{peak:.2e}"),
            once,
            blade,
            verdict.to_owned(),
        ]
    });
    let note = format!(
        "a channel holds something where one of its p-values is below {level:.1e}: {FAMILY} for all tests together; 1/rev and blade pass ({} blades): at the frequency of the measured speed on each hold, folded at the log's rate, all holds together; - where no hold can show it",
        start.blades
    );
    let columns = vec![
        "channel",
        "over the floor",
        "whiteness p",
        "runs p",
        "strongest period, s",
        "its p",
        "1/rev p",
        "blade pass p",
        "verdict",
    ];
    (columns, rows.collect(), note)
}

/// Two-sided p-value of the number of runs about the median.
fn runs(r: &[f64]) -> f64 {
    let mut sorted = r.to_vec();
    let middle = crate::numeric::order::median(&mut sorted);
    let signs: Vec<bool> = r.iter().filter(|v| **v != middle).map(|v| *v > middle).collect();
    let (up, n) = (signs.iter().filter(|s| **s).count() as f64, signs.len() as f64);
    let down = n - up;
    if up < 10.0 || down < 10.0 {
        return 1.0;
    }
    let seen = 1.0 + signs.windows(2).filter(|w| w[0] != w[1]).count() as f64;
    let expected = 1.0 + 2.0 * up * down / n;
    let variance = (expected - 1.0) * (expected - 2.0) / (n - 1.0);
    Normal::standard().cdf(-((seen - expected) / variance.sqrt()).abs()) * 2.0
}

/// Period of the largest peak of the periodogram, and Fisher's p-value for it.
fn strongest(t: &[f64], r: &[f64]) -> (f64, f64) {
    let stride = r.len().div_ceil(MOST).max(1);
    let z: Vec<f64> = r.chunks_exact(stride).map(|c| c.iter().sum::<f64>() / stride as f64).collect();
    let n = z.len();
    if n < 32 {
        return (0.0, 1.0);
    }
    let mean = z.iter().sum::<f64>() / n as f64;
    let m = (n - 1) / 2;
    let power = |k: usize| {
        let (mut c, mut s) = (0.0, 0.0);
        for (i, v) in z.iter().enumerate() {
            let phase = std::f64::consts::TAU * ((k * i) % n) as f64 / n as f64;
            c += (v - mean) * phase.cos();
            s += (v - mean) * phase.sin();
        }
        c * c + s * s
    };
    let powers: Vec<f64> = (1..=m).map(power).collect();
    let total: f64 = powers.iter().sum();
    let Some((k, top)) = powers.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)) else { return (0.0, 1.0) };
    let span = (t[t.len() - 1] - t[0]) * n as f64 / (n as f64 - 1.0);
    // first term of Fisher's sum: an upper bound that is tight where it matters
    let p = if total > 0.0 { (m as f64 * (1.0 - top / total).powi(m as i32 - 1)).min(1.0) } else { 1.0 };
    (span / (k + 1) as f64, p)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(i: usize) -> f64 {
        let mut s = (i as u64 + 3).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        (0..12)
            .map(|_| {
                s ^= s >> 29;
                s = s.wrapping_mul(0xBF58_476D_1CE4_E5B9);
                s ^= s >> 32;
                (s >> 11) as f64 / (1u64 << 53) as f64
            })
            .sum::<f64>()
            - 6.0
    }

    #[test]
    fn a_weak_wave_is_found_by_its_period_and_noise_is_not() {
        let t: Vec<f64> = (0..1500).map(|i| i as f64 * 0.1).collect();
        let plain: Vec<f64> = (0..1500).map(noise).collect();
        assert!(strongest(&t, &plain).1 > 1e-3 && runs(&plain) > 1e-3);
        let wave: Vec<f64> = plain.iter().zip(&t).map(|(n, t)| n + 0.35 * (std::f64::consts::TAU * t / 7.5).sin()).collect();
        let (period, p) = strongest(&t, &wave);
        assert!((period - 7.5).abs() < 0.2 && p < 1e-6, "{period} {p}");
    }

    #[test]
    fn a_drift_makes_few_runs() {
        let drift: Vec<f64> = (0..400).map(|i| noise(i) + 0.01 * i as f64).collect();
        assert!(runs(&drift) < 1e-6);
    }
}
