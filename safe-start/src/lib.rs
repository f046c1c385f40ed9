//! What both boards do before anything else, and after everything else has failed.
//!
//! What it is: [`crystal`], which judges a crystal before the clock is built on it; [`record`], which keeps over a reset what ended the
//! program; and, on the board, the registers under both (`stm32f4`).
//! What can go wrong: a crystal that is silent, or none of the known ones, is not used; a record that a power-up left by chance is not
//! told.
//! Units: Hz; addresses.
//! Reference: specification `rig.md`, "On a real bench"; RM0090 section 7.2.
#![no_std]
#![deny(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing))]

pub mod crystal;
pub mod record;
#[cfg(target_os = "none")]
pub mod stm32f4;
