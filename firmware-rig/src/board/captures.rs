//! Four input captures on TIM2, and the board's clock.
//!
//! What it is: the interrupt moves each capture into its channel's queue; the tick drains the queues and extends the
//! counter to 64 bits.
//! What can go wrong: a capture that was overwritten, or a full queue, marks its channel in [`OVERRUN`].
//! Units: 84 MHz ticks.
//! Reference: RM0090 section 18.3.5 (input capture), 18.4.5 (CCxIF clears on reading CCRx, CCxOF by writing 0).

use crate::board::health;
use core::sync::atomic::{AtomicU8, Ordering};
use firmware_rig::queue::{CAPACITY, EdgeQueue};
use frame::rig::CAPTURE_CHANNELS;
use frame::units::Ticks;
use heapless::Vec;
use stm32f4xx_hal::gpio::{Input, PA7};
use stm32f4xx_hal::pac::TIM2;

/// Channel B of the encoder, read at the captured edges of A.
pub(crate) type EncoderB = PA7<Input>;

/// Captures since the last tick: the interrupt puts them in, the tick takes them out.
static QUEUES: [EdgeQueue; CAPTURE_CHANNELS] = [const { EdgeQueue::new() }; CAPTURE_CHANNELS];
/// Channels that lost an edge since the last tick, a bit each.
static OVERRUN: AtomicU8 = AtomicU8::new(0);

/// Starts the timer and its four captures.
pub(crate) fn start(timer: &TIM2) {
    timer.psc().reset();
    timer.arr().write(|w| w.arr().set(u32::MAX));
    timer.ccmr1_input().write(|w| w.cc1s().ti1().cc2s().ti2());
    timer.ccmr2_input().write(|w| w.cc3s().ti3().cc4s().ti4().ic4psc().four_events());
    timer.ccer().write(|w| w.cc1e().set_bit().cc2e().set_bit().cc3e().set_bit().cc4e().set_bit());
    timer.egr().write(|w| w.ug().set_bit());
    timer.cr1().write(|w| w.cen().set_bit());
    // A capture flag that is set here is the counter's own start; the portable half drops each channel's first capture too.
    timer.sr().write(|w| w.cc1if().clear().cc2if().clear().cc3if().clear().cc4if().clear());
    timer.dier().write(|w| w.cc1ie().set_bit().cc2ie().set_bit().cc3ie().set_bit().cc4ie().set_bit());
}

/// The capture interrupt.
pub(crate) fn serve(timer: &TIM2, encoder_b: &EncoderB) {
    let status = timer.sr().read();
    let mut lost = 0;
    let [beam, opto, hall, encoder] = &QUEUES;
    if status.cc1if().bit() && !beam.put(timer.ccr1().read().bits()) {
        lost |= 1;
    }
    if status.cc2if().bit() && !opto.put(timer.ccr2().read().bits()) {
        lost |= 2;
    }
    if status.cc3if().bit() && !hall.put(timer.ccr3().read().bits()) {
        lost |= 4;
    }
    if status.cc4if().bit() {
        if !encoder.put(timer.ccr4().read().bits()) {
            lost |= 8;
        }
        health::step(encoder_b.is_high());
    }
    let over = (status.bits() >> 9) as u8 & 0xf; // CC4OF..CC1OF
    if over != 0 {
        timer.sr().write(|w| w.cc1of().clear().cc2of().clear().cc3of().clear().cc4of().clear());
        lost |= over;
    }
    if lost != 0 {
        OVERRUN.fetch_or(lost, Ordering::Relaxed);
    }
}

/// Edges of one tick.
pub(crate) type Edges = [Vec<u32, CAPACITY>; CAPTURE_CHANNELS];

/// Drains the queues; call it before [`Clock::now`], so that no edge lies in the future.
pub(crate) fn drain(edges: &mut Edges) -> [bool; CAPTURE_CHANNELS] {
    let lost = OVERRUN.swap(0, Ordering::Relaxed);
    for (queue, edges) in QUEUES.iter().zip(edges.iter_mut()) {
        edges.clear();
        while !edges.is_full() {
            let Some(edge) = queue.take() else { break };
            let _ = edges.push(edge); // not full: asked above
        }
    }
    [lost & 1 != 0, lost & 2 != 0, lost & 4 != 0, lost & 8 != 0]
}

/// Extends the 32-bit counter, which turns over every 51 s.
#[derive(Default)]
pub(crate) struct Clock {
    last: Ticks,
}

impl Clock {
    /// The time, from a counter that was read just now.
    pub(crate) fn now(&mut self, counter: u32) -> Ticks {
        let passed = counter.wrapping_sub(self.last.0 as u32);
        self.last = Ticks(self.last.0 + u64::from(passed));
        self.last
    }
}
