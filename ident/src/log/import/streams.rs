//! Streams with clocks of their own, brought onto the rows of one.
//!
//! What it is: what was sampled at other instants is taken on the straight line between two samples, or as it last stood.
//! What can go wrong: before the first sample, after the last and across a gap nothing is known, and nothing is filled in.
//! Units: s; those of the values.
//! Reference: none needed.

/// Longest distance of two samples between which anything is known, s.
const GAP_S: f64 = 0.5;

/// Samples of one quantity.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Stream {
    /// Times, s.
    pub(super) t: Vec<f64>,
    /// Values, as many.
    pub(super) v: Vec<f64>,
}

/// How a value between two samples is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Between {
    /// On the straight line.
    Line,
    /// As the earlier one: commands, counters.
    Hold,
}

impl Stream {
    /// The stream on other times.
    pub(super) fn onto(&self, times: &[f64], between: Between) -> Vec<f64> {
        let mut k = 0;
        times.iter().map(|t| self.at(*t, &mut k, between)).collect()
    }

    fn at(&self, t: f64, k: &mut usize, between: Between) -> f64 {
        while *k + 1 < self.t.len() && self.t[*k + 1] <= t {
            *k += 1;
        }
        let (Some(a), Some(va)) = (self.t.get(*k), self.v.get(*k)) else { return f64::NAN };
        if t < *a {
            return f64::NAN;
        }
        let next = self.t.get(*k + 1).zip(self.v.get(*k + 1));
        match next {
            _ if t == *a => *va,
            Some((b, vb)) if b - a <= GAP_S => match between {
                Between::Line => va + (vb - va) * (t - a) / (b - a),
                Between::Hold => *va,
            },
            _ if between == Between::Hold && t - a <= GAP_S => *va,
            _ => f64::NAN,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_holds_and_gaps() {
        let s = Stream { t: vec![1.0, 1.1, 1.2, 3.0], v: vec![0.0, 1.0, 3.0, 9.0] };
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9 || (a.is_nan() && b.is_nan());
        let line = s.onto(&[0.5, 1.0, 1.05, 1.15, 1.3, 2.0, 3.0, 3.2], Between::Line);
        let wanted = [f64::NAN, 0.0, 0.5, 2.0, f64::NAN, f64::NAN, 9.0, f64::NAN];
        assert!(line.iter().zip(wanted).all(|(a, b)| near(*a, b)), "{line:?}");
        let hold = s.onto(&[1.05, 1.3, 2.0, 3.2], Between::Hold);
        assert!(hold.iter().zip([0.0, 3.0, f64::NAN, 9.0]).all(|(a, b)| near(*a, b)), "{hold:?}");
    }
}
