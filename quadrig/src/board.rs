//! A board at the other end of a port.
//!
//! What it is: the port, the codec in both directions, and a question with its answer. Waiting is counted in the port's own time.
//! What can go wrong: no such port, a port that goes away, a board that does not answer, a command that is refused: one line each.
//! Units: bytes; baud; ms.
//! Reference: specification `formats.md`, "Telemetry".

use crate::Failure;
use crate::port::{Port, PortArgs};
use frame::message::{Beep, Command, Event, Message};
use frame::units::Ticks;
use frame::wire::{Decoder, Encoder, LinkStats, MAX_WIRE, Received};
use std::io::ErrorKind;
use std::time::{Duration, SystemTime};
use virtual_board::Hand;

/// Speed of the rig's line (pin table of the board).
const BAUD: u32 = 2_000_000;
/// How long an answer may take.
pub(crate) const ANSWER_TIME: Duration = Duration::from_millis(1500);
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
    port: Port,
    encoder: Encoder,
    decoder: Decoder,
    sent: Duration,
    gone: Option<String>,
}

impl Board {
    /// Opens the rig board's port.
    pub(crate) fn open(port: &PortArgs) -> Result<Self, Failure> {
        Ok(Self::at(port.open(BAUD, false)?))
    }

    /// The board at an open port.
    pub(crate) fn at(port: Port) -> Self {
        Self { port, encoder: Encoder::default(), decoder: Decoder::default(), sent: Duration::ZERO, gone: None }
    }

    /// Opens the same port again after it went away; the counters go on.
    pub(crate) fn reopen(&mut self) -> bool {
        let open = self.port.reopen();
        if open {
            self.gone = None;
            let _ = self.decoder.push::<Message>(0); // the frame that the loss cut short ends here, not in the next one
        }
        open
    }

    /// Time since the port was opened: waits are counted in it.
    pub(crate) fn now(&self) -> Duration {
        self.port.now()
    }

    /// Why the port is gone, in one line.
    pub(crate) fn gone(&self) -> String {
        self.gone
            .clone()
            .unwrap_or_else(|| format!("{}: the port is gone; expected it to stay: check plug and cable", self.port.name()))
    }

    /// Name of the port, for people.
    pub(crate) fn name(&self) -> String {
        self.port.name()
    }

    /// Whether the board is in this program.
    pub(crate) fn is_virtual(&self) -> bool {
        self.port.is_virtual()
    }

    /// The next beep pattern of a virtual board's ESC.
    pub(crate) fn beep(&mut self) -> Option<Beep> {
        self.port.beep()
    }

    /// Lays a hand on a virtual board's bench.
    pub(crate) fn hand(&mut self, hand: &Hand) -> Result<(), Failure> {
        self.port.hand(hand)
    }

    /// Whether a virtual board's ESC has power.
    pub(crate) fn is_powered(&self) -> bool {
        self.port.is_powered()
    }

    /// Whether a virtual bench's stop loop is open.
    pub(crate) fn is_stopped(&self) -> bool {
        self.port.is_stopped()
    }

    /// Counters of the line.
    pub(crate) fn stats(&self) -> LinkStats {
        self.decoder.stats()
    }

    /// Sends one command. Its time is the clock's since 1970, so that the board can tell a new frame from an old one.
    pub(crate) fn send(&mut self, command: Command) -> Result<(), Failure> {
        let now = if self.port.is_virtual() {
            self.port.now() // the same run, the same bytes
        } else {
            SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default()
        };
        let at = Ticks((now.as_nanos() * u128::from(Ticks::HZ) / 1_000_000_000) as u64);
        let mut wire = [0; MAX_WIRE];
        let used = self.encoder.encode(at, &command, &mut wire).map_err(|_| "a command did not fit its frame")?;
        self.sent = self.port.now();
        // an empty frame first: whatever stood on the line before is not part of ours
        let bytes = [&[0], &wire[..used]].concat();
        self.port.write_all(&bytes).map_err(|e| {
            format!("{}: cannot be written to ({e}); expected the board to stay: check plug and cable", self.port.name()).into()
        })
    }

    /// A sign of life when one is due.
    pub(crate) fn keep_alive(&mut self) -> Result<(), Failure> {
        if self.port.now() >= self.sent + PING { self.send(Command::Ping) } else { Ok(()) }
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
            Err(e) => {
                self.gone = self.port.is_virtual().then(|| e.to_string());
                Heard::Gone
            }
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
        let until = self.port.now() + ANSWER_TIME;
        while self.port.now() < until {
            match self.hear() {
                Heard::Gone => return Err(self.gone().into()),
                Heard::Messages(messages) => {
                    for received in messages {
                        seen(&received.message);
                        if let Message::Event(Event::Refused(reasons)) = received.message {
                            let words: Vec<&str> = reasons.words().collect();
                            return Err(refused(&words.join("; ")).into());
                        }
                        if let Some(found) = answer(&received.message) {
                            return Ok(found);
                        }
                    }
                }
            }
        }
        Err(self.unanswered())
    }

    /// No answer came, in one line.
    pub(crate) fn unanswered(&self) -> Failure {
        let s = ANSWER_TIME.as_secs_f32();
        format!("{}: no answer from the board; expected one in {s} s: is it powered, and a rig board?", self.port.name()).into()
    }

    /// Waits until the board has told a reading: a tare before its first one is refused. What it does not tell in time it is asked all the same.
    pub(crate) fn wait_for_a_reading(&mut self) -> Result<(), Failure> {
        let until = self.port.now() + ANSWER_TIME;
        while self.port.now() < until {
            match self.hear() {
                Heard::Gone => return Err(self.gone().into()),
                Heard::Messages(messages) if messages.iter().any(|m| matches!(m.message, Message::Rig(_))) => return Ok(()),
                Heard::Messages(_) => {}
            }
        }
        Ok(())
    }

    /// Sends a command that is accepted or refused.
    pub(crate) fn obey(&mut self, command: Command, seen: impl FnMut(&Message)) -> Result<(), Failure> {
        self.ask(command, seen, |m| matches!(m, Message::Event(Event::Accepted)).then_some(()))
    }
}

/// A refusal of the board, with where its words are explained.
pub(crate) fn refused(words: &str) -> String {
    format!(
        "the board refuses: {words}; expected it ready for this command: `quadrig rig status` says how it is, docs/errors.md what to do"
    )
}
