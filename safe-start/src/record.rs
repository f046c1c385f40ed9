//! What ended the program, kept over a reset.
//!
//! What it is: a few words of memory that the start-up code leaves alone: kind, numbers, the end of a file's name, and a check word.
//! What can go wrong: what a power-up leaves in memory by chance passes the check once in 2^32; it is then told as a crash that was
//! none. Nothing is decided by it.
//! Units: words of 32 bits.
//! Reference: specification `rig.md`, "HardFault, NMI, panic share one path".

use core::sync::atomic::{AtomicU32, Ordering};
use frame::message::{Crash, CrashCause, Event};

/// Words of a file's name.
const NAME: usize = 6;
/// Words of a record: check word, kind, three numbers, name.
pub const WORDS: usize = 5 + NAME;
/// Where the check word begins.
const SEED: u32 = 0x5051_4e49;

/// Kinds of record.
const PANIC: u32 = 1;
const HARD_FAULT: u32 = 2;
const CLOCK: u32 = 3;
const NON_MASKABLE: u32 = 4;
/// The number of the exception stands in the lowest byte.
const UNEXPECTED: u32 = 0x100;

/// The words.
#[derive(Debug)]
pub struct Record([AtomicU32; WORDS]);

impl Default for Record {
    fn default() -> Self {
        Self::new()
    }
}

impl Record {
    /// One that holds nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self([const { AtomicU32::new(0) }; WORDS])
    }

    fn check(&self) -> u32 {
        let [_, rest @ ..] = &self.0;
        rest.iter().fold(SEED, |sum, word| sum.rotate_left(5) ^ word.load(Ordering::Relaxed))
    }

    fn write(&self, kind: u32, numbers: [u32; 3], name: &str) {
        let [mark, kept, a, b, c, words @ ..] = &self.0;
        mark.store(0, Ordering::Relaxed); // whole or not at all
        kept.store(kind, Ordering::Relaxed);
        for (word, number) in [a, b, c].into_iter().zip(numbers) {
            word.store(number, Ordering::Relaxed);
        }
        let bytes = name.as_bytes();
        let mut end = bytes.iter().skip(bytes.len().saturating_sub(4 * NAME));
        for word in words {
            let mut next = || u32::from(end.next().copied().unwrap_or(0));
            word.store(next() | next() << 8 | next() << 16 | next() << 24, Ordering::Relaxed);
        }
        mark.store(self.check(), Ordering::Relaxed);
    }

    /// Keeps the place of a panic.
    pub fn keep_panic(&self, file: &str, line: u32) {
        self.write(PANIC, [line, 0, 0], file);
    }

    /// Keeps a crash.
    pub fn keep_crash(&self, crash: &Crash) {
        let kind = match crash.cause {
            CrashCause::HardFault => HARD_FAULT,
            CrashCause::ClockFailed => CLOCK,
            CrashCause::NonMaskable => NON_MASKABLE,
            CrashCause::Unexpected(number) => UNEXPECTED | u32::from(number as u8),
        };
        self.write(kind, [crash.pc, crash.lr, crash.status], "");
    }

    /// What was kept, once.
    pub fn take(&self) -> Option<Event> {
        let [mark, kind, a, b, c, name @ ..] = &self.0;
        let found = mark.load(Ordering::Relaxed) == self.check();
        mark.store(!self.check(), Ordering::Relaxed);
        if !found {
            return None;
        }
        let [kind, pc, lr, status] = [kind, a, b, c].map(|word| word.load(Ordering::Relaxed));
        let crashed = |cause| Some(Event::Crashed(Crash { cause, pc, lr, status }));
        match kind {
            PANIC => {
                let mut file = [0; 4 * NAME];
                for (bytes, word) in file.chunks_exact_mut(4).zip(name) {
                    bytes.copy_from_slice(&word.load(Ordering::Relaxed).to_le_bytes());
                }
                Some(Event::Panicked { line: pc, file })
            }
            HARD_FAULT => crashed(CrashCause::HardFault),
            CLOCK => crashed(CrashCause::ClockFailed),
            NON_MASKABLE => crashed(CrashCause::NonMaskable),
            other if other & !0xff == UNEXPECTED => crashed(CrashCause::Unexpected(other as u8 as i8)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crash_comes_back_once() {
        let causes = [
            CrashCause::HardFault,
            CrashCause::ClockFailed,
            CrashCause::NonMaskable,
            CrashCause::Unexpected(-11),
            CrashCause::Unexpected(81),
        ];
        for cause in causes {
            let record = Record::new();
            assert_eq!(record.take(), None, "empty");
            let crash = Crash { cause, pc: 0x0800_1234, lr: 0x0800_4321, status: 0x8200 };
            record.keep_crash(&crash);
            assert_eq!(record.take(), Some(Event::Crashed(crash)));
            assert_eq!(record.take(), None, "told once");
        }
    }

    #[test]
    fn a_panic_keeps_its_line_and_the_end_of_its_file() {
        let record = Record::new();
        record.keep_panic("a/very/long/path/that/does/not/fit/src/main.rs", 77);
        let Some(Event::Panicked { line: 77, file }) = record.take() else { panic!("no panic") };
        assert_eq!(&file, b"at/does/not/fit/src/main.rs".last_chunk::<24>().unwrap());
    }

    /// Another version of the firmware may have kept something that this one does not know.
    #[test]
    fn a_whole_record_of_an_unknown_kind_is_not_told() {
        for kind in [0, 5, 0xff, 0x200, 0x1_0100] {
            let record = Record::new();
            record.write(kind, [1, 2, 3], "");
            assert_eq!(record.take(), None, "{kind:#x}");
        }
    }

    #[test]
    fn a_damaged_record_is_not_told() {
        for word in 0..WORDS {
            for bit in 0..32 {
                let record = Record::new();
                record.keep_panic("src/main.rs", 5);
                record.0[word].fetch_xor(1 << bit, Ordering::Relaxed);
                assert_eq!(record.take(), None, "word {word}, bit {bit}");
            }
        }
    }
}
