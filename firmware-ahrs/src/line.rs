//! From bytes of the serial line to commands: frames of a program, or lines that a person types.
//!
//! What it is: one line carries both. Frames begin with a byte that is not printable, or whose successor, the frame's version, is not;
//! everything up to the closing zero then belongs to the frame. What is printable up to a line end is a typed command.
//! What can go wrong: a damaged frame is counted by the decoder; a typed line that is no command is told as [`Heard::Unknown`]; when
//! more commands wait than there is room for, the newest is lost and its sender misses the answer.
//! Units: bytes.
//! Reference: specification `ahrs.md`, "Board"; `frame::wire`.

use frame::wire::{Decoder, VERSION};
use frame::{Command, ImuCommand, ImuContent, ImuFormat, ImuSensor};
use heapless::{Deque, String};

/// Longest typed command, bytes.
const LONGEST: usize = 32;
/// Commands that wait.
const WAITING: usize = 4;

/// What the line brought.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Heard {
    /// A command.
    Command(Command),
    /// A typed line that is none.
    Unknown,
}

/// The receiving half of the link.
#[derive(Debug, Clone, Default)]
pub struct CommandLine {
    decoder: Decoder,
    in_frame: bool,
    /// A line end that may be the first byte of a frame.
    end: Option<u8>,
    typed: String<LONGEST>,
    too_long: bool,
    waiting: Deque<Heard, WAITING>,
}

impl CommandLine {
    /// Nothing heard yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes one byte of the line.
    pub fn take(&mut self, byte: u8) {
        match byte {
            _ if self.in_frame => self.frame_byte(byte),
            b'\r' | b'\n' if self.typed.is_empty() && !self.too_long => self.end = Some(byte),
            b'\r' | b'\n' => {
                let heard = if self.too_long { None } else { command(&self.typed) };
                self.hear(heard.map_or(Heard::Unknown, Heard::Command));
                self.forget();
            }
            b' '..=b'~' => {
                self.end = None;
                self.too_long |= self.typed.push(char::from(byte)).is_err();
            }
            _ => self.begin_frame(byte),
        }
    }

    /// The next of what was heard.
    pub fn next_heard(&mut self) -> Option<Heard> {
        self.waiting.pop_front()
    }

    /// Frames that were damaged or of another version, so far.
    #[must_use]
    pub fn damaged(&self) -> u32 {
        let stats = self.decoder.stats();
        stats.damaged.wrapping_add(stats.foreign)
    }

    /// What looked like typing was the beginning of a frame.
    fn begin_frame(&mut self, byte: u8) {
        self.in_frame = true;
        if let Some(end) = self.end.filter(|_| byte == VERSION) {
            self.frame_byte(end);
        }
        let typed = self.typed.clone();
        self.forget();
        typed.bytes().for_each(|b| self.frame_byte(b));
        self.frame_byte(byte);
    }

    fn frame_byte(&mut self, byte: u8) {
        self.in_frame = byte != 0;
        if let Some(received) = self.decoder.push::<Command>(byte) {
            self.hear(Heard::Command(received.message));
        }
    }

    fn hear(&mut self, heard: Heard) {
        let _ = self.waiting.push_back(heard); // full: lost, see the module's header
    }

    fn forget(&mut self) {
        self.typed.clear();
        (self.end, self.too_long) = (None, false);
    }
}

