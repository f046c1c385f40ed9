//! A channel's scale from known values: the straight line, its standard errors, and what it leaves over.
//!
//! What it is: classical calibration. The values are known (masses, a meter), the counts carry the error: counts are fitted against values
//! by least squares, and the line is turned round for use.
//! What can go wrong: one value, or one reading whatever the value was, is no line.
//! Units: the channel's own, and counts.
//! Reference: Beharie 2013, Eq. 5.34-5.35 with the errata (slope and offset both); Draper & Smith, "Applied Regression Analysis", section 1.4.

use firmware_rig::rig_config::Calibrated;
use frame::calibration::AdcScale;

/// A known value and what it reads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Known {
    /// The value, in the channel's unit.
    pub(super) value: f64,
    /// Mean counts that it gives.
    pub(super) counts: f64,
    /// Standard error of that mean; 0 where it is not known.
    pub(super) sigma: f64,
}

/// A line through known values: value = (counts - zero) * gain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Line {
    /// Counts at value zero.
    pub(super) zero: f64,
    /// Unit per count.
    pub(super) gain: f64,
    /// Standard error of `zero`, counts.
    pub(super) zero_sigma: f64,
    /// Standard error of `gain`.
    pub(super) gain_sigma: f64,
    /// Root mean square of the residuals over the degrees of freedom, in the unit; 0 for two points.
    pub(super) residual: f64,
    /// Largest residual, in the unit.
    pub(super) worst: f64,
    /// Points used.
    pub(super) points: usize,
}

/// No line goes through the points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NoLine {
    /// Fewer than two different values.
    OneValue,
    /// Different values, one reading.
    OneReading,
}

/// Fewest counts between the lowest and the highest reading.
const FEWEST_COUNTS: f64 = 1.0;

/// The line through `points`. Its standard errors are those of the residuals, or of the readings' own noise where that is more; two
/// points have the noise alone.
///
/// # Errors
/// [`NoLine`].
pub(super) fn line(points: &[Known]) -> Result<Line, NoLine> {
    let n = points.len() as f64;
    let sum = |of: fn(&Known) -> f64| points.iter().map(of).sum::<f64>();
    if points.is_empty() {
        return Err(NoLine::OneValue);
    }
    let (mean_v, mean_c) = (sum(|p| p.value) / n, sum(|p| p.counts) / n);
    let (mut vv, mut vc, mut cc) = (0.0, 0.0, 0.0);
    for point in points {
        let (v, c) = (point.value - mean_v, point.counts - mean_c);
        (vv, vc, cc) = (vv + v * v, vc + v * c, cc + c * c);
    }
    if vv <= 0.0 {
        return Err(NoLine::OneValue);
    }
    if cc < FEWEST_COUNTS || vc == 0.0 {
        return Err(NoLine::OneReading);
    }
    let slope = vc / vv; // counts per unit
    let zero = mean_c - slope * mean_v;
    let residuals = || points.iter().map(|p| (p.counts - zero) / slope - p.value);
    let square: f64 = residuals().map(|r| r * r).sum();
    let freedom = n - 2.0;
    let residual = if freedom > 0.0 { (square / freedom).sqrt() } else { 0.0 };
    let noise = sum(|p| p.sigma * p.sigma) / n;
    let scatter = noise.max(residual * residual * slope * slope).sqrt(); // counts
    Ok(Line {
        zero,
        gain: 1.0 / slope,
        zero_sigma: scatter * (1.0 / n + mean_v * mean_v / vv).sqrt(),
        gain_sigma: scatter / vv.sqrt() / (slope * slope),
        residual,
        worst: residuals().map(f64::abs).fold(0.0, f64::max),
        points: points.len(),
    })
}

impl Line {
    /// As the board takes it, found on a day counted from 1970-01-01 (0: not known).
    pub(super) fn calibrated(&self, day: u16) -> Calibrated {
        Calibrated {
            scale: AdcScale { zero: self.zero as f32, gain: self.gain as f32 },
            zero_sigma: self.zero_sigma as f32,
            gain_sigma: self.gain_sigma as f32,
            residual: self.residual as f32,
            worst: self.worst as f32,
            points: self.points.min(255) as u8,
            day,
        }
    }

