//! Without a filter.
#![no_std]
#![no_main]

use core::hint::black_box;
use filter_peers as _;

#[cortex_m_rt::entry]
fn main() -> ! {
    filter_peers::run(|_, measured| {
        black_box(measured);
    })
}
