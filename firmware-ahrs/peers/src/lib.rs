//! The cost harness around filters that are not ours.
//!
//! What it is: the same readings and the same loop as in `../src/cost`, and what an image needs beside them.
//! What can go wrong: see there.
//! Units: rad/s, m/s^2, uT, s.
//! Reference: `docs/ahrs.md`, "Cost"; `cargo xtask ahrs-peers`.
#![no_std]
#![forbid(unsafe_code)]

#[path = "../../src/cost/body.rs"]
mod body;

use dcm::Measurement;
use stm32f4xx_hal as _; // its vector table

/// Time between updates, s, as in `body.rs`.
pub const DT: f32 = 1.0 / 200.0;

/// Runs `step` over the body's motion, then sleeps.
pub fn run(step: impl FnMut(f32, &Measurement)) -> ! {
    body::run(step)
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}
