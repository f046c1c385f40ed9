//! The IMU board's surroundings: a body that moves, three chips that sense it with all their faults, a bus between.
//!
//! What it is: [`Motion`] says where the body is at any instant, [`Aboard`] where a flying one is; [`SensorChip`] is the register file of one chip, which measures
//! that motion through its [`Errors`] and whatever is [`Hidden`]; [`I2cBus`] carries the board's transfers to the chips. [`Lis3dh`], the test
//! accelerometer, is on SPI ([`crate::hal`]), and on I2C as one of the chips. The native run ([`crate::native::ahrs`])
//! and the emulated board use the same chips.
//! What can go wrong: an unconfigured chip behaves like one (asleep, idle, wrong range), so a driver that skips its configuration is
//! seen; a chip that is off the bus does not acknowledge; a held data line stops every transfer.
//! Units: ns since power-up; rad, m, gauss, g; counts in the registers.
//! Reference: specification `ahrs.md`, "Sensors"; data sheets PS-ITG-3200A rev 1.4, ADXL345 rev E, HMC5883L.

mod body;
mod bus;
mod chip;
mod errors;
pub mod hidden;
mod lis3dh;
mod motion;

pub use body::{Aboard, Body, Felt};
pub use bus::{BusError, BusFault, I2cBus};
pub use chip::{ChipKind, SensorChip, Served};
pub use errors::{ChipErrors, Errors};
pub use hidden::{Hidden, ImuEffectKind, ImuScheduled};
pub use lis3dh::Lis3dh;
pub use motion::Motion;

/// Body axes of FRD and chip axes of a board that lies flat, parts on top: y and z are opposite.
fn to_chip(v: [f64; 3]) -> [f64; 3] {
    [v[0], -v[1], -v[2]]
}
