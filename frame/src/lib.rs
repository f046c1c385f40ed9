//! The narrow waist of the system: everything that crosses from a board to a host, and back.
//!
//! What it is: physical units as newtypes, one-instant sample frames whose values carry their verdict and
//! their raw code, and the wire codec that both the firmware and the host use.
//!
//! What can go wrong: a lost, damaged or truncated frame costs that frame alone and is counted by
//! [`wire::Decoder`]; a raw code outside its range keeps its code and carries a verdict that says so.
//!
//! Units: SI inside (`Newton`, `Volt`, ...); rev/min for rotor speed; nanoseconds for ESC pulses;
//! ticks of the capture timer for time on the board.
//!
//! Reference: `formats.md` of the specification, "Telemetry".
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing))]

pub mod calibration;
pub mod consensus;
pub mod esc;
pub mod flag;
pub mod imu;
pub mod imu_command;
pub mod message;
pub mod rig;
pub mod schedule;
pub mod units;
pub mod version;
pub mod wire;

pub use calibration::{AdcScale, Calibration, Converted};
pub use consensus::Consensus;
pub use esc::{EscCode, EscVerdict};
pub use flag::Flag;
pub use imu::ImuSample;
pub use imu_command::{
    ImuCalibrated, ImuCommand, ImuContent, ImuErrors, ImuFormat, ImuRefusal, ImuReport, ImuSensor, ImuValues, TestAccel,
};
pub use message::{Command, Event, Hello, Message};
pub use rig::{AdcCode, AdcVerdict, CaptureCode, CaptureVerdict, Fault, FaultSet, Refusals, RigSample, RigState};
pub use units::*;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
