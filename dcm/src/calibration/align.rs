//! Magnetometer axes against the accelerometer's.
//!
//! What it is: wherever the body rests, the angle between field and vertical is the same; the small rotation that makes it so
//! is found from readings in many attitudes by least squares.
//! What can go wrong: attitudes that do not determine the rotation to a degree are refused.
//! Units: rad.
//! Reference: Kok & Schon, IEEE Sensors J. 16(14), 2016, in its simplest form.

use super::CalibrationError;
use super::least_squares::Normal;
use crate::rotation::{Increment, rotate, unit};
use crate::{Mat3, Vec3};
use libm::sqrtf;

const LEAST: u32 = 8;
const STEPS: usize = 6;
/// Largest standard error that is accepted, rad: one degree.
const LARGEST_SIGMA: f32 = 0.0175;

/// The result.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alignment {
    /// Turns a field in magnetometer axes into accelerometer axes.
    pub matrix: Mat3,
    /// The same as a rotation vector, rad.
    pub angle: Vec3,
    /// Its standard errors, rad.
    pub sigma: Vec3,
    /// Root mean square of what is left of the dip, rad.
    pub residual: f32,
}

/// Pairs of calibrated specific force and field, each at rest in another attitude.
///
/// # Errors
/// [`CalibrationError::TooFew`], [`CalibrationError::NoFit`], [`CalibrationError::Coverage`].
pub fn alignment(pairs: &[(Vec3, Vec3)]) -> Result<Alignment, CalibrationError> {
    let found = pairs.len() as u32;
    if found < LEAST {
        return Err(CalibrationError::TooFew { found, needed: LEAST });
    }
    let mut matrix = Mat3::identity();
    let mut sigma = Vec3::zeros();
    let mut residual = 0.0;
    for _ in 0..STEPS {
        let mut normal = Normal::<4>::new();
        for (force, field) in pairs {
            let (Some(down), Some(field)) = (unit(&-force), unit(field)) else { return Err(CalibrationError::NoFit) };
            let field = matrix * field;
            // (m + t x m) d = c: m d = c - t (m x d)
            let arm = field.cross(&down);
            normal.add(&[-arm.x, -arm.y, -arm.z, 1.0], field.dot(&down));
        }
        let solution = normal.solve().ok_or(CalibrationError::Coverage { found: 0.0 })?;
        let [x, y, z, sine] = solution.x;
        let [sx, sy, sz, _] = solution.sigma;
        sigma = Vec3::new(sx, sy, sz);
        residual = solution.rms / sqrtf((1.0 - sine * sine).max(0.01));
        let turn = rotate(&Mat3::identity(), &Vec3::new(x, y, z), Increment::Exponential);
        matrix = turn * matrix;
    }
    let worst = sigma.iter().fold(0.0f32, |a, b| a.max(*b));
    if worst > LARGEST_SIGMA {
        return Err(CalibrationError::Coverage { found: LARGEST_SIGMA / worst });
    }
    let angle = Vec3::new(matrix.m32 - matrix.m23, matrix.m13 - matrix.m31, matrix.m21 - matrix.m12) / 2.0;
    Ok(Alignment { matrix, angle, sigma, residual })
}
