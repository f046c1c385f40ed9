//! The back-EMF meter on TIM1 channel 4, beside the encoder's index on channel 1.
//!
//! What it is: the counter runs at 10.5 MHz; the interrupt reads at which count an edge came and how long ago that was, and gives the instant on
//! the capture timer's own scale. The tick drains the queue. Only a fitted meter interrupts. Pull-up and digital filter as on the speed inputs,
//! the filter at twice their clock (48 ns).
//! What can go wrong: the counter has 16 bits and turns over every 6.2 ms: an interrupt that is held up for longer gives an edge a wrong instant.
//! The core is held up for so long only while flash is erased, which a disarmed rig alone does. A full queue masks the channel until the next
//! tick, as on the speed inputs.
//! Units: counts of 16 cycles at 168 MHz (95 ns), ticks of 84 MHz.
//! Reference: RM0090 sections 17.3.5 (input capture), 17.4.5 (SR: CCxIF clears on reading CCRx, CCxOF by writing 0), 17.4.7 (ICxF); DS8626
//! table 9 (PA11, AF1). Beharie 2013 section 5.4.7.

use core::sync::atomic::{AtomicBool, Ordering};
use firmware_rig::queue::{CAPACITY, EdgeQueue};
use heapless::Vec;
use stm32f4xx_hal::pac::{TIM1, TIM2};

/// Cycles of the timer's clock in a count.
const CYCLES: u16 = 16;
/// Ticks of the capture timer in a count: its clock is half of this timer's.
const TICKS: u32 = CYCLES as u32 / 2;

/// Captures since the last tick: the interrupt puts them in, the tick takes them out.
static EDGES: EdgeQueue = EdgeQueue::new();
/// An edge was lost since the last tick.
static OVERRUN: AtomicBool = AtomicBool::new(false);

/// Captures of one tick.
pub(crate) type Edges = Vec<u32, CAPACITY>;

/// Starts the counter, and the capture of the encoder's index on channel 1.
pub(crate) fn start(timer: &TIM1) {
    timer.psc().write(|w| w.psc().set(CYCLES - 1));
    timer.arr().write(|w| w.arr().set(u16::MAX));
    timer.ccmr1_input().write(|w| w.cc1s().ti1().ic1f().fck_int_n8());
    timer.ccmr2_input().write(|w| w.cc4s().ti4().ic4f().fck_int_n8());
    timer.ccer().write(|w| w.cc1e().set_bit());
    timer.egr().write(|w| w.ug().set_bit());
    timer.cr1().write(|w| w.cen().set_bit());
}

/// Lets a fitted meter interrupt: after the tick has drained the queue, so that one that was masked begins anew.
pub(crate) fn arm(timer: &TIM1, fitted: bool) {
    if timer.dier().read().cc4ie().bit() == fitted {
        return;
    }
    timer.ccer().write(|w| w.cc1e().set_bit().cc4e().bit(fitted));
    #[allow(unsafe_code)] // flags of which a 1 changes nothing: what the channel captured while it was masked goes
    timer.sr().write(|w| unsafe { w.bits(!(FLAG | OVER)) });
    timer.dier().write(|w| w.cc4ie().bit(fitted));
}

/// CC4IF and CC4OF in SR.
const FLAG: u32 = 1 << 4;
const OVER: u32 = 1 << 12;

/// The capture interrupt. `clock` is the capture timer.
pub(crate) fn serve(timer: &TIM1, clock: &TIM2) {
    if !timer.sr().read().cc4if().bit() {
        return;
    }
    let edge = timer.ccr4().read().bits() as u16; // takes the flag down
    // nothing of this priority comes between the two counters
    let (count, now) = (timer.cnt().read().bits() as u16, clock.cnt().read().bits());
    let at = now.wrapping_sub(u32::from(count.wrapping_sub(edge)) * TICKS);
    let over = timer.sr().read().bits() & OVER != 0; // after the data
    if over {
        #[allow(unsafe_code)] // flags of which a 1 changes nothing: only the one that was seen is taken down
        timer.sr().write(|w| unsafe { w.bits(!OVER) });
    }
    let full = !EDGES.put(at);
    if full {
        timer.dier().write(|w| w.cc4ie().clear_bit());
    }
    if over || full {
        OVERRUN.store(true, Ordering::Relaxed);
    }
}

/// Drains the queue; says whether an edge was lost.
pub(crate) fn drain(edges: &mut Edges) -> bool {
    edges.clear();
    while !edges.is_full() {
        let Some(edge) = EDGES.take() else { break };
        let _ = edges.push(edge); // not full: asked above
    }
    OVERRUN.swap(false, Ordering::Relaxed)
}
