//! Three by three linear algebra that needs no square root.
//!
//! What it is: squared length, determinant and inverse; nalgebra has them for types with roots only, which it would take
//! from `std`.
//! What can go wrong: a singular matrix has no inverse.
//! Units: those of its input.
//! Reference: Cramer's rule, the inverse from the cross products of the columns.

use crate::{Mat3, Vec3};

/// Squared length.
pub(crate) fn square(v: &Vec3) -> f32 {
    v.dot(v)
}

/// Determinant.
pub(crate) fn determinant(m: &Mat3) -> f32 {
    let (a, b, c) = (m.column(0), m.column(1), m.column(2));
    a.dot(&b.cross(&c))
}

/// Inverse; `None` where there is none or it is not finite.
pub(crate) fn inverse(m: &Mat3) -> Option<Mat3> {
    let (a, b, c) = (m.column(0), m.column(1), m.column(2));
    let bc = b.cross(&c);
    let scale = 1.0 / a.dot(&bc);
    let inverse = Mat3::from_rows(&[bc.transpose(), c.cross(&a).transpose(), a.cross(&b).transpose()]) * scale;
    inverse.iter().all(|c| c.is_finite()).then_some(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_undoes_the_matrix_and_a_singular_one_has_none() {
        let m = Mat3::new(2.0, 0.5, -1.0, 0.1, 3.0, 0.2, 0.0, -0.4, 1.5);
        assert!((inverse(&m).unwrap() * m - Mat3::identity()).abs().max() < 1e-6);
        assert!((determinant(&m) - 9.125).abs() < 1e-5);
        assert_eq!(inverse(&Mat3::zeros()), None);
    }
}
