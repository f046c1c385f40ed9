//! What a board remembers without power.
//!
//! What it is: [`Stored`], what settings must be able to do; [`seal`] and [`open`], their form in flash: version, content, CRC-32;
//! [`load`] and [`save`] over any NOR flash; and, on the board, the flash itself (`stm32f4`).
//! What can go wrong: a stored form of another version, length or checksum is refused as damaged; a power cut at any instant of a
//! save leaves the old settings or the new ones.
//! Units: bytes.
//! Reference: specification `rig.md` and `ahrs.md`, "stored with a checksum, versioned, and refused when stale or damaged".
#![no_std]
#![deny(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing))]

mod seal;
#[cfg(target_os = "none")]
pub mod stm32f4;
mod store;

pub use seal::{MAX_STORED, Stored, open, seal};
pub use store::{load, save};
