//! What goes into a filter and what it says about each step.
//!
//! What it is: the readings of one instant, and the flags of one step.
//! What can go wrong: nothing here; the flags name it.
//! Units: rad/s, m/s^2; microtesla for the field (the classic filter takes any unit).
//! Reference: specification `ahrs.md`, "Attitude"; f = a - g, at rest and level f = (0, 0, -g) in body axes FRD.

use crate::Vec3;

/// Readings of one instant in body axes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Measurement {
    /// Body rates, rad/s.
    pub gyro: Option<Vec3>,
    /// Specific force, m/s^2.
    pub accel: Option<Vec3>,
    /// Magnetic field, uT (the classic filter takes any unit).
    pub mag: Option<Vec3>,
}

/// What one step did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Step {
    /// The gyro turned the matrix.
    pub gyro_used: bool,
    /// The accelerometer's reading was taken: added to what corrects the tilt.
    pub accel_used: bool,
    /// The magnetometer corrected it; of a fast one not every reading does.
    pub mag_used: bool,
    /// The attitude was set from accelerometer (and magnetometer) instead of being corrected.
    pub started: bool,
    /// A reading was not finite or had no direction, or the time step was not positive and finite.
    pub bad_input: bool,
    /// A reading lay at or beyond the end of the sensor's range.
    pub overrange: bool,
}
