//! A polynomial through points with errors on both axes.
//!
//! What it is: weighted least squares, each point's variance being its own plus what the slope makes of its abscissa's; points that
//! stand far out by a robust measure are left out and named; covariance scaled by what the points scatter about the curve.
//! What can go wrong: fewer points than coefficients and two more give no curve.
//! Units: the caller's.
//! Reference: York 1966 (effective variance); Huber & Ronchetti 2009 (bisquare); Hurvich & Tsai 1989 (AICc).

use super::Estimate;
use crate::numeric::order::median;
use crate::numeric::solve::Normal;
use nalgebra::DMatrix;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// A point with its errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Abscissa.
    pub x: f64,
    /// Its standard error.
    pub x_error: f64,
    /// Ordinate.
    pub y: f64,
    /// Its standard error.
    pub y_error: f64,
}

/// A fitted polynomial.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Coefficients from order 0 up.
    pub coefficients: Vec<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Scatter of the points about the curve over what their errors promise, squared; 1 where both agree.
    pub chi2: f64,
    /// Points less coefficients.
    pub freedom: usize,
    /// Positions of the points that were left out.
    pub outliers: Vec<usize>,
    /// Share of the variance that is explained, points weighted alike.
    pub r2: f64,
    /// Points, as they came.
    pub points: Vec<Point>,
}

/// Farthest that a point may stand, in robust standard deviations.
const FAR: f64 = 6.0;

impl Curve {
    /// Fits a degree.
    #[must_use]
    pub fn fit(points: &[Point], degree: usize) -> Option<Self> {
        let k = degree + 1;
        if points.len() < k + 2 {
            return None;
        }
        let mut kept: Vec<bool> = vec![true; points.len()];
        let mut weights = errors(points, &[]);
        let mut solved = solve(points, degree, &weights, &kept)?;
        // errors of the abscissa need the slope; the robust search for outliers needs both
        for _ in 0..3 {
            weights = errors(points, &solved.0);
            kept = inliers(points, degree, &weights)?;
            solved = solve(points, degree, &weights, &kept)?;
        }
        let (coefficients, inverse, rss) = solved;
        let n = kept.iter().filter(|k| **k).count();
        let freedom = n.checked_sub(k).filter(|f| *f > 0)?;
        let chi2 = rss / freedom as f64;
        let mean = points.iter().zip(&kept).filter(|p| *p.1).map(|(p, _)| p.y).sum::<f64>() / n as f64;
        let (mut total, mut left) = (0.0, 0.0);
        for (p, _) in points.iter().zip(&kept).filter(|p| *p.1) {
            total += (p.y - mean).powi(2);
            left += (p.y - value(&coefficients, p.x)).powi(2);
        }
        Some(Self {
            covariance: inverse * chi2.max(1e-12),
            coefficients,
            chi2,
            freedom,
            outliers: (0..points.len()).filter(|i| !kept[*i]).collect(),
            r2: 1.0 - left / total.max(1e-300),
            points: points.to_vec(),
        })
    }

    /// Value of the curve.
    #[must_use]
    pub fn at(&self, x: f64) -> f64 {
        value(&self.coefficients, x)
    }

    /// Standard error of the curve itself.
    #[must_use]
    pub fn error_at(&self, x: f64) -> f64 {
        let powers: Vec<f64> = (0..self.coefficients.len()).map(|k| x.powi(k as i32)).collect();
        let mut sum = 0.0;
        for (i, a) in powers.iter().enumerate() {
            for (j, b) in powers.iter().enumerate() {
                sum += a * b * self.covariance[(i, j)];
            }
        }
        sum.max(0.0).sqrt()
    }

    /// Half width of the 95 % band in which the curve lies.
    #[must_use]
    pub fn band(&self, x: f64) -> f64 {
        self.quantile() * self.error_at(x)
    }

    /// Half width of the 95 % band in which a further plateau of usual error would lie.
    #[must_use]
    pub fn prediction(&self, x: f64) -> f64 {
        let mut variances: Vec<f64> = errors(&self.points, &self.coefficients).iter().map(|w| 1.0 / w).collect();
        let usual = median(&mut variances) * self.chi2;
        self.quantile() * (self.error_at(x).powi(2) + usual).sqrt()
    }

    /// One coefficient with its interval.
    #[must_use]
    pub fn coefficient(&self, k: usize) -> Estimate {
        let se = self.covariance[(k, k)].max(0.0).sqrt();
        Estimate { value: self.coefficients[k], se, half: self.quantile() * se }
    }

    fn quantile(&self) -> f64 {
        StudentsT::new(0.0, 1.0, self.freedom as f64).map_or(1.96, |t| t.inverse_cdf(0.975))
    }

    /// Abscissae of the first and last point.
    #[must_use]
    pub fn range(&self) -> (f64, f64) {
        let xs = self.points.iter().map(|p| p.x);
        (xs.clone().fold(f64::INFINITY, f64::min), xs.fold(f64::NEG_INFINITY, f64::max))
    }
}

fn value(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |s, c| s * x + c)
}

