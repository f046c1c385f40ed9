//! How much a flight shakes.
//!
//! What it is: mean square of the specific force about the straight line of each window, all axes together, smoothed over half a second.
//! What can go wrong: a vibration that hardly changes over the flight tells nothing and is not given.
//! Units: (m/s^2)^2.
//! Reference: IEEE Std 1293, vibration rectification error (proportional to the mean square).

use super::columns::Flight;
use crate::noise::median;

/// Windows on each side that are averaged: half a second.
const SIDE: usize = 6;
/// Least spread over the mean: with less, it is one with a constant.
const SPREAD: f64 = 0.25;

/// Mean square of the vibration in each window, and its usual value; `None` where it hardly changes.
#[must_use]
pub(crate) fn power(flight: &Flight) -> Option<(Vec<f64>, f64)> {
    let force = flight.record.force.as_ref()?;
    let windows = &flight.windows;
    let mut square = vec![0.0; windows.len()];
    for axis in force {
        let (means, slopes) = (windows.mean(axis), windows.slope(axis));
        for (k, (a, b)) in windows.bounds.iter().enumerate() {
            let left = |i: usize| axis[i] - means[k] - slopes[k] * (flight.record.t[i] - windows.t[k]);
            square[k] += (*a..*b).map(|i| left(i).powi(2)).sum::<f64>() / (b - a).saturating_sub(2).max(1) as f64;
        }
    }
    let smooth: Vec<f64> = (0..square.len())
        .map(|k| {
            let (a, b) = (k.saturating_sub(SIDE), (k + SIDE + 1).min(square.len()));
            square[a..b].iter().sum::<f64>() / (b - a) as f64
        })
        .collect();
    let n = smooth.len().max(1) as f64;
    let mean = smooth.iter().sum::<f64>() / n;
    let spread = (smooth.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    let usual = median(&mut smooth.clone());
    (spread > SPREAD * mean && usual > 0.0).then_some((smooth, usual))
}
