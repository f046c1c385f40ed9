//! The emulated board: runs the very image that gets flashed.
//!
//! What it is: an STM32F405 with register-level peripherals under the unmodified ELF file, on virtual time, with models of
//! ours on its pins and buses. The emulator crate is hidden in here.
//!
//! What can go wrong: the image is not built ([`EmulatedError::NoImage`] says how); the emulated part is a superset of ours
//! (an STM32F427), so a register that only the larger part has would not be noticed; one instruction takes one cycle, so
//! instruction counts are right and worst-case times are not.
//!
//! Units: nanoseconds since power-up; bytes; volts at the pins.
//!
//! Reference: RM0090 rev 22; crate rigless 0.4.

pub mod ahrs;
mod converter;
pub mod cost;
mod cross;
mod crystal;
mod flash;
mod harm;
mod machine;
pub mod operator;
mod part;
pub mod pilot;
mod pulse;
pub mod rig;

pub use crystal::Quartz;
pub use flash::Caches;
pub use machine::{Accesses, EmulatedError, GeneralTimer, Machine, Outcome, Pins, Port, PulseTrain, World, firmware, run};
pub use pulse::SeenFrame;
