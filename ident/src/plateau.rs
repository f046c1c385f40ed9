//! Plateaus: stretches in which the rig stands still at one level.
//!
//! What it is: command steps (or, without a command, speed steps) cut the run; settling rows are dropped; every channel is
//! averaged with a standard error that accounts for its colour.
//! What can go wrong: a ramp has no plateaus, and none are invented.
//! Units: as the columns; seconds.
//! Reference: specification `identification.md`, item 2; Beharie 2013, section 5.7.3.

use crate::context::Context;
use crate::log::Log;
use crate::noise::median;

/// One plateau.
#[derive(Debug, Clone, PartialEq)]
pub struct Plateau {
    /// First settled instant, s.
    pub from_s: f64,
    /// Last instant, s.
    pub to_s: f64,
    /// Rows that were averaged.
    pub rows: usize,
    /// Mean and standard error of each column of the log, `None` where the plateau holds no sample of it.
    pub means: Vec<Option<(f64, f64)>>,
}

/// Finds the plateaus of a log.
#[must_use]
pub fn plateaus(context: &Context, log: &Log) -> Vec<Plateau> {
    context
        .steady
        .iter()
        .filter_map(|(from, to)| {
            let start = from + settled_after(context, *from, *to);
            if to - start < 5 {
                return None;
            }
            let means = log.columns.iter().map(|c| mean_with_error(&c.values[start..*to])).collect();
            Some(Plateau { from_s: log.t[start], to_s: log.t[to - 1], rows: to - start, means })
        })
        .collect()
}

/// Rows at the head of a stretch in which the speed is still on its way: until it stays within three standard deviations of
/// the second half's median.
fn settled_after(context: &Context, from: usize, to: usize) -> usize {
    if context.rpm.is_empty() {
        return 0;
    }
    let z = &context.rpm[from..to];
    let mut late: Vec<f64> = z[z.len() / 2..].to_vec();
    let level = median(&mut late);
    let mut deviation: Vec<f64> = z[z.len() / 2..].iter().map(|v| (v - level).abs()).collect();
    let spread = (1.4826 * median(&mut deviation)).max(1e-4 * level.abs()).max(1e-9);
    let unsettled = z.iter().take(z.len() / 2).rposition(|v| (v - level).abs() > 5.0 * spread);
    // isolated spikes late in the first half are not settling
    unsettled.filter(|k| z[..=*k].iter().filter(|v| (*v - level).abs() > 5.0 * spread).count() * 2 > *k).map_or(0, |k| k + 1)
}

/// Mean of the finite values and its standard error with a first-order correction for colour.
fn mean_with_error(values: &[f64]) -> Option<(f64, f64)> {
    let v: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    if v.len() < 3 {
        return None;
    }
    let n = v.len() as f64;
    let mean = v.iter().sum::<f64>() / n;
    let c0 = v.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
    let c1 = v.windows(2).map(|w| (w[0] - mean) * (w[1] - mean)).sum::<f64>() / n;
    let rho = if c0 > 0.0 { (c1 / c0 + 1.0 / n).clamp(0.0, 0.95) } else { 0.0 };
    Some((mean, (c0 / (n - 1.0) * (1.0 + rho) / (1.0 - rho)).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Column;

    #[test]
    fn a_staircase_with_a_lag_gives_its_levels() {
        let n = 1200;
        let t: Vec<f64> = (0..n).map(|i| f64::from(i) * 0.1).collect();
        let pulse: Vec<f64> = (0..n).map(|i| 1100.0 + 50.0 * f64::from(i / 200)).collect();
        let mut rpm = Vec::new();
        let mut s = 0.0;
        for p in &pulse {
            s += (3.0 * (p - 1000.0) - s) * 0.2;
            rpm.push(s);
        }
        let log = Log {
            t,
            columns: vec![Column { name: "pulse_us".into(), values: pulse }, Column { name: "rpm".into(), values: rpm }],
            ..Log::default()
        };
        let context = Context::new(&log, None);
        let found = plateaus(&context, &log);
        assert_eq!(found.len(), 6);
        for (k, p) in found.iter().enumerate() {
            let (mean, _) = p.means[1].unwrap();
            assert!((mean - 3.0 * (100.0 + 50.0 * k as f64)).abs() < 0.5, "{k}: {mean}");
            assert!(p.rows > 100);
        }
    }
}
