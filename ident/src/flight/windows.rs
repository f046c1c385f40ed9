//! The stated filter: what is seen of a flight is its mean over windows that do not overlap.
//!
//! What it is: every channel is the mean of its readings over a window of [`LENGTH_S`] (at least [`FEWEST`] rows); an angular acceleration
//! is the slope of the straight line through the gyro's readings in it. Predictions go through the same window, so that nothing is late;
//! noise is independent from one window to the next.
//! What can go wrong: a window in which a reading that is needed is missing, or across a gap, is left out.
//! Units: s; those of the values.
//! Reference: specification `flight.md`, "The loop on flights" ("smoothed from the gyro by a stated filter").

/// Length of a window, s: some ten times shorter than a quadrotor's own motions.
pub const LENGTH_S: f64 = 0.04;
/// Fewest rows of one.
pub const FEWEST: usize = 4;
/// A step this many times as long as usual is a gap.
const GAP: f64 = 3.5;

/// Windows over the rows of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Windows {
    /// First row of each, and the row after its last.
    pub bounds: Vec<(usize, usize)>,
    /// Middle of each, s.
    pub t: Vec<f64>,
    rows_t: Vec<f64>,
}

impl Windows {
    /// Over rows at times `t`, those that are `usable` alone.
    #[must_use]
    pub fn new(t: &[f64], usable: &[bool]) -> Self {
        let usual = crate::numeric::order::usual_step(t);
        let length = LENGTH_S.max(FEWEST as f64 * usual);
        let rows = ((length / usual).round() as usize).max(FEWEST);
        let mut bounds = Vec::new();
        let mut from = 0;
        while from < t.len() {
            let broken = |i: usize| !usable[i] || (i > from && t[i] - t[i - 1] > GAP * usual);
            match (from..(from + rows).min(t.len())).find(|i| broken(*i)) {
                Some(i) => from = if usable[i] { i } else { i + 1 },
                None => {
                    if from + rows <= t.len() {
                        bounds.push((from, from + rows));
                    }
                    from += rows;
                }
            }
        }
        let middle = |(a, b): &(usize, usize)| t[*a..*b].iter().sum::<f64>() / (b - a) as f64;
        Self { t: bounds.iter().map(middle).collect(), bounds, rows_t: t.to_vec() }
    }

    /// Each of `rows` by itself.
    #[must_use]
    pub fn each(t: &[f64], rows: &[usize]) -> Self {
        Self { bounds: rows.iter().map(|i| (*i, i + 1)).collect(), t: rows.iter().map(|i| t[*i]).collect(), rows_t: t.to_vec() }
    }

