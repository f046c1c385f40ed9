//! Magnetometer: hard and soft iron.
//!
//! What it is: the ellipsoid through the readings, all nine parameters: r = |W (m - b)| - 1 made small by Gauss-Newton with
//! damping, from the best sphere.
//! What can go wrong: too few readings, directions missing, no ellipsoid: refused. A rotation of the axes cannot be seen by this
//! (that is what [`super::alignment`] is for): W is symmetric.
//! Units: the readings' for offset and residual; the matrix has none and determinant 1, so that the mean field keeps its size.
//! Reference: Renaudin, Afzal & Lachapelle, J. Sensors 2010, 967245 (the geometric form of the fit).

use super::collect::coverage;
use super::least_squares::Normal;
use super::{CalibrationError, LEAST_COVERAGE};
use crate::linear::{determinant, square};
use crate::{Mat3, Vec3};
use libm::{cbrtf, sqrtf};

/// Readings that nine parameters need to have errors worth stating.
const LEAST: u32 = 40;
/// Largest residual, as a share of the field.
const LARGEST_RESIDUAL: f32 = 0.1;
const STEPS: usize = 20;

/// The result.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipsoid {
    /// Hard iron.
    pub offset: Vec3,
    /// Its standard errors.
    pub offset_sigma: Vec3,
    /// `matrix (reading - offset)` lies on a sphere.
    pub matrix: Mat3,
    /// Standard errors of xx, yy, zz, xy, xz, yz of the matrix.
    pub matrix_sigma: [f32; 6],
    /// Radius of that sphere.
    pub norm: f32,
    /// Root mean square distance from it.
    pub residual: f32,
    /// Share of all directions that the readings cover.
    pub coverage: f32,
}

/// Fits the readings.
///
/// # Errors
/// [`CalibrationError::TooFew`], [`CalibrationError::NoFit`], [`CalibrationError::Coverage`].
pub fn ellipsoid(readings: &[Vec3]) -> Result<Ellipsoid, CalibrationError> {
    let found = readings.len() as u32;
    if found < LEAST {
        return Err(CalibrationError::TooFew { found, needed: LEAST });
    }
    if readings.iter().any(|m| !m.iter().all(|c| c.is_finite())) {
        return Err(CalibrationError::NoFit);
    }
    let mean = readings.iter().sum::<Vec3>() / found as f32;
    let size = sqrtf(readings.iter().map(|m| square(&(m - mean))).sum::<f32>() / found as f32);
    if size.is_nan() || size <= 0.0 {
        return Err(CalibrationError::NoFit);
    }
    let scaled = || readings.iter().map(|m| (m - mean) / size);

    let (mut b, mut w) = sphere(scaled()).ok_or_else(|| refused(readings, &mean))?;
    let mut sigma = [0.0; 9];
    let mut best = cost(scaled(), &b, &w);
    let mut damping = 1e-3f32;
    for _ in 0..STEPS {
        let mut normal = Normal::<9>::new();
        for x in scaled() {
            let (row, residual) = row(&x, &b, &w);
            normal.add(&row, -residual);
        }
        let Some(step) = normal.damped(damping).solve() else { break };
        let [bx, by, bz, xx, yy, zz, xy, xz, yz] = step.x;
        let next_b = b + Vec3::new(bx, by, bz);
        let next_w = w + Mat3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let next = cost(scaled(), &next_b, &next_w);
        if next.is_finite() && next <= best {
            (b, w) = (next_b, next_w);
            damping *= 0.1;
            let done = best - next < 1e-6 * best;
            best = next;
            if done {
                break;
            }
        } else {
            damping = (damping * 10.0).max(1e-6);
        }
    }
    let mut normal = Normal::<9>::new();
    for x in scaled() {
        let (row, residual) = row(&x, &b, &w);
        normal.add(&row, -residual);
    }
    sigma.copy_from_slice(&normal.solve().ok_or_else(|| refused(readings, &mean))?.sigma);

    let volume = determinant(&w);
    if volume.is_nan() || volume <= 0.0 {
        return Err(CalibrationError::NoFit);
    }
    let radius = 1.0 / cbrtf(volume);
    let matrix = w * radius;
    let offset = mean + b * size;
    let coverage = coverage(readings.iter().map(|m| matrix * (m - offset)));
    let residual = sqrtf(best / found as f32);
    if residual > LARGEST_RESIDUAL {
        return Err(CalibrationError::NoFit);
    }
    if coverage < LEAST_COVERAGE {
        return Err(CalibrationError::Coverage { found: coverage });
    }
    let [sx, sy, sz, rest @ ..] = sigma;
    Ok(Ellipsoid {
        offset,
        offset_sigma: Vec3::new(sx, sy, sz) * size,
        matrix,
        matrix_sigma: rest.map(|s| s * radius),
        norm: radius * size,
        residual: residual * radius * size,
        coverage,
    })
}

