//! The ESC's telemetry on USART3.
//!
//! What it is: the interrupt moves each byte that arrives into a queue, with what the receiver says of it; the tick drains the queue. The
//! receiver is on only where the telemetry is fitted.
//! What can go wrong: a byte with a framing, noise or overrun error goes into the queue marked, so that its frame is not used. Whatever the
//! line does, its rate bounds it to a byte in 87 us, which is less than 1 % of the processor.
//! Units: bytes at 115 200 baud: 42 MHz over 365, 0.11 % slow.
//! Reference: RM0090 sections 30.3.3 (reception, overrun, noise, framing), 30.6.1 (SR: PE, FE, NF and ORE clear on a read of SR followed by one
//! of DR), 30.6.4 (RXNEIE interrupts for ORE too); DS8626 table 9 (PB11, AF7).

use core::sync::atomic::{AtomicBool, Ordering};
use firmware_rig::esc_line::LINE_ERROR;
use firmware_rig::queue::{CAPACITY, EdgeQueue};
use heapless::Vec;
use stm32f4xx_hal::pac::USART3;

const BAUD: u32 = 115_200;
const APB1_HZ: u32 = 42_000_000;

/// Bytes since the last tick: the interrupt puts them in, the tick takes them out.
static HEARD: EdgeQueue = EdgeQueue::new();
/// The queue was full: a tick was held up for longer than ten milliseconds.
static LOST: AtomicBool = AtomicBool::new(false);

/// Bytes of one tick.
pub(crate) type Words = Vec<u16, CAPACITY>;

/// Sets the rate.
pub(crate) fn start(port: &USART3) {
    let divisor = (APB1_HZ + BAUD / 2) / BAUD; // 16 times oversampling: mantissa and fraction together
    port.brr().write(|w| w.div_mantissa().set((divisor >> 4) as u16).div_fraction().set((divisor & 15) as u8));
}

/// Switches the receiver on where the telemetry is fitted, and off where it is not.
pub(crate) fn arm(port: &USART3, fitted: bool) {
    if port.cr1().read().re().bit() != fitted {
        port.cr1().write(|w| w.ue().bit(fitted).re().bit(fitted).rxneie().bit(fitted));
    }
}

/// The interrupt.
pub(crate) fn serve(port: &USART3) {
    let status = port.sr().read();
    let byte = port.dr().read().dr().bits() & 0xff; // takes RXNE and the errors down
    let bad = status.fe().bit() || status.nf().bit() || status.ore().bit();
    let word = if bad { byte | LINE_ERROR } else { byte };
    if !HEARD.put(u32::from(word)) {
        LOST.store(true, Ordering::Relaxed);
    }
}

/// Drains the queue.
pub(crate) fn drain(words: &mut Words) {
    words.clear();
    while !words.is_full() {
        let Some(word) = HEARD.take() else { break };
        let _ = words.push(word as u16); // not full: asked above
    }
    if LOST.swap(false, Ordering::Relaxed)
        && let Some(first) = words.first_mut()
    {
        *first |= LINE_ERROR;
    }
}
