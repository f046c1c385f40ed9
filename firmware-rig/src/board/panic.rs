//! The last resort: minimum throttle, then a reset.
//!
//! What it is: the panic handler. It sets the minimum pulse, lets a pulse that has begun end, and resets the core.
//! What can go wrong: were the pulse timer not running yet, the wait ends by its own count.
//! Units: ticks of TIM3.
//! Reference: specification `rig.md`, "a stop is a continuous train of 1000 us pulses".

use crate::board::pulse::{MAXIMUM, MINIMUM};
use stm32f4xx_hal::pac::TIM3;

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    #[allow(unsafe_code)] // nothing else runs any more: interrupts are off and we never return
    let timer = unsafe { TIM3::steal() };
    timer.ccr1().write(|w| w.ccr().set(MINIMUM));
    let mut patience = 2_000_000u32;
    while timer.cnt().read().cnt().bits() <= MAXIMUM && patience > 0 {
        patience -= 1;
    }
    cortex_m::peripheral::SCB::sys_reset()
}