    /// What a point is off by, in the unit: reading less value.
    pub(super) fn residual_of(&self, point: &Known) -> f64 {
        (point.counts - self.zero) * self.gain - point.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    fn known(points: &[(f64, f64, f64)]) -> Vec<Known> {
        points.iter().map(|(value, counts, sigma)| Known { value: *value, counts: *counts, sigma: *sigma }).collect()
    }

    /// Draper & Smith's formulas, written out on numbers that a pocket calculator takes.
    #[test]
    fn the_textbooks_line_and_errors() {
        // counts = 10 + 2 value with residuals 1, -2, 1, 0, which are at right angles to both
        let line = line(&known(&[(0.0, 11.0, 0.0), (1.0, 10.0, 0.0), (2.0, 15.0, 0.0), (3.0, 16.0, 0.0)])).unwrap();
        assert!((line.gain - 0.5).abs() < 1e-12 && (line.zero - 10.0).abs() < 1e-12, "{line:?}");
        let s = (6.0f64 / 2.0).sqrt(); // counts
        assert!((line.residual - s / 2.0).abs() < 1e-12 && (line.worst - 1.0).abs() < 1e-12, "{line:?}");
        assert!((line.gain_sigma - s / 5.0f64.sqrt() / 4.0).abs() < 1e-12, "{line:?}");
        assert!((line.zero_sigma - s * (0.25f64 + 2.25 / 5.0).sqrt()).abs() < 1e-12, "{line:?}");
    }

    #[test]
    fn two_points_have_their_readings_noise_and_no_residual() {
        let line = line(&known(&[(0.0, 1400.0, 0.3), (-2.0, 2000.0, 0.4)])).unwrap();
        assert_eq!((line.residual, line.points), (0.0, 2));
        assert!((line.gain + 2.0 / 600.0).abs() < 1e-12 && (line.zero - 1400.0).abs() < 1e-9);
        let pooled = (0.5f64 * (0.09 + 0.16)).sqrt();
        assert!((line.gain_sigma - pooled / 2.0f64.sqrt() / 300.0 / 300.0).abs() < 1e-9, "{line:?}");
    }

    /// What the standard errors promise: of many calibrations with noise, two thirds lie within one.
    #[test]
    fn standard_errors_are_what_they_say() {
        let mut seed = 1u64;
        let mut normal = || {
            (0..12).fold(-6.0, |sum, _| {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                sum + (seed >> 40) as f64 / f64::from(1 << 24)
            })
        };
        let (mut gains, mut zeros) = (0, 0);
        for _ in 0..2000 {
            let points: Vec<Known> = (0..8)
                .map(|i| Known { value: f64::from(i), counts: 500.0 + 40.0 * f64::from(i) + normal(), sigma: 0.0 })
                .collect();
            let line = line(&points).unwrap();
            gains += usize::from((line.gain - 1.0 / 40.0).abs() < line.gain_sigma);
            zeros += usize::from((line.zero - 500.0).abs() < line.zero_sigma);
        }
        // Student's t with six degrees of freedom: 64.4 % within one standard error
        assert!((1230..=1345).contains(&gains) && (1230..=1345).contains(&zeros), "{gains} and {zeros} of 2000");
    }

    #[test]
    fn what_is_no_line_is_refused() {
        assert_eq!(line(&[]), Err(NoLine::OneValue));
        assert_eq!(line(&known(&[(1.0, 500.0, 0.0)])), Err(NoLine::OneValue));
        assert_eq!(line(&known(&[(1.0, 500.0, 0.0), (1.0, 700.0, 0.0)])), Err(NoLine::OneValue));
        assert_eq!(line(&known(&[(0.0, 500.0, 0.0), (1.0, 500.2, 0.0)])), Err(NoLine::OneReading));
    }
}
