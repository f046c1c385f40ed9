//! Attitude as a unit quaternion.
//!
//! What it is: the way from angles to a quaternion and back. The quaternion is what is integrated; angles are read off it.
//! What can go wrong: nothing; straight up or down, roll is taken as zero and yaw holds the whole turn.
//! Units: rad; Hamilton quaternions, scalar first, body to earth.
//! Reference: errata 2.67 (the Euler rates are singular at 90 degrees: integrate the rotation, derive the angles); R = Rz(psi) Ry(theta)
//! Rx(phi); Diebel 2006, Eq. 125 and 297.

use super::{Rotation, Vector};
use nalgebra::{Quaternion, Unit};

/// Share of a full pitch beyond which roll and yaw cannot be told apart: 1 - 1e-12 is within 1.4e-6 rad of straight up.
const POLE: f64 = 1.0 - 1.0e-12;

/// The rotation of roll, pitch and yaw.
#[must_use]
pub fn from_euler([roll, pitch, yaw]: [f64; 3]) -> Rotation {
    let [(sr, cr), (sp, cp), (sy, cy)] = [roll, pitch, yaw].map(|angle| libm::sincos(0.5 * angle));
    Unit::new_normalize(Quaternion::new(
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ))
}

/// The rotation of a quaternion of any length, scalar first.
#[must_use]
pub fn from_quaternion([w, x, y, z]: [f64; 4]) -> Rotation {
    Unit::new_normalize(Quaternion::new(w, x, y, z))
}

/// Roll, pitch and yaw of a rotation.
#[must_use]
pub fn to_euler(attitude: &Rotation) -> [f64; 3] {
    let [x, y, z, w]: [f64; 4] = attitude.coords.into();
    let up = 2.0 * (w * y - x * z);
    if up.abs() > POLE {
        let yaw = -2.0 * up.signum() * libm::atan2(x, w);
        return [0.0, core::f64::consts::FRAC_PI_2 * up.signum(), wrapped(yaw)];
    }
    [
        libm::atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        libm::asin(up),
        libm::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    ]
}

/// The angle within a half turn either way.
fn wrapped(angle: f64) -> f64 {
    let (s, c) = libm::sincos(angle);
    libm::atan2(s, c)
}

/// Rate of change of an attitude that turns at `rate` (body axes, rad/s), per second.
#[must_use]
pub fn derivative(attitude: &Quaternion<f64>, rate: &Vector) -> Quaternion<f64> {
    attitude * Quaternion::from_parts(0.0, 0.5 * rate)
}

/// Angle between two attitudes, rad.
#[must_use]
pub fn angle_between(a: &Rotation, b: &Rotation) -> f64 {
    let apart = a.inverse() * b;
    2.0 * libm::atan2(apart.imag().norm(), apart.w.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_come_back_and_the_poles_keep_the_attitude() {
        for roll in [-3.0, -1.0, 0.0, 0.4, 2.9] {
            for pitch in [-1.5, -0.7, 0.0, 1.2] {
                for yaw in [-2.8, 0.0, 1.9] {
                    let back = to_euler(&from_euler([roll, pitch, yaw]));
                    assert!([roll, pitch, yaw].iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-9), "{back:?}");
                }
            }
        }
        for pitch in [core::f64::consts::FRAC_PI_2, -core::f64::consts::FRAC_PI_2] {
            let there = from_euler([0.7, pitch, 2.5]);
            assert!(angle_between(&from_euler(to_euler(&there)), &there) < 1e-5);
        }
    }

    /// R = Rz Ry Rx: its third row is (-sin pitch, sin roll cos pitch, cos roll cos pitch), the body axes' share of down.
    #[test]
    fn down_in_body_axes_is_that_of_the_errata() {
        let (roll, pitch): (f64, f64) = (0.3, -0.8);
        let down = from_euler([roll, pitch, 1.1]).inverse() * Vector::z();
        let want = [-pitch.sin(), roll.sin() * pitch.cos(), roll.cos() * pitch.cos()];
        assert!((0..3).all(|i| (down[i] - want[i]).abs() < 1e-12), "{down:?} {want:?}");
    }
}
