//! Direction-cosine attitude filter.
//!
//! What it is: the classic direction-cosine-matrix filter. The state is the rotation from body to earth; the gyro turns
//! it, accelerometer and magnetometer pull it back through a proportional-integral correction. [`Config`] chooses gains,
//! increment and accelerometer weighting; [`Config::RAZOR`] is the published filter, [`Config::TUNED`] the baseline.
//!
//! What can go wrong: NaN, zero and missing readings are ignored one by one and flagged in [`Step`]; a gap in time starts
//! the tilt anew and keeps bias and heading; Euler angles are defined at the pole (roll 0, yaw takes the whole heading).
//!
//! Units: rad, rad/s, m/s^2 (any unit for the field, only its direction counts), seconds. Body FRD, earth NED.
//!
//! Reference: Premerlani & Bizard, *Direction Cosine Matrix IMU: Theory*, 2009; Beharie 2013 chapter 4 and Appendix E
//! with the errata of 4.3, 4.19-4.25, 4.28-4.30 and E.15.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing))]

mod angles;
mod config;
mod filter;
mod rotation;

pub use angles::{Euler, euler_of, matrix_of, quaternion_of};
pub use config::{AccelWeight, Config, Gains, Increment};
pub use filter::{Dcm, Measurement, Step};
pub use rotation::{rotate, unit};

/// Column vector of three, single precision.
pub type Vec3 = nalgebra::Vector3<f32>;
/// Three by three matrix, single precision.
pub type Mat3 = nalgebra::Matrix3<f32>;

/// Standard gravity, m/s^2 (ISO 80000-3).
pub const STANDARD_GRAVITY: f32 = 9.806_65;
