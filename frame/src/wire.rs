//! The wire: COBS-delimited frames with version, sequence number, tick timestamp and CRC.
//!
//! What it is: `[version u8][sequence u16 LE][ticks u64 LE][postcard payload][CRC-32 LE]`, COBS-stuffed, ended by a zero byte.
//! What can go wrong: a damaged or truncated frame costs that frame alone; it is counted, and a gap in the sequence
//! counts the frames that never came.
//! Units: bytes; ticks of the capture timer.
//! Reference: Cheshire & Baker 1999 (COBS); CRC-32/ISO-HDLC; postcard wire format 1.0.

use crate::units::Ticks;
use crc::{CRC_32_ISO_HDLC, Crc};
use serde::{Serialize, de::DeserializeOwned};

/// Version of the frame layout and of the message sets; before it there were 1, 31, 0xF4 and 0xF5. Not printable, no line end, and longer than any frame
/// (the first byte of a stuffed frame is at most its length): so a board that takes typed lines as well tells a frame that begins without a
/// stuffing byte from one that begins with it.
pub const VERSION: u8 = 0xF6;
/// Longest frame before stuffing, bytes.
pub const MAX_FRAME: usize = 240;
/// Longest frame on the wire: COBS adds one byte in 254, plus the delimiter.
pub const MAX_WIRE: usize = MAX_FRAME + 2 + 1;
const HEADER: usize = 11;
const TRAILER: usize = 4;

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// CRC-32/ISO-HDLC of `bytes`, by the table that the frames' own checksum has.
#[must_use]
pub fn checksum(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// Why a message could not be put on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum EncodeError {
    /// The message does not fit [`MAX_FRAME`], or the output buffer is shorter than [`MAX_WIRE`].
    TooLong,
}

impl core::fmt::Display for EncodeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooLong => f.write_str("the message is longer than a frame"),
        }
    }
}

impl core::error::Error for EncodeError {}

/// Numbers and stuffs outgoing messages.
#[derive(Debug, Clone, Copy, Default)]
pub struct Encoder {
    sequence: u16,
}

impl Encoder {
    /// Writes `message` into `out` and returns how many bytes of it to send, the final zero included.
    ///
    /// # Errors
    /// [`EncodeError::TooLong`] when it does not fit; the sequence number is not used up then.
    pub fn encode<T: Serialize>(&mut self, at: Ticks, message: &T, out: &mut [u8; MAX_WIRE]) -> Result<usize, EncodeError> {
        let mut raw = [0u8; MAX_FRAME];
        let (head, rest) = raw.split_at_mut(HEADER);
        let [v, s0, s1, time @ ..] = head else { return Err(EncodeError::TooLong) };
        *v = VERSION;
        [*s0, *s1] = self.sequence.to_le_bytes();
        time.copy_from_slice(&at.0.to_le_bytes());
        let room = rest.len() - TRAILER;
        let payload = rest.get_mut(..room).ok_or(EncodeError::TooLong)?;
        let used = postcard::to_slice(message, payload).map_err(|_| EncodeError::TooLong)?.len();
        let body = HEADER + used;
        let crc = checksum(raw.get(..body).ok_or(EncodeError::TooLong)?);
        raw.get_mut(body..body + TRAILER).ok_or(EncodeError::TooLong)?.copy_from_slice(&crc.to_le_bytes());
        let n =
            cobs::try_encode(raw.get(..body + TRAILER).ok_or(EncodeError::TooLong)?, out).map_err(|_| EncodeError::TooLong)?;
        *out.get_mut(n).ok_or(EncodeError::TooLong)? = 0;
        self.sequence = self.sequence.wrapping_add(1);
        Ok(n + 1)
    }
}

/// Tells a new frame from one that came before.
///
/// A frame is new when its time of sending is later than that of the last new one, or the same with a sequence number ahead of it.
/// Senders put a clock that never runs backwards into the time (a host: time since 1970 in ticks).
#[derive(Debug, Clone, Copy, Default)]
pub struct Freshness {
    last: Option<(Ticks, u16)>,
}

impl Freshness {
    /// Whether the frame is new; a new one is remembered.
    pub fn is_new(&mut self, at: Ticks, sequence: u16) -> bool {
        let new = self.last.is_none_or(|(then, number)| {
            let ahead = sequence.wrapping_sub(number);
            at > then || (at == then && ahead != 0 && ahead < 1 << 15)
        });
        if new {
            self.last = Some((at, sequence));
        }
        new
    }
}

/// What the decoder has seen so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LinkStats {
    /// Good frames.
    pub good: u32,
    /// Frames with a wrong checksum, wrong stuffing, an unknown payload or too much length.
    pub damaged: u32,
    /// Frames of another protocol version.
    pub foreign: u32,
    /// Frames that the gaps in the sequence say were sent and never came whole (damaged ones included).
    pub missing: u32,
}

/// One good frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Received<T> {
    /// Sequence number.
    pub sequence: u16,
    /// Board time of sending.
    pub at: Ticks,
    /// The message.
    pub message: T,
}

