//! The last resort: minimum throttle in hardware, a record of the place, then a reset.
//!
//! What it is: what the rig board adds to [`safe_start::stm32f4::crash`]. After a panic or a hard fault the pulse timer is set to its
//! minimum, and a pulse that has begun ends as the timer has it. When the crystal has failed, the timer runs from another clock and a
//! pulse would become many times as long: the output is forced low instead, at once, and the start after the reset gives minimum
//! pulses of the right length from the internal oscillator.
//! What can go wrong: were the pulse timer not running yet, the wait ends by its own count.
//! Units: ticks of TIM3.
//! Reference: specification `rig.md`, "a stop is a continuous train of 1000 us pulses"; RM0090 sections 18.3.8 (forced output mode),
//! 7.2.7 (clock security system).

use crate::board::pulse::{MAXIMUM, MINIMUM};
use frame::message::CrashCause;
use stm32f4xx_hal::pac::TIM3;

safe_start::last_resort!(quiet, settle);

fn timer() -> TIM3 {
    #[allow(unsafe_code)] // nothing else runs any more: the program never goes on from here
    unsafe {
        TIM3::steal()
    }
}

fn quiet(cause: Option<CrashCause>) {
    let timer = timer();
    timer.ccr1().write(|w| w.ccr().set(MINIMUM));
    if cause == Some(CrashCause::ClockFailed) {
        timer.ccmr1_output().write(|w| w.oc1m().force_inactive());
    }
}

/// Longest wait for the end of a pulse: 2 ms take some 60 000 turns of the loop.
const PATIENCE: u32 = 200_000;

fn settle(cause: Option<CrashCause>) {
    let timer = timer();
    let mut patience = PATIENCE;
    while cause != Some(CrashCause::ClockFailed) && timer.cnt().read().cnt().bits() <= MAXIMUM && patience > 0 {
        patience -= 1;
    }
}