/// A fit that is not determined lacks directions, or is none.
fn refused(readings: &[Vec3], centre: &Vec3) -> CalibrationError {
    let found = coverage(readings.iter().map(|m| m - centre));
    if found < LEAST_COVERAGE { CalibrationError::Coverage { found } } else { CalibrationError::NoFit }
}

/// The best sphere: |x|^2 = 2 b x + c.
fn sphere(readings: impl Iterator<Item = Vec3>) -> Option<(Vec3, Mat3)> {
    let mut normal = Normal::<4>::new();
    for x in readings {
        normal.add(&[2.0 * x.x, 2.0 * x.y, 2.0 * x.z, 1.0], square(&x));
    }
    let [x, y, z, c] = normal.solve()?.x;
    let b = Vec3::new(x, y, z);
    let radius = sqrtf(c + square(&b));
    (radius > 0.0).then(|| (b, Mat3::identity() / radius))
}

fn cost(readings: impl Iterator<Item = Vec3>, b: &Vec3, w: &Mat3) -> f32 {
    readings.map(|x| row(&x, b, w).1).map(|r| r * r).sum()
}

/// Derivatives of |W (x - b)| - 1 and its value.
fn row(x: &Vec3, b: &Vec3, w: &Mat3) -> ([f32; 9], f32) {
    let d = x - b;
    let u = w * d;
    let length = sqrtf(square(&u)).max(1e-9);
    let n = u / length;
    let g = -(w * n); // W is symmetric
    let cross = |i: f32, j: f32, k: f32, l: f32| i * j + k * l;
    let terms = [
        g.x,
        g.y,
        g.z,
        n.x * d.x,
        n.y * d.y,
        n.z * d.z,
        cross(n.x, d.y, n.y, d.x),
        cross(n.x, d.z, n.z, d.x),
        cross(n.y, d.z, n.z, d.y),
    ];
    (terms, length - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corners of a box around a centre lie on a sphere.
    fn corners(centre: Vec3, half: Vec3) -> impl Iterator<Item = Vec3> {
        let side = |k: u32, bit: u32| if k & bit == 0 { 1.0 } else { -1.0 };
        (0..8).map(move |k| centre + half.component_mul(&Vec3::new(side(k, 1), side(k, 2), side(k, 4))))
    }

    #[test]
    fn the_sphere_through_two_boxes_is_found() {
        let centre = Vec3::new(0.5, -0.25, 0.75);
        let points = corners(centre, Vec3::new(1.0, 2.0, 2.0)).chain(corners(centre, Vec3::new(2.0, 2.0, -1.0)));
        let (b, w) = sphere(points).unwrap();
        assert!((b - centre).abs().max() < 1e-5, "{b}");
        assert!((w - Mat3::identity() / 3.0).abs().max() < 1e-5, "{w}");
    }

    /// The derivatives against differences, far from the ellipsoid.
    #[test]
    fn the_derivatives_are_the_slopes() {
        let (x, b) = (Vec3::new(1.5, -2.0, 0.7), Vec3::new(0.1, 0.3, -0.2));
        let w = Mat3::new(1.2, 0.2, -0.1, 0.2, 0.8, 0.3, -0.1, 0.3, 1.1);
        let (slopes, value) = row(&x, &b, &w);
        let u = w * (x - b);
        assert!((value - (sqrtf(square(&u)) - 1.0)).abs() < 1e-6);
        let h = 0.01;
        for (k, slope) in slopes.into_iter().enumerate() {
            let moved = |h: f32| {
                let mut by = [0.0; 9];
                by[k] = h;
                let [bx, by, bz, xx, yy, zz, xy, xz, yz] = by;
                row(&x, &(b + Vec3::new(bx, by, bz)), &(w + Mat3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz))).1
            };
            let known = (moved(h) - moved(-h)) / (2.0 * h);
            assert!((slope - known).abs() < 1e-3, "{k}: {slope} {known}");
        }
    }
}
