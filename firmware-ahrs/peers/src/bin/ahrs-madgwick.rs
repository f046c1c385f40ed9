//! Crate ahrs: Madgwick's first filter.
#![no_std]
#![no_main]

use ahrs::{Ahrs, Madgwick};
use core::hint::black_box;
use cortex_m::singleton;
use filter_peers as _;
use nalgebra::Vector3;

#[cortex_m_rt::entry]
fn main() -> ! {
    let filter = singleton!(: Madgwick<f32> = Madgwick::new(filter_peers::DT, 0.1)).unwrap();
    filter_peers::run(|_, measured| {
        let (Some(w), Some(f)) = (measured.gyro, measured.accel) else { return };
        let (w, f) = (Vector3::new(w.x, w.y, w.z), Vector3::new(f.x, f.y, f.z));
        let _ = match measured.mag {
            Some(m) => black_box(filter.update(&w, &f, &Vector3::new(m.x, m.y, m.z))),
            None => black_box(filter.update_imu(&w, &f)),
        };
    })
}
