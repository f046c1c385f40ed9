//! The last resort: minimum throttle in hardware, a record of the place, then a reset.
//!
//! What it is: what the rig board adds to [`safe_start::stm32f4::crash`]. After a panic or a hard fault the pulse timer is set to its
//! minimum, and a pulse that has begun ends as the timer has it. Where the ESC hears DShot, the words in memory become throttle 0, and
//! the timer and its DMA send three such frames before the reset. When the crystal has failed, the timer runs from another clock and a
//! pulse would become many times as long, a frame unreadable: the output is forced low instead, at once, and the start after the reset
//! gives minimum pulses or frames of the right length from the internal oscillator.
//! What can go wrong: were the pulse timer not running yet, each wait ends by its own count.
//! Units: ticks of TIM3.
//! Reference: specification `rig.md`, "a stop is a continuous train of 1000 us pulses"; RM0090 sections 18.3.8 (forced output mode),
//! 7.2.7 (clock security system).

use crate::board::pulse::{MAXIMUM, MINIMUM, await_frame, sends_frames, stop_frames};
use frame::message::CrashCause;
use stm32f4xx_hal::pac::{DMA1, TIM3};

safe_start::last_resort!(quiet, settle);

/// Frames of throttle 0 before the reset: one might be lost.
const FRAMES: u8 = 3;

fn parts() -> (TIM3, DMA1) {
    #[allow(unsafe_code)] // nothing else runs any more: the program never goes on from here
    unsafe {
        (TIM3::steal(), DMA1::steal())
    }
}

fn quiet(cause: Option<CrashCause>) {
    let (timer, dma) = parts();
    if cause == Some(CrashCause::ClockFailed) {
        timer.ccmr1_output().write(|w| w.oc1m().force_inactive());
    } else if sends_frames(&timer) {
        stop_frames(&timer, &dma);
    } else {
        timer.ccr1().write(|w| w.ccr().set(MINIMUM));
    }
}

/// Longest wait for the end of a pulse: 2 ms take some 60 000 turns of the loop.
const PATIENCE: u32 = 200_000;

fn settle(cause: Option<CrashCause>) {
    let (timer, dma) = parts();
    if cause == Some(CrashCause::ClockFailed) {
        return;
    }
    if sends_frames(&timer) {
        (0..FRAMES).for_each(|_| await_frame(&dma));
        return;
    }
    let mut patience = PATIENCE;
    while timer.cnt().read().cnt().bits() <= MAXIMUM && patience > 0 {
        patience -= 1;
    }
}
