//! Four input captures on a 32-bit timer.
//!
//! What it is: the edges of the simulated sensors as the timer latches them, moved into the firmware's queues as its interrupt does.
//! What can go wrong: a queue that is full loses the edge, and its channel is marked, as on the board.
//! Units: ticks of 84 MHz since the timer was started, modulo 2^32.
//! Reference: RM0090 section 18.3.5 (input capture); `firmware_rig::queue`.

use super::pins::RigPins;
use firmware_rig::queue::EdgeQueue;
use frame::rig::CAPTURE_CHANNELS;

/// The capture timer.
pub struct CaptureTimer {
    pins: RigPins,
    start_ticks: u64,
}

impl CaptureTimer {
    /// Starts the timer at zero; edges from before are nobody's.
    #[must_use]
    pub fn start(pins: &RigPins) -> Self {
        Self { pins: pins.clone(), start_ticks: pins.clock().ticks().0 }
    }

    /// The counter now.
    #[must_use]
    pub fn counter(&self) -> u32 {
        (self.pins.clock().ticks().0 - self.start_ticks) as u32
    }

    /// Moves every edge so far into its channel's queue; which channels lost one.
    pub fn serve(&self, queues: &[EdgeQueue; CAPTURE_CHANNELS]) -> [bool; CAPTURE_CHANNELS] {
        let now_ns = self.pins.clock().now_ns();
        let mut behind = self.pins.now();
        let mut lost = [false; CAPTURE_CHANNELS];
        while let Some(edge) = behind.bench.edge_until(now_ns) {
            let channel = usize::from(edge.channel);
            if edge.rising && edge.at_ticks >= self.start_ticks {
                lost[channel] |= !queues[channel].put((edge.at_ticks - self.start_ticks) as u32);
            }
        }
        lost
    }
}
