//! The rig board's portable half: the same code on the board, in the native simulation and in the emulator.
//!
//! What it is: [`Rig::tick`] takes what the peripherals delivered since the last tick and gives the pulse, and from time to
//! time a raw sample and an event; [`RigConsole`] is the shell around it, from bytes of the line to bytes of the line. Nothing here reads a
//! clock or a register.
//!
//! What can go wrong: lost edges, missing conversions, late ticks and a silent host all arrive as data and leave as
//! verdicts and latched faults; no input makes it panic.
//!
//! Units: ticks of the capture timer, ADC counts, nanoseconds of pulse; SI in the [`config`].
//!
//! Reference: specification `rig.md`; Beharie 2013, sections 3.2, 5.2-5.7.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing))]

#[cfg(test)]
extern crate std;

pub mod bank;
pub mod burst;
pub mod capture;
pub mod config;
pub mod console;
mod course;
pub mod cross;
mod elapsed;
pub mod esc_line;
pub mod health;
mod hold_max;
pub mod line;
mod operator;
pub mod pattern;
pub mod queue;
pub mod rig;
pub mod rig_config;
pub mod sampling;
pub mod stop;
pub mod strain;
pub mod transfer;

pub use burst::Conversions;
pub use capture::CaptureChannel;
pub use config::Config;
pub use console::{Delivered, Orders, RigConsole, Start};
pub use cross::Beside;
pub use health::Vitals;
pub use line::{CommandLine, LineNews};
pub use rig::{Inputs, Outputs, Rig};
pub use rig_config::{EscTelemetry, RigConfig};
pub use sampling::AdcBlock;
pub use stop::StopWatch;
