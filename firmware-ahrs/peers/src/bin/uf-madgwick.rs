//! Crate uf-ahrs: Madgwick.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::time::Duration;
use cortex_m::singleton;
use filter_peers as _;
use uf_ahrs::{Ahrs, Madgwick, MadgwickParams};

#[cortex_m_rt::entry]
fn main() -> ! {
    let period = Duration::from_micros(5000);
    let filter = singleton!(: Madgwick = Madgwick::new(period, MadgwickParams::default())).unwrap();
    filter_peers::run(|_, measured| {
        let (Some(w), Some(f)) = (measured.gyro, measured.accel) else { return };
        black_box(match measured.mag {
            Some(m) => filter.update(w, f, m),
            None => filter.update_imu(w, f),
        });
    })
}
