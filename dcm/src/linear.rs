//! Three by three linear algebra that needs no square root.
//!
//! What it is: squared length and determinant; nalgebra has them for types with roots only, which it would take from `std`.
//! What can go wrong: nothing.
//! Units: those of its input.
//! Reference: the triple product of the columns.

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_determinant_is_the_known_one() {
        let m = Mat3::new(2.0, 0.5, -1.0, 0.1, 3.0, 0.2, 0.0, -0.4, 1.5);
        assert!((determinant(&m) - 9.125).abs() < 1e-5);
        assert_eq!(determinant(&Mat3::zeros()), 0.0);
    }
}
