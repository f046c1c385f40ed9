//! A piece of a schedule.
//!
//! What it is: [`Segment`], a pulse, a length and how the pulse gets there ([`Shape`]); what may be done to one while it is played ([`Steer`]).
//! What can go wrong: a segment with a pulse out of 1000 to 2000 us, without length, or with too fast a sine is not possible
//! ([`Segment::is_possible`]): a [`crate::Track`] refuses it.
//! Units: nanoseconds of pulse, milliseconds, millihertz.
//! Reference: Beharie 2013, section 3.2.6.

use crate::units::PulseWidth;

/// Highest frequency of a chirp, millihertz: an ESC takes 50 pulses a second.
pub const FASTEST_MILLIHERTZ: u32 = 100_000;

/// How the pulse moves within a segment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
        from_millihertz: u32,
        /// Frequency at the end, millihertz.
        to_millihertz: u32,
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
            Shape::Chirp { amplitude, from_millihertz, to_millihertz } => {
                inside(PulseWidth(self.pulse.0.saturating_add(amplitude.0)))
                    && inside(PulseWidth(self.pulse.0.saturating_sub(amplitude.0)))
                    && from_millihertz <= FASTEST_MILLIHERTZ
                    && to_millihertz <= FASTEST_MILLIHERTZ
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

/// What a host does to a segment that it steers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Steer {
    /// Move the pulse.
    Pulse(PulseWidth),
    /// End it, and go on with the next.
    GoOn,
}
