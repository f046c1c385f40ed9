//! A board's milliseconds, held to the clock.
//!
//! What it is: waits until a millisecond of the board is due; at twice the speed it is due twice as early, at speed 0 at once.
//! What can go wrong: a machine that is late makes the board late: its time stands still for as long, and nothing is caught up in a hurry.
//! Units: ms of the board's time.
//! Reference: specification `rig.md`, "The simulator".

use std::time::{Duration, Instant};

/// How far the board may lag behind the clock before its time stands still.
const LAG: Duration = Duration::from_millis(20);

/// Holds a board to the clock.
#[derive(Debug)]
pub struct Pace {
    begun: Instant,
    /// Seconds of the clock for a second of the board.
    scale: f64,
}

impl Pace {
    /// Board time begins now and passes `speed` times as fast as the clock; 0 for as fast as it goes.
    #[must_use]
    pub fn new(speed: f64) -> Self {
        Self { begun: Instant::now(), scale: if speed > 0.0 { speed.recip() } else { 0.0 } }
    }

    /// Waits until `ms` milliseconds of the board have passed.
    pub fn wait(&mut self, ms: u64) {
        if self.scale <= 0.0 {
            return;
        }
        let due = Duration::from_millis(ms).mul_f64(self.scale);
        let passed = self.begun.elapsed();
        if passed > due + LAG {
            self.begun += passed - due;
        }
        std::thread::sleep(due.saturating_sub(passed));
    }
}
