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
pub(crate) fn inverse_sqrt(x: f32) -> f32 {
    let mut y = x.invsqrt();
    for _ in 0..3 {
        y *= 1.5 - 0.5 * x * y * y;
    }
    y
}

/// Direction of a vector; `None` when it has none (zero, tiny, huge or not finite).
#[must_use]
#[inline(never)]
pub fn unit(v: &Vec3) -> Option<Vec3> {
    let square = v.dot(v);
    (square.is_finite() && square > 1e-20).then(|| v * inverse_sqrt(square))
}

/// Product of two matrices: one copy of it in the image.
#[inline(never)]
pub(crate) fn product(a: &Mat3, b: &Mat3) -> Mat3 {
    a * b
}

/// The rotation that a rotation vector `t` (rad) means.
#[must_use]
pub(crate) fn increment(t: &Vec3, order: Increment) -> Mat3 {
    let (s, c, diagonal) = match order {
        Increment::FirstOrder => (1.0, 0.0, 1.0),
        Increment::Exponential => {
            let square = t.dot(t);
            let c = 0.5 - square * (1.0 / 24.0 - square / 720.0);
            (1.0 - square * (1.0 / 6.0 - square / 120.0), c, 1.0 - square * c)
        }
    };
    let (v, w) = (t * s, t * c);
    let (xy, xz, yz) = (w.x * t.y, w.x * t.z, w.y * t.z);
    Mat3::new(
        diagonal + w.x * t.x,
        xy - v.z,
        xz + v.y,
        xy + v.z,
        diagonal + w.y * t.y,
        yz - v.x,
        xz - v.y,
        yz + v.x,
        diagonal + w.z * t.z,
    )
}

/// Turns the body by the small rotation vector `t` (rad, body axes) and renormalises.
#[must_use]
pub fn rotate(r: &Mat3, t: &Vec3, order: Increment) -> Mat3 {
    renormalise(&product(r, &increment(t, order)))
}

/// Error of a length or an angle beyond which first order is not enough.
const FIRST_ORDER: f32 = 0.01;

/// Makes the rows unit vectors at right angles again; half of the error goes to each of the first two rows. That is good to
/// first order; after an absurd step it is done exactly.
pub(crate) fn renormalise(r: &Mat3) -> Mat3 {
    let (x, y) = (r.row(0).transpose(), r.row(1).transpose());
    let half = 0.5 * x.dot(&y);
    let (x, y) = (x - y * half, y - x * half);
    let (long_x, long_y) = (x.dot(&x), y.dot(&y));
    if half.abs() > FIRST_ORDER || (long_x - 1.0).abs() > FIRST_ORDER || (long_y - 1.0).abs() > FIRST_ORDER {
        return renormalise_exactly(r);
    }
    let (x, y) = (x * (1.5 - 0.5 * long_x), y * (1.5 - 0.5 * long_y));
    from_rows(&x, &y)
}

/// The same by Gram and Schmidt.
#[cold]
#[inline(never)]
fn renormalise_exactly(r: &Mat3) -> Mat3 {
    let x = exactly(&r.row(0).transpose());
    let y = r.row(1).transpose();
    from_rows(&x, &exactly(&(y - x * x.dot(&y))))
}

fn exactly(v: &Vec3) -> Vec3 {
    v * inverse_sqrt(v.dot(v))
}

fn from_rows(x: &Vec3, y: &Vec3) -> Mat3 {
    Mat3::from_rows(&[x.transpose(), y.transpose(), x.cross(y).transpose()])
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