    /// Number of windows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.bounds.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bounds.is_empty()
    }

    /// Mean of a value over each window.
    #[must_use]
    pub fn mean(&self, values: &[f64]) -> Vec<f64> {
        self.bounds.iter().map(|(a, b)| values[*a..*b].iter().sum::<f64>() / (b - a) as f64).collect()
    }

    /// Slope of the straight line through a value in each window, 1/s of its unit.
    #[must_use]
    pub fn slope(&self, values: &[f64]) -> Vec<f64> {
        let one = |((a, b), middle): (&(usize, usize), &f64)| {
            let (mut above, mut below) = (0.0, 0.0);
            for (t, v) in self.rows_t[*a..*b].iter().zip(&values[*a..*b]) {
                let x = t - middle;
                above += x * v;
                below += x * x;
            }
            above / below
        };
        self.bounds.iter().zip(&self.t).map(one).collect()
    }

    /// The slope that the straight line would show in a quantity of which `rate` is the rate of change.
    #[must_use]
    pub fn slope_of_rate(&self, rate: &[f64]) -> Vec<f64> {
        let one = |((a, b), middle): (&(usize, usize), &f64)| {
            let (mut sum, mut above, mut below) = (0.0, 0.0, 0.0);
            for i in *a..*b {
                if i > *a {
                    sum += 0.5 * (rate[i] + rate[i - 1]) * (self.rows_t[i] - self.rows_t[i - 1]);
                }
                let x = self.rows_t[i] - middle;
                above += x * sum;
                below += x * x;
            }
            above / below
        };
        self.bounds.iter().zip(&self.t).map(one).collect()
    }

    /// Standard deviation that noise from row to row leaves in the means: from the scatter about the straight line of each window.
    #[must_use]
    pub fn floor_of_mean(&self, values: &[f64]) -> f64 {
        let n = self.rows() as f64;
        self.scatter(values) / n.sqrt()
    }

    /// The same for the slopes.
    #[must_use]
    pub fn floor_of_slope(&self, values: &[f64]) -> f64 {
        let below = self
            .bounds
            .first()
            .zip(self.t.first())
            .map_or(1.0, |((a, b), middle)| self.rows_t[*a..*b].iter().map(|t| (t - middle).powi(2)).sum::<f64>());
        self.scatter(values) / below.sqrt()
    }

    /// Standard deviation of a row's own noise.
    #[must_use]
    pub fn floor_of_row(&self, values: &[f64]) -> f64 {
        self.scatter(values)
    }

    /// Rows of a window.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.bounds.first().map_or(FEWEST, |(a, b)| b - a)
    }

    /// Scatter of the rows about the straight line of their window.
    fn scatter(&self, values: &[f64]) -> f64 {
        let means = self.mean(values);
        let slopes = self.slope(values);
        let squares: Vec<f64> = (0..self.len())
            .map(|k| {
                let (a, b) = self.bounds[k];
                let left = |i: usize| values[i] - means[k] - slopes[k] * (self.rows_t[i] - self.t[k]);
                (a..b).map(|i| left(i).powi(2)).sum::<f64>() / (b as f64 - a as f64 - 2.0)
            })
            .filter(|v| v.is_finite())
            .collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_and_slopes_of_a_parabola() {
        let t: Vec<f64> = (0..1000).map(|i| 0.002 * f64::from(i)).collect();
        let windows = Windows::new(&t, &vec![true; 1000]);
        assert_eq!((windows.len(), windows.rows()), (50, 20));
        let speed: Vec<f64> = t.iter().map(|t| 3.0 * t * t).collect();
        let rate: Vec<f64> = t.iter().map(|t| 6.0 * t).collect();
        for ((seen, through), middle) in windows.slope(&speed).iter().zip(windows.slope_of_rate(&rate)).zip(&windows.t) {
            assert!((seen - through).abs() < 1e-6 && (seen - 6.0 * middle).abs() < 1e-6);
        }
    }

    #[test]
    fn gaps_and_missing_rows_are_left_out() {
        let t: Vec<f64> = (0..100).map(|i| 0.01 * f64::from(i) + if i >= 50 { 0.5 } else { 0.0 }).collect();
        let mut usable = vec![true; 100];
        usable[10] = false;
        let windows = Windows::new(&t, &usable);
        assert!(windows.bounds.iter().all(|(a, b)| b - a == 4 && !(*a..*b).contains(&10) && !(*a < 50 && *b > 50)));
        assert_eq!(windows.bounds[2], (11, 15));
    }

    /// White noise in the gyro: the floor of the slopes is what their scatter is.
    #[test]
    fn the_floors_are_those_of_the_noise() {
        let mut s = 3u64;
        let mut noise = move || {
            s ^= s << 13;
            s ^= s >> 7;
            s ^= s << 17;
            (s >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let t: Vec<f64> = (0..20_000).map(|i| 0.002 * f64::from(i)).collect();
        let values: Vec<f64> = t.iter().map(|t| t.sin() + noise()).collect();
        let windows = Windows::new(&t, &vec![true; t.len()]);
        let off = |seen: Vec<f64>, truth: &dyn Fn(f64) -> f64| {
            let squares: f64 = seen.iter().zip(&windows.t).map(|(v, t)| (v - truth(*t)).powi(2)).sum();
            (squares / seen.len() as f64).sqrt()
        };
        let slope = off(windows.slope(&values), &f64::cos);
        assert!((windows.floor_of_slope(&values) / slope - 1.0).abs() < 0.1, "{slope} {}", windows.floor_of_slope(&values));
        let mean = off(windows.mean(&values), &f64::sin);
        assert!((windows.floor_of_mean(&values) / mean - 1.0).abs() < 0.1, "{mean}");
    }
}
