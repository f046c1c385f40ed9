//! A simulated body: what its ideal sensors read.

use dcm::{Mat3, Measurement, STANDARD_GRAVITY, Vec3};

/// At rest at `r`, in a field of these parts to the north, to the east and down.
pub(crate) fn at_rest(r: &Mat3, field: [f32; 3]) -> Measurement {
    Measurement {
        gyro: Some(Vec3::zeros()),
        accel: Some(r.transpose() * Vec3::new(0.0, 0.0, -STANDARD_GRAVITY)),
        mag: Some(r.transpose() * Vec3::from(field)),
    }
}
