//! A schedule on the line: segments, and what a host may still change while one is being played.
//!
//! What it is: [`Segment`] (a pulse, a length and how the pulse gets there), eight of them in a frame ([`SegmentBatch`]), and what the
//! board answers ([`ScheduleNews`]). A schedule that is longer than the board's memory is sent ahead of its playing.
//! What can go wrong: a gap in the numbers and an impossible segment are refused in the answer; segments that are there already are
//! not taken twice, so that a host may send again what it is not sure of.
//! Units: nanoseconds of pulse, milliseconds, millihertz.
//! Reference: specification `rig.md`, "ESC pulse and arming" (schedules) and "The operator's side".

use crate::rig::Refusals;
use crate::units::Ticks;
pub use esc_pwm::segment::{FASTEST_MILLIHERTZ, Segment, Shape, Steer};
use serde::{Deserialize, Serialize};

/// Segments in one frame.
pub const BATCH: usize = 8;
/// Up to eight segments that follow one another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SegmentBatch {
    /// Number of the first of them in the schedule, from 0. Number 0 begins a new schedule, unless one is being played.
    pub first: u32,
    /// How many there are; none only asks for the news.
    pub count: u8,
    /// The schedule ends with the last of them.
    pub last: bool,
    /// They, and after them what is not looked at.
    pub segments: [Segment; BATCH],
}

impl SegmentBatch {
    /// The first segments of `from`, at most [`BATCH`], as numbers `first` and on; `last`: the schedule ends with the last of `from`.
    #[must_use]
    pub fn of(first: u32, from: &[Segment]) -> Self {
        let mut segments = [Segment::default(); BATCH];
        let count = segments.iter_mut().zip(from).map(|(slot, segment)| *slot = *segment).count();
        Self { first, count: count as u8, last: count == from.len(), segments }
    }

    /// Those that are to be looked at; `None` where more are said to be there than a batch holds.
    #[must_use]
    pub fn segments(&self) -> Option<&[Segment]> {
        self.segments.get(..usize::from(self.count))
    }

    /// Nothing but a question.
    #[must_use]
    pub fn question(next: u32) -> Self {
        Self { first: next, count: 0, last: false, segments: [Segment::default(); BATCH] }
    }
}

/// The segment that is being played.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Playing {
    /// Its number.
    pub segment: u32,
    /// When it began, to the millisecond.
    pub since: Ticks,
}

/// How a schedule stands on the board: the answer to segments and to steering.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ScheduleNews {
    /// What is being played, if the schedule runs.
    pub playing: Option<Playing>,
    /// Number of the segment that is to come next.
    pub next: u32,
    /// Segments for which there is room.
    pub room: u16,
    /// Why what was asked was not done; none: it was done.
    pub refused: Refusals,
}
