//! How much a flight shakes.
//!
//! What it is: mean square of the specific force across the rotors' axes about the straight line of each window. One window tells it badly:
//! it holds a few turns of rotors that beat against each other, and of a turn that falls in step with the rows it sees nothing. What shakes
//! are the rotors, once a turn, so it is told as one function of a rotor's speed, the frame's answer, times a strength for each rotor;
//! where no rotor's speed was logged it is averaged over half a second.
//! What can go wrong: a vibration that hardly changes over the flight tells nothing and is not given.
//! Units: (m/s^2)^2.
//! Reference: IEEE Std 1293, vibration rectification error (proportional to the mean square); least squares with a gamma spread,
//! Wood 2017, section 3.1.

use super::record::Record;
use super::windows::Windows;
use crate::numeric::order::median;
use crate::numeric::order::usual_step;
use nalgebra::{DMatrix, DVector};

/// Windows on each side that are averaged where nothing of the rotors was logged: half a second.
const SIDE: usize = 6;
/// Least spread over the mean: with less, it is one with a constant.
const SPREAD: f64 = 0.25;
/// Places at which a function of a rotor's speed is told.
const KNOTS: usize = 16;
/// Least windows for each of its values.
const EACH: usize = 10;
/// Turns of line and strengths; each window's spread is set to what was last told of it.
const ROUNDS: usize = 10;

/// How much a flight shakes.
#[derive(Debug, Clone, PartialEq)]
pub struct Shaking {
    /// Mean square in each window.
    pub square: Vec<f64>,
    /// Its usual value.
    pub usual: f64,
}

