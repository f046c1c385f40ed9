//! Drivers of four inertial and magnetic sensors over the traits of embedded-hal 1.0.
//!
//! What it is: [`Itg3200`] (gyro), [`Adxl345`] and [`Lis3dh`] (accelerometers), [`Hmc5883l`] (magnetometer). Each is a bus and an immutable
//! configuration: `configure` checks the identity and writes the registers, `read` takes one sample in one burst. Nothing is kept between two
//! calls, so a sensor that was unplugged needs only `configure` again; several sensors share a bus by `&mut`.
//!
//! What can go wrong: nobody answers, another chip does, the bus fails: [`SensorError`]. A reading at the end of its range is handed out as it
//! is; each chip says how to see that.
//!
//! Units: words as the chips send them, in the chips' own axes; beside them functions to deg/s, g, gauss and degC.
//!
//! Reference: data sheets PS-ITG-3200A rev 1.4, ADXL345 rev E, HMC5883L, LIS3DH rev 2; each register names its section.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing))]

pub mod adxl345;
mod error;
#[cfg(test)]
mod failing_bus;
pub mod hmc5883l;
pub mod itg3200;
pub mod lis3dh;

pub use adxl345::Adxl345;
pub use error::SensorError;
pub use hmc5883l::Hmc5883l;
pub use itg3200::Itg3200;
pub use lis3dh::Lis3dh;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
