//! What a channel reads at a value of another: a curve through medians.
//!
//! What it is: medians in bins of the regressor, each checked against its neighbours, and straight lines between them.
//! What can go wrong: a bin whose larger part is bad is replaced by what its neighbours say, which is right to their curvature only.
//! Units: as the two channels.
//! Reference: Tukey 1977 (running medians).

use super::excursion::LONGEST;
use crate::numeric::order::median;

/// Most bins: those of a staircase of 50 us and as many between.
const BINS: usize = 48;
/// Fewest samples of a bin.
const FEWEST: usize = 5;

/// A curve.
pub(crate) struct Curve(Vec<(f64, f64)>);

impl Curve {
    /// Through pairs of regressor and reading; `None` for too few.
    pub(crate) fn through(mut pairs: Vec<(f64, f64)>) -> Option<Self> {
        pairs.retain(|p| p.0.is_finite() && p.1.is_finite());
        if pairs.len() < 4 * FEWEST {
            return None;
        }
        pairs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let span = pairs[pairs.len() - 1].0 - pairs[0].0;
        let (low, width) = (pairs[0].0, (span / BINS as f64).max(1e-12));
        let bin = |x: f64| ((x - low) / width) as usize;
        let mut of_bins: Vec<(f64, f64)> = Vec::new();
        let mut sure = Vec::new();
        for part in pairs.chunk_by(|a, b| bin(a.0) == bin(b.0)).filter(|p| p.len() >= FEWEST) {
            let of = |pick: fn(&(f64, f64)) -> f64| median(&mut part.iter().map(pick).collect::<Vec<_>>());
            of_bins.push((of(|p| p.0), of(|p| p.1)));
            sure.push(part.len() > 2 * LONGEST);
        }
        (!of_bins.is_empty()).then(|| Self(checked(&of_bins, &sure)))
    }

    /// The value up to which its first line reaches.
    pub(crate) fn first_line(&self) -> f64 {
        self.0.get(1).or(self.0.first()).map_or(f64::NEG_INFINITY, |p| p.0)
    }

    /// The reading at a value: straight lines between the points, the last ones beyond.
    pub(crate) fn at(&self, x: f64) -> f64 {
        let after = self.0.partition_point(|p| p.0 < x);
        match (after.checked_sub(1).map(|k| self.0[k]), self.0.get(after)) {
            (Some(a), Some(b)) => line(a, *b, x),
            (Some(a), None) => a.1,
            (None, b) => b.map_or(0.0, |b| b.1),
        }
    }
}

/// Each point, or what its neighbours say where two of them agree that it is another: the median of three. What is `sure` has more samples
/// than a drop-out lasts.
fn checked(points: &[(f64, f64)], sure: &[bool]) -> Vec<(f64, f64)> {
    let get = |k: usize, by: isize| k.checked_add_signed(by).and_then(|k| points.get(k)).copied();
    let say = |k: usize, a: isize, b: isize| Some(line(get(k, a)?, get(k, b)?, points[k].0));
    let of = |k: usize| {
        if sure[k] {
            return points[k];
        }
        let (between, above, below) = (say(k, -1, 1), say(k, 1, 2), say(k, -1, -2));
        let others = match (between, above, below) {
            (Some(a), Some(b), Some(c)) => [a, 0.5 * (b + c)],
            (Some(a), Some(b), None) | (Some(a), None, Some(b)) => [a, b],
            (None, _, Some(b)) => [b, say(k, -1, -3).unwrap_or(points[k].1)],
            (None, Some(b), _) => [b, say(k, 1, 3).unwrap_or(points[k].1)],
            _ => return points[k],
        };
        let mut three = [points[k].1, others[0], others[1]];
        (points[k].0, median(&mut three))
    };
    (0..points.len()).map(of).collect()
}

fn line(a: (f64, f64), b: (f64, f64), x: f64) -> f64 {
    a.1 + (b.1 - a.1) * (x - a.0) / (b.0 - a.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_that_is_bad_for_the_most_part_does_not_bend_the_curve() {
        let square = |x: f64| 0.1 * x * x;
        let pairs = |bad: usize| -> Vec<(f64, f64)> {
            let level = |i: usize| 10.0 + (i / 40) as f64;
            (0..800).map(|i| (level(i), if i / 40 == bad && i % 40 > 10 { 0.0 } else { square(level(i)) })).collect()
        };
        for bad in [0, 7, 19] {
            let curve = Curve::through(pairs(bad)).expect("enough");
            let x = 10.0 + bad as f64;
            assert!((curve.at(x) / square(x) - 1.0).abs() < 0.1, "{bad}: {} for {}", curve.at(x), square(x));
        }
    }
}
