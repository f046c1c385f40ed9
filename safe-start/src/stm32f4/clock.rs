//! The crystal, started and measured before the clock is built on it.
//!
//! What it is: while the core still runs from the internal oscillator, the crystal is started and its frequency over 31 (HSE_RTC) is
//! captured by TIM11 channel 1 in ticks of the internal oscillator. ST's own boot loader finds the crystal's frequency in the same way
//! (AN2606, "TIM11: used to determine the value of the HSE").
//! What can go wrong: every wait is bounded ([`PATIENCE`]); a crystal that is not trusted is switched off. Once trusted it is watched by
//! the clock security system: a failure switches the core to the internal oscillator and raises the NMI ([`super::crash`]).
//! Units: core cycles (16 MHz here); Hz.
//! Reference: RM0090 sections 7.2.1 (HSE), 7.2.7 (clock security system), 7.2.11 (measurement with TIM11), 7.3.1 (CR), 7.3.3 (RTCPRE),
//! 19.5.11 (TIM11_OR).

use crate::crystal::{Measurement, judge};
use cortex_m::peripheral::DWT;
use frame::message::ClockNews;
use stm32f4xx_hal::pac::{RCC, TIM11};

/// Longest wait for the crystal to start, and for the measurement: 10 ms at 16 MHz. A crystal takes 2 ms (DS8626, tSU(HSE), typical),
/// the measurement 0.5 ms; each stays below the shortest time of the rig board's watchdog, 13.6 ms.
pub const PATIENCE: u32 = 160_000;
/// Division of the crystal's frequency on the way to TIM11 (RTCPRE, 2 to 31).
const DIVISION: u8 = 31;
/// Periods of the divided frequency to a capture (input prescaler).
const PER_CAPTURE: u32 = 8;
/// Captures of a measurement: 7 936 ticks for 8 MHz, so that a tick is 0.013 %.
const CAPTURES: u32 = 16;

/// Starts the crystal and judges it; `between` is called between the two bounded waits (it feeds the watchdog).
///
/// Call it before the clock tree is set up: the core runs from the internal oscillator, all prescalers are 1. The cycle counter runs.
pub fn start_crystal(rcc: &RCC, timer: &TIM11, between: impl FnOnce()) -> ClockNews {
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    let started = wait(|| rcc.cr().read().hserdy().bit_is_set());
    between();
    let news = judge(if started { measure(rcc, timer) } else { None });
    if news.crystal_hz == 0 {
        rcc.cr().modify(|_, w| w.hseon().clear_bit());
    } else {
        rcc.cr().modify(|_, w| w.csson().set_bit());
    }
    news
}

/// The clock security system has switched to the internal oscillator (CIR, RM0090 section 7.3.4).
#[must_use]
pub fn has_failed() -> bool {
    #[allow(unsafe_code)] // one flag is read
    let rcc = unsafe { &*RCC::ptr() };
    rcc.cir().read().cssf().bit_is_set()
}

/// Waits until `ready`, for [`PATIENCE`] at the most; whether it came.
fn wait(ready: impl Fn() -> bool) -> bool {
    let begun = DWT::cycle_count();
    loop {
        if ready() {
            return true;
        }
        if DWT::cycle_count().wrapping_sub(begun) > PATIENCE {
            return false;
        }
    }
}

/// Counts ticks of the internal oscillator over 16 captures.
fn measure(rcc: &RCC, timer: &TIM11) -> Option<Measurement> {
    rcc.apb2enr().modify(|_, w| w.tim11en().set_bit());
    let _ = rcc.apb2enr().read(); // the clock reaches the timer two cycles after the write (ES0182, delay after an RCC peripheral clock enabling)
    #[allow(unsafe_code)] // five bits, and two, of which these values are defined
    unsafe {
        rcc.cfgr().modify(|_, w| w.rtcpre().bits(DIVISION));
        timer.or().write(|w| w.rmp().bits(0b10)); // HSE_RTC
        timer.arr().write(|w| w.bits(0xffff));
    }
    timer.ccmr1_input().write(|w| w.cc1s().ti1().ic1psc().eight_events());
    timer.ccer().write(|w| w.cc1e().set_bit());
    timer.cr1().write(|w| w.cen().set_bit());
    let _ = capture(timer)?; // begins within a period
    let mut last = capture(timer)?;
    let mut ticks = 0u32;
    for _ in 0..CAPTURES {
        let now = capture(timer)?;
        ticks += u32::from(now.wrapping_sub(last));
        last = now;
    }
    let missed = timer.sr().read().cc1of().bit_is_set();
    timer.cr1().reset();
    #[allow(unsafe_code)] // as above
    unsafe {
        rcc.cfgr().modify(|_, w| w.rtcpre().bits(0));
    }
    rcc.apb2enr().modify(|_, w| w.tim11en().clear_bit());
    (!missed).then_some(Measurement { periods: CAPTURES * PER_CAPTURE * u32::from(DIVISION), ticks })
}

/// The next capture; reading it takes the flag down (RM0090 section 19.5.4).
fn capture(timer: &TIM11) -> Option<u16> {
    wait(|| timer.sr().read().cc1if().bit_is_set()).then(|| timer.ccr1().read().bits() as u16)
}
