//! Roots, sines and cosines small enough for a microcontroller.
//!
//! What it is: a square root from the reciprocal one, and sine and cosine of angles of a few turns. The general library's
//! reduce their argument in double precision, which costs this processor 8 KB.
//! What can go wrong: beyond about a thousand radians the reduction loses digits; what is not finite gives what is not.
//! Units: rad.
//! Reference: Cephes `sinf`, `cosf` (Moshier), coefficients and two-part reduction; Abramowitz & Stegun 4.4.47 for the angle.

use crate::rotation::inverse_sqrt;

/// Square root of a number that is not negative; zero below the smallest normal number.
#[inline(never)]
pub(crate) fn root(x: f32) -> f32 {
    if x < f32::MIN_POSITIVE { 0.0 } else { x * inverse_sqrt(x) }
}

/// Angle of the direction (`x`, `y`) whose length is `long`, rad in [-pi, pi]; good to 2.5e-5 (0.0015 degrees).
pub(crate) fn angle(y: f32, x: f32, long: f32) -> f32 {
    // the half angle lies within 45 degrees of zero or of 90
    let t = y / (long + x.abs());
    let z = t * t;
    let series = (((0.020_835_1 * z - 0.085_133) * z + 0.180_141) * z - 0.330_299_5) * z + 0.999_866;
    let half = 2.0 * t * series;
    if x >= 0.0 { half } else { core::f32::consts::PI.copysign(y) - half }
}

/// Sine and cosine.
#[inline(never)]
pub(crate) fn sin_cos(angle: f32) -> (f32, f32) {
    let quarter = (angle * core::f32::consts::FRAC_2_PI) + if angle < 0.0 { -0.5 } else { 0.5 };
    let n = quarter as i32;
    let turns = n as f32;
    // pi/2 in three parts
    let x = ((angle - turns * 1.570_312_5) - turns * 4.837_513e-4) - turns * 7.549_79e-8;
    let z = x * x;
    let sine = ((-1.951_529_6e-4 * z + 8.332_161e-3) * z - 1.666_665_5e-1) * z * x + x;
    let cosine = ((2.443_315_7e-5 * z - 1.388_731_6e-3) * z + 4.166_664_6e-2) * z * z - 0.5 * z + 1.0;
    match n & 3 {
        0 => (sine, cosine),
        1 => (cosine, -sine),
        2 => (-sine, -cosine),
        _ => (-cosine, sine),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_agree_with_the_library_to_rounding() {
        for k in -4000..4000 {
            let a = k as f32 * 0.01;
            let (s, c) = sin_cos(a);
            assert!((s - libm::sinf(a)).abs() < 3e-7 && (c - libm::cosf(a)).abs() < 3e-7, "{a}: {s} {c}");
        }
        assert!(sin_cos(f32::NAN).0.is_nan());
    }

    #[test]
    fn angles_agree_with_the_library() {
        for k in -3141..=3141 {
            let a = k as f32 * 0.001;
            let found = angle(3.0 * libm::sinf(a), 3.0 * libm::cosf(a), 3.0);
            assert!((found - a).abs() < 2.5e-5, "{a}: {found}");
        }
    }

    #[test]
    fn roots_of_everything_that_has_one() {
        for x in [0.0f32, 1e-30, 2.0, 96.17, 1e30] {
            assert!((root(x) - libm::sqrtf(x)).abs() <= 1e-6 * libm::sqrtf(x), "{x}");
        }
    }

    #[test]
    fn what_is_smaller_than_a_normal_number_has_the_root_zero() {
        for x in [0.0f32, 1e-40, f32::MIN_POSITIVE / 2.0, -1.0] {
            assert_eq!(root(x), 0.0, "{x}");
        }
        let least = root(f32::MIN_POSITIVE) / 1.084_202_2e-19; // 2^-63
        assert!((least - 1.0).abs() < 1e-6, "{least}");
    }
}