/// Weight of each point: one over its variance, with what a slope makes of the abscissa's error. A point whose error is nearly
/// nothing (a resting rotor) counts no more than ten usual ones.
fn errors(points: &[Point], coefficients: &[f64]) -> Vec<f64> {
    let slope = |x: f64| coefficients.iter().enumerate().skip(1).map(|(k, c)| k as f64 * c * x.powi(k as i32 - 1)).sum::<f64>();
    let variances: Vec<f64> = points.iter().map(|p| p.y_error.powi(2) + (slope(p.x) * p.x_error).powi(2)).collect();
    let usual = median(&mut variances.clone()).max(1e-300);
    variances.iter().map(|v| 1.0 / if v.is_finite() { v.max(0.1 * usual) } else { 1e12 * usual }).collect()
}

type Solved = (Vec<f64>, DMatrix<f64>, f64);

fn solve(points: &[Point], degree: usize, weights: &[f64], kept: &[bool]) -> Option<Solved> {
    let mut normal = Normal::new(degree + 1);
    for ((p, w), _) in points.iter().zip(weights).zip(kept).filter(|p| *p.1) {
        let row: Vec<f64> = (0..=degree).map(|k| p.x.powi(k as i32)).collect();
        normal.add(&row, p.y, *w);
    }
    let s = normal.solve()?;
    // from the residuals: the difference of large sums in `rss` would drown small ones
    let rss = points
        .iter()
        .zip(weights)
        .zip(kept)
        .filter(|p| *p.1)
        .map(|((p, w), _)| w * (p.y - value(&s.coefficients, p.x)).powi(2))
        .sum();
    Some((s.coefficients, s.inverse, rss))
}

/// Points within [`FAR`] robust deviations of a bisquare fit.
fn inliers(points: &[Point], degree: usize, weights: &[f64]) -> Option<Vec<bool>> {
    let all = vec![true; points.len()];
    let mut robust = weights.to_vec();
    let mut off = Vec::new();
    for _ in 0..20 {
        let (c, ..) = solve(points, degree, &robust, &all)?;
        off = points.iter().zip(weights).map(|(p, w)| (p.y - value(&c, p.x)) * w.sqrt()).collect();
        // the residuals of n points about k coefficients are short of the errors by (n - k)/n
        let shrink = (points.len() as f64 / (points.len() - degree - 1) as f64).sqrt();
        let scale = (1.4826 * median(&mut off.iter().map(|v: &f64| v.abs()).collect::<Vec<_>>()) * shrink).max(1e-12);
        off.iter_mut().for_each(|v| *v /= scale);
        robust = weights.iter().zip(&off).map(|(w, v)| w * (1.0 - (v / 6.0).powi(2)).max(0.0).powi(2) + 1e-9 * w).collect();
    }
    let inside: Vec<bool> = off.iter().map(|v| v.abs() <= FAR).collect();
    // a fit that throws out a third has found no curve: then every point counts
    Some(if inside.iter().filter(|k| **k).count() * 3 < points.len() * 2 { all } else { inside })
}

/// What a degree would give.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Order {
    /// Degree.
    pub degree: usize,
    /// Akaike's criterion for few points; less is better.
    pub aicc: f64,
    /// Scatter over promised errors, squared.
    pub chi2: f64,
    /// Whether this is the lowest degree that none beats by more than 2.
    pub chosen: bool,
}

impl Order {
    /// Compares degrees 1 to `highest` on the same points.
    #[must_use]
    pub fn compare(points: &[Point], highest: usize) -> Vec<Self> {
        let mut out: Vec<Self> = (1..=highest)
            .filter_map(|degree| {
                let curve = Curve::fit(points, degree)?;
                let n = (curve.freedom + degree + 1) as f64;
                let k = (degree + 2) as f64;
                let chi2 = curve.chi2 * curve.freedom as f64;
                let room = n - k - 1.0;
                (room > 0.0).then(|| Self {
                    degree,
                    aicc: n * (chi2 / n).max(1e-12).ln() + 2.0 * k + 2.0 * k * (k + 1.0) / room,
                    chi2: curve.chi2,
                    chosen: false,
                })
            })
            .collect();
        let best = out.iter().map(|o| o.aicc).fold(f64::INFINITY, f64::min);
        if let Some(o) = out.iter_mut().find(|o| o.aicc <= best + 2.0) {
            o.chosen = true;
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> Vec<Point> {
        (0..20)
            .map(|i| {
                let x = f64::from(i) * 0.3;
                Point { x, x_error: 0.0, y: 1.0 + 0.5 * x * x + 0.02 * (f64::from(i) * 2.4).sin(), y_error: 0.02 }
            })
            .collect()
    }

    #[test]
    fn a_quadratic_comes_back_and_is_chosen() {
        let p = points();
        let c = Curve::fit(&p, 2).unwrap();
        assert!((c.coefficients[2] - 0.5).abs() < 3.0 * c.coefficient(2).se && c.outliers.is_empty());
        assert!(c.prediction(3.0) > c.band(3.0) && c.band(3.0) > 0.0);
        let chosen: Vec<usize> = Order::compare(&p, 4).iter().filter(|o| o.chosen).map(|o| o.degree).collect();
        assert_eq!(chosen, [2]);
    }

    #[test]
    fn a_point_that_does_not_belong_is_named_and_moves_nothing() {
        let mut p = points();
        let before = Curve::fit(&p, 2).unwrap();
        p[7].y += 3.0;
        let after = Curve::fit(&p, 2).unwrap();
        assert_eq!(after.outliers, [7]);
        assert!((after.coefficients[2] - before.coefficients[2]).abs() < before.coefficient(2).se);
    }
}
