//! Mass calibration of the load cell.
//!
//! What it is: up to sixteen known masses with the counts they give, and the straight line through them: exact for two points,
//! least squares for more, with the residuals.
//! What can go wrong: fewer than two different readings, or a slope that is not within a factor of four of the design's, is refused:
//! a mass that was forgotten must not become a calibration.
//! Units: gram in, counts, newton out; a mass that pulls down as the motor's weight does reads as negative thrust.
//! Reference: Beharie 2013, Eq. 5.34-5.36 with the errata (slope and offset both; F = y g / 1000).

use frame::calibration::AdcScale;
use frame::message::MassFit;
use heapless::Vec;

/// Standard gravity, m/s^2.
const G: f64 = 9.806_65;
/// Points that are kept.
const MOST: usize = 16;
/// Largest mass that is taken, gram: the beam's margin is far below.
const HEAVIEST_G: f32 = 20_000.0;
/// Largest ratio between the fitted slope and the design's.
const PLAUSIBLE: f32 = 4.0;

/// Masses and their readings.
#[derive(Debug, Clone, Default)]
pub struct MassPoints {
    points: Vec<(f32, f32), MOST>,
}

impl MassPoints {
    /// None yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { points: Vec::new() }
    }

    /// Takes a mass and the mean counts that it gives; gives the number of points.
    ///
    /// # Errors
    /// `()` when the mass is impossible or there is no room.
    #[allow(clippy::result_unit_err)] // the caller answers with its own reasons
    pub fn take(&mut self, mass_g: f32, counts: f32) -> Result<u8, ()> {
        if !mass_g.is_finite() || !(-HEAVIEST_G..=HEAVIEST_G).contains(&mass_g) || !counts.is_finite() {
            return Err(());
        }
        self.points.push((mass_g, counts)).map_err(|_| ())?;
        Ok(self.points.len() as u8)
    }

    /// Forgets all of them.
    pub fn forget(&mut self) {
        self.points.clear();
    }

    /// The line through the points.
    ///
    /// # Errors
    /// `()` with fewer than two different readings, or when the slope is implausible beside `design`.
    #[allow(clippy::result_unit_err)]
    pub fn fit(&self, design: &AdcScale) -> Result<MassFit, ()> {
        let n = self.points.len() as f64;
        let newton = |mass_g: f32| -f64::from(mass_g) * G / 1000.0;
        let sums = self.points.iter().fold((0.0, 0.0), |(x, y), (m, c)| (x + f64::from(*c), y + newton(*m)));
        let (mean_x, mean_y) = if n > 0.0 { (sums.0 / n, sums.1 / n) } else { return Err(()) };
        let (mut xx, mut xy) = (0.0, 0.0);
        for (mass, counts) in &self.points {
            let (dx, dy) = (f64::from(*counts) - mean_x, newton(*mass) - mean_y);
            xx += dx * dx;
            xy += dx * dy;
        }
        if xx < 1.0 {
            return Err(()); // one reading, whatever the masses were
        }
        let gain = xy / xx;
        let ratio = libm::fabs(gain) as f32 / libm::fabsf(design.gain);
        if !(1.0 / PLAUSIBLE..=PLAUSIBLE).contains(&ratio) {
            return Err(());
        }
        let zero = mean_x - mean_y / gain;
        let (mut square, mut worst) = (0.0, 0.0f64);
        for (mass, counts) in &self.points {
            let residual = libm::fabs(newton(*mass) - (f64::from(*counts) - zero) * gain);
            square += residual * residual;
            worst = if residual > worst { residual } else { worst };
        }
        let freedom = n - 2.0;
        let residual_n = if freedom > 0.0 { libm::sqrt(square / freedom) } else { 0.0 };
        Ok(MassFit {
            gain: gain as f32,
            zero: zero as f32,
            residual_n: residual_n as f32,
            worst_n: worst as f32,
            points: self.points.len() as u8,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DESIGN: AdcScale = AdcScale { zero: 1427.0, gain: -0.003_66 };

    fn points(list: &[(f32, f32)]) -> MassPoints {
        let mut points = MassPoints::new();
        list.iter().for_each(|(mass, counts)| {
            points.take(*mass, *counts).unwrap();
        });
        points
    }

    /// Errata, Eq. 5.35: grams = 231.37 V - 531.81 in volts after the amplifier; half of it at the 3.3 V converter.
    fn thesis_counts(grams: f32) -> f32 {
        (grams + 531.81) / 231.37 * 0.5 / 3.3 * 4096.0
    }

    #[test]
    fn two_points_give_the_line_of_the_thesis() {
        let fit = points(&[(0.0, thesis_counts(0.0)), (500.0, thesis_counts(500.0))]).fit(&DESIGN).unwrap();
        let per_gram = 0.009_806_65 / fit.gain.abs();
        assert!((per_gram - 2.682).abs() < 0.002, "{per_gram} counts a gram");
        assert!((fit.zero - thesis_counts(0.0)).abs() < 0.01);
        assert!(fit.gain < 0.0, "a mass that pulls down is negative thrust");
        assert_eq!((fit.residual_n, fit.points), (0.0, 2));
        assert!(fit.worst_n < 1e-4);
    }

    #[test]
    fn least_squares_tells_its_residuals() {
        let off = [0.8f32, -1.1, 0.3, 1.6, -1.4, -0.2];
        let list: std::vec::Vec<(f32, f32)> =
            off.iter().enumerate().map(|(i, e)| (i as f32 * 150.0, thesis_counts(i as f32 * 150.0) + e)).collect();
        let fit = points(&list).fit(&DESIGN).unwrap();
        // the textbook's normal equations, in another form
        let n = list.len() as f64;
        let (mut sx, mut sy, mut sxx, mut sxy) = (0.0, 0.0, 0.0, 0.0);
        for (m, c) in &list {
            let (x, y) = (f64::from(*c), -f64::from(*m) * 9.806_65e-3);
            (sx, sy, sxx, sxy) = (sx + x, sy + y, sxx + x * x, sxy + x * y);
        }
        let gain = (n * sxy - sx * sy) / (n * sxx - sx * sx);
        let offset = (sy - gain * sx) / n;
        let rss: f64 = list.iter().map(|(m, c)| (-f64::from(*m) * 9.806_65e-3 - offset - gain * f64::from(*c)).powi(2)).sum();
        assert!((f64::from(fit.gain) / gain - 1.0).abs() < 1e-6);
        assert!((f64::from(fit.residual_n) / (rss / (n - 2.0)).sqrt() - 1.0).abs() < 1e-3);
        assert!(fit.worst_n > fit.residual_n && fit.worst_n < 0.01);
    }

    #[test]
    fn what_is_no_calibration_is_refused() {
        assert!(points(&[]).fit(&DESIGN).is_err());
        assert!(points(&[(100.0, 1500.0)]).fit(&DESIGN).is_err(), "one point");
        assert!(points(&[(0.0, 1500.0), (500.0, 1500.2)]).fit(&DESIGN).is_err(), "the mass was not hung on");
        assert!(points(&[(0.0, 1500.0), (5.0, 2800.0)]).fit(&DESIGN).is_err(), "a slope a hundred times too flat");
        let mut full = MassPoints::new();
        assert!(full.take(f32::NAN, 1.0).is_err());
        assert!(full.take(1e9, 1.0).is_err());
        for i in 0..16 {
            assert_eq!(full.take(1.0, 1.0), Ok(i + 1));
        }
        assert!(full.take(1.0, 1.0).is_err(), "full");
    }
}
