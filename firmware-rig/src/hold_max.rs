//! What the range calibration believes of the ESC's supply, and what ends its maximum pulses.
//!
//! What it is: [`SupplyProof`] (off is believed only of a supply that was seen on), and [`HoldWatch`] (edges of the rotor, and the time
//! since the supply came on).
//! What can go wrong: an unplugged sense wire reads 0 V as a supply does that is off. It proves nothing. A wire that comes off
//! after the proof is left to the rotor and to the current. One edge alone may be the spark of plugging in the battery.
//! Units: ms, V.
//! Reference: specification `rig.md`, "On a real bench"; Beharie 2013, Appendix C.

use crate::elapsed::Elapsed;
use frame::rig::CAPTURE_CHANNELS;
use frame::units::{Ticks, Volt};

/// Edges on one channel from which on the rotor counts as turning.
const EDGES: u16 = 2;

/// Whether the supply is known to be off.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SupplyProof {
    on_ms: u32,
    off_ms: u32,
    seen_on: bool,
}

impl SupplyProof {
    /// One tick with the supply's reading, if there is one; `settle_ms` is how long on and off must last to count.
    pub(crate) fn take(&mut self, supply: Option<Volt>, powered: Volt, tick_ms: u32, settle_ms: u32) {
        let Some(supply) = supply else {
            (self.on_ms, self.off_ms) = (0, 0);
            return;
        };
        let on = supply >= powered;
        let counted = |timer: u32, holds: bool| if holds { timer.saturating_add(tick_ms) } else { 0 };
        (self.on_ms, self.off_ms) = (counted(self.on_ms, on), counted(self.off_ms, !on));
        self.seen_on |= self.on_ms >= settle_ms;
    }

    /// How long the supply has read on, ms.
    pub(crate) fn on_ms(&self) -> u32 {
        self.on_ms
    }

    /// Off for long enough, and on before that; `live_zero` where an open wire cannot read as off.
    pub(crate) fn is_off(&self, settle_ms: u32, live_zero: bool) -> bool {
        self.off_ms >= settle_ms && (self.seen_on || live_zero)
    }
}

/// What has happened since maximum is held.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct HoldWatch {
    edges: [u16; CAPTURE_CHANNELS],
    powered: Option<Elapsed>,
}

impl HoldWatch {
    /// One tick: the edges that came in it, and whether the supply is on.
    pub(crate) fn take(&mut self, now: Ticks, taken: [u16; CAPTURE_CHANNELS], powered: bool) {
        for (sum, taken) in self.edges.iter_mut().zip(taken) {
            *sum = sum.saturating_add(taken);
        }
        if powered && self.powered.is_none() {
            self.powered = Some(Elapsed::since(now));
        }
    }

    /// Some channel has seen the rotor move.
    pub(crate) fn stirs(&self) -> bool {
        self.edges.iter().any(|edges| *edges >= EDGES)
    }

    /// Milliseconds since the supply came on.
    pub(crate) fn powered_ms(&mut self, now: Ticks, per_ms: u32) -> u64 {
        self.powered.as_mut().map_or(0, |since| since.ms(now, per_ms))
    }
}