/// The command that a typed line means.
#[must_use]
pub fn command(line: &str) -> Option<Command> {
    let mut words = line.split_ascii_whitespace();
    let both = (words.next()?, words.next());
    if words.next().is_some() {
        return None;
    }
    Some(Command::Imu(match both {
        ("ping", None) => return Some(Command::Ping),
        ("identify", None) => return Some(Command::Identify),
        ("format", Some("text")) => ImuCommand::Format(ImuFormat::Text),
        ("format", Some("binary")) => ImuCommand::Format(ImuFormat::Binary),
        ("send", Some("raw")) => ImuCommand::Content(ImuContent::Raw),
        ("send", Some("calibrated")) => ImuCommand::Content(ImuContent::Calibrated),
        ("send", Some("both")) => ImuCommand::Content(ImuContent::Both),
        ("stream", Some("on")) => ImuCommand::Stream(true),
        ("stream", Some("off")) => ImuCommand::Stream(false),
        ("once", None) => ImuCommand::Once,
        ("calibrate", Some("gyro")) => ImuCommand::Calibrate(ImuSensor::Gyro),
        ("calibrate", Some("accel")) => ImuCommand::Calibrate(ImuSensor::Accel),
        ("calibrate", Some("mag")) => ImuCommand::Calibrate(ImuSensor::Mag),
        ("calibrate", Some("align")) => ImuCommand::Calibrate(ImuSensor::Alignment),
        ("finish", None) => ImuCommand::Finish,
        ("cancel", None) => ImuCommand::Cancel,
        ("save", None) => ImuCommand::Save,
        ("load", None) => ImuCommand::Load,
        ("reset", None) => ImuCommand::Factory,
        ("errors", None) => ImuCommand::Errors,
        _ => return None,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use frame::Ticks;
    use frame::wire::{Encoder, MAX_WIRE};
    use proptest::prelude::*;
    extern crate std;
    use std::vec::Vec;

    fn heard(line: &mut CommandLine, bytes: &[u8]) -> Vec<Heard> {
        bytes
            .iter()
            .flat_map(|b| {
                line.take(*b);
                line.next_heard()
            })
            .collect()
    }

    fn framed(at: Ticks, command: Command) -> Vec<u8> {
        let mut wire = [0; MAX_WIRE];
        let n = Encoder::default().encode(at, &command, &mut wire).unwrap();
        wire[..n].to_vec()
    }

    #[test]
    fn typed_lines_and_frames_mix() {
        let mut line = CommandLine::new();
        let once = Heard::Command(Command::Imu(ImuCommand::Once));
        assert_eq!(
            heard(&mut line, b"\r\nonce\r\n  stream   off \nnonsense\n"),
            [once, Heard::Command(Command::Imu(ImuCommand::Stream(false))), Heard::Unknown]
        );
        assert_eq!(heard(&mut line, &framed(Ticks(1), Command::Identify)), [Heard::Command(Command::Identify)]);
        assert_eq!(heard(&mut line, b"once\r\n"), [once]);
        assert_eq!(heard(&mut line, &framed(Ticks(1), Command::Ping)), [Heard::Command(Command::Ping)], "after a line end");
        assert_eq!(heard(&mut line, &[b'a'; 100]), []);
        assert_eq!(heard(&mut line, b"\nonce\n"), [Heard::Unknown, once], "too long to be one");
        assert_eq!(line.damaged(), 0);
    }

    #[test]
    fn the_words_of_the_manual_are_commands_and_others_are_not() {
        for words in ["", "stream", "stream maybe", "once more", "calibrate gyro now", "SAVE"] {
            assert_eq!(command(words), None, "{words:?}");
        }
        assert_eq!(command("calibrate align"), Some(Command::Imu(ImuCommand::Calibrate(ImuSensor::Alignment))));
        assert_eq!(command("reset"), Some(Command::Imu(ImuCommand::Factory)));
    }

    /// Every command that this board obeys, with each of the values that one can have.
    fn commands() -> impl Strategy<Value = Command> {
        use frame::imu_command::{ImuContent, ImuFormat, ImuSensor};
        let sensors = [ImuSensor::Gyro, ImuSensor::Accel, ImuSensor::Mag, ImuSensor::Alignment];
        let imu = [ImuCommand::Once, ImuCommand::Finish, ImuCommand::Cancel, ImuCommand::Save, ImuCommand::Load]
            .into_iter()
            .chain([ImuCommand::Factory, ImuCommand::Errors, ImuCommand::Stream(true), ImuCommand::Stream(false)])
            .chain([ImuFormat::Binary, ImuFormat::Text].map(ImuCommand::Format))
            .chain([ImuContent::Raw, ImuContent::Calibrated, ImuContent::Both].map(ImuCommand::Content))
            .chain(sensors.map(ImuCommand::Calibrate));
        proptest::sample::select(imu.map(Command::Imu).chain([Command::Ping, Command::Identify]).collect::<Vec<_>>())
    }

    proptest! {
        /// Whatever the command and the time of sending, and so the first byte of the frame, it is a frame, also right after a typed line.
        #[test]
        fn every_frame_is_taken_as_one(
            at in any::<u64>(),
            command in commands(),
            end in prop_oneof![Just("\n"), Just("\r\n"), Just("")],
        ) {
            prop_assert!(framed(Ticks(at), command).len() < usize::from(VERSION), "no stuffing byte is the version");
            let mut line = CommandLine::new();
            let typed = if end.is_empty() { 0 } else { heard(&mut line, std::format!("once{end}").as_bytes()).len() };
            prop_assert_eq!(typed, usize::from(!end.is_empty()));
            prop_assert_eq!(heard(&mut line, &framed(Ticks(at), command)), [Heard::Command(command)]);
        }

        #[test]
        fn garbage_never_panics_and_ends_with_the_next_line_or_frame(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let mut line = CommandLine::new();
            bytes.iter().for_each(|b| line.take(*b));
            while line.next_heard().is_some() {}
            line.take(0);
            line.take(b'\n');
            while line.next_heard().is_some() {}
            prop_assert_eq!(heard(&mut line, b"save\n"), [Heard::Command(Command::Imu(ImuCommand::Save))]);
        }
    }

    #[test]
    fn every_word_of_the_manual_is_its_command() {
        for (words, known) in [
            ("ping", Command::Ping),
            ("identify", Command::Identify),
            ("format text", Command::Imu(ImuCommand::Format(ImuFormat::Text))),
            ("format binary", Command::Imu(ImuCommand::Format(ImuFormat::Binary))),
            ("stream on", Command::Imu(ImuCommand::Stream(true))),
            ("stream off", Command::Imu(ImuCommand::Stream(false))),
            ("cancel", Command::Imu(ImuCommand::Cancel)),
        ] {
            assert_eq!(command(words), Some(known), "{words}");
        }
    }

    /// What does not fit is no command, even where its beginning is one.
    #[test]
    fn a_line_that_is_too_long_is_none_whatever_it_begins_with() {
        let mut line = CommandLine::new();
        assert_eq!(heard(&mut line, b"once"), []);
        assert_eq!(heard(&mut line, &[b' '; LONGEST]), []);
        assert_eq!(heard(&mut line, b"\n"), [Heard::Unknown]);
    }

    #[test]
    fn a_damaged_frame_is_counted() {
        let mut line = CommandLine::new();
        let mut wire = framed(Ticks(1), Command::Identify);
        let middle = wire.len() / 2;
        wire[middle] ^= 0x40;
        assert_eq!(heard(&mut line, &wire), []);
        assert_eq!(line.damaged(), 1);
        assert_eq!(heard(&mut line, &framed(Ticks(2), Command::Ping)), [Heard::Command(Command::Ping)]);
        assert_eq!(line.damaged(), 1);
    }
}
