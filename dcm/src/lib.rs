//! Direction-cosine attitude filter and calibration of its sensors.
//!
//! What it is: [`Dcm`], a direction-cosine filter whose accelerometer is averaged in the earth frame, whose heading is
//! decoupled and gated, and which estimates gyro bias (at rest and in motion) and hard iron as it goes; [`Classic`], the
//! filter of the thesis, kept as the baseline.
//!
//! What can go wrong: NaN, zero, saturated and missing readings are left out one by one and flagged in [`Step`]; a gap in
//! time starts the tilt anew and keeps bias and heading; Euler angles are defined at the pole (roll 0, yaw takes the whole
//! heading).
//!
//! Units: rad, rad/s, m/s^2, uT, seconds. Any right-handed body axes; earth NED inside, [`Earth`] chooses what comes out.
//!
//! Reference: Premerlani & Bizard, *Direction Cosine Matrix IMU: Theory*, 2009; Beharie 2013 chapter 4 and Appendix E
//! with errata; Laidig & Seel, *VQF*, Information Fusion 91 (2023), for filtering accelerations in the earth frame.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing))]

mod angles;
pub mod calibration;
mod classic;
mod columns;
mod config;
mod earth;
mod filter;
mod fresh;
mod linear;
mod measurement;
mod rotation;
mod trig;

pub use angles::{Euler, euler_of, matrix_of, quaternion_of};
pub use classic::{AccelWeight, Classic, ClassicConfig, Gains};
pub use config::{BiasConfig, Config, FieldConfig, IronConfig, RestConfig, Standard};
pub use earth::Earth;
pub use filter::{Dcm, Flags, Quality, STATE_WORDS, StateError};
pub use fresh::Fresh;
pub use measurement::{Measurement, Step};
pub use rotation::{Increment, rotate, unit};

/// Column vector of three, single precision.
pub type Vec3 = nalgebra::Vector3<f32>;
/// Three by three matrix, single precision.
pub type Mat3 = nalgebra::Matrix3<f32>;

/// Standard gravity, m/s^2 (ISO 80000-3).
pub const STANDARD_GRAVITY: f32 = 9.806_65;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
