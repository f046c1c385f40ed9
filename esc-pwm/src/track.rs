//! A schedule of the host as it is played: segments in a ring, sent ahead where they are too many.
//!
//! What it is: [`Track`] holds up to [`TRACK`] segments and knows which pulse belongs to a time. What was played makes room for
//! what comes; a schedule that fits stays, and can be played again.
//! What can go wrong: a track that is played to the end of what is there, with the schedule's end still missing, has run dry
//! ([`Played::Dry`]): that is a fault, never a pulse. One that is too short to begin with is refused.
//! Units: milliseconds since the track was started, nanoseconds of pulse.
//! Reference: specification `rig.md`, "ESC pulse and arming" (schedules), "The operator's side".

use crate::fault::Refusals;
use crate::schedule::{Chirp, between};
use crate::segment::{Segment, Shape, Steer};
use crate::units::PulseWidth;

/// Segments that a board keeps.
pub const TRACK: usize = 128;
/// What must be there before an unfinished track may begin, milliseconds: half of the link's shortest usual time-out.
pub const AHEAD_MS: u64 = 500;

/// What a time gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Played {
    /// This pulse.
    Pulse(PulseWidth),
    /// The schedule is over.
    Over,
    /// More was to come and is not there.
    Dry,
}

/// Where the track is being played.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Cursor {
    segment: u32,
    /// When it began, milliseconds since the start.
    begun_ms: u64,
    /// Where the segment before ended.
    from: PulseWidth,
    /// Where the host has moved the pulse.
    steered: Option<PulseWidth>,
}

/// The segments of a schedule, as far as they are there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Track {
    ring: [Segment; TRACK],
    /// Number of the oldest that is kept, and of the one that is to come next.
    first: u32,
    next: u32,
    /// The schedule's last segment is there.
    whole: bool,
    cursor: Option<Cursor>,
}

impl Default for Track {
    fn default() -> Self {
        Self::new()
    }
}

impl Track {
    /// Nothing.
    #[must_use]
    pub const fn new() -> Self {
        let nothing = Segment { pulse: PulseWidth::MIN, length_ms: 0, shape: Shape::Hold };
        Self { ring: [nothing; TRACK], first: 0, next: 0, whole: false, cursor: None }
    }

    fn segment(&self, number: u32) -> Option<&Segment> {
        if (self.first..self.next).contains(&number) { self.ring.get(number as usize % TRACK) } else { None }
    }

    /// Takes `segments` that follow those that are there, as numbers `first` and on; what is there already is passed over. `last`: the
    /// schedule ends with the last of them.
    ///
    /// # Errors
    /// [`Refusals::OUT_OF_RANGE`] when some would be left out, one is impossible, the schedule has ended already, or there is no room.
    /// Those before it are kept.
    pub fn take(&mut self, first: u32, segments: &[Segment], last: bool) -> Result<(), Refusals> {
        let Some(final_one) = segments.len().checked_sub(1) else { return Ok(()) };
        for (place, segment) in (0..).zip(segments) {
            let number = first.checked_add(place).ok_or(Refusals(Refusals::OUT_OF_RANGE))?;
            self.put(number, *segment)?;
        }
        self.whole |= last && u64::from(first) + final_one as u64 + 1 == u64::from(self.next);
        Ok(())
    }

    /// Puts one segment at `number`; number 0 begins a new schedule, unless one is being played.
    ///
    /// # Errors
    /// As [`Track::take`].
    fn put(&mut self, number: u32, segment: Segment) -> Result<(), Refusals> {
        const REFUSED: Refusals = Refusals(Refusals::OUT_OF_RANGE);
        if number == 0 && self.cursor.is_none() {
            (self.first, self.next, self.whole) = (0, 0, false);
        }
        if number < self.next {
            return Ok(());
        }
        if number > self.next || !segment.is_possible() || self.room() == 0 {
            return Err(REFUSED);
        }
        if self.whole {
            if self.cursor.is_some() {
                return Err(REFUSED);
            }
            self.whole = false;
        }
        if self.next - self.first == TRACK as u32 {
            self.first += 1;
        }
        let slot = self.ring.get_mut(number as usize % TRACK).ok_or(REFUSED)?;
        *slot = segment;
        self.next = self.next.checked_add(1).ok_or(REFUSED)?;
        Ok(())
    }

