//! A board at the other end of a serial line.
//!
//! What it is: the port, the codec in both directions, and a question with its answer.
//! What can go wrong: no such port, a port that goes away, a board that does not answer, a command that is refused: one line each.
//! Units: bytes; baud; ms.
//! Reference: specification `formats.md`, "Telemetry".

use crate::Failure;
use frame::message::{Command, Event, Message};
use frame::units::Ticks;
use frame::wire::{Decoder, Encoder, LinkStats, MAX_WIRE, Received};
use serialport::SerialPort;
use std::io::ErrorKind;
use std::time::{Duration, Instant, SystemTime};

/// Speed of the rig's line (pin table of the board).
const BAUD: u32 = 921_600;
/// Longest wait in one read.
const READ_TIME: Duration = Duration::from_millis(20);
/// How long an answer may take.
const ANSWER_TIME: Duration = Duration::from_millis(1500);
/// Time between two signs of life towards an armed board.
pub(crate) const PING: Duration = Duration::from_millis(200);

/// What a read brought.
pub(crate) enum Heard {
    /// These messages, maybe none.
    Messages(Vec<Received<Message>>),
    /// The port is gone.
    Gone,
}

/// The board.
pub(crate) struct Board {
    name: String,
    baud: u32,
    port: Box<dyn SerialPort>,
    encoder: Encoder,
    decoder: Decoder,
    sent: Instant,
}

impl Board {
    /// Opens the rig board's port by its name.
    pub(crate) fn open(name: &str) -> Result<Self, Failure> {
        Self::open_at(name, BAUD)
    }

    /// Opens a port of another speed.
    pub(crate) fn open_at(name: &str, baud: u32) -> Result<Self, Failure> {
        let port = serialport::new(name, baud).timeout(READ_TIME).open().map_err(|e| {
            let known: Vec<String> = serialport::available_ports().unwrap_or_default().into_iter().map(|p| p.port_name).collect();
            let known =
                if known.is_empty() { "no serial port is there".to_owned() } else { format!("there are {}", known.join(", ")) };
            format!("{name}: cannot be opened ({e}); {known}")
        })?;
        Ok(Self {
            name: name.to_owned(),
            baud,
            port,
            encoder: Encoder::default(),
            decoder: Decoder::default(),
            sent: Instant::now(),
        })
    }

    /// Opens the same port again after it went away; the counters go on.
    pub(crate) fn reopen(&mut self) -> bool {
        let opened = serialport::new(&self.name, self.baud).timeout(READ_TIME).open();
        let open = opened.map(|port| self.port = port).is_ok();
        if open {
            let _ = self.decoder.push::<Message>(0); // the frame that the loss cut short ends here, not in the next one
        }
        open
    }

    /// Counters of the line.
    pub(crate) fn stats(&self) -> LinkStats {
        self.decoder.stats()
    }

    /// Sends one command. Its time is the clock's since 1970, so that the board can tell a new frame from an old one.
    pub(crate) fn send(&mut self, command: Command) -> Result<(), Failure> {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let at = Ticks((now.as_nanos() * u128::from(Ticks::HZ) / 1_000_000_000) as u64);
        let mut wire = [0; MAX_WIRE];
        let used = self.encoder.encode(at, &command, &mut wire).map_err(|_| "a command did not fit its frame")?;
        self.sent = Instant::now();
        // an empty frame first: whatever stood on the line before is not part of ours
        let bytes = [&[0], &wire[..used]].concat();
        self.port.write_all(&bytes).map_err(|e| format!("{}: cannot be written to ({e})", self.name).into())
    }

    /// A sign of life when one is due.
    pub(crate) fn keep_alive(&mut self) -> Result<(), Failure> {
        if self.sent.elapsed() >= PING { self.send(Command::Ping) } else { Ok(()) }
    }

    /// What arrived; waits for some 20 ms at most.
    pub(crate) fn hear(&mut self) -> Heard {
        let mut bytes = [0; 4096];
        match self.port.read(&mut bytes) {
            Ok(0) => Heard::Gone,
            Ok(n) => Heard::Messages(bytes[..n].iter().filter_map(|b| self.decoder.push(*b)).collect()),
            Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted | ErrorKind::WouldBlock) => {
                Heard::Messages(Vec::new())
            }
            Err(_) => Heard::Gone,
        }
    }

    /// Sends a command and waits until `answer` recognises its answer; `seen` sees every message on the way.
    pub(crate) fn ask<T>(
        &mut self,
        command: Command,
        mut seen: impl FnMut(&Message),
        mut answer: impl FnMut(&Message) -> Option<T>,
    ) -> Result<T, Failure> {
        self.send(command)?;
        let begun = Instant::now();
        while begun.elapsed() < ANSWER_TIME {
            match self.hear() {
                Heard::Gone => return Err(format!("{}: the port is gone", self.name).into()),
                Heard::Messages(messages) => {
                    for received in messages {
                        seen(&received.message);
                        if let Message::Event(Event::Refused(reasons)) = received.message {
                            let words: Vec<&str> = reasons.words().collect();
                            return Err(format!("the board refuses: {}", words.join("; ")).into());
                        }
                        if let Some(found) = answer(&received.message) {
                            return Ok(found);
                        }
                    }
                }
            }
        }
        Err(format!(
            "{}: no answer from the board in {} s; is it powered, and a rig board?",
            self.name,
            ANSWER_TIME.as_secs_f32()
        )
        .into())
    }

    /// Sends a command that is accepted or refused.
    pub(crate) fn obey(&mut self, command: Command, seen: impl FnMut(&Message)) -> Result<(), Failure> {
        self.ask(command, seen, |m| matches!(m, Message::Event(Event::Accepted)).then_some(()))
    }
}
