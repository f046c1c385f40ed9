//! Euler angles and quaternion of a rotation matrix.
//!
//! What it is: conversions out of (and for start-up into) the matrix body to earth, R = Rz(yaw) Ry(pitch) Rx(roll).
//! What can go wrong: at pitch +-90 degrees roll and yaw are not separate; within 0.06 degrees of it roll is 0 and yaw takes
//! the whole heading. The angles come from libm: micromath's arc tangent is off by up to 0.16 degrees.
//! Units: radians; roll and yaw in (-pi, pi], pitch in [-pi/2, pi/2].
//! Reference: Beharie 2013 Eq. 4.19-4.30 with errata (4.25 has the wrong sign, 4.28 and 4.30 need atan2); Shepperd 1978.

use crate::Mat3;
use crate::columns::{Column, cross};
use crate::rotation::direction;
use crate::trig::{root, sin_cos};
use libm::atan2f;

/// cos^2(pitch) below which roll and yaw are not told apart.
const POLE: f32 = 1e-6;

/// Roll, pitch and yaw, rad.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Euler {
    /// About body x, right wing down positive.
    pub roll: f32,
    /// About the horizontal right axis, nose up positive.
    pub pitch: f32,
    /// Compass heading of body x, clockwise from north seen from above.
    pub yaw: f32,
}

/// Euler angles of the rotation body to earth.
#[must_use]
pub fn euler_of(r: &Mat3) -> Euler {
    let (r11, r12, r21, r22) = (r.m11, r.m12, r.m21, r.m22);
    let cos2 = r11 * r11 + r21 * r21;
    let pitch = atan2f(-r.m31, root(cos2));
    if cos2 < POLE {
        return Euler { roll: 0.0, pitch, yaw: atan2f(-r12, r22) };
    }
    Euler { roll: atan2f(r.m32, r.m33), pitch, yaw: atan2f(r21, r11) }
}

/// The rotation body to earth of three Euler angles.
#[must_use]
pub fn matrix_of(e: &Euler) -> Mat3 {
    let (sf, cf) = sin_cos(e.roll);
    let (st, ct) = sin_cos(e.pitch);
    let (sp, cp) = sin_cos(e.yaw);
    Mat3::new(
        ct * cp,
        sf * st * cp - cf * sp,
        cf * st * cp + sf * sp,
        ct * sp,
        sf * st * sp + cf * cp,
        cf * st * sp - sf * cp,
        -st,
        sf * ct,
        cf * ct,
    )
}

/// Unit quaternion body to earth, Hamilton, scalar first and not negative.
#[must_use]
pub fn quaternion_of(r: &Mat3) -> [f32; 4] {
    let trace = r.m11 + r.m22 + r.m33;
    // four times each squared component; the largest is at least 1, so its root is safe to divide by
    let four = [1.0 + trace, 1.0 + 2.0 * r.m11 - trace, 1.0 + 2.0 * r.m22 - trace, 1.0 + 2.0 * r.m33 - trace];
    let (a, b, c) = (r.m32 - r.m23, r.m13 - r.m31, r.m21 - r.m12);
    let (d, e, f) = (r.m12 + r.m21, r.m13 + r.m31, r.m23 + r.m32);
    let [w, x, y, z] = four;
    let raw = if w >= x && w >= y && w >= z {
        [w, a, b, c]
    } else if x >= y && x >= z {
        [a, x, d, e]
    } else if y >= z {
        [b, d, y, f]
    } else {
        [c, e, f, z]
    };
    let square: f32 = raw.iter().map(|q| q * q).sum();
    let sign = if raw.first().is_some_and(|w| *w < 0.0) { -1.0 } else { 1.0 };
    let k = sign / root(square);
    raw.map(|q| q * k)
}

