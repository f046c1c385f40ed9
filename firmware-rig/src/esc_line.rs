//! The ESC's serial telemetry: from bytes of the line to its last good frame.
//!
//! What it is: ten bytes between two silences are a frame: temperature (degC, one byte), then most significant byte first voltage (0.01 V),
//! current (0.01 A), charge (mAh) and electrical speed (100 turns a minute), and a CRC-8. An ESC sends them by itself, some 32 a second, or
//! one when a DShot frame asks for it ([`EscLine::asks`]).
//! What can go wrong: a frame that is too short, too long, does not check or came with an error of the line is counted and not used; the
//! next silence begins anew. A damaged frame of the right length passes the CRC once in 256. What is older than [`STALE_MS`] is told as absent.
//! Units: ms of the tick; figures as the ESC sends them ([`EscCode`]).
//! Reference: KISS ESC telemetry protocol (also BLHeli_32, AM32); CRC-8 polynomial 0x07, initial value 0, no reflection.

use crc::{CRC_8_SMBUS, Crc, NoTable};
use frame::esc::{EscCode, EscVerdict};
use frame::units::Ticks;

/// A byte of the line that came with a framing, noise or overrun error, beside its eight bits.
pub const LINE_ERROR: u16 = 1 << 8;
/// Age at which a frame's figures are given up, ms: eight frames of an ESC that sends 32 a second.
pub const STALE_MS: u64 = 250;
/// Bytes of a frame.
pub const LENGTH: usize = 10;
/// The same in ticks.
const STALE: Ticks = Ticks::from_ms(STALE_MS);
/// Silence that ends a frame: two ticks without a byte, so at least a millisecond. A frame's bytes follow one another, and two frames are
/// some 30 ms apart.
const SILENCE: Ticks = Ticks(Ticks::from_ms(3).0 / 2);
/// Time between two frames that are asked for, half a tick less: 20 ms.
const ASK: Ticks = Ticks(Ticks::from_ms(39).0 / 2);

/// CRC-8 of the telemetry: polynomial 0x07, initial value 0, no reflection. Bit by bit: a frame of ten bytes needs no table in the flash.
const CRC: Crc<u8, NoTable> = Crc::<u8, NoTable>::new(&CRC_8_SMBUS);

/// Checksum of a frame's first nine bytes.
#[must_use]
pub fn crc8(bytes: &[u8]) -> u8 {
    CRC.checksum(bytes)
}

/// The figures of a frame that checks; their age and verdict are to be filled in.
#[must_use]
pub fn figures(bytes: &[u8; LENGTH]) -> Option<EscCode> {
    let [temperature, v1, v0, a1, a0, q1, q0, n1, n0, crc] = *bytes;
    let [content @ .., _] = bytes;
    (crc8(content) == crc).then(|| EscCode {
        temperature,
        voltage: u16::from_be_bytes([v1, v0]),
        current: u16::from_be_bytes([a1, a0]),
        charge: u16::from_be_bytes([q1, q0]),
        speed: u16::from_be_bytes([n1, n0]),
        ..EscCode::default()
    })
}

/// What was heard so far, modulo 65 536.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct EscCounts {
    /// Frames that checked.
    pub good: u16,
    /// Frames that did not, of any length.
    pub damaged: u16,
    /// Bytes that came with an error of the line.
    pub errors: u16,
}

/// The receiving end of the telemetry.
#[derive(Debug, Clone, Default)]
pub struct EscLine {
    bytes: [u8; LENGTH],
    /// Bytes since the last silence, more than a frame's included.
    held: usize,
    /// One of them came with an error.
    bad: bool,
    /// When the last byte came.
    heard: Option<Ticks>,
    good: Option<(Ticks, EscCode)>,
    /// When something was last heard that is no frame.
    ill: Option<Ticks>,
    counts: EscCounts,
    asked: Option<Ticks>,
}

impl EscLine {
    /// Takes what the line brought since the last tick: bytes, those with [`LINE_ERROR`] damaged.
    pub fn take(&mut self, now: Ticks, words: &[u16]) {
        let silent = self.heard.is_none_or(|at| now.since(at) >= SILENCE);
        if self.held > 0 && silent {
            self.finish();
        }
        for word in words {
            let damaged = word & LINE_ERROR != 0;
            self.counts.errors = self.counts.errors.wrapping_add(u16::from(damaged));
            self.bad |= damaged;
            if let Some(slot) = self.bytes.get_mut(self.held) {
                *slot = *word as u8;
            }
            self.held = self.held.saturating_add(1);
            self.heard = Some(now);
        }
        if self.held > LENGTH {
            self.ill = self.heard; // and will be counted once there is a silence
        }
    }

