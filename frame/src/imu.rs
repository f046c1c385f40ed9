//! One instant of the IMU board.
//!
//! What it is: raw words of the three sensors and, where the filter runs, its attitude.
//! What can go wrong: `fresh` says which of the three sensors gave a new reading; a stale word repeats the last one.
//! Units: sensor counts (scale factors in the drivers), quaternion scaled by 2^30.
//! Reference: specification `ahrs.md`.

use crate::units::Ticks;
use serde::{Deserialize, Serialize};

/// Raw words of gyro, accelerometer and magnetometer, in body axes after the mounting's remap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ImuSample {
    /// When the gyro was read.
    pub at: Ticks,
    /// ITG-3200, 14.375 LSB per deg/s.
    pub gyro: [i16; 3],
    /// ADXL345 in full resolution, 256 LSB per g.
    pub accel: [i16; 3],
    /// HMC5883L, 1090 LSB per gauss at the default gain.
    pub mag: [i16; 3],
    /// ITG-3200 temperature word.
    pub temperature: i16,
    /// Bit 0 gyro, bit 1 accelerometer, bit 2 magnetometer: fresh in this sample.
    pub fresh: u8,
    /// Same bits, and bit 3 for the test accelerometer: the sensor answered its identity check and is alive.
    pub alive: u8,
    /// Attitude, body to earth, Hamilton, scalar first, each component times 2^30; all zero before start-up.
    pub quaternion_q30: [i32; 4],
}
