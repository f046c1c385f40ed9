//! The noise floor, from the data.
//!
//! What it is: the scatter of a channel about its own course inside steady stretches, as a function of speed, with its colour.
//! What can go wrong: quantisation hides the scatter (a floor of step/sqrt 12 is kept); too few steady rows fall back on all
//! successive differences, robustly.
//! Units: the channel's.
//! Reference: von Neumann 1941 (mean square successive difference); notes on method: never from the fit residual.

use crate::numeric::order::{median, quantum};
use crate::numeric::solve::Normal;

/// Noise of one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Variance that does not depend on speed.
    pub a: f64,
    /// Variance for each (rpm/1000)^2.
    pub b: f64,
    /// Variance for each (rpm/1000)^4.
    pub c: f64,
    /// Lag-one autocorrelation of the noise, 0 when white.
    pub rho: f64,
    /// Root mean square over the run.
    pub rms: f64,
}

impl Noise {
    /// Variance at a speed, rev/min.
    #[must_use]
    pub fn variance(&self, rpm: f64) -> f64 {
        let k = rpm / 1000.0;
        let x = k * k;
        self.a + x * (self.b + x * self.c)
    }

    /// Variance by which a sample is weighted: a `share` of it is the run's mean variance, because where a polynomial misfits,
    /// a nearly noiseless stretch must not outvote the rest of the run.
    #[must_use]
    pub fn weight_variance(&self, rpm: f64, share: f64) -> f64 {
        (1.0 - share) * self.variance(rpm) + share * self.rms * self.rms
    }
}

/// Where the noise is read off.
#[derive(Debug, Clone, Copy)]
pub struct Stretches<'a> {
    /// Row ranges `[from, to)` without a jump of the load, ramps included.
    pub calm: &'a [(usize, usize)],
    /// Row ranges in which the load is held.
    pub held: &'a [(usize, usize)],
}

impl Stretches<'_> {
    /// Whether a range is a ramp: no part of it is held.
    fn is_ramp(&self, from: usize, to: usize) -> bool {
        self.held.iter().all(|(a, b)| *b <= from || to <= *a)
    }
}

/// Estimates the noise of a channel given at `rows`: the scatter of `y`, which is the channel `reading` less what follows the
/// measured speed (a gust moves speed and thrust together, and is no noise of the load cell).
#[must_use]
pub fn estimate(rows: &[usize], reading: &[f64], y: &[f64], rpm: &[f64], stretches: Stretches<'_>) -> Noise {
    let quantum = resolution(rows, reading, stretches);
    let digits = LAST_DIGIT * reading.iter().fold(0.0, |most, v| f64::max(most, v.abs()));
    let floor = (quantum * quantum / 12.0).max(digits * digits);
    let mut samples: Vec<(f64, f64)> = Vec::new(); // (speed/1000)^2, squared second difference scaled to a variance
    let mut colour = Colour::default();
    for (from, to) in stretches.calm {
        // the first tenth of a stretch, and at least two rows, belong to settling
        let skip = from + 2 + (to - from) / 10;
        let lo = rows.partition_point(|r| *r < skip);
        let hi = rows.partition_point(|r| *r < *to);
        if hi < lo + 4 {
            continue;
        }
        // the second difference of white noise has six times its variance, and a slope drops out
        let mut second: Vec<f64> = y[lo..hi].windows(3).map(|w| w[0] - 2.0 * w[1] + w[2]).collect();
        for (k, block) in second.chunks_mut(BLOCK).enumerate() {
            let first = lo + k * BLOCK;
            if stretches.is_ramp(rows[first], rows[first + block.len()] + 1) {
                drop_jumps(block);
            }
        }
        for (k, d) in second.iter().enumerate().filter(|(_, d)| d.is_finite()) {
            let speed = if rpm.is_empty() { 0.0 } else { rpm[rows[lo + k + 1]] / 1000.0 };
            samples.push((speed * speed, d * d / 6.0));
        }
        second.split(|d| !d.is_finite()).for_each(|d| colour.add(d));
    }
    if samples.len() < 20 {
        samples = y
            .windows(3)
            .enumerate()
            .map(|(k, w)| {
                let d = w[0] - 2.0 * w[1] + w[2];
                let speed = if rpm.is_empty() { 0.0 } else { rpm[rows[k + 1]] / 1000.0 };
                (speed * speed, d * d / 6.0)
            })
            .collect();
        trim(&mut samples);
    }
    drop_glitches(&mut samples);
    let [a, b, c] = variance_curve(&samples);
    let a = a.max(floor).max(1e-30);
    let rho = colour.rho();
    // positive colour makes successive differences too small: gamma_d2 = var (6 - 8 rho + 2 rho^2) for an AR(1)
    let widen = 6.0 / (6.0 - 8.0 * rho + 2.0 * rho * rho).max(0.3);
    let mut noise = Noise { a: a * widen, b: b * widen, c: c * widen, rho, rms: 0.0 };
    let speed = |r: &usize| if rpm.is_empty() { 0.0 } else { rpm[*r] };
    noise.rms = (rows.iter().map(|r| noise.variance(speed(r))).sum::<f64>() / rows.len().max(1) as f64).sqrt();
    noise
}

