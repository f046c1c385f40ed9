//! Calibration of the three sensors.
//!
//! What it is: gyro zero at rest ([`GyroZero`]), accelerometer from six positions ([`six_positions`]) or from the three 0 g
//! positions of the thesis ([`three_positions`]), magnetometer ellipsoid ([`ellipsoid`]), magnetometer axes against the
//! accelerometer's ([`alignment`]); and [`Calibration`], which applies them. Board and host call the same functions.
//! What can go wrong: motion, too few readings, poor coverage: refused with a [`CalibrationError`] that says what is missing.
//! Every result carries its standard errors and residual.
//! Units: those of the readings, and said at each field.
//! Reference: Beharie 2013 section 4.2.7, Table 4 and Eq. 4.4-4.6, 4.15-4.16 with errata.

mod align;
mod collect;
mod ellipsoid;
mod least_squares;
mod positions;
mod zero;

pub use align::{Alignment, alignment};
pub use collect::{Collector, coverage};
pub use ellipsoid::{Ellipsoid, ellipsoid};
pub use positions::{SixPositions, six_positions, three_positions};
pub use zero::GyroZero;

use crate::{Mat3, Vec3};

/// Share of all directions that a magnetometer calibration must have seen.
pub const LEAST_COVERAGE: f32 = 0.75;

/// Why a calibration is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum CalibrationError {
    /// Fewer readings than the unknowns need.
    TooFew {
        /// Readings that were there.
        found: u32,
        /// Readings that are needed.
        needed: u32,
    },
    /// The body moved: the readings scatter by more than the sensor's noise.
    Moving {
        /// Scatter, in the unit of the readings.
        scatter: f32,
    },
    /// Directions are missing: turn the sensor further.
    Coverage {
        /// Share of all directions that was seen.
        found: f32,
    },
    /// A position does not look like the one that was asked for (wrong axis, or not at rest).
    Position {
        /// Which, from 0.
        index: u8,
    },
    /// The readings lie on no ellipsoid, or do not determine it.
    NoFit,
}

/// What turns readings into right ones: `matrix (reading - offset)` for each sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibration {
    /// Gyro zero, rad/s.
    pub gyro_offset: Vec3,
    /// Accelerometer offset, m/s^2.
    pub accel_offset: Vec3,
    /// Accelerometer gains (the inverse of what the sensor does) and axes.
    pub accel_matrix: Mat3,
    /// Hard iron, uT.
    pub mag_offset: Vec3,
    /// Soft iron and axes.
    pub mag_matrix: Mat3,
}

impl Default for Calibration {
    fn default() -> Self {
        Self {
            gyro_offset: Vec3::zeros(),
            accel_offset: Vec3::zeros(),
            accel_matrix: Mat3::identity(),
            mag_offset: Vec3::zeros(),
            mag_matrix: Mat3::identity(),
        }
    }
}

/// Numbers in a calibration.
pub const CALIBRATION_WORDS: usize = 27;

impl Calibration {
    /// A right rate, rad/s.
    #[must_use]
    pub fn gyro(&self, reading: &Vec3) -> Vec3 {
        reading - self.gyro_offset
    }

    /// A right specific force, m/s^2.
    #[must_use]
    pub fn accel(&self, reading: &Vec3) -> Vec3 {
        self.accel_matrix * (reading - self.accel_offset)
    }

    /// A right field, uT.
    #[must_use]
    pub fn mag(&self, reading: &Vec3) -> Vec3 {
        self.mag_matrix * (reading - self.mag_offset)
    }

    /// As words, for storing.
    #[must_use]
    pub fn to_words(&self) -> [u32; CALIBRATION_WORDS] {
        let all = self.gyro_offset.iter().chain(self.accel_offset.iter()).chain(self.accel_matrix.iter());
        let all = all.chain(self.mag_offset.iter()).chain(self.mag_matrix.iter());
        let mut words = [0; CALIBRATION_WORDS];
        for (slot, value) in words.iter_mut().zip(all) {
            *slot = value.to_bits();
        }
        words
    }

    /// From words; `None` when one is not finite.
    #[must_use]
    pub fn from_words(words: &[u32; CALIBRATION_WORDS]) -> Option<Self> {
        let mut values = words.iter().map(|w| f32::from_bits(*w));
        let mut out = Self::default();
        let Self { gyro_offset, accel_offset, accel_matrix, mag_offset, mag_matrix } = &mut out;
        let all = gyro_offset.iter_mut().chain(accel_offset.iter_mut()).chain(accel_matrix.iter_mut());
        for slot in all.chain(mag_offset.iter_mut()).chain(mag_matrix.iter_mut()) {
            *slot = values.next().filter(|v| v.is_finite())?;
        }
        Some(out)
    }
}
