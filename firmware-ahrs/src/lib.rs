//! The IMU board, portable half.
//!
//! What it is: what the sensors are set to, the sampler that reads them on a fixed tick (drivers: `imu-sensors`),
//! [`Ahrs::tick`], which turns readings and a timestamp into an attitude and a telemetry sample, and [`Console`], which does what
//! the user asks for. The RTIC application, the tests and the emulated board call the same functions.
//!
//! What can go wrong: a sensor is missing, is a look-alike, stops answering or saturates; each case has its own
//! error or flag, none stops the tick, and no path panics.
//!
//! Units: sensor counts on the wire; rad/s, m/s^2 and uT towards the filter; ticks of the capture timer.
//!
//! Reference: specification `ahrs.md`; data sheets PS-ITG-3200A rev 1.4, ADXL345 rev E, HMC5883L.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing))]

pub mod ahrs;
pub mod calibrator;
pub mod chips;
pub mod console;
pub mod job;
pub mod line;
pub mod mounting;
pub mod sampler;
pub mod settings;
mod still;
pub mod stuck;
pub mod text;

pub use ahrs::{Ahrs, AhrsConfig, Inputs, Outputs};
pub use console::Console;
pub use imu_sensors::itg3200::GyroReading;
pub use job::{Done, Job};
pub use line::{CommandLine, Heard};
pub use mounting::{Axis, Mounting};
pub use sampler::{Readings, Sampler};
pub use settings::Settings;

/// Sample rate of the board, Hz (specification `ahrs.md`, "Board": at least 200).
pub const TICK_HZ: u32 = 200;

/// Bit of the gyro in `present`, `fresh` and `alive` masks.
pub const GYRO: u8 = 1;
/// Bit of the accelerometer in those masks.
pub const ACCEL: u8 = 2;
/// Bit of the magnetometer in those masks.
pub const MAG: u8 = 4;
/// Bit of the optional test accelerometer in those masks.
pub const TEST_ACCEL: u8 = 8;