/// Part of its largest reading that no channel of a log is trusted below: six digits.
const LAST_DIGIT: f64 = 1e-6;

/// Stretches without a jump for each distinct value from which on a channel that does not move within any of them is one whose display
/// is too coarse to, rather than one without noise.
const SHARED: usize = 4;

/// The resolution of a channel, also where a run shows a few digits of its display only; 0 where the readings do not tell it: a
/// channel without noise has a value a level, and their distances are the schedule's.
fn resolution(rows: &[usize], reading: &[f64], stretches: Stretches<'_>) -> f64 {
    let settled = stretches.calm.iter().filter_map(|(from, to)| {
        let skip = from + 2 + (to - from) / 10;
        let (lo, hi) = (rows.partition_point(|r| *r < skip), rows.partition_point(|r| r < to));
        reading.get(lo..hi).filter(|r| r.len() >= 4)
    });
    let moves: Vec<bool> = settled.map(|r| r.windows(2).any(|w| w[0] != w[1])).collect();
    if moves.is_empty() {
        return quantum(reading);
    }
    let moves = moves.contains(&true);
    let mut values = reading.to_vec();
    values.sort_unstable_by(f64::total_cmp);
    values.dedup();
    if !moves && values.len() * SHARED > stretches.calm.len() {
        return 0.0;
    }
    let finest = values.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 1e-12).fold(f64::INFINITY, f64::min);
    if values.len() <= 8 && finest.is_finite() { finest } else { quantum(reading) }
}

/// Products of second differences at lags 0 and 1: they tell the colour of the noise and are blind to whatever varies slowly,
/// which is no noise but the very thing that is sought.
#[derive(Default)]
struct Colour {
    same: f64,
    next: f64,
    pairs: usize,
}

impl Colour {
    /// Largest lag-one autocorrelation that is called colour; what is slower is course.
    const MOST: f64 = 0.8;

    /// Adds the second differences of an evenly sampled stretch.
    fn add(&mut self, second: &[f64]) {
        for w in second.windows(2) {
            self.same += 0.5 * (w[0] * w[0] + w[1] * w[1]);
            self.next += w[0] * w[1];
            self.pairs += 1;
        }
    }

    /// Lag-one autocorrelation of an AR(1) whose second differences look like these; 0 where they could be white.
    fn rho(&self) -> f64 {
        if self.pairs < 30 || self.same <= 0.0 {
            return 0.0;
        }
        // for AR(1): gamma_d2(1)/gamma_d2(0) = (-4 + 3 rho - rho^2) / (6 - 2 rho), from -2/3 when white to -1/2
        let of = |rho: f64| (-4.0 + 3.0 * rho - rho * rho) / (6.0 - 2.0 * rho);
        let seen = self.next / self.same;
        let uncertain = 1.2 / (self.pairs as f64).sqrt(); // two standard errors (Bartlett)
        if seen - uncertain < of(0.0) {
            return 0.0;
        }
        let (mut lo, mut hi) = (0.0, Self::MOST);
        for _ in 0..40 {
            let mid = 0.5 * (lo + hi);
            if of(mid) < seen { lo = mid } else { hi = mid }
        }
        0.5 * (lo + hi)
    }
}

/// Second differences that are compared with one another, so that noise that grows along a ramp is none of theirs.
const BLOCK: usize = 128;

/// Standard deviations, from the median, beyond which a second difference on a ramp holds a jump.
const JUMP: f64 = 4.5;

/// Takes out what jumps on a ramp: a command in coarse steps moves a few rows and leaves the scatter of the others as it is.
fn drop_jumps(second: &mut [f64]) {
    let limit = JUMP * 1.4826 * median(&mut second.iter().map(|d| d.abs()).collect::<Vec<_>>());
    let far = second.iter().filter(|d| d.abs() > limit).count();
    if limit > 0.0 && far * 3 < second.len() {
        second.iter_mut().filter(|d| d.abs() > limit).for_each(|d| *d = f64::NAN);
    }
}

