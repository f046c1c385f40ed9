//! A stop between two ticks.
//!
//! What it is: the control tick is called twice a millisecond and works every second time; a stop (key or command) is looked for
//! each time and acts on the pulse timer at once. So a stop is in the timer at most half a millisecond after it came, whatever its
//! phase, and the next pulse that starts more than a millisecond after it is a minimum pulse. The loop is normally closed to ground: open
//! means stop, so that a broken wire stops as well.
//! What can go wrong: a tick that began before the stop may still write its pulse after it; the half tick that follows overwrites
//! it, because a tick is over within half a millisecond (`budgets/rig.toml`).
//! Units: half milliseconds.
//! Reference: specification `rig.md`, "ESC pulse and arming" ("The first pulse that starts more than 1 ms after the stop event is
//! minimum").

/// What is to be done now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Half {
    /// Write the minimum pulse to the timer, before anything else.
    pub minimum: bool,
    /// The control tick is due.
    pub tick: bool,
}

/// The stop loop as the tick knows it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct StopLoop {
    /// Open now.
    pub(crate) open: bool,
    /// It was closed at some time since the reset.
    pub(crate) known: bool,
}

/// Remembers a stop until the tick has taken it.
#[derive(Debug, Clone, Copy, Default)]
pub struct StopWatch {
    seen: bool,
    between: bool,
}

impl StopWatch {
    /// Called twice a millisecond with whether the stop loop is open and whether a stop of the host waits in the line.
    pub fn half(&mut self, open: bool, waits: bool) -> Half {
        self.seen |= open;
        self.between = !self.between;
        Half { minimum: self.seen || waits, tick: !self.between }
    }

    /// Whether the next look is that of a control tick.
    pub(crate) fn tick_is_next(&self) -> bool {
        self.between
    }

    /// Whether the loop was open at some look since the last tick.
    pub fn take(&mut self) -> bool {
        core::mem::take(&mut self.seen)
    }
}
