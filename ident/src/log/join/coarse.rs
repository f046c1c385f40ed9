//! Where in the stand's log the second log begins, to a fraction of a second.
//!
//! What it is: both as means over bins of equal length; at every lag the correlation over what both then saw.
//! What can go wrong: a schedule that repeats itself correlates at several lags: the best few are handed on.
//! Units: s.
//! Reference: normalised cross-correlation.

use super::signal::{Pair, Signal};

/// Most bins of a log.
const BINS: usize = 3000;
/// Least share of the shorter log that both must have seen, and least time, s.
const OVERLAP: (f64, f64) = (0.3, 5.0);
/// How many lags are handed on.
const KEEP: usize = 4;

/// The most likely lags (stand time less other time), best first.
pub(super) fn lags(pairs: &[Pair]) -> Vec<f64> {
    let length = |s: &Signal| s.t[s.t.len() - 1] - s.t[0];
    let longest = pairs.iter().flat_map(|p| [length(&p.stand), length(&p.other)]).fold(0.0, f64::max);
    let coarsest = pairs.iter().flat_map(|p| [p.stand.step, p.other.step]).fold(0.0, f64::max);
    let bin = (longest / BINS as f64).max(coarsest).max(0.05);
    let mut found: Vec<(f64, f64)> = Vec::new();
    for pair in pairs {
        let (a, b) = (binned(&pair.stand, bin), binned(&pair.other, bin));
        let least = ((OVERLAP.0 * a.len().min(b.len()) as f64) as usize).max((OVERLAP.1 / bin) as usize);
        let scores: Vec<f64> = (0..a.len() + b.len()).map(|k| correlation(&a, &b, k as i64 - b.len() as i64, least)).collect();
        let mut order: Vec<usize> = (1..scores.len().saturating_sub(1))
            .filter(|k| scores[*k] > 0.3 && scores[*k] >= scores[k - 1] && scores[*k] >= scores[k + 1])
            .collect();
        order.sort_by(|x, y| scores[*y].total_cmp(&scores[*x]));
        let lag = |k: usize| (k as f64 - b.len() as f64) * bin + pair.stand.t[0] - pair.other.t[0];
        found.extend(order.into_iter().take(KEEP).map(|k| (scores[k], lag(k))));
    }
    found.sort_by(|x, y| y.0.total_cmp(&x.0));
    let mut kept: Vec<f64> = Vec::new();
    for (_, lag) in found {
        if kept.len() < KEEP && kept.iter().all(|k| (k - lag).abs() > 1.0) {
            kept.push(lag);
        }
    }
    kept
}

/// Means over bins; an empty bin is missing. Spikes are cut to the range of most samples.
fn binned(signal: &Signal, bin: f64) -> Vec<f64> {
    let mut sorted = signal.v.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let (low, high) = (sorted[sorted.len() / 100], sorted[sorted.len() - 1 - sorted.len() / 100]);
    let count = ((signal.t[signal.t.len() - 1] - signal.t[0]) / bin) as usize + 1;
    let mut sums = vec![(0.0, 0.0); count];
    for (t, v) in signal.t.iter().zip(&signal.v) {
        let sum = &mut sums[(((t - signal.t[0]) / bin) as usize).min(count - 1)];
        *sum = (sum.0 + v.clamp(low, high), sum.1 + 1.0);
    }
    sums.into_iter().map(|(sum, n)| if n > 0.0 { sum / n } else { f64::NAN }).collect()
}

/// Correlation of `a[i + lag]` with `b[i]` over bins that both hold.
fn correlation(a: &[f64], b: &[f64], lag: i64, least: usize) -> f64 {
    let from = (-lag).max(0) as usize;
    let to = (a.len() as i64 - lag).clamp(0, b.len() as i64) as usize;
    if to < from + least {
        return 0.0;
    }
    let (mut n, mut sx, mut sy, mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (i, y) in b.iter().enumerate().take(to).skip(from) {
        let x = a[(i as i64 + lag) as usize];
        if x.is_finite() && y.is_finite() {
            n += 1.0;
            sx += x;
            sy += y;
            xx += x * x;
            yy += y * y;
            xy += x * y;
        }
    }
    let (vx, vy) = (xx - sx * sx / n, yy - sy * sy / n);
    if n < least as f64 || vx <= 0.0 || vy <= 0.0 { 0.0 } else { (xy - sx * sy / n) / (vx * vy).sqrt() }
}
