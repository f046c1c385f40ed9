//! Cost image with the thesis' filter.
//!
//! What it is: see `body.rs`. What can go wrong: nothing. Units: none. Reference: `budgets/ahrs.toml`.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[macro_use]
mod body;

#[cfg(target_os = "none")]
image! {
    let mut filter = dcm::Classic::new(dcm::ClassicConfig::TUNED);
    |dt, measured| {
        filter.update(dt, measured);
        core::hint::black_box(filter.matrix());
    }
}

#[cfg(not(target_os = "none"))]
fn main() {}
