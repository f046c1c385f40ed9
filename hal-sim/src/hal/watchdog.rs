//! The independent watchdog.
//!
//! What it is: unless it is fed in time it resets the board: the pulse pin is let go, conversions end, and the reset cause says why.
//! What can go wrong: once started there is no way back.
//! Units: ns.
//! Reference: RM0090 section 21.3 (IWDG); the board's 20 ms (`firmware-rig/src/board/watchdog.rs`).

use super::pins::RigPins;

/// The watchdog.
pub struct Watchdog {
    pins: RigPins,
    timeout_ns: u64,
    life: u32,
}

impl Watchdog {
    /// Starts it.
    #[must_use]
    pub fn start(pins: &RigPins, timeout_ns: u64) -> Self {
        let life = pins.now().life;
        let mut this = Self { pins: pins.clone(), timeout_ns, life };
        this.feed();
        this
    }

    /// Another time-out from now.
    pub fn feed(&mut self) {
        let now_ns = self.pins.clock().now_ns();
        let mut behind = self.pins.now();
        if behind.life == self.life {
            behind.deadline_ns = Some(now_ns + self.timeout_ns);
        }
    }
}
