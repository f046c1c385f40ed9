//! Turning and renormalising the matrix.
//!
//! What it is: the increment R <- R exp([t]x) to first or fifth order and the first-order orthonormalisation.
//! What can go wrong: rows drift from unit length and right angles; every step pulls them back. A vector without a
//! direction (zero or not finite) has no unit vector.
//! Units: radians of body rotation in the step.
//! Reference: Premerlani & Bizard 2009, Eq. 17-21; Beharie 2013 Eq. 4.21-4.24 and E.15 with errata (body-rate increments,
//! element [0][2] is +t_y).

use crate::{Mat3, Vec3};
use micromath::F32Ext;

/// How the matrix is turned by one gyro sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Increment {
    /// R (I + U), Beharie 2013 Eq. E.15 corrected.
    FirstOrder,
    /// R exp(U) by its series to the fifth order in the angle.
    Exponential,
}

/// 1/sqrt(x) for a normal positive number: the seed of micromath and Newton steps down to f32 rounding.
fn inverse_sqrt(x: f32) -> f32 {
    let mut y = x.invsqrt();
    for _ in 0..3 {
        y *= 1.5 - 0.5 * x * y * y;
    }
    y
}

/// Direction of a vector; `None` when it has none (zero, tiny, huge or not finite).
#[must_use]
pub fn unit(v: &Vec3) -> Option<Vec3> {
    let square = v.dot(v);
    (square.is_finite() && square > 1e-20).then(|| v * inverse_sqrt(square))
}

/// Skew-symmetric matrix of a cross product: `skew(a) b = a x b`.
fn skew(t: &Vec3) -> Mat3 {
    Mat3::new(0.0, -t.z, t.y, t.z, 0.0, -t.x, -t.y, t.x, 0.0)
}

/// Turns the body by the small rotation vector `t` (rad, body axes) and renormalises.
#[must_use]
pub fn rotate(r: &Mat3, t: &Vec3, increment: Increment) -> Mat3 {
    let u = skew(t);
    let turned = match increment {
        Increment::FirstOrder => r + r * u,
        Increment::Exponential => {
            let square = t.dot(t);
            let s = 1.0 - square / 6.0 + square * square / 120.0;
            let c = 0.5 - square / 24.0 + square * square / 720.0;
            r + r * (u * s + u * u * c)
        }
    };
    renormalise(&turned)
}

/// Makes the rows unit vectors at right angles again; half of the error goes to each of the first two rows. That is good to
/// first order; after an absurd step the second row takes the whole error exactly.
pub(crate) fn renormalise(r: &Mat3) -> Mat3 {
    let (x, y) = (scale(r.row(0).transpose()), scale(r.row(1).transpose()));
    let half = 0.5 * x.dot(&y);
    let (x, mut y) = (scale(x - y * half), scale(y - x * half));
    if half.abs() > 0.01 {
        y = scale(y - x * x.dot(&y));
    }
    let z = x.cross(&y);
    Mat3::from_rows(&[x.transpose(), y.transpose(), scale(z).transpose()])
}

/// To unit length: first order near 1 (no root), exactly otherwise.
fn scale(v: Vec3) -> Vec3 {
    let square = v.dot(&v);
    if (0.99..1.01).contains(&square) { v * (0.5 * (3.0 - square)) } else { v * inverse_sqrt(square) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn orthonormality(r: &Mat3) -> f32 {
        (r * r.transpose() - Mat3::identity()).abs().max()
    }

    #[test]
    fn inverse_root_is_exact_to_rounding() {
        for x in [1e-12_f32, 0.3, 1.0, 2.0, 96.2, 1e12] {
            let rel = (f64::from(inverse_sqrt(x)) * f64::from(x).sqrt() - 1.0).abs();
            assert!(rel < 5e-7, "{x}: {rel}");
        }
    }

    #[test]
    fn thousands_of_steps_stay_orthonormal() {
        for increment in [Increment::FirstOrder, Increment::Exponential] {
            let mut r = Mat3::identity();
            for k in 0..50_000 {
                let a = k as f32 * 0.01;
                r = rotate(&r, &(Vec3::new(libm::sinf(a), libm::cosf(0.7 * a), 0.5) * 0.1), increment);
            }
            assert!(orthonormality(&r) < 1e-4, "{increment:?} {}", orthonormality(&r));
        }
    }

    /// A quarter turn about z in 100 steps: the first-order step loses t^3/3 each time, the series does not.
    #[test]
    fn the_series_is_exact_and_the_first_order_step_is_known_to_be_short() {
        let step = core::f32::consts::FRAC_PI_2 / 100.0;
        let end = |increment| {
            let r = (0..100).fold(Mat3::identity(), |r, _| rotate(&r, &Vec3::new(0.0, 0.0, step), increment));
            libm::atan2f(r[(1, 0)], r[(0, 0)])
        };
        let wanted = core::f32::consts::FRAC_PI_2;
        assert!((end(Increment::Exponential) - wanted).abs() < 1e-5);
        let lost = wanted - end(Increment::FirstOrder);
        let known = 100.0 * step.powi(3) / 3.0;
        assert!((lost - known).abs() < 0.1 * known, "{lost} {known}");
    }

    /// E.15 as printed uses the z rate in element [0][2]: a pure pitch rate would then not turn body x downwards or up.
    #[test]
    fn a_pitch_rate_raises_the_nose() {
        let r = rotate(&Mat3::identity(), &Vec3::new(0.0, 0.01, 0.0), Increment::FirstOrder);
        assert!(r[(2, 0)] < -0.009, "nose up: body x points against earth z (down)");
        assert!(r[(0, 2)] > 0.009);
    }

    #[test]
    fn vectors_without_direction_have_no_unit() {
        assert_eq!(unit(&Vec3::zeros()), None);
        assert_eq!(unit(&Vec3::new(f32::NAN, 0.0, 1.0)), None);
        assert_eq!(unit(&Vec3::new(f32::INFINITY, 0.0, 1.0)), None);
        assert!((unit(&Vec3::new(0.0, 3.0, -4.0)).unwrap() - Vec3::new(0.0, 0.6, -0.8)).abs().max() < 1e-6);
    }
}
