//! How much a flight shakes.
//!
//! What it is: mean square of the specific force about the straight line of each window, all axes together. One window tells it badly: it
//! holds a few turns of rotors that beat against each other. What shakes are the rotors, so it is told as a sum of smooth functions of
//! their speeds, one a rotor; where no speed and no command was logged it is averaged over half a second.
//! What can go wrong: a vibration that hardly changes over the flight tells nothing and is not given.
//! Units: (m/s^2)^2.
//! Reference: IEEE Std 1293, vibration rectification error (proportional to the mean square); generalised additive model with a gamma
//! spread, Wood 2017, section 3.1.

use super::record::Record;
use super::windows::Windows;
use crate::noise::median;
use nalgebra::{DMatrix, DVector};

/// Windows on each side that are averaged where nothing of the rotors was logged: half a second.
const SIDE: usize = 6;
/// Least spread over the mean: with less, it is one with a constant.
const SPREAD: f64 = 0.25;
/// Places at which a function of a rotor's speed is told.
const KNOTS: usize = 10;
/// Least windows for each of its values.
const EACH: usize = 5;
/// Rounds in which each window's spread is set to what was told of it.
const ROUNDS: usize = 6;

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
        let drives = if record.speed.is_empty() { &record.command } else { &record.speed };
        let drives: Vec<Vec<f64>> = drives.iter().map(|d| windows.mean(d)).collect();
        let square = by_rotor(&seen, &drives).unwrap_or_else(|| averaged(&seen));
        let n = square.len().max(1) as f64;
        let mean = square.iter().sum::<f64>() / n;
        let spread = (square.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
        let usual = median(&mut square.clone());
        (spread > SPREAD * mean && usual > 0.0).then_some(Self { square, usual })
    }
}

/// Mean square of what each window holds about its straight line.
fn seen(record: &Record, windows: &Windows) -> Option<Vec<f64>> {
    let force = record.force.as_ref()?;
    let mut square = vec![0.0; windows.len()];
    for axis in force {
        let (means, slopes) = (windows.mean(axis), windows.slope(axis));
        for (k, (a, b)) in windows.bounds.iter().enumerate() {
            let left = |i: usize| axis[i] - means[k] - slopes[k] * (record.t[i] - windows.t[k]);
            square[k] += (*a..*b).map(|i| left(i).powi(2)).sum::<f64>() / (b - a).saturating_sub(2).max(1) as f64;
        }
    }
    Some(square)
}

fn averaged(square: &[f64]) -> Vec<f64> {
    let around = |k: usize| &square[k.saturating_sub(SIDE)..(k + SIDE + 1).min(square.len())];
    (0..square.len()).map(|k| around(k).iter().sum::<f64>() / around(k).len() as f64).collect()
}

/// What the rotors' speeds make of it: for each rotor a broken line, what all of them share and what each differs by. A window's own
/// value spreads as widely as its mean.
fn by_rotor(square: &[f64], drives: &[Vec<f64>]) -> Option<Vec<f64>> {
    let (n, rotors) = (square.len(), drives.len());
    let values = KNOTS * (rotors + 1);
    if rotors == 0 || n < EACH * values {
        return None;
    }
    let knots = knots(drives);
    let mut rows = DMatrix::<f64>::zeros(n, values);
    for (rotor, drive) in drives.iter().enumerate() {
        for (k, v) in drive.iter().enumerate() {
            for (knot, share) in hats(&knots, *v) {
                rows[(k, knot)] += share;
                rows[(k, KNOTS * (rotor + 1) + knot)] += share;
            }
        }
    }
    let mean = square.iter().sum::<f64>() / n as f64;
    let usual = median(&mut square.to_vec()).max(1e-3 * mean);
    let size = usual / rotors as f64;
    let mut told = vec![mean; n];
    for _ in 0..ROUNDS {
        // what all rotors share is nearly free; one differs from it by about as much as there is of it
        let mut normal = DMatrix::<f64>::zeros(values, values);
        for v in 0..values {
            normal[(v, v)] = if v < KNOTS { (100.0 * size).powi(-2) } else { size.powi(-2) };
        }
        let mut right = DVector::<f64>::zeros(values);
        let weights = told.iter().map(|m| m.max(0.1 * usual).powi(-2));
        let weighted = DMatrix::from_fn(n, values, |k, v| rows[(k, v)] / told[k].max(0.1 * usual));
        right += rows.transpose() * DVector::from_iterator(n, square.iter().zip(weights).map(|(s, w)| s * w));
        normal += weighted.transpose() * &weighted;
        let solution = normal.cholesky()?.solve(&right);
        told = (&rows * solution).iter().map(|v| v.max(0.0)).collect();
    }
    Some(told)
}

/// Places of equal distance from the lowest speed of any rotor to the highest, but for the outermost hundredths.
fn knots(drives: &[Vec<f64>]) -> Vec<f64> {
    let mut all: Vec<f64> = drives.iter().flatten().copied().collect();
    all.sort_by(f64::total_cmp);
    let (low, high) = (all[all.len() / 100], all[all.len() - 1 - all.len() / 100]);
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
        let (told, smooth) = (by_rotor(&square, &drives).unwrap(), averaged(&square));
        assert!(off(&told) < 0.25 && off(&smooth) > 1.0, "{} {}", off(&told), off(&smooth));
    }
}
