//! Crate vqf-rs: VQF.
#![no_std]
#![no_main]

use core::hint::black_box;
use cortex_m::singleton;
use filter_peers as _;
use vqf_rs::VQF;

#[cortex_m_rt::entry]
fn main() -> ! {
    let filter = singleton!(: VQF = VQF::new(filter_peers::DT, None, Some(1.0 / 75.0), None)).unwrap();
    filter_peers::run(|_, measured| {
        let (Some(w), Some(f)) = (measured.gyro, measured.accel) else { return };
        filter.update(w.into(), f.into(), measured.mag.map(Into::into));
        black_box(filter.quat_9d());
    })
}
