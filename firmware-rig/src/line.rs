//! The host's line: from bytes to at most one command a tick.
//!
//! What it is: the decoder, the guard against frames that come a second time, and a short queue of commands in which a stop
//! overtakes everything that waits.
//! What can go wrong: a damaged frame is counted; a frame that is not newer than the last is not obeyed and counted, but a stop
//! is always obeyed; a full queue drops the newest command, which the host notices by the missing answer.
//! Units: bytes.
//! Reference: specification `formats.md`, "Telemetry"; `rig.md`, "Acquisition".

use frame::message::Command;
use frame::wire::{Decoder, Freshness, LinkStats};
use heapless::Deque;

/// Commands that wait; a host sends one and waits for its answer.
const WAITING: usize = 8;

/// What the line brought since the last tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LineNews {
    /// Frames that were damaged.
    pub damaged: u8,
    /// Frames that were not newer than the last one.
    pub replayed: u8,
}

/// The receiving half of the link.
#[derive(Debug, Clone, Default)]
pub struct CommandLine {
    decoder: Decoder,
    freshness: Freshness,
    waiting: Deque<Command, WAITING>,
    damaged_before: u32,
    replayed: u32,
    replayed_before: u32,
}

impl CommandLine {
    /// Nothing heard yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes one byte of the line.
    pub fn take(&mut self, byte: u8) {
        let Some(received) = self.decoder.push::<Command>(byte) else { return };
        if !self.freshness.is_new(received.at, received.sequence) {
            self.replayed = self.replayed.wrapping_add(1);
            if received.message != Command::Stop {
                return;
            }
        }
        if received.message == Command::Stop {
            self.waiting.clear();
        }
        let _ = self.waiting.push_back(received.message); // full: dropped, see the module's header
    }

    /// The next command, and what went wrong on the line since the last call.
    pub fn next_command(&mut self) -> (Option<Command>, LineNews) {
        let stats = self.decoder.stats();
        let bad = stats.damaged.wrapping_add(stats.foreign);
        let count = |now: u32, before: u32| u8::try_from(now.wrapping_sub(before)).unwrap_or(u8::MAX);
        let news = LineNews { damaged: count(bad, self.damaged_before), replayed: count(self.replayed, self.replayed_before) };
        (self.damaged_before, self.replayed_before) = (bad, self.replayed);
        (self.waiting.pop_front(), news)
    }

    /// A stop waits to be obeyed.
    #[must_use]
    pub fn stop_waits(&self) -> bool {
        self.waiting.front() == Some(&Command::Stop)
    }

    /// Counters of the decoder.
    #[must_use]
    pub fn stats(&self) -> LinkStats {
        self.decoder.stats()
    }

    /// Frames that were not newer than the last one, so far.
    #[must_use]
    pub fn replayed(&self) -> u32 {
        self.replayed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use frame::units::Ticks;
    use frame::wire::{Encoder, MAX_WIRE};
    use std::vec::Vec;

    fn framed(encoder: &mut Encoder, ms: u64, command: Command) -> Vec<u8> {
        let mut wire = [0; MAX_WIRE];
        let n = encoder.encode(Ticks::from_ms(ms), &command, &mut wire).unwrap();
        wire[..n].to_vec()
    }

    fn feed(line: &mut CommandLine, bytes: &[u8]) {
        bytes.iter().for_each(|b| line.take(*b));
    }

    #[test]
    fn a_frame_that_comes_again_is_not_obeyed_and_is_told() {
        let (mut line, mut host) = (CommandLine::new(), Encoder::default());
        let arm = framed(&mut host, 1, Command::Arm);
        feed(&mut line, &arm);
        assert_eq!(line.next_command(), (Some(Command::Arm), LineNews::default()));
        feed(&mut line, &arm);
        assert_eq!(line.next_command(), (None, LineNews { damaged: 0, replayed: 1 }));
        assert_eq!(line.next_command(), (None, LineNews::default()), "told once");
        let ping = framed(&mut host, 1, Command::Ping);
        feed(&mut line, &ping);
        assert_eq!(line.next_command().0, Some(Command::Ping), "the same instant with the next number is new");
        feed(&mut line, &framed(&mut Encoder::default(), 2, Command::Ping));
        assert_eq!(line.next_command().0, Some(Command::Ping), "a host that started anew numbers from 0 at a later time");
    }

    #[test]
    fn a_stop_is_obeyed_even_when_it_comes_again_and_overtakes_what_waits() {
        let (mut line, mut host) = (CommandLine::new(), Encoder::default());
        let stop = framed(&mut host, 1, Command::Stop);
        feed(&mut line, &stop);
        assert_eq!(line.next_command().0, Some(Command::Stop));
        feed(&mut line, &framed(&mut host, 2, Command::Arm));
        feed(&mut line, &framed(&mut host, 2, Command::RunSchedule));
        feed(&mut line, &stop);
        assert_eq!(line.next_command(), (Some(Command::Stop), LineNews { damaged: 0, replayed: 1 }));
        assert_eq!(line.next_command().0, None, "what waited before the stop is gone");
    }

    #[test]
    fn damage_is_counted_frame_by_frame() {
        let (mut line, mut host) = (CommandLine::new(), Encoder::default());
        for k in 0..3 {
            let mut bytes = framed(&mut host, k, Command::Arm);
            bytes[3] ^= 0x55;
            feed(&mut line, &bytes);
        }
        assert_eq!(line.next_command(), (None, LineNews { damaged: 3, replayed: 0 }));
    }
}
