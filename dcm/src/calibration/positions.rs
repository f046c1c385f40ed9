//! Accelerometer from resting positions.
//!
//! What it is: from the mean readings with each axis up and down, offset and gain of each axis, by the
//! errata's formula. From the three 0 g positions of the thesis, offsets only.
//! What can go wrong: a position that does not have the axis up that was asked for is refused, by its number.
//! Units: those of the readings for the offset; the matrix gives m/s^2.
//! Reference: Beharie 2013 Table 4 and Eq. 4.4-4.6 with errata: offset (X+ + X-)/2, gain (X+ - X-)/(2 g).

use super::CalibrationError;
use crate::{Mat3, STANDARD_GRAVITY, Vec3};

/// The result.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SixPositions {
    /// Reading without any force.
    pub offset: Vec3,
    /// Standard error of the offset.
    pub offset_sigma: Vec3,
    /// Gain of each axis, reading per m/s^2.
    pub gain: Vec3,
    /// Standard error of the gain.
    pub gain_sigma: Vec3,
    /// `matrix (reading - offset)` is the specific force, m/s^2.
    pub matrix: Mat3,
    /// Root mean square of what is left, m/s^2: how well the positions were held, and the axes' angles.
    pub residual: f32,
}

/// Readings with +x, -x, +y, -y, +z, -z up, in that order; `noise` is the standard error of each of them.
///
/// # Errors
/// [`CalibrationError::Position`] when a reading has another axis up.
pub fn six_positions(readings: &[Vec3; 6], noise: f32) -> Result<SixPositions, CalibrationError> {
    let mean = readings.iter().sum::<Vec3>() / 6.0;
    for (index, reading) in readings.iter().enumerate() {
        let v = reading - mean;
        let along = v.get(index / 2).copied().unwrap_or(0.0) * if index % 2 == 0 { 1.0 } else { -1.0 };
        if !v.iter().all(|c| c.is_finite()) || along * along < 0.75 * v.dot(&v) || along <= 0.0 {
            return Err(CalibrationError::Position { index: index as u8 });
        }
    }
    let at = |index: usize, axis: usize| readings.get(index).and_then(|r| r.get(axis)).copied().unwrap_or(0.0);
    let pair = |sign: f32| Vec3::from_fn(|axis, _| (at(2 * axis, axis) + sign * at(2 * axis + 1, axis)) / 2.0);
    let (offset, gain) = (pair(1.0), pair(-1.0) / STANDARD_GRAVITY);
    let matrix = Mat3::from_diagonal(&gain.map(|k| 1.0 / k));
    let left = readings.iter().enumerate().map(|(index, reading)| {
        let force = matrix * (reading - offset);
        let up = Vec3::from_fn(|axis, _| {
            if axis != index / 2 {
                0.0
            } else if index % 2 == 0 {
                1.0
            } else {
                -1.0
            }
        });
        let off = force - up * STANDARD_GRAVITY;
        off.dot(&off)
    });
    let sigma = noise * core::f32::consts::FRAC_1_SQRT_2;
    Ok(SixPositions {
        offset,
        offset_sigma: Vec3::repeat(sigma),
        gain,
        gain_sigma: Vec3::repeat(sigma / STANDARD_GRAVITY),
        matrix,
        residual: libm::sqrtf(left.sum::<f32>() / 18.0),
    })
}

/// Offsets from Table 4: each axis level twice. The readings are with z up, x up and y up; each axis is level in two of them.
///
/// # Errors
/// [`CalibrationError::Position`] when a reading does not have its axis up.
pub fn three_positions(readings: &[Vec3; 3]) -> Result<Vec3, CalibrationError> {
    let [z_up, x_up, y_up] = readings;
    for (index, (v, axis)) in [(z_up, 2), (x_up, 0), (y_up, 1)].into_iter().enumerate() {
        let along = v.get(axis).copied().unwrap_or(0.0);
        if !(along > 0.0 && along * along > 0.5 * v.dot(v)) {
            return Err(CalibrationError::Position { index: index as u8 });
        }
    }
    Ok(Vec3::new(z_up.x + y_up.x, z_up.y + x_up.y, x_up.z + y_up.z) / 2.0)
}
