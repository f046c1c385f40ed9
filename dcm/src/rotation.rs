//! Turning and renormalising the matrix.
//!
//! What it is: the increment R <- R exp([t]x) to first or fifth order and the first-order orthonormalisation.
//! What can go wrong: rows drift from unit length and right angles; every step pulls them back. A vector without a
//! direction (zero or not finite) has no unit vector.
//! Units: radians of body rotation in the step.
//! Reference: Premerlani & Bizard 2009, Eq. 17-21; Beharie 2013 Eq. 4.21-4.24 and E.15 with errata (body-rate increments,
//! element [0][2] is +t_y).

use crate::columns::{Column, add_scaled, cross, dot, scaled, square};
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
#[inline(never)]
pub(crate) fn inverse_sqrt(x: f32) -> f32 {
    let mut y = x.invsqrt();
    for _ in 0..3 {
        y *= 1.5 - 0.5 * x * y * y;
    }
    y
}

/// Direction of a vector; `None` when it has none (zero, tiny, huge or not finite).
#[must_use]
pub fn unit(v: &Vec3) -> Option<Vec3> {
    let [v] = &v.data.0;
    direction(v).map(Vec3::from)
}

/// The same of a column.
#[inline(never)]
pub(crate) fn direction(v: &Column) -> Option<Column> {
    let square = square(v);
    (square < f32::MAX && square > 1e-20).then(|| scaled(v, inverse_sqrt(square)))
}

/// The rotation that a rotation vector `t` (rad) means.
#[must_use]
fn increment(t: &Vec3, order: Increment) -> Mat3 {
    match order {
        Increment::FirstOrder => Mat3::identity() + t.cross_matrix(),
        Increment::Exponential => Mat3::from(exponential(&[t.x, t.y, t.z])),
    }
}

/// Turns the body by the small rotation vector `t` (rad, body axes) and renormalises.
#[must_use]
pub fn rotate(r: &Mat3, t: &Vec3, order: Increment) -> Mat3 {
    renormalise(&(r * increment(t, order)))
}

/// Error of a length or an angle beyond which first order is not enough.
const FIRST_ORDER: f32 = 0.01;

/// Makes the rows unit vectors at right angles again; half of the error goes to each of the first two rows. That is good to
/// first order; after an absurd step it is done exactly. Not by [`orthonormalise`], which the default filter calls on columns: through it
/// the thesis' filter takes 168 bytes more of flash.
fn renormalise(r: &Mat3) -> Mat3 {
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

/// Makes three columns that are nearly unit vectors at right angles so again, to first order: half of the error goes to each of the first
/// two, and the third is their vector product.
#[inline(never)]
pub(crate) fn orthonormalise(r: &mut [Column; 3]) {
    let [x, y, _] = &*r;
    let half = -0.5 * dot(x, y);
    let (x, y) = (add_scaled(x, y, half), add_scaled(y, x, half));
    let length = |v: &Column| add_scaled(v, v, 0.5 - 0.5 * square(v));
    let (x, y) = (length(&x), length(&y));
    *r = [x, y, cross(&x, &y)];
}

/// The rotation that a rotation vector means, to the fifth order in the angle.
#[inline(never)]
pub(crate) fn exponential(t: &Column) -> [Column; 3] {
    let square = square(t);
    let c = 0.5 - square * (1.0 / 24.0 - square / 720.0);
    let s = 1.0 - square * (1.0 / 6.0 - square / 120.0);
    let diagonal = 1.0 - square * c;
    let [x, y, z] = t;
    let (sx, sy, sz) = (x * s, y * s, z * s);
    let (cx, cy, cz) = (x * c, y * c, z * c);
    let (xy, xz, yz) = (cx * y, cx * z, cy * z);
    [[diagonal + cx * x, xy + sz, xz - sy], [xy - sz, diagonal + cy * y, yz + sx], [xz + sy, yz - sx, diagonal + cz * z]]
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

    /// The ends of what has a direction: their squares are the limits themselves.
    #[test]
    fn the_tiny_and_the_huge_have_no_direction() {
        let big = (1.0 - f32::EPSILON / 2.0) * 2f32.powi(64);
        let ends = [big, 2f32.powi(52), 0.0];
        assert_eq!(square(&ends), f32::MAX);
        assert!(direction(&ends).is_none() && direction(&[big, 0.0, 0.0]).is_some());
        assert_eq!(square(&[6e-11, 8e-11, 0.0]), 1e-20);
        assert!(direction(&[6e-11, 8e-11, 0.0]).is_none() && direction(&[6.1e-11, 8e-11, 0.0]).is_some());
    }

    /// Rows at a wrong angle only, or of a wrong length only: first order would leave more than rounding.
    #[test]
    fn any_large_error_of_the_rows_is_taken_out_exactly() {
        let angled = |sine: f32| [[1.0, 0.0, 0.0], [sine, (1.0 - sine * sine).sqrt(), 0.0]];
        for [x, y] in [
            angled(0.11),
            angled(-0.11),
            angled(0.6),
            [[1.1, 0.0, 0.0], [0.0, 1.0, 0.0]],
            [[0.9, 0.0, 0.0], [0.0, 1.0, 0.0]],
            [[1.0, 0.0, 0.0], [0.0, 1.1, 0.0]],
            [[1.0, 0.0, 0.0], [0.0, 0.9, 0.0]],
        ] {
            let r = from_rows(&Vec3::from(x), &Vec3::from(y));
            let found = rotate(&r, &Vec3::zeros(), Increment::Exponential);
            assert!(orthonormality(&found) < 2e-6, "{x:?} {y:?}: {}", orthonormality(&found));
        }
    }

    /// To first order half of the cosine goes to each row; twice its cube is left.
    #[test]
    fn up_to_a_hundredth_the_error_is_taken_out_to_first_order() {
        let half = FIRST_ORDER;
        let r = from_rows(&Vec3::x(), &Vec3::new(2.0 * half, (1.0 - 4.0 * half * half).sqrt(), 0.0));
        let found = rotate(&r, &Vec3::zeros(), Increment::FirstOrder);
        let left = found.row(0).dot(&found.row(1));
        assert!((left - 2.0 * half.powi(3)).abs() < 0.3e-6, "{left}");
    }
}