/// Drops isolated absurd rows: at most one in a hundred, a thousand standard deviations and more away.
fn drop_glitches(samples: &mut Vec<(f64, f64)>) {
    let limit = 1e5 * median(&mut samples.iter().map(|s| s.1).collect::<Vec<_>>());
    let far = samples.iter().filter(|s| s.1 > limit).count();
    if limit > 0.0 && far * 100 < samples.len() {
        samples.retain(|s| s.1 <= limit);
    }
}

/// Keeps the quieter nine tenths: what is left over from transients goes.
fn trim(samples: &mut Vec<(f64, f64)>) {
    samples.sort_unstable_by(|p, q| p.1.total_cmp(&q.1));
    samples.truncate((samples.len() * 9 / 10).max(1));
}

/// Non-negative variance = a + b x + c x^2 over the squared speed x, through binned means, robust against single bins: a bin
/// that stands far above the curve (a resonance) must not bend it.
fn variance_curve(samples: &[(f64, f64)]) -> [f64; 3] {
    if samples.is_empty() {
        return [1e-30, 0.0, 0.0];
    }
    let top = samples.iter().map(|s| s.0).fold(0.0, f64::max);
    let mut bins: Vec<(f64, f64, f64)> = vec![(0.0, 0.0, 0.0); 16];
    for (x, v) in samples {
        let k = if top > 0.0 { (((x / top).sqrt() * 16.0) as usize).min(15) } else { 0 };
        bins[k].0 += x;
        bins[k].1 += v;
        bins[k].2 += 1.0;
    }
    let points: Vec<(f64, f64, f64)> = bins.iter().filter(|b| b.2 >= 5.0).map(|b| (b.0 / b.2, b.1 / b.2, b.2)).collect();
    let mean = samples.iter().map(|s| s.1).sum::<f64>() / samples.len() as f64;
    if points.len() < 4 {
        return [mean, 0.0, 0.0];
    }
    let mut curve = [mean, 0.0, 0.0];
    for _ in 0..8 {
        // relative errors of a variance are alike in every bin: weight by count / variance^2
        let weighted: Vec<(f64, f64, f64)> = points
            .iter()
            .map(|(x, v, n)| {
                let model = (curve[0] + x * (curve[1] + x * curve[2])).max(1e-3 * mean);
                let excess = (v / model).max(1.0);
                (x / top.max(1e-12), *v, n / (model * model) / (excess * excess))
            })
            .collect();
        curve = non_negative(&weighted);
        curve[1] /= top.max(1e-12);
        curve[2] /= (top * top).max(1e-24);
    }
    curve
}