/// Takes bytes one at a time and gives whole messages.
#[derive(Debug, Clone)]
pub struct Decoder {
    buffer: [u8; MAX_WIRE],
    used: usize,
    overflow: bool,
    last: Option<u16>,
    stats: LinkStats,
}

impl Default for Decoder {
    fn default() -> Self {
        Self { buffer: [0; MAX_WIRE], used: 0, overflow: false, last: None, stats: LinkStats::default() }
    }
}

impl Decoder {
    /// Counters so far.
    #[must_use]
    pub fn stats(&self) -> LinkStats {
        self.stats
    }

    /// Takes one byte; gives a message when it completes a good frame.
    pub fn push<T: DeserializeOwned>(&mut self, byte: u8) -> Option<Received<T>> {
        if byte != 0 {
            match self.buffer.get_mut(self.used) {
                Some(slot) => {
                    *slot = byte;
                    self.used += 1;
                }
                None => self.overflow = true,
            }
            return None;
        }
        let (length, overflow) = (self.used, self.overflow);
        self.used = 0;
        self.overflow = false;
        if length == 0 && !overflow {
            return None; // an empty frame is how a sender resynchronises the line
        }
        let parsed = if overflow { None } else { self.parse(length) };
        match parsed {
            Some(Ok(received)) => {
                if let Some(last) = self.last {
                    self.stats.missing += u32::from(received.sequence.wrapping_sub(last).wrapping_sub(1));
                }
                self.last = Some(received.sequence);
                self.stats.good += 1;
                Some(received)
            }
            Some(Err(())) => {
                self.stats.foreign += 1;
                None
            }
            None => {
                self.stats.damaged += 1;
                None
            }
        }
    }

