//! A board without hardware, for learning, rehearsing and testing.
//!
//! What it is: the firmware against the plant, a millisecond at a time ([`VirtualBoard`]): the rig board or the IMU board natively, or (feature
//! `emulated`) the flash image on the emulated microcontroller. [`Pace`] holds it to the clock, [`Cable`] puts it behind a
//! pseudo-terminal, [`FlashFile`] lets its settings outlive the program, [`Hand`] is what a person does at the bench, [`sound`] what is heard there.
//! What can go wrong: see [`BoardError`]; a machine that is too slow makes the board late, never hurried.
//! Units: ms of the board's own time; bytes.
//! Reference: specification `rig.md`, "The operator's side": a virtual board.
#![forbid(unsafe_code)]

mod board;
#[cfg(unix)]
mod cable;
mod flash_file;
mod hand;
#[cfg(feature = "emulated")]
mod image;
mod imu;
mod pace;
mod rig;
pub mod sound;

pub use board::{BoardError, Kind, Order, VirtualBoard, switch_on};
#[cfg(unix)]
pub use cable::Cable;
pub use flash_file::FlashFile;
pub use hand::Hand;
#[cfg(feature = "emulated")]
pub use image::ImageBoard;
pub use imu::ImuBoard;
pub use pace::Pace;
pub use rig::RigBoard;
