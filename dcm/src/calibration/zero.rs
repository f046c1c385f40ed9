//! Gyro zero at rest.
//!
//! What it is: mean and scatter of the rates while the body rests, with Welford's update, which f32 survives.
//! What can go wrong: motion: the scatter says so.
//! Units: those of the readings.
//! Reference: Welford 1962; Beharie 2013 Eq. 4.1 with errata.

use super::CalibrationError;
use crate::Vec3;
use libm::sqrtf;

/// Readings that a zero needs.
const LEAST: u32 = 100;

/// Collects rates.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GyroZero {
    count: u32,
    mean: Vec3,
    scatter: Vec3,
}

impl GyroZero {
    /// Takes one reading; what is not finite is left out.
    pub fn add(&mut self, rate: &Vec3) {
        if !rate.iter().all(|w| w.is_finite()) {
            return;
        }
        self.count = self.count.saturating_add(1);
        let away = rate - self.mean;
        self.mean += away / self.count as f32;
        self.scatter += away.component_mul(&(rate - self.mean));
    }

    /// Readings so far.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.count
    }

    /// Zero and its standard error on each axis; `noise` is the largest standard deviation that a sensor at rest has.
    ///
    /// # Errors
    /// [`CalibrationError::TooFew`], [`CalibrationError::Moving`].
    pub fn finish(&self, noise: f32) -> Result<(Vec3, Vec3), CalibrationError> {
        if self.count < LEAST {
            return Err(CalibrationError::TooFew { found: self.count, needed: LEAST });
        }
        let deviation = self.scatter.map(|s| sqrtf((s / (self.count - 1) as f32).max(0.0)));
        let worst = deviation.iter().fold(0.0f32, |a, b| a.max(*b));
        if worst > noise {
            return Err(CalibrationError::Moving { scatter: worst });
        }
        Ok((self.mean, deviation / sqrtf(self.count as f32)))
    }
}