    /// `None` is damage, `Some(Err(()))` a good checksum of another version.
    fn parse<T: DeserializeOwned>(&mut self, length: usize) -> Option<Result<Received<T>, ()>> {
        let mut plain = [0u8; MAX_WIRE];
        let report = cobs::decode(self.buffer.get(..length)?, &mut plain).ok()?;
        let frame = plain.get(..report.frame_size())?;
        let body = frame.len().checked_sub(TRAILER)?;
        let (content, crc) = frame.split_at_checked(body)?;
        if checksum(content).to_le_bytes() != *crc {
            return None;
        }
        let (head, payload) = content.split_at_checked(HEADER)?;
        let [version, s0, s1, time @ ..] = head else { return None };
        if *version != VERSION {
            return Some(Err(()));
        }
        let at = Ticks(u64::from_le_bytes(time.try_into().ok()?));
        let (message, rest) = postcard::take_from_bytes(payload).ok()?;
        if !rest.is_empty() {
            return None; // it only begins as one of ours: a board that hears itself must not obey
        }
        Some(Ok(Received { sequence: u16::from_le_bytes([*s0, *s1]), at, message }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::esc::{EscCode, EscVerdict};
    use crate::message::{Command, Message};
    use crate::rig::RigSample;
    use proptest::prelude::*;

    /// A sample begins as `Arm` does, an event as a beep.
    #[test]
    fn what_a_board_says_is_no_command() {
        let (mut encoder, mut decoder) = (Encoder::default(), Decoder::default());
        let state = crate::message::Event::State { from: Default::default(), to: Default::default(), at: Ticks(9) };
        for message in [Message::Rig(RigSample::default()), Message::Event(state), Message::Health(Default::default())] {
            let mut out = [0; MAX_WIRE];
            let len = encoder.encode(Ticks(1), &message, &mut out).unwrap();
            assert!(out[..len].iter().all(|byte| decoder.push::<Command>(*byte).is_none()), "{message:?}");
        }
        assert_eq!((decoder.stats().good, decoder.stats().damaged), (0, 3));
    }

    fn stream(n: u16) -> (Vec<u8>, Vec<usize>) {
        let mut encoder = Encoder::default();
        let mut bytes = Vec::new();
        let mut ends = Vec::new();
        for i in 0..n {
            let mut out = [0; MAX_WIRE];
            let sample = RigSample { at: Ticks(u64::from(i) * 8_400_000), ..RigSample::default() };
            let len = encoder.encode(sample.at, &Message::Rig(sample), &mut out).unwrap();
            bytes.extend_from_slice(&out[..len]);
            ends.push(bytes.len());
        }
        (bytes, ends)
    }

    extern crate std;
    use std::vec::Vec;

    fn decode(bytes: &[u8]) -> (Vec<Received<Message>>, LinkStats) {
        let mut decoder = Decoder::default();
        let got = bytes.iter().filter_map(|b| decoder.push(*b)).collect();
        (got, decoder.stats())
    }

    #[test]
    fn the_checksum_is_the_published_one() {
        assert_eq!(checksum(b"123456789"), 0xCBF4_3926, "check value of CRC-32/ISO-HDLC");
    }

    #[test]
    fn a_stream_comes_back() {
        let (bytes, _) = stream(300);
        let (got, stats) = decode(&bytes);
        assert_eq!(got.len(), 300);
        assert_eq!(stats, LinkStats { good: 300, ..LinkStats::default() });
        assert_eq!(got[7].at, Ticks(7 * 8_400_000));
    }

    #[test]
    fn the_fullest_sample_fits() {
        let code = crate::rig::AdcCode { sum: u32::MAX, count: u16::MAX, rms_q8: u32::MAX, verdict: Default::default() };
        let capture = crate::rig::CaptureCode { edges: u16::MAX, span: u32::MAX, verdict: Default::default(), uneven: u16::MAX };
        let esc = EscCode {
            verdict: EscVerdict::Garbled,
            temperature: u8::MAX,
            voltage: u16::MAX,
            current: u16::MAX,
            charge: u16::MAX,
            speed: u16::MAX,
            age_ms: u16::MAX,
        };
        let beside = RigSample { esc: Some(esc), back_emf: Some(capture), ..RigSample::default() };
        let sample = RigSample { at: Ticks(u64::MAX), rpm: [capture; 4], adc: [code; 5], ..beside };
        let mut out = [0; MAX_WIRE];
        assert!(Encoder::default().encode(Ticks(u64::MAX), &Message::Rig(sample), &mut out).is_ok());
    }

    #[test]
    fn the_fullest_batch_of_segments_fits() {
        use crate::schedule::{BATCH, Segment, SegmentBatch, Shape};
        use crate::units::PulseWidth;
        let most = PulseWidth(u32::MAX);
        for shape in [
            Shape::Chirp { amplitude: most, from_millihertz: u32::MAX, to_millihertz: u32::MAX },
            Shape::Steered { low: most, high: most },
        ] {
            let segment = Segment { pulse: PulseWidth::MAX, length_ms: u32::MAX, shape };
            let batch = SegmentBatch { first: u32::MAX, count: BATCH as u8, last: true, segments: [segment; BATCH] };
            let mut out = [0; MAX_WIRE];
            assert!(Encoder::default().encode(Ticks(u64::MAX), &Command::Segments(batch), &mut out).is_ok());
        }
    }

    #[test]
    fn a_newer_version_is_counted_as_foreign() {
        let mut raw = std::vec![VERSION + 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        let crc = CRC.checksum(&raw).to_le_bytes();
        raw.extend_from_slice(&crc);
        let mut bytes = std::vec![0; raw.len() + 2];
        let n = cobs::encode(&raw, &mut bytes);
        bytes.truncate(n);
        bytes.push(0);
        assert_eq!(decode(&bytes).1, LinkStats { foreign: 1, ..LinkStats::default() });
    }

    proptest! {
        /// One damaged byte costs at most the frame that it is in (two when it eats or makes a delimiter).
        #[test]
        fn damage_is_local(position in 0usize..2000, flip in 1u8..=255) {
            let (mut bytes, ends) = stream(40);
            let position = position % bytes.len();
            let delimiter = ends.contains(&(position + 1));
            bytes[position] ^= flip;
            let (got, stats) = decode(&bytes);
            let most = if delimiter { 2 } else { 1 };
            prop_assert!(got.len() >= 40 - most, "{} of 40, {:?}", got.len(), stats);
            prop_assert!(stats.damaged >= 1 || got.len() == 40);
            for r in &got {
                prop_assert_eq!(r.at, Ticks(u64::from(r.sequence) * 8_400_000));
            }
        }

        #[test]
        fn garbage_never_panics_and_never_passes(bytes in proptest::collection::vec(any::<u8>(), 0..600)) {
            let (got, _) = decode(&bytes);
            prop_assert!(got.is_empty());
        }

        #[test]
        fn truncation_costs_one(cut in 1usize..60) {
            let (bytes, ends) = stream(10);
            let start = ends[3];
            let mut broken = bytes[..start].to_vec();
            let frame = &bytes[start..ends[4]];
            broken.extend_from_slice(&frame[..frame.len().saturating_sub(cut.min(frame.len() - 1))]);
            broken.push(0);
            broken.extend_from_slice(&bytes[ends[4]..]);
            let (got, stats) = decode(&broken);
            prop_assert!(got.len() >= 9);
            prop_assert_eq!(stats.missing as usize, 10 - got.len());
        }

        #[test]
        fn commands_come_back(ns in 0u32..3_000_000, hold in any::<u32>(), index in any::<u8>(), ramp in any::<bool>()) {
            let command = Command::ScheduleStep { index, pulse: crate::units::PulseWidth(ns), hold_ms: hold, ramp };
            let mut out = [0; MAX_WIRE];
            let n = Encoder::default().encode(Ticks(0), &command, &mut out).unwrap();
            let mut decoder = Decoder::default();
            let got: Vec<Received<Command>> = out[..n].iter().filter_map(|b| decoder.push(*b)).collect();
            prop_assert_eq!(got.len(), 1);
            prop_assert_eq!(got[0].message, command);
        }
    }
}
