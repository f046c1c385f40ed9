//! What the processor measures of itself: stack, cycles, the encoder's direction.
//!
//! What it is: counters that the interrupts fill and the tick reads; the painted stack is measured in the idle loop.
//! What can go wrong: none of it is used for control; a counter that wraps is only a figure.
//! Units: core cycles (DWT), bytes.
//! Reference: cortex-m-rt, feature `paint-stack`; ARMv7-M DWT_CYCCNT.

use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::peripheral::DWT;
use firmware_rig::Vitals;

/// Most cycles of a tick and of a capture interrupt.
static TICK: AtomicU32 = AtomicU32::new(0);
static CAPTURE: AtomicU32 = AtomicU32::new(0);
/// Untouched bytes of stack, as last measured.
static STACK_FREE: AtomicU32 = AtomicU32::new(0);
/// Encoder steps since reset.
static FORWARD: AtomicU32 = AtomicU32::new(0);
static BACKWARD: AtomicU32 = AtomicU32::new(0);

/// Start of a measurement.
pub(crate) fn cycles() -> u32 {
    DWT::cycle_count()
}

/// A tick that began at `start` ends.
pub(crate) fn tick_took(start: u32) {
    TICK.fetch_max(DWT::cycle_count().wrapping_sub(start), Ordering::Relaxed);
}

/// A capture interrupt that began at `start` ends.
pub(crate) fn capture_took(start: u32) {
    CAPTURE.fetch_max(DWT::cycle_count().wrapping_sub(start), Ordering::Relaxed);
}

/// An encoder step, by the level of channel B at the rising edge of A.
pub(crate) fn step(b_is_high: bool) {
    if b_is_high { &BACKWARD } else { &FORWARD }.fetch_add(1, Ordering::Relaxed);
}

#[allow(unsafe_code)] // symbols of the linker script; their addresses alone are used
mod bounds {
    unsafe extern "C" {
        static _stack_start: u32;
        static _stack_end: u32;
    }

    /// Lowest and highest address of the stack.
    pub(super) fn stack() -> (usize, usize) {
        (&raw const _stack_end as usize, &raw const _stack_start as usize)
    }
}

/// Counts the paint that is left at the bottom of the stack. Takes about a millisecond: for the idle loop.
pub(crate) fn measure_stack() {
    let (end, start) = bounds::stack();
    let mut at = end;
    #[allow(unsafe_code)] // words of RAM between the two symbols
    while at < start && unsafe { (at as *const u32).read_volatile() } == cortex_m_rt::STACK_PAINT_VALUE {
        at += 4;
    }
    STACK_FREE.store((at - end) as u32, Ordering::Relaxed);
}

/// What this processor measures of itself; `index` is the encoder's index marks so far.
pub(crate) fn vitals(index: u16) -> Vitals {
    let (end, start) = bounds::stack();
    Vitals {
        tick_cycles: TICK.load(Ordering::Relaxed),
        capture_cycles: CAPTURE.load(Ordering::Relaxed),
        stack_free: STACK_FREE.load(Ordering::Relaxed),
        stack_size: (start - end) as u32,
        steps: [FORWARD.load(Ordering::Relaxed), BACKWARD.load(Ordering::Relaxed)],
        index,
    }
}
