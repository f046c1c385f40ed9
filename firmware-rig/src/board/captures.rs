//! Four input captures on TIM2, and the board's clock.
//!
//! What it is: the interrupt moves each capture into its channel's queue; the tick drains the queues and extends the
//! counter to 64 bits. Only fitted channels are enabled. Each input has a pull-up and the timer's digital filter: a level must stand for
//! eight samples of 84 MHz (95 ns), the longest filter that leaves an edge known to one tick; what lasts longer is kept off by the RC
//! in front of the pin (`docs/wiring.md`).
//! What can go wrong: a capture that was overwritten, or a full queue, marks its channel in [`OVERRUN`]. A full queue (128 edges in a
//! millisecond, which no rotor gives) also masks the channel's interrupt until the next tick has drained it, so that an input that
//! screams costs at most 128 interrupts a tick and never the tick that looks for the stop.
//! Units: 84 MHz ticks.
//! Reference: RM0090 sections 18.3.5 (input capture; read the data before the over-capture flag), 18.4.5 (CCxIF clears on reading CCRx,
//! CCxOF by writing 0, a 1 changes nothing), 18.4.7 (ICxF).

use crate::board::health;
use core::sync::atomic::{AtomicU8, Ordering};
use firmware_rig::queue::{CAPACITY, EdgeQueue};
use frame::rig::CAPTURE_CHANNELS;
use frame::units::Ticks;
use heapless::Vec;
use stm32f4xx_hal::gpio::{Input, PA7};
use stm32f4xx_hal::pac::{TIM1, TIM2};

/// Channel B of the encoder, read at the captured edges of A.
pub(crate) type EncoderB = PA7<Input>;

/// Captures since the last tick: the interrupt puts them in, the tick takes them out.
static QUEUES: [EdgeQueue; CAPTURE_CHANNELS] = [const { EdgeQueue::new() }; CAPTURE_CHANNELS];
/// Channels that lost an edge since the last tick, a bit each.
static OVERRUN: AtomicU8 = AtomicU8::new(0);

/// Channels of `mask` in the layout of CCER: a bit in four.
fn enables(mask: u8) -> u32 {
    (0..CAPTURE_CHANNELS).filter(|n| mask >> n & 1 != 0).fold(0, |bits, n| bits | 1 << (4 * n))
}

/// Starts the timer and the captures of the channels of `fitted`, a bit each.
pub(crate) fn start(timer: &TIM2, fitted: u8) {
    timer.psc().reset();
    timer.arr().write(|w| w.arr().set(u32::MAX));
    timer.ccmr1_input().write(|w| w.cc1s().ti1().ic1f().fck_int_n8().cc2s().ti2().ic2f().fck_int_n8());
    timer.ccmr2_input().write(|w| w.cc3s().ti3().ic3f().fck_int_n8().cc4s().ti4().ic4f().fck_int_n8().ic4psc().four_events());
    timer.egr().write(|w| w.ug().set_bit());
    timer.cr1().write(|w| w.cen().set_bit());
    // A capture flag that is set here is the counter's own start; the portable half drops each channel's first capture too.
    arm(timer, fitted);
}

/// Lets the channels of `fitted` interrupt, and no others: after the tick has drained the queues, so that one that was masked begins
/// anew.
pub(crate) fn arm(timer: &TIM2, fitted: u8) {
    let wanted = u32::from(fitted) << 1; // CC1IE..CC4IE
    let before = timer.dier().read().bits();
    if before == wanted {
        return;
    }
    #[allow(unsafe_code)] // enable bits of channels, and flags of which a 1 changes nothing
    unsafe {
        timer.ccer().write(|w| w.bits(enables(fitted)));
        let new = wanted & !before;
        timer.sr().write(|w| w.bits(!(new | new << 8))); // what the channel captured while it was masked
        timer.dier().write(|w| w.bits(wanted));
    }
}

/// The capture interrupt.
pub(crate) fn serve(timer: &TIM2, encoder_b: &EncoderB) {
    let enabled = (timer.dier().read().bits() >> 1) as u8;
    let ready = (timer.sr().read().bits() >> 1) as u8 & enabled;
    let mut full = 0;
    let [beam, opto, hall, encoder] = &QUEUES;
    if ready & 1 != 0 && !beam.put(timer.ccr1().read().bits()) {
        full |= 1;
    }
    if ready & 2 != 0 && !opto.put(timer.ccr2().read().bits()) {
        full |= 2;
    }
    if ready & 4 != 0 && !hall.put(timer.ccr3().read().bits()) {
        full |= 4;
    }
    if ready & 8 != 0 {
        if !encoder.put(timer.ccr4().read().bits()) {
            full |= 8;
        }
        health::step(encoder_b.is_high());
    }
    let over = (timer.sr().read().bits() >> 9) as u8 & 0xf; // after the data; CC4OF..CC1OF
    #[allow(unsafe_code)] // flags of which a 1 changes nothing: only those that were seen are taken down; and fewer enable bits
    unsafe {
        if over != 0 {
            timer.sr().write(|w| w.bits(!(u32::from(over) << 9)));
        }
        if full != 0 {
            timer.dier().modify(|r, w| w.bits(r.bits() & !(u32::from(full) << 1)));
        }
    }
    let lost = full | over & enabled;
    if lost != 0 {
        OVERRUN.fetch_or(lost, Ordering::Relaxed);
    }
}

/// Whether the encoder's index has passed since the last look.
pub(crate) fn index(timer: &TIM1) -> bool {
    let passed = timer.sr().read().cc1if().bit();
    if passed {
        let _ = timer.ccr1().read(); // reading takes the flag down
    }
    passed
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
        self.last = self.last.counted(counter);
        self.last
    }
}