/// Sets the columns of the rotation body to earth whose up axis is `up` (unit, body axes) and whose heading is that of `heading`
/// (body axes, any length, points to where earth x lies); `false` when the two are parallel.
#[inline(never)]
fn set_from(attitude: &mut [Column; 3], up: &Column, heading: &Column) -> bool {
    let Some(east) = direction(&cross(heading, up)) else { return false };
    let north = cross(up, &east);
    for (((column, n), e), u) in attitude.iter_mut().zip(north).zip(east).zip(up) {
        *column = [n, e, -u];
    }
    true
}

/// Up in body axes.
#[inline(never)]
pub(crate) fn up([[.., x], [.., y], [.., z]]: &[Column; 3]) -> Column {
    [-x, -y, -z]
}

/// Turns the rotation body to earth so that `up` (unit, body axes) is upwards and `field` in the magnetic meridian, earth x; where
/// there is none or it is vertical, the heading stays. Says whether the heading comes from the field.
pub(crate) fn start_attitude(attitude: &mut [Column; 3], up: &Column, field: Option<&Column>) -> bool {
    if field.is_some_and(|field| set_from(attitude, up, field)) {
        return true;
    }
    // the first body axis that is not vertical, now or before, keeps its heading
    let ([x, y, z], [[ax, ay, _], [bx, by, _], [cx, cy, _]]) = (up, *attitude);
    for north in [[ax, ay * z, -ay * y], [-by * z, bx, by * x], [cy * y, -cy * x, cx]] {
        if set_from(attitude, up, &north) {
            break;
        }
    }
    false
}

