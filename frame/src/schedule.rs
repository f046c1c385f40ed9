//! A schedule on the line: segments, and what a host may still change while one is being played.
//!
//! What it is: [`Segment`] (a pulse, a length and how the pulse gets there), eight of them in a frame ([`SegmentBatch`]), and what the
//! board answers ([`ScheduleNews`]). A schedule that is longer than the board's memory is sent ahead of its playing.
//! What can go wrong: a gap in the numbers and an impossible segment are refused in the answer; segments that are there already are
//! not taken twice, so that a host may send again what it is not sure of.
//! Units: nanoseconds of pulse, milliseconds, millihertz.
//! Reference: specification `rig.md`, "ESC pulse and arming" (schedules) and "The operator's side".

use crate::rig::Refusals;
use crate::units::{PulseWidth, Ticks};
use serde::{Deserialize, Serialize};

/// Segments in one frame.
pub const BATCH: usize = 8;
/// Highest frequency of a chirp, millihertz: an ESC takes 50 pulses a second.
pub const FASTEST_MHZ: u32 = 100_000;

/// How the pulse moves within a segment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Shape {
    /// At the segment's pulse from its first millisecond to its last.
    #[default]
    Hold,
    /// In a straight line to the segment's pulse, which is reached as the next segment begins.
    Line {
        /// Where it begins; `None`: where the segment before ended, 1000 us for the first.
        from: Option<PulseWidth>,
    },
    /// A sine about the segment's pulse whose frequency moves linearly.
    Chirp {
        /// Amplitude.
        amplitude: PulseWidth,
        /// Frequency at the beginning, millihertz.
        from_mhz: u32,
        /// Frequency at the end, millihertz.
        to_mhz: u32,
    },
    /// The host may move the pulse within these bounds, and may end the segment before its time.
    Steered {
        /// Lowest pulse.
        low: PulseWidth,
        /// Highest pulse.
        high: PulseWidth,
    },
}

/// A piece of a schedule.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Segment {
    /// Its pulse.
    pub pulse: PulseWidth,
    /// How long it lasts, milliseconds; not 0.
    pub length_ms: u32,
    /// How the pulse moves.
    pub shape: Shape,
}

impl Segment {
    /// Whether the board would play it: every pulse that it can give lies in 1000 to 2000 us, and it takes time.
    #[must_use]
    pub fn is_possible(&self) -> bool {
        let inside = |pulse: PulseWidth| pulse == pulse.clamped();
        let shape = match self.shape {
            Shape::Hold | Shape::Line { from: None } => true,
            Shape::Line { from: Some(from) } => inside(from),
            Shape::Chirp { amplitude, from_mhz, to_mhz } => {
                inside(PulseWidth(self.pulse.0.saturating_add(amplitude.0)))
                    && inside(PulseWidth(self.pulse.0.saturating_sub(amplitude.0)))
                    && from_mhz <= FASTEST_MHZ
                    && to_mhz <= FASTEST_MHZ
            }
            Shape::Steered { low, high } => inside(low) && inside(high) && (low..=high).contains(&self.pulse),
        };
        shape && inside(self.pulse) && self.length_ms > 0
    }

    /// Highest pulse that it can give.
    #[must_use]
    pub fn highest(&self) -> PulseWidth {
        match self.shape {
            Shape::Hold | Shape::Line { from: None } => self.pulse,
            Shape::Line { from: Some(from) } => self.pulse.max(from),
            Shape::Chirp { amplitude, .. } => PulseWidth(self.pulse.0.saturating_add(amplitude.0)),
            Shape::Steered { high, .. } => high,
        }
    }
}

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

    /// Nothing but a question.
    #[must_use]
    pub fn question(next: u32) -> Self {
        Self { first: next, count: 0, last: false, segments: [Segment::default(); BATCH] }
    }
}

/// What a host does to a segment that it steers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Steer {
    /// Move the pulse.
    Pulse(PulseWidth),
    /// End it, and go on with the next.
    GoOn,
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
