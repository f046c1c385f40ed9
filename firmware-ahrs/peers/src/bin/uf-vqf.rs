//! Crate uf-ahrs: VQF.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::time::Duration;
use cortex_m::singleton;
use filter_peers as _;
use uf_ahrs::{Vqf, VqfParams};

#[cortex_m_rt::entry]
fn main() -> ! {
    let (gyro, mag) = (Duration::from_micros(5000), Duration::from_micros(13_333));
    let filter = singleton!(: Vqf = Vqf::new_with_sensor_rates(gyro, gyro, mag, VqfParams::default())).unwrap();
    filter_peers::run(|_, measured| {
        let (Some(w), Some(f)) = (measured.gyro, measured.accel) else { return };
        filter.update2(w, f);
        if let Some(m) = measured.mag {
            filter.magnetometer_update(m);
        }
        black_box(filter.heading_orientation());
    })
}