/// Rotation about earth z.
pub(crate) fn about_down(angle: f32) -> Mat3 {
    let (s, c) = sin_cos(angle);
    Mat3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use core::f32::consts::{FRAC_PI_2, PI};
    use proptest::prelude::*;

    #[test]
    fn signs_of_small_angles() {
        let r = matrix_of(&Euler { roll: 0.1, pitch: 0.2, yaw: 0.3 });
        assert!(r.m31 < 0.0, "nose up: body x points against down (4.25 as printed has the other sign)");
        assert!(r.m32 > 0.0, "right wing down: body y points down");
        assert!(r.m21 > 0.0, "turned right: body x points east");
    }

    #[test]
    fn at_the_pole_roll_is_zero_and_yaw_takes_the_whole_heading() {
        for (pitch, sign) in [(FRAC_PI_2, -1.0), (-FRAC_PI_2, 1.0)] {
            let e = euler_of(&matrix_of(&Euler { roll: 0.4, pitch, yaw: 1.0 }));
            assert_eq!(e.roll, 0.0);
            assert!((e.pitch - pitch).abs() < 1e-3);
            assert!((e.yaw - (1.0 + sign * 0.4)).abs() < 1e-4, "{e:?}");
        }
    }

    #[test]
    fn down_and_heading_make_the_matrix() {
        let r = matrix_of(&Euler { roll: -0.3, pitch: 0.9, yaw: -2.0 });
        let up = [-r.m31, -r.m32, -r.m33];
        let [[x, y, z]] = (r.transpose() * Vec3::new(0.4, 0.0, 0.8)).data.0;
        let mut found = [[0.0; 3]; 3];
        assert!(set_from(&mut found, &up, &[x, y, z]));
        assert!((Mat3::from(found) - r).abs().max() < 1e-6);
        assert!(!set_from(&mut found, &[0.0, 0.0, 1.0], &[0.0, 0.0, 3.0]));
    }

    /// The limit itself is no pole yet: roll is told.
    #[test]
    fn at_the_edge_of_the_pole_roll_is_still_told() {
        let r = |north: f32, east: f32| Mat3::new(north, 0.0, 0.0, east, 1.0, 0.0, -1.0, 6e-4, 8e-4);
        assert_eq!(6e-4f32 * 6e-4 + 8e-4 * 8e-4, POLE);
        assert!((euler_of(&r(6e-4, 8e-4)).roll - 0.75f32.atan()).abs() < 1e-6);
        assert_eq!(euler_of(&r(6e-4, 7e-4)).roll, 0.0);
    }

    /// Of the two quaternions of a half turn the one along its axis.
    #[test]
    fn a_half_turn_is_about_its_own_axis() {
        let turns = [(1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)];
        for (axis, (x, y, z)) in turns.into_iter().enumerate() {
            let mut known = [0.0; 4];
            known[axis + 1] = 1.0;
            let found = quaternion_of(&Mat3::from_diagonal(&Vec3::new(x, y, z)));
            assert!(found.iter().zip(known).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}");
        }
    }

    fn heading(column: &Column) -> f32 {
        column[1].atan2(column[0])
    }

    /// Starts anew with `up` from an attitude whose columns are given, without a field. The heading of the body axis `kept` stays.
    fn keeps_the_heading(before: [Column; 3], up: Column, kept: usize) {
        let mut now = before;
        assert!(!start_attitude(&mut now, &up, None));
        let r = Mat3::from(now);
        assert!((r * r.transpose() - Mat3::identity()).abs().max() < 1e-6, "{r}");
        let [[x, y, z]] = (r.transpose() * Vec3::new(0.0, 0.0, -1.0)).data.0;
        assert!((x - up[0]).abs() + (y - up[1]).abs() + (z - up[2]).abs() < 1e-6, "{x} {y} {z}");
        let (now, before) = (heading(&now[kept]), heading(&before[kept]));
        assert!((now - before).abs() < 1e-6, "axis {kept}: {now} {before}");
    }

    /// The columns of an attitude whose body axis `vertical` points down. The next one lies 0.3 rad east of north.
    fn standing(vertical: usize) -> [Column; 3] {
        let (s, c) = sin_cos(0.3);
        let mut columns = [[0.0; 3]; 3];
        columns[vertical] = [0.0, 0.0, 1.0];
        columns[(vertical + 1) % 3] = [c, s, 0.0];
        columns[(vertical + 2) % 3] = [-s, c, 0.0];
        columns
    }

    #[test]
    fn the_first_axis_that_is_level_now_and_before_keeps_its_heading() {
        let level = matrix_of(&Euler { roll: 0.2, pitch: -0.3, yaw: 2.0 }).data.0;
        keeps_the_heading(level, [0.48, -0.6, -0.64], 0);
        keeps_the_heading(standing(0), [0.48, -0.6, -0.64], 1);
        keeps_the_heading(standing(0), [0.6, 0.48, 0.64], 1);
        keeps_the_heading(level, [1.0, 0.0, 0.0], 1);
        keeps_the_heading(level, [-1.0, 0.0, 0.0], 1);
        // x was vertical and y is now, and the other way round
        for sign in [1.0, -1.0] {
            keeps_the_heading(standing(0), [0.0, sign, 0.0], 2);
            keeps_the_heading(standing(1), [sign, 0.0, 0.0], 2);
        }
    }

    proptest! {
        #[test]
        fn angles_come_back(roll in -PI..PI, pitch in -1.55f32..1.55, yaw in -PI..PI) {
            let e = euler_of(&matrix_of(&Euler { roll, pitch, yaw }));
            let near = |a: f32, b: f32, tol: f32| { let d = (a - b).abs(); d < tol || (2.0 * PI - d).abs() < tol };
            let tol = 2e-6 / libm::cosf(pitch);
            prop_assert!(near(e.roll, roll, tol) && near(e.yaw, yaw, tol) && near(e.pitch, pitch, 2e-5), "{e:?}");
        }

        #[test]
        fn quaternion_turns_vectors_as_the_matrix_does(roll in -PI..PI, pitch in -1.6f32..1.6, yaw in -PI..PI) {
            let r = matrix_of(&Euler { roll, pitch, yaw });
            let [w, x, y, z] = quaternion_of(&r);
            prop_assert!(w >= 0.0);
            let (v, p) = (Vec3::new(x, y, z), Vec3::new(0.3, -0.5, 0.8));
            let t = v.cross(&p) * 2.0;
            let turned = p + t * w + v.cross(&t);
            prop_assert!((turned - r * p).abs().max() < 2e-6);
        }
    }
}