impl Shaking {
    /// Of the windows of a record; `None` where the vibration hardly changes.
    #[must_use]
    pub fn of(record: &Record, windows: &Windows) -> Option<Self> {
        let seen = seen(record, windows)?;
        let drives: Vec<Vec<f64>> = record.speed.iter().map(|d| windows.mean(d)).collect();
        let step = usual_step(&record.t);
        let rows = windows.bounds.first().map_or(0, |(a, b)| b - a);
        let square = by_rotor(&seen, &drives, |w| seen_of(w * step, rows)).unwrap_or_else(|| averaged(&seen));
        let n = square.len().max(1) as f64;
        let mean = square.iter().sum::<f64>() / n;
        let spread = (square.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
        let usual = median(&mut square.clone());
        (spread > SPREAD * mean && usual > 0.0).then_some(Self { square, usual })
    }
}

/// Mean square of what each window holds about its straight line, across the rotors' axes.
fn seen(record: &Record, windows: &Windows) -> Option<Vec<f64>> {
    let force = record.force.as_ref()?;
    let mut square = vec![0.0; windows.len()];
    for axis in &force[..2] {
        let (means, slopes) = (windows.mean(axis), windows.slope(axis));
        for (k, (a, b)) in windows.bounds.iter().enumerate() {
            let left = |i: usize| axis[i] - means[k] - slopes[k] * (record.t[i] - windows.t[k]);
            square[k] += (*a..*b).map(|i| left(i).powi(2)).sum::<f64>() / (b - a).saturating_sub(2).max(1) as f64;
        }
    }
    Some(square)
}

/// The share of a sine's mean square that `rows` rows show about their straight line, where it turns by `angle` from row to row.
fn seen_of(angle: f64, rows: usize) -> f64 {
    let n = rows as f64;
    let place = |j: usize| j as f64 - 0.5 * (n - 1.0);
    let sum = |of: &dyn Fn(f64) -> f64| (0..rows).map(|j| of(place(j))).sum::<f64>();
    // about the middle the cosine is even and the sine odd
    let even = sum(&|x| (angle * x).cos()).powi(2) / n;
    let odd = sum(&|x| x * (angle * x).sin()).powi(2) / sum(&|x| x * x);
    (n - even - odd) / (n - 2.0)
}

fn averaged(square: &[f64]) -> Vec<f64> {
    let around = |k: usize| &square[k.saturating_sub(SIDE)..(k + SIDE + 1).min(square.len())];
    (0..square.len()).map(|k| around(k).iter().sum::<f64>() / around(k).len() as f64).collect()
}

/// What the rotors' speeds make of it: the frame answers each speed in one way, a broken line, and each rotor shakes with a strength of its own.
/// A window's own value spreads as widely as its mean. Line and strengths are sought by turns.
fn by_rotor(square: &[f64], drives: &[Vec<f64>], seen_of: impl Fn(f64) -> f64) -> Option<Vec<f64>> {
    let (n, rotors) = (square.len(), drives.len());
    if rotors == 0 || n < EACH * (KNOTS + rotors) {
        return None;
    }
    let knots = knots(drives);
    let seen: Vec<Vec<f64>> = drives.iter().map(|d| d.iter().map(|w| seen_of(*w)).collect()).collect();
    let least = 0.1 * median(&mut square.to_vec());
    let mut strength = vec![1.0; rotors];
    let mut told = vec![square.iter().sum::<f64>() / n as f64; n];
    let mut shaken = Vec::new();
    for _ in 0..ROUNDS {
        let mut line = DMatrix::<f64>::zeros(n, KNOTS);
        for (r, drive) in drives.iter().enumerate() {
            for (k, v) in drive.iter().enumerate() {
                hats(&knots, *v).into_iter().for_each(|(knot, share)| line[(k, knot)] += strength[r] * share * seen[r][k]);
            }
        }
        let heights = weighted(&line, square, &told, least)?;
        let answer = |v: f64| hats(&knots, v).into_iter().map(|(knot, share)| share * heights[knot].max(0.0)).sum::<f64>();
        let own = DMatrix::from_fn(n, rotors, |k, r| answer(drives[r][k]) * seen[r][k]);
        let found = weighted(&own, square, &told, least)?.map(|s| s.max(0.0));
        let mean = found.sum() / rotors as f64;
        strength = found.iter().map(|s| s / mean.max(f64::MIN_POSITIVE)).collect();
        told = (&own * &found).iter().copied().collect();
        shaken = (0..n).map(|k| (0..rotors).map(|r| found[r] * answer(drives[r][k])).sum()).collect();
    }
    Some(shaken)
}

/// Least squares where each value spreads as widely as what was last told of it.
fn weighted(columns: &DMatrix<f64>, square: &[f64], told: &[f64], least: f64) -> Option<DVector<f64>> {
    let scale = |k: usize| told[k].max(least).max(f64::MIN_POSITIVE);
    let rows = DMatrix::from_fn(columns.nrows(), columns.ncols(), |k, v| columns[(k, v)] / scale(k));
    let right = DVector::from_fn(columns.nrows(), |k, _| square[k] / scale(k));
    let mut normal = rows.transpose() * &rows;
    let ridge = 1e-6 * normal.trace() / columns.ncols() as f64;
    (0..columns.ncols()).for_each(|v| normal[(v, v)] += ridge);
    Some(normal.cholesky()?.solve(&(rows.transpose() * right)))
}

/// Places of equal distance from the lowest speed of any rotor to the highest.
fn knots(drives: &[Vec<f64>]) -> Vec<f64> {
    let all = || drives.iter().flatten().copied();
    let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
    (0..KNOTS).map(|k| low + (high - low) * k as f64 / (KNOTS - 1) as f64).collect()
}

/// The two places beside a value, with its share of each.
fn hats(knots: &[f64], v: f64) -> [(usize, f64); 2] {
    let width = (knots[1] - knots[0]).max(f64::MIN_POSITIVE);
    let at = ((v - knots[0]) / width).clamp(0.0, (KNOTS - 1) as f64);
    let below = (at as usize).min(KNOTS - 2);
    [(below, 1.0 - (at - below as f64)), (below + 1, at - below as f64)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean over all phases of what a straight line leaves of a sine.
    #[test]
    fn a_sine_in_step_with_the_rows_is_not_seen() {
        let left = |angle: f64, phase: f64, n: usize| {
            let y: Vec<f64> = (0..n).map(|j| (angle * j as f64 + phase).sin()).collect();
            let x: Vec<f64> = (0..n).map(|j| j as f64 - 0.5 * (n as f64 - 1.0)).collect();
            let mean = y.iter().sum::<f64>() / n as f64;
            let slope = x.iter().zip(&y).map(|(x, y)| x * y).sum::<f64>() / x.iter().map(|x| x * x).sum::<f64>();
            x.iter().zip(&y).map(|(x, y)| (y - mean - slope * x).powi(2)).sum::<f64>() / (n as f64 - 2.0)
        };
        for (angle, n) in [(0.01, 8), (0.4, 8), (2.5, 10), (std::f64::consts::TAU - 0.2, 20)] {
            let mean = (0..100).map(|k| left(angle, 0.01 * std::f64::consts::TAU * f64::from(k), n)).sum::<f64>() / 100.0;
            assert!((2.0 * mean - seen_of(angle, n)).abs() < 1e-9, "{angle} {n}: {mean}");
        }
        assert!(seen_of(0.01, 8) < 1e-3 && seen_of(2.0, 20) > 0.9);
    }

    /// Two rotors whose speeds wander by themselves, one of which meets a resonance: windows that spread as widely as their mean are told
    /// within a quarter, and averages over half a second are not.
    #[test]
    fn a_resonance_is_told_from_windows_that_spread_widely() {
        let n = 1200;
        let speed = |k: usize, period: f64| 1.0 + 0.3 * (k as f64 / period).sin();
        let drives = [7.3, 4.1].map(|period| (0..n).map(|k| speed(k, period)).collect::<Vec<f64>>());
        let of = |w: f64| w.powi(4) / ((1.0 - (w / 1.2).powi(2)).powi(2) + 0.03);
        let truth: Vec<f64> = (0..n).map(|k| of(drives[0][k]) + 0.3 * of(drives[1][k])).collect();
        // twice the spread of a uniform draw about one half is a spread of 0.58 of the mean
        let mut state = 1_u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            2.0 * (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let square: Vec<f64> = truth.iter().map(|v| v * draw()).collect();
        let off = |told: &[f64]| (told.iter().zip(&truth).map(|(a, b)| (a / b - 1.0).powi(2)).sum::<f64>() / n as f64).sqrt();
        let (told, smooth) = (by_rotor(&square, &drives, |_| 1.0).unwrap(), averaged(&square));
        assert!(off(&told) < 0.25 && off(&smooth) > 1.0, "{} {}", off(&told), off(&smooth));
    }
}
