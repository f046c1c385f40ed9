//! What two logs both saw.
//!
//! What it is: a quantity of each as samples over its own clock, and its smooth value and slope at any time.
//! What can go wrong: a channel that hardly changes says nothing of a clock and is left out; across a gap nothing is known.
//! Units: s; the channel's.
//! Reference: local linear regression with a Gaussian kernel, Fan & Gijbels, "Local Polynomial Modelling", 1996.

use crate::log::{Log, SPEED};
use crate::numeric::order::median;

/// A kernel reaches this many widths.
const REACH: f64 = 3.0;
/// A channel must range over so many times what neighbours differ by.
const CHANGES: f64 = 6.0;

/// Samples of one quantity.
#[derive(Debug, Clone)]
pub(crate) struct Signal {
    /// Times, s, rising.
    pub(crate) t: Vec<f64>,
    /// Values.
    pub(crate) v: Vec<f64>,
    /// Usual step, s.
    pub(crate) step: f64,
}

/// One quantity in both logs.
#[derive(Debug, Clone)]
pub(crate) struct Pair {
    /// Name of the stand's channel.
    pub(crate) channel: &'static str,
    /// The stand's.
    pub(crate) stand: Signal,
    /// The second log's.
    pub(crate) other: Signal,
}

impl Signal {
    fn new(log: &Log, name: &str) -> Option<Self> {
        let values = log.column(name)?;
        let kept: Vec<(f64, f64)> = log.t.iter().copied().zip(values.iter().copied()).filter(|(_, v)| v.is_finite()).collect();
        if kept.len() < 50 {
            return None;
        }
        let (t, v): (Vec<f64>, Vec<f64>) = kept.into_iter().unzip();
        // a value that is held over rows is one sample
        let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
        let step = median(&mut steps);
        let signal = Self { t, v, step };
        signal.changes().then_some(signal)
    }

    /// Whether it moves by much more than its noise.
    fn changes(&self) -> bool {
        let mut sorted = self.v.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| sorted[(share * (sorted.len() - 1) as f64) as usize];
        let mut between: Vec<f64> = self.v.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
        let range = at(0.98) - at(0.02);
        range > 0.0 && range > CHANGES * median(&mut between)
    }

    /// Smooth value and slope at a time: a straight line through its neighbourhood of this width; nothing in a gap.
    pub(crate) fn at(&self, t: f64, width: f64) -> Option<(f64, f64)> {
        let reach = REACH * width;
        let from = self.t.partition_point(|u| *u < t - reach);
        let (mut s0, mut s1, mut s2, mut m0, mut m1) = (0.0, 0.0, 0.0, 0.0, 0.0);
        let (mut before, mut after) = (false, false);
        for (u, v) in self.t[from..].iter().zip(&self.v[from..]) {
            let d = u - t;
            if d > reach {
                break;
            }
            let w = (-0.5 * (d / width).powi(2)).exp();
            s0 += w;
            s1 += w * d;
            s2 += w * d * d;
            m0 += w * v;
            m1 += w * d * v;
            before |= d <= 0.0;
            after |= d >= 0.0;
        }
        let det = s0 * s2 - s1 * s1;
        if !before || !after || det < 1e-6 * s0 * s0 * width * width {
            return None;
        }
        Some(((s2 * m0 - s1 * m1) / det, (s0 * m1 - s1 * m0) / det))
    }
}

/// Every quantity that both logs hold and that changes in both, speed first.
pub(crate) fn pairs(stand: &Log, other: &Log) -> Vec<Pair> {
    let speed = |log: &Log| SPEED.into_iter().chain(["rpm_esc"]).find(|n| Signal::new(log, n).is_some());
    let named =
        |log: &Log, name: &'static str, second: &'static str| [name, second].into_iter().find(|n| log.column(n).is_some());
    let mut names = vec![("rpm", speed(stand), speed(other))];
    for (name, second) in [("current_a", "current_esc_a"), ("voltage_v", "voltage_esc_v"), ("thrust_n", "thrust_n")] {
        names.push((name, named(stand, name, second), named(other, name, second)));
    }
    let pair = |(channel, a, b): (&'static str, Option<&str>, Option<&str>)| {
        Some(Pair { channel, stand: Signal::new(stand, a?)?, other: Signal::new(other, b?)? })
    };
    names.into_iter().filter_map(pair).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_its_value_and_slope_everywhere_and_a_gap_has_none() {
        let t: Vec<f64> = (0..100).map(|i| 0.1 * f64::from(i) + if i > 50 { 5.0 } else { 0.0 }).collect();
        let s = Signal { v: t.iter().map(|t| 3.0 + 2.0 * t).collect(), t, step: 0.1 };
        let (v, slope) = s.at(2.03, 0.1).unwrap();
        assert!((v - 7.06).abs() < 1e-9 && (slope - 2.0).abs() < 1e-9);
        assert!(s.at(7.5, 0.1).is_none() && s.at(-1.0, 0.1).is_none());
    }
}
