//! What the cost images are: a rolling body's readings at the board's rates, and the frame around them. On the host each is an empty program.
//!
//! What it is: readings without any library function, so that the image without a filter holds nothing of the filter; the
//! images differ in the filter alone, and so do their sizes and instruction counts.
//! What can go wrong: an optimiser that sees through the inputs; hence the black boxes.
//! Units: rad/s, m/s^2, uT, s.
//! Reference: issue of the board's cost; `budgets/ahrs.toml`.

use core::hint::black_box;
use dcm::{Measurement, Vec3};
use stm32f4xx_hal as _; // its vector table

/// An image that takes a step of the body by the closure, with a filter where there is one.
macro_rules! image {
    (let mut $filter:ident = $new:expr; $step:expr) => {
        image! { @main { let mut $filter = $new; crate::body::run($step) } }
    };
    (@main { $($body:tt)* }) => {
        #[panic_handler]
        fn panic(_: &core::panic::PanicInfo) -> ! {
            cortex_m::peripheral::SCB::sys_reset()
        }

        #[cortex_m_rt::entry]
        fn main() -> ! {
            $($body)*
        }
    };
    ($step:expr) => {
        image! { @main { crate::body::run($step) } }
    };
}

/// Updates of a run.
const UPDATES: u32 = 4000;
/// Time between them, s.
const DT: f32 = 1.0 / 200.0;
/// Ticks of eight on which the magnetometer is fresh: 75 Hz of 200.
const FRESH: [bool; 8] = [true, false, false, true, false, true, false, false];

/// Runs `step` over the body's motion, then sleeps.
pub(crate) fn run(mut step: impl FnMut(f32, &Measurement)) -> ! {
    let (mut sine, mut cosine) = (0.0f32, 1.0f32);
    for k in 0..UPDATES {
        cosine -= sine * DT;
        sine += cosine * DT;
        let mag = FRESH.get(k as usize % 8).copied().unwrap_or(false);
        let measured = Measurement {
            gyro: Some(Vec3::new(1.0, 0.01, -0.02)),
            accel: Some(Vec3::new(0.1, -9.8 * sine, -9.8 * cosine)),
            mag: mag.then(|| Vec3::new(20.0, 43.0 * sine, 43.0 * cosine)),
        };
        step(black_box(DT), black_box(&measured));
    }
    loop {
        cortex_m::asm::wfi();
    }
}