    /// The bytes between two silences are whole.
    fn finish(&mut self) {
        let whole = self.held == LENGTH && !self.bad;
        match figures(&self.bytes).filter(|_| whole).zip(self.heard) {
            Some((code, at)) => {
                self.good = Some((at, code));
                self.counts.good = self.counts.good.wrapping_add(1);
            }
            None => {
                self.ill = self.heard;
                self.counts.damaged = self.counts.damaged.wrapping_add(1);
            }
        }
        (self.held, self.bad) = (0, false);
    }

    /// What is to be told at `now`.
    #[must_use]
    pub fn code(&self, now: Ticks) -> EscCode {
        let verdict = self.verdict(now);
        let Some((at, code)) = self.good else { return EscCode { verdict, age_ms: u16::MAX, ..EscCode::default() } };
        let age_ms = u16::try_from(now.since(at).as_ms()).unwrap_or(u16::MAX);
        let code = if verdict == EscVerdict::Nominal { code } else { EscCode::default() };
        EscCode { verdict, age_ms, ..code }
    }

    /// What is to be said of it at `now`.
    #[must_use]
    pub fn verdict(&self, now: Ticks) -> EscVerdict {
        let lately = |at: Ticks| now.since(at) <= STALE;
        match (self.good, self.ill) {
            (Some((at, _)), _) if lately(at) => EscVerdict::Nominal,
            (_, Some(at)) if lately(at) => EscVerdict::Garbled,
            _ => EscVerdict::Silent,
        }
    }

    /// What was heard so far.
    #[must_use]
    pub fn counts(&self) -> EscCounts {
        self.counts
    }

