//! Back ends of the firmware's peripherals on the virtual clock, driven by the plants.
//!
//! What it is: what a driver meets in place of the microcontroller. Where embedded-hal has a trait, the back end implements it:
//! [`PulsePin`] (`SetDutyCycle`) drives the ESC, [`SpiPort`] (`SpiDevice`) carries the test accelerometer, [`SerialEnd`] (`embedded-io`) the
//! telemetry, [`VirtualClock`] (`DelayNs`) waits, and [`I2cBus`] (`I2c`) has the three chips of the IMU board. It has none for input capture,
//! conversion and watchdog; there values enter as data: [`CaptureTimer`] fills the firmware's queues, [`ScanConverter`] its blocks, and
//! [`Watchdog`] resets. `hal-sim/tests/hal.rs` runs the rig board's program over them.
//! What can go wrong: as on the board: a queue that is not emptied loses edges, a ring that is not drained is lapped, a watchdog that is not
//! fed resets the pins.
//! Units: ns since power-up; ticks of the timers.
//! Reference: specification `rig.md`, "The simulator"; embedded-hal 1.0, embedded-io 0.6; house rules 1 and 2.

mod adc;
mod capture;
mod pins;
mod pwm;
mod spi;
mod uart;
mod watchdog;

pub use crate::clock::VirtualClock;
pub use crate::imu::I2cBus;
pub use adc::ScanConverter;
pub use capture::CaptureTimer;
pub use pins::RigPins;
pub use pwm::PulsePin;
pub use spi::SpiPort;
pub use uart::{SerialEnd, SerialError};
pub use watchdog::Watchdog;
