//! The clock that firmware under simulation reads and waits on.
//!
//! What it is: nanoseconds that only the simulation moves on; bus transfers and delays take their time from it.
//! What can go wrong: it never goes back; [`VirtualClock::advance_to`] an instant that has passed does nothing.
//! Units: ns since power-up.
//! Reference: embedded-hal 1.0, `delay::DelayNs`; house rule 7.

use embedded_hal::delay::DelayNs;
use frame::units::Ticks;
use std::cell::Cell;
use std::rc::Rc;

/// A handle to the one clock of a run; clones are the same clock.
#[derive(Debug, Clone, Default)]
pub struct VirtualClock {
    now_ns: Rc<Cell<u64>>,
}

impl VirtualClock {
    /// Now.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.now_ns.get()
    }

    /// Now, in ticks of the boards' timestamp clock.
    #[must_use]
    pub fn ticks(&self) -> Ticks {
        Ticks(self.now_ns() * 84 / 1000)
    }

    /// Lets time pass.
    pub fn pass_ns(&self, ns: u64) {
        self.now_ns.set(self.now_ns() + ns);
    }

    /// Lets time pass until an instant.
    pub fn advance_to(&self, at_ns: u64) {
        self.now_ns.set(self.now_ns().max(at_ns));
    }
}

impl DelayNs for VirtualClock {
    fn delay_ns(&mut self, ns: u32) {
        self.pass_ns(u64::from(ns));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_moves_every_handle_on_and_nothing_back() {
        let clock = VirtualClock::default();
        clock.clone().delay_us(3);
        assert_eq!((clock.now_ns(), clock.ticks()), (3_000, Ticks(252)));
        clock.advance_to(1_000);
        assert_eq!(clock.now_ns(), 3_000);
        clock.advance_to(10_000_000);
        assert_eq!(clock.ticks(), Ticks::from_ms(10));
    }
}
