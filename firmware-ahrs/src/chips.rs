//! The sensors of the board, and what they are set to.
//!
//! What it is: address, range and rate of each chip, and each as a driver on the board's bus.
//! What can go wrong: a range that is changed here changes the scale of what is measured; the scales are read from here, too.
//! Units: as named.
//! Reference: specification `ahrs.md`, "Sensors"; drivers: `imu-sensors`.

use embedded_hal::i2c::I2c;
use imu_sensors::{Adxl345, Hmc5883l, Itg3200, Lis3dh, adxl345, hmc5883l, itg3200, lis3dh};

/// Gyro: 98 Hz of samples at 1 kHz, each of which a tick may find.
pub const GYRO: itg3200::Config =
    itg3200::Config { address: itg3200::Address::Low, bandwidth: itg3200::Bandwidth::Hz98, divider: 0 };
/// Accelerometer: twice the tick's rate, so that every reading is a new one.
pub const ACCEL: adxl345::Config =
    adxl345::Config { address: adxl345::Address::Low, range: adxl345::Range::G16, rate: adxl345::Rate::Hz400 };
/// Magnetometer: its fastest continuous rate, the Earth's field (0.7 G at most) well within.
pub const MAG: hmc5883l::Config =
    hmc5883l::Config { averaging: hmc5883l::Averaging::One, rate: hmc5883l::Rate::Hz75, range: hmc5883l::Range::Gauss1_3 };
/// Test accelerometer: as the accelerometer.
pub const TEST: lis3dh::Config = lis3dh::Config { range: lis3dh::Range::G16, rate: lis3dh::Rate::Hz400 };
/// Where it answers.
const TEST_ADDRESS: lis3dh::Address = lis3dh::Address::Low;

/// The gyro on a bus.
pub(crate) fn gyro<B: I2c>(bus: &mut B) -> Itg3200<&mut B> {
    Itg3200::new(bus, GYRO)
}

/// The accelerometer on a bus.
pub(crate) fn accel<B: I2c>(bus: &mut B) -> Adxl345<&mut B> {
    Adxl345::new(bus, ACCEL)
}

/// The magnetometer on a bus.
pub(crate) fn mag<B: I2c>(bus: &mut B) -> Hmc5883l<&mut B> {
    Hmc5883l::new(bus, MAG)
}

/// The test accelerometer on a bus.
pub(crate) fn test<B: I2c>(bus: &mut B) -> Lis3dh<lis3dh::OnI2c<&mut B>> {
    Lis3dh::on_i2c(bus, TEST_ADDRESS, TEST)
}