    /// Whether the ESC is to be asked for a frame at `now`: to be called once a tick, and true in one of twenty.
    pub fn asks(&mut self, now: Ticks) -> bool {
        let due = self.asked.is_none_or(|at| now.since(at) >= ASK);
        if due {
            self.asked = Some(now);
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// 41 degC, 11.48 V, 12.34 A, 77 mAh, 45 100 electrical turns a minute; its CRC was reckoned apart, bit by bit.
    const FRAME: [u8; LENGTH] = [41, 0x04, 0x7c, 0x04, 0xd2, 0x00, 0x4d, 0x01, 0xc3, 0x19];

    fn words(bytes: &[u8]) -> Vec<u16> {
        bytes.iter().map(|b| u16::from(*b)).collect()
    }

    /// Gives `bytes` at `ms`, and the silence after them.
    fn hear(line: &mut EscLine, ms: u64, bytes: &[u16]) -> EscCode {
        line.take(Ticks::from_ms(ms), bytes);
        (1..=3).for_each(|later| line.take(Ticks::from_ms(ms + later), &[]));
        line.code(Ticks::from_ms(ms + 3))
    }

    #[test]
    fn the_checksum_is_the_published_one() {
        assert_eq!(crc8(b"123456789"), 0xF4, "check value of CRC-8/SMBUS");
        assert_eq!(crc8(&[]), 0);
    }

    #[test]
    fn a_frame_gives_its_figures_and_their_age() {
        let mut line = EscLine::default();
        let none = line.code(Ticks::from_ms(5));
        assert_eq!((none.verdict, none.age_ms), (EscVerdict::Silent, u16::MAX), "nothing was heard yet");
        let code = hear(&mut line, 10, &words(&FRAME));
        assert_eq!((code.verdict, code.age_ms), (EscVerdict::Nominal, 3));
        assert_eq!((code.temperature, code.voltage, code.current, code.charge, code.speed), (41, 1148, 1234, 77, 451));
        let late = |ms: u64| line.code(Ticks::from_ms(10 + ms));
        assert_eq!((late(STALE_MS).verdict, late(STALE_MS).voltage), (EscVerdict::Nominal, 1148));
        let gone = late(STALE_MS + 1);
        assert_eq!((gone.verdict, gone.voltage, gone.age_ms), (EscVerdict::Silent, 0, 251), "told as absent, without figures");
    }

    #[test]
    fn a_frame_may_come_in_two_ticks_and_counts_once_its_end_was_silent() {
        let mut line = EscLine::default();
        let all = words(&FRAME);
        line.take(Ticks::from_ms(10), &all[..4]);
        assert_eq!(line.verdict(Ticks::from_ms(10)), EscVerdict::Silent, "half a frame is not damaged");
        line.take(Ticks::from_ms(11), &all[4..]);
        line.take(Ticks::from_ms(12), &[]);
        assert_eq!(line.counts(), EscCounts::default(), "more bytes may come");
        line.take(Ticks::from_ms(13), &[]);
        assert_eq!(line.counts(), EscCounts { good: 1, ..EscCounts::default() });
    }

    #[test]
    fn what_does_not_check_is_counted_and_the_next_frame_is_whole_again() {
        let mut flipped = words(&FRAME);
        flipped[3] ^= 0x10;
        let mut noisy = words(&FRAME);
        noisy[3] |= LINE_ERROR;
        let mut long = words(&FRAME);
        long.push(0);
        let twice = [words(&FRAME), words(&FRAME)].concat();
        let mut line = EscLine::default();
        for (n, bad) in [flipped, noisy, words(&FRAME[1..]), long, twice, words(&[0x55])].iter().enumerate() {
            let ms = 1000 * (n as u64 + 1);
            let code = hear(&mut line, ms, bad);
            assert_eq!((code.verdict, code.current), (EscVerdict::Garbled, 0), "{bad:?}");
            assert_eq!(usize::from(line.counts().damaged), n + 1, "{bad:?}");
            assert_eq!(hear(&mut line, ms + 31, &words(&FRAME)).verdict, EscVerdict::Nominal, "after {bad:?}");
        }
        assert_eq!(line.counts(), EscCounts { good: 6, damaged: 6, errors: 1 });
    }

    /// A stream without a pause is told as garbled at once, and as silence a while after it ended.
    #[test]
    fn what_is_no_frame_is_told_while_it_is_new() {
        let mut line = EscLine::default();
        line.take(Ticks::from_ms(10), &[0x55; LENGTH + 1]);
        let at = |ms: u64| line.verdict(Ticks::from_ms(ms));
        assert_eq!(
            [at(10), at(10 + STALE_MS), at(11 + STALE_MS)],
            [EscVerdict::Garbled, EscVerdict::Garbled, EscVerdict::Silent]
        );
    }

    #[test]
    fn a_frame_is_asked_for_once_in_twenty_ticks() {
        let mut line = EscLine::default();
        let asked: Vec<u64> = (0..100).filter(|ms| line.asks(Ticks::from_ms(*ms))).collect();
        assert_eq!(asked, [0, 20, 40, 60, 80]);
    }

    proptest! {
        /// A stream without a pause has no frame in it, whatever it says.
        #[test]
        fn garbage_without_a_pause_is_never_used(bytes in proptest::collection::vec(any::<u16>(), 11..600)) {
            let mut line = EscLine::default();
            for (ms, part) in bytes.chunks(11).enumerate() {
                line.take(Ticks::from_ms(ms as u64), part);
                prop_assert_ne!(line.code(Ticks::from_ms(ms as u64)).verdict, EscVerdict::Nominal);
            }
            prop_assert_eq!(line.counts().good, 0);
        }

        /// One byte of a frame changed or lost: it is not used. What the CRC says of one changed byte is sure: it is shorter than nine bits.
        #[test]
        fn one_damaged_byte_is_always_found(at in 0usize..LENGTH, flip in 1u8..=255, lost in any::<bool>()) {
            let mut bytes = FRAME.to_vec();
            if lost {
                bytes.remove(at);
            } else {
                bytes[at] ^= flip;
            }
            let mut line = EscLine::default();
            prop_assert_eq!(hear(&mut line, 10, &words(&bytes)).verdict, EscVerdict::Garbled);
            prop_assert_eq!(hear(&mut line, 41, &words(&FRAME)).verdict, EscVerdict::Nominal);
        }

        /// Any figures come back.
        #[test]
        fn any_frame_that_checks_is_taken(content in any::<[u8; 9]>()) {
            let mut bytes = content.to_vec();
            bytes.push(crc8(&content));
            let mut line = EscLine::default();
            let code = hear(&mut line, 10, &words(&bytes));
            prop_assert_eq!(code.verdict, EscVerdict::Nominal);
            prop_assert_eq!(code.current.to_be_bytes(), [content[3], content[4]]);
        }
    }
}
