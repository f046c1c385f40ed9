//! A burst: every conversion of one analogue channel, for a spectrum of what vibrates.
//!
//! What it is: once asked for, the conversions of the channel fill a memory that the host lends, without a gap; then they leave in parts,
//! where the line has room beside the samples.
//! What can go wrong: conversions that were lost (the scan was started anew) begin the burst anew; so does a second request. A part that the
//! line loses leaves a gap that the receiver sees, and the whole burst is asked for again.
//! Units: counts; conversions a second of the channel.
//! Reference: specification `rig.md`, "On a real bench" ("a burst of every conversion of one channel (vibration spectrum) on request").

use frame::message::{BURST_PART, BurstPart};
use frame::units::Ticks;

/// Conversions of a burst on the board: 0.40 s at 61.8 kHz, 0.16 s at 155.6 kHz; a spectrum of 2.5 Hz and 6.3 Hz.
pub const LENGTH: usize = 24_576;

/// What a host brings of the channel that [`Burst::wanted`] names.
#[derive(Debug, Clone, Copy)]
pub struct Conversions<'a> {
    /// Its conversions since the last tick, in order; `None`: some were lost.
    pub codes: Option<&'a [u16]>,
    /// How many there are in a second.
    pub rate_hz: f32,
}

/// Where a burst stands.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
enum Phase {
    #[default]
    Idle,
    Filling {
        channel: u8,
        from: Option<Ticks>,
        filled: usize,
    },
    Sending {
        channel: u8,
        from: Ticks,
        rate_hz: f32,
        at: usize,
    },
}

/// A burst under way, or none.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Burst {
    phase: Phase,
}

impl Burst {
    /// Begins to record a channel; what was under way is given up.
    pub(crate) fn begin(&mut self, channel: u8) {
        self.phase = Phase::Filling { channel, from: None, filled: 0 };
    }

    /// The channel whose conversions are wanted.
    pub(crate) fn wanted(&self) -> Option<usize> {
        match self.phase {
            Phase::Filling { channel, .. } => Some(usize::from(channel)),
            _ => None,
        }
    }

    /// Takes the conversions of the tick at `now` into `memory`.
    pub(crate) fn take(&mut self, now: Ticks, conversions: &Conversions<'_>, memory: &mut [u16]) {
        let Phase::Filling { channel, from, filled } = self.phase else { return };
        let Some(codes) = conversions.codes else {
            self.begin(channel);
            return;
        };
        let from = from.or((!codes.is_empty()).then_some(now));
        let room = memory.get_mut(filled..).unwrap_or(&mut []);
        let mut filled = filled;
        for (slot, code) in room.iter_mut().zip(codes) {
            *slot = *code;
            filled += 1;
        }
        self.phase = match from {
            Some(from) if filled >= memory.len() => Phase::Sending { channel, from, rate_hz: conversions.rate_hz, at: 0 },
            _ => Phase::Filling { channel, from, filled },
        };
    }

    /// The next part that is to leave.
    pub(crate) fn part(&self, memory: &[u16]) -> Option<BurstPart> {
        let Phase::Sending { channel, from, rate_hz, at } = self.phase else { return None };
        let mut codes = [[0; 32]; BURST_PART / 32];
        let rest = memory.get(at..).filter(|rest| !rest.is_empty())?;
        for (slot, code) in codes.iter_mut().flatten().zip(rest) {
            *slot = *code;
        }
        let length = u16::try_from(memory.len()).unwrap_or(u16::MAX);
        Some(BurstPart { channel, from, rate_hz, length, at: at as u16, codes })
    }

    /// The part that [`Burst::part`] gave has left.
    pub(crate) fn sent(&mut self, memory: &[u16]) {
        let Phase::Sending { channel, from, rate_hz, at } = self.phase else { return };
        let at = at + BURST_PART;
        self.phase = if at < memory.len() { Phase::Sending { channel, from, rate_hz, at } } else { Phase::Idle };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn conversions(codes: &[u16]) -> Conversions<'_> {
        Conversions { codes: Some(codes), rate_hz: 61_765.0 }
    }

    fn sent(burst: &mut Burst, memory: &[u16]) -> (Vec<u16>, Vec<BurstPart>) {
        let mut parts = Vec::new();
        while let Some(part) = burst.part(memory) {
            parts.push(part);
            burst.sent(memory);
        }
        let mut codes: Vec<u16> = parts.iter().flat_map(|p| p.codes.iter().flatten().copied()).collect();
        codes.truncate(parts.first().map_or(0, |p| usize::from(p.length)));
        (codes, parts)
    }

    #[test]
    fn what_was_converted_leaves_in_order_and_whole() {
        let (mut burst, mut memory) = (Burst::default(), [0; 500]);
        assert_eq!((burst.wanted(), burst.part(&memory)), (None, None));
        burst.begin(3);
        assert_eq!(burst.wanted(), Some(3));
        let all: Vec<u16> = (0..600).collect();
        for (ms, codes) in (1..).zip(all.chunks(62)) {
            burst.take(Ticks::from_ms(ms), &conversions(codes), &mut memory);
        }
        assert_eq!(burst.wanted(), None, "the memory is full");
        let (codes, parts) = sent(&mut burst, &memory);
        assert_eq!(codes, all[..500]);
        assert!(parts.iter().all(|p| (p.channel, p.from, p.length) == (3, Ticks::from_ms(1), 500)), "{parts:?}");
        assert_eq!(parts.iter().map(|p| p.at).collect::<Vec<_>>(), [0, 96, 192, 288, 384, 480]);
        assert_eq!(burst.part(&memory), None, "told once");
    }

    #[test]
    fn lost_conversions_begin_it_anew() {
        let (mut burst, mut memory) = (Burst::default(), [0; 100]);
        burst.begin(0);
        burst.take(Ticks::from_ms(1), &conversions(&[1; 60]), &mut memory);
        burst.take(Ticks::from_ms(2), &Conversions { codes: None, rate_hz: 61_765.0 }, &mut memory);
        burst.take(Ticks::from_ms(3), &conversions(&[2; 60]), &mut memory);
        burst.take(Ticks::from_ms(4), &conversions(&[3; 60]), &mut memory);
        let (codes, parts) = sent(&mut burst, &memory);
        assert_eq!((codes[0], codes[59], codes[60], parts[0].from), (2, 2, 3, Ticks::from_ms(3)));
    }
}
