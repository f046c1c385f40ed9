//! A serial line between board and host.
//!
//! What it is: two ends, each `embedded_io::{Read, Write}` with their readiness; a byte takes ten bits, and arrives when its stop bit has
//! passed. An end that must wait lets the virtual clock pass.
//! What can go wrong: reading while nothing is on its way would wait for ever and is refused ([`SerialError::Silent`]); a line that is cut
//! swallows what is sent.
//! Units: baud; ns since power-up.
//! Reference: RM0090 section 30.3 (USART, 8N1); embedded-io 0.6; specification `formats.md`, "Telemetry".

use crate::clock::VirtualClock;
use embedded_io::{Error, ErrorKind, ErrorType, Read, ReadReady, Write, WriteReady};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// Start bit, eight of data, stop bit.
const BITS: u64 = 10;
/// Bytes that wait to be sent at the most, as on the board.
const QUEUE: usize = 1024;

/// Why an end could not do what it was asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SerialError {
    /// Nothing is on its way, so a read would wait for ever.
    #[error("nothing is on the line")]
    Silent,
}

impl Error for SerialError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::TimedOut
    }
}

/// One direction: bytes with the end of their stop bits.
#[derive(Debug, Default)]
struct Wire {
    bytes: VecDeque<(u64, u8)>,
    /// When the last one has left, ns.
    free_ns: u64,
    cut: bool,
}

/// One end of the line.
#[derive(Debug, Clone)]
pub struct SerialEnd {
    clock: VirtualClock,
    byte_ns: u64,
    out: Rc<RefCell<Wire>>,
    into: Rc<RefCell<Wire>>,
}

impl SerialEnd {
    /// The two ends of a line.
    #[must_use]
    pub fn pair(clock: &VirtualClock, baud: u32) -> (Self, Self) {
        let (a, b) = (Rc::new(RefCell::new(Wire::default())), Rc::new(RefCell::new(Wire::default())));
        let end = |out: &Rc<RefCell<Wire>>, into: &Rc<RefCell<Wire>>| Self {
            clock: clock.clone(),
            byte_ns: BITS * 1_000_000_000 / u64::from(baud.max(1)),
            out: out.clone(),
            into: into.clone(),
        };
        (end(&a, &b), end(&b, &a))
    }

    /// Cuts what this end sends, or joins it again.
    pub fn cut(&self, cut: bool) {
        self.out.borrow_mut().cut = cut;
    }

    /// Bytes that have not left yet.
    fn waiting(&self) -> usize {
        let left_ns = self.out.borrow().free_ns.saturating_sub(self.clock.now_ns());
        left_ns.div_ceil(self.byte_ns) as usize
    }
}

impl ErrorType for SerialEnd {
    type Error = SerialError;
}

impl ReadReady for SerialEnd {
    fn read_ready(&mut self) -> Result<bool, SerialError> {
        Ok(self.into.borrow().bytes.front().is_some_and(|(at, _)| *at <= self.clock.now_ns()))
    }
}

impl WriteReady for SerialEnd {
    fn write_ready(&mut self) -> Result<bool, SerialError> {
        Ok(self.waiting() < QUEUE)
    }
}

impl Read for SerialEnd {
    fn read(&mut self, buf: &mut [u8]) -> Result<usize, SerialError> {
        if buf.is_empty() {
            return Ok(0);
        }
        let mut wire = self.into.borrow_mut();
        let (first_ns, _) = *wire.bytes.front().ok_or(SerialError::Silent)?;
        self.clock.advance_to(first_ns);
        let now_ns = self.clock.now_ns();
        let mut count = 0;
        for slot in buf {
            if wire.bytes.front().is_none_or(|(at, _)| *at > now_ns) {
                break;
            }
            let Some((_, byte)) = wire.bytes.pop_front() else { break };
            *slot = byte;
            count += 1;
        }
        Ok(count)
    }
}

impl Write for SerialEnd {
    fn write(&mut self, buf: &[u8]) -> Result<usize, SerialError> {
        if !buf.is_empty() && self.waiting() >= QUEUE {
            self.clock.pass_ns(self.byte_ns);
        }
        let room = QUEUE.saturating_sub(self.waiting()).min(buf.len());
        let mut wire = self.out.borrow_mut();
        for byte in buf.iter().take(room) {
            wire.free_ns = wire.free_ns.max(self.clock.now_ns()) + self.byte_ns;
            let at = (wire.free_ns, *byte);
            if !wire.cut {
                wire.bytes.push_back(at);
            }
        }
        Ok(room)
    }

    fn flush(&mut self) -> Result<(), SerialError> {
        self.clock.advance_to(self.out.borrow().free_ns);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_take_their_time_and_keep_their_order() {
        let clock = VirtualClock::default();
        let (mut board, mut host) = SerialEnd::pair(&clock, 1_000_000);
        board.write_all(b"abc").unwrap();
        assert!(!host.read_ready().unwrap());
        clock.advance_to(20_000);
        let mut got = [0; 8];
        assert_eq!(host.read(&mut got), Ok(2), "ten bits of 1 us each");
        assert_eq!(host.read(&mut got[2..]), Ok(1));
        assert_eq!((&got[..3], clock.now_ns()), (&b"abc"[..], 30_000), "reading has waited for the third");
        assert_eq!(host.read(&mut got), Err(SerialError::Silent));
        host.write_all(b"x").unwrap();
        assert_eq!(host.read(&mut got), Err(SerialError::Silent), "the other direction is another wire");
        assert_eq!(board.read(&mut got), Ok(1));
        host.cut(true);
        host.write_all(b"y").unwrap();
        host.flush().unwrap();
        assert_eq!(board.read(&mut got), Err(SerialError::Silent));
    }

    #[test]
    fn a_full_queue_makes_the_writer_wait() {
        let clock = VirtualClock::default();
        let (mut board, _host) = SerialEnd::pair(&clock, 1_000_000);
        board.write_all(&[0; QUEUE]).unwrap();
        assert!(!board.write_ready().unwrap());
        assert_eq!(clock.now_ns(), 0);
        board.write_all(&[0; 3]).unwrap();
        assert_eq!(clock.now_ns(), 30_000);
    }
}
