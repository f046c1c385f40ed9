//! Crate fusion-ahrs: port of x-io Fusion, Madgwick's second filter.
#![no_std]
#![no_main]

use core::hint::black_box;
use cortex_m::singleton;
use filter_peers as _;
use fusion_ahrs::{Ahrs, AhrsSettings, Vector};

#[cortex_m_rt::entry]
fn main() -> ! {
    let filter = singleton!(: Ahrs = Ahrs::with_settings(AhrsSettings::default())).unwrap();
    filter.set_sample_period(filter_peers::DT);
    filter_peers::run(|_, measured| {
        let (Some(w), Some(f)) = (measured.gyro, measured.accel) else { return };
        let (w, f) = (Vector::new(w.x, w.y, w.z), Vector::new(f.x, f.y, f.z));
        match measured.mag {
            Some(m) => filter.update(w, f, Vector::new(m.x, m.y, m.z)),
            None => filter.update_no_magnetometer(w, f),
        }
        black_box(filter.quaternion());
    })
}
