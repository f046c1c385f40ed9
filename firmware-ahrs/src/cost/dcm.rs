//! Cost image with the board's filter. On the host this is an empty program.
//!
//! What it is: see `body.rs`. What can go wrong: nothing. Units: none. Reference: `budgets/ahrs.toml`.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod body;

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(target_os = "none")]
use stm32f4xx_hal as _; // its vector table

#[cfg(target_os = "none")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    let mut filter = dcm::Dcm::new(dcm::Standard);
    body::run(|dt, measured| {
        filter.update(dt, measured);
        core::hint::black_box(filter.matrix());
    })
}