    /// Appends one segment as the schedule's last, at `number`.
    ///
    /// # Errors
    /// As [`Track::take`].
    pub fn append_last(&mut self, number: u32, segment: Segment) -> Result<(), Refusals> {
        if number < self.next && number > 0 {
            return Err(Refusals(Refusals::OUT_OF_RANGE));
        }
        self.put(number, segment)?;
        self.whole = true;
        Ok(())
    }

    /// Segments for which there is room: what was played makes room.
    #[must_use]
    pub fn room(&self) -> u16 {
        let needed = self.cursor.map_or(self.first, |cursor| cursor.segment.max(self.first));
        (TRACK as u32).saturating_sub(self.next.saturating_sub(needed)) as u16
    }

    /// Number of the segment that is to come next.
    #[must_use]
    pub const fn next(&self) -> u32 {
        self.next
    }

    /// The segment that is being played, and when it began.
    #[must_use]
    pub fn playing(&self) -> Option<(u32, u64)> {
        self.cursor.map(|cursor| (cursor.segment, cursor.begun_ms))
    }

    /// What speaks against playing it from its beginning.
    #[must_use]
    pub fn check(&self) -> Refusals {
        let there = self.first == 0 && self.next > 0;
        let ahead: u64 = if self.whole {
            u64::MAX
        } else {
            (0..self.next).filter_map(|n| self.segment(n)).map(|s| u64::from(s.length_ms)).sum()
        };
        Refusals::default().with_if(Refusals::EMPTY_SCHEDULE, !there).with_if(Refusals::SHORT_STREAM, there && ahead < AHEAD_MS)
    }

    /// Begins to play it, at time 0.
    pub fn start(&mut self) {
        self.cursor = Some(Cursor { segment: 0, begun_ms: 0, from: PulseWidth::MIN, steered: None });
    }

    /// Plays it no more. What is still there can be started again from its beginning, if that is still there.
    pub fn stop(&mut self) {
        self.cursor = None;
    }

    /// The pulse `ms` milliseconds after the start; times must not run backwards.
    pub fn at(&mut self, ms: u64) -> Played {
        while let Some(cursor) = self.cursor {
            let Some(segment) = self.segment(cursor.segment) else {
                return if self.whole { Played::Over } else { Played::Dry };
            };
            let age = ms.saturating_sub(cursor.begun_ms);
            let length = u64::from(segment.length_ms);
            if age < length {
                return Played::Pulse(pulse_of(segment, &cursor, age));
            }
            let from = pulse_of(segment, &cursor, length);
            self.cursor = Some(Cursor { segment: cursor.segment + 1, begun_ms: cursor.begun_ms + length, from, steered: None });
        }
        Played::Over
    }

    /// Does to the segment that is being played what the host asks, `ms` milliseconds after the start.
    ///
    /// # Errors
    /// [`Refusals::WRONG_STATE`] when another segment is being played, or it is not steered; [`Refusals::OUT_OF_RANGE`] when the pulse
    /// is beyond its bounds.
    pub fn steer(&mut self, number: u32, how: Steer, ms: u64) -> Result<(), Refusals> {
        const ELSEWHERE: Refusals = Refusals(Refusals::WRONG_STATE);
        let cursor = self.cursor.filter(|cursor| cursor.segment == number).ok_or(ELSEWHERE)?;
        let segment = self.segment(number).ok_or(ELSEWHERE)?;
        let Shape::Steered { low, high } = segment.shape else { return Err(ELSEWHERE) };
        self.cursor = Some(match how {
            Steer::Pulse(pulse) if (low..=high).contains(&pulse) => Cursor { steered: Some(pulse), ..cursor },
            Steer::Pulse(_) => return Err(Refusals(Refusals::OUT_OF_RANGE)),
            Steer::GoOn => {
                let from = cursor.steered.unwrap_or(segment.pulse);
                Cursor { segment: number + 1, begun_ms: ms, from, steered: None }
            }
        });
        Ok(())
    }
}

/// Pulse of a segment `age` milliseconds after it began.
fn pulse_of(segment: &Segment, cursor: &Cursor, age: u64) -> PulseWidth {
    match segment.shape {
        Shape::Hold => segment.pulse,
        Shape::Line { from } => between(from.unwrap_or(cursor.from), segment.pulse, age, u64::from(segment.length_ms)),
        Shape::Chirp { amplitude, from_millihertz, to_millihertz } => {
            Chirp { centre: segment.pulse, amplitude, from_millihertz, to_millihertz, length_ms: segment.length_ms }.value(age)
        }
        Shape::Steered { .. } => cursor.steered.unwrap_or(segment.pulse),
    }
}