/// Weighted least squares over 1, x, x^2 with coefficients that are not negative: the best of the admissible subsets.
fn non_negative(points: &[(f64, f64, f64)]) -> [f64; 3] {
    let subsets: [&[usize]; 6] = [&[0, 1, 2], &[0, 1], &[0, 2], &[1, 2], &[0], &[2]];
    let cost = |c: &[f64; 3]| points.iter().map(|(x, v, w)| w * (v - c[0] - x * (c[1] + x * c[2])).powi(2)).sum::<f64>();
    let mut best: Option<(f64, [f64; 3])> = None;
    for subset in subsets {
        let mut normal = Normal::new(subset.len());
        for (x, v, w) in points {
            let row: Vec<f64> = subset.iter().map(|k| x.powi(*k as i32)).collect();
            normal.add(&row, *v, *w);
        }
        let Some(solution) = normal.solve() else { continue };
        if solution.coefficients.iter().all(|c| *c >= 0.0) {
            let mut c = [0.0; 3];
            for (k, value) in subset.iter().zip(&solution.coefficients) {
                c[*k] = *value;
            }
            let cost = cost(&c);
            if best.is_none_or(|b| cost < b.0) {
                best = Some((cost, c));
            }
        }
    }
    best.map_or([1e-30, 0.0, 0.0], |b| b.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(ranges: &[(usize, usize)]) -> Stretches<'_> {
        Stretches { calm: ranges, held: ranges }
    }

    #[test]
    fn a_command_in_coarse_steps_is_no_noise_of_a_ramp() {
        let rows: Vec<usize> = (0..4000).collect();
        let y: Vec<f64> = rows.iter().map(|i| 40.0 * (*i as f64 / 32.0).floor() + 2.0 * hash_noise(*i)).collect();
        let noise = estimate(&rows, &y, &y, &[], Stretches { calm: &[(0, 4000)], held: &[] });
        assert!((noise.rms - 2.0).abs() < 0.1 && noise.rho == 0.0, "{noise:?}");
        // what jumps while the load is held is not explained by the command
        assert!(estimate(&rows, &y, &y, &[], held(&[(0, 4000)])).rms > 5.0);
    }

    #[test]
    fn a_display_of_few_digits_keeps_its_step() {
        let rows: Vec<usize> = (0..1200).collect();
        let levels: Vec<(usize, usize)> = (0..12).map(|k| (100 * k, 100 * (k + 1))).collect();
        let floor = |y: &[f64]| estimate(&rows, y, y, &[], held(&levels)).rms;
        let step = 0.1 / 12.0_f64.sqrt();
        let rounded = |v: f64| (10.0 * v).round() / 10.0;
        // it toggles, and it changes between levels only
        let toggles: Vec<f64> = rows.iter().map(|i| rounded(11.45 + 0.03 * hash_noise(*i))).collect();
        assert!(floor(&toggles) >= step, "{}", floor(&toggles));
        let still: Vec<f64> = rows.iter().map(|i| if *i < 700 { 11.5 } else { 11.4 }).collect();
        assert!((floor(&still) / step - 1.0).abs() < 1e-6, "{}", floor(&still));
        // a constant has the last of six digits; what has no noise has a value a level, and those are no digits
        assert!((floor(&[11.5; 1200]) / 11.5e-6 - 1.0).abs() < 1e-6);
        // a table of single points does not tell the two apart, and keeps the coarser
        let table: Vec<f64> = (0..16).map(|i| 0.3 * f64::from(i * i)).collect();
        let points: Vec<(usize, usize)> = (0..16).map(|i| (i, i + 1)).collect();
        assert_eq!(resolution(&rows[..16], &table, held(&points)), quantum(&table));
        let clean: Vec<f64> = rows.iter().map(|i| 700.0 * (1 + i / 100) as f64).collect();
        assert!(floor(&clean) < 1.0, "{}", floor(&clean));
    }

    fn hash_noise(i: usize) -> f64 {
        // sum of twelve uniform numbers from splitmix64 (Steele, Lea & Flood 2014): standard normal to a few per cent
        (0..12)
            .map(|k| {
                let mut z = (12 * i as u64 + k + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
                z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
                z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
                ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
            })
            .sum::<f64>()
            - 6.0
    }

    #[test]
    fn a_known_level_is_found_through_drift() {
        let y: Vec<f64> = (0..4000).map(|i| 0.02 * hash_noise(i) + 1e-3 * i as f64).collect();
        let rows: Vec<usize> = (0..4000).collect();
        let noise = estimate(&rows, &y, &y, &[], held(&[(0, 2000), (2000, 4000)]));
        assert!((noise.rms / 0.02 - 1.0).abs() < 0.06, "{noise:?}");
        assert!(noise.rho < 0.08);
    }

    #[test]
    fn a_slow_wave_is_no_noise_and_colour_is() {
        let rows: Vec<usize> = (0..4000).collect();
        let wave: Vec<f64> = (0..4000).map(|i| 0.02 * hash_noise(i) + 0.2 * (i as f64 * 0.02).sin()).collect();
        let noise = estimate(&rows, &wave, &wave, &[], held(&[(0, 4000)]));
        assert!((noise.rms / 0.02 - 1.0).abs() < 0.06, "{noise:?}");
        let mut state = 0.0;
        let coloured: Vec<f64> = (0..4000)
            .map(|i| {
                state = 0.5 * state + 0.75_f64.sqrt() * 0.02 * hash_noise(i);
                state
            })
            .collect();
        let noise = estimate(&rows, &coloured, &coloured, &[], held(&[(0, 4000)]));
        assert!((noise.rms / 0.02 - 1.0).abs() < 0.12 && (noise.rho - 0.5).abs() < 0.15, "{noise:?}");
    }

    #[test]
    fn growth_with_speed_is_found() {
        let rpm: Vec<f64> = (0..12_000).map(|i| 1000.0 * (1 + i / 2000) as f64).collect();
        let y: Vec<f64> = (0..12_000).map(|i| hash_noise(i) * (0.01 + 0.0004 * (rpm[i] / 1000.0).powi(2)).sqrt()).collect();
        let rows: Vec<usize> = (0..12_000).collect();
        let steady: Vec<(usize, usize)> = (0..6).map(|k| (2000 * k, 2000 * (k + 1))).collect();
        let noise = estimate(&rows, &y, &y, &rpm, held(&steady));
        for speed in [1000.0, 3000.0, 6000.0] {
            let truth = 0.01 + 0.0004 * (speed / 1000.0_f64).powi(2);
            assert!((noise.variance(speed) / truth - 1.0).abs() < 0.15, "{speed}: {noise:?}");
        }
    }

    #[test]
    fn median_of_even_and_odd() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0, 1.0, 2.0, 3.0]), 2.5);
    }
}
