//! The telemetry link on USART1.
//!
//! What it is: frames queue up and leave by DMA2 stream 7; commands arrive by DMA2 stream 2 in a circle that the tick polls.
//! What can go wrong: a full transmit queue drops a whole frame, which the host sees as a gap in the sequence; what can go
//! wrong with a command stands in `firmware_rig::line`.
//! Units: bytes at 921 600 baud.
//! Reference: RM0090 section 30.3.13 (DMA), table 43; specification `formats.md`, "Telemetry".

use core::sync::atomic::{AtomicU8, Ordering};
use firmware_rig::{CommandLine, LineNews};
use frame::message::{Command, Message};
use frame::units::Ticks;
use frame::wire::{Encoder, MAX_WIRE};
use heapless::Vec;
use stm32f4xx_hal::pac::{DMA2, USART1};

const BAUD: u32 = 921_600;
const APB2_HZ: u32 = 84_000_000;
const OUT: usize = 1024;
const IN: usize = 256;

static SENDING: [AtomicU8; OUT] = [const { AtomicU8::new(0) }; OUT];
static RECEIVED: [AtomicU8; IN] = [const { AtomicU8::new(0) }; IN];

/// The link.
pub(crate) struct Link {
    encoder: Encoder,
    waiting: Vec<u8, OUT>,
    line: CommandLine,
    tail: usize,
    _usart: USART1,
}

impl Link {
    /// Starts both directions.
    pub(crate) fn start(usart: USART1, dma: &DMA2) -> Self {
        let divisor = (APB2_HZ + BAUD / 2) / BAUD; // 16 times oversampling: mantissa and fraction together
        usart.brr().write(|w| w.div_mantissa().set((divisor >> 4) as u16).div_fraction().set((divisor & 15) as u8));
        usart.cr3().write(|w| w.dmat().set_bit().dmar().set_bit());
        usart.cr1().write(|w| w.ue().set_bit().te().set_bit().re().set_bit());

        let (receive, send) = (dma.st(2), dma.st(7));
        receive.ndtr().write(|w| w.ndt().set(IN as u16));
        #[allow(unsafe_code)] // the data register of this port and two static buffers of the lengths given
        unsafe {
            receive.par().write(|w| w.pa().bits(usart.dr().as_ptr() as u32));
            receive.m0ar().write(|w| w.m0a().bits(RECEIVED.as_ptr() as u32));
            send.par().write(|w| w.pa().bits(usart.dr().as_ptr() as u32));
            send.m0ar().write(|w| w.m0a().bits(SENDING.as_ptr() as u32));
        }
        receive
            .cr()
            .write(|w| w.chsel().set(4).minc().incremented().circ().enabled().dir().peripheral_to_memory().en().enabled());
        Self { encoder: Encoder::default(), waiting: Vec::new(), line: CommandLine::new(), tail: 0, _usart: usart }
    }

    /// Queues one message.
    pub(crate) fn send(&mut self, at: Ticks, message: &Message) {
        let mut wire = [0; MAX_WIRE];
        if let Ok(bytes) = self.encoder.encode(at, message, &mut wire)
            && let Some(bytes) = wire.get(..bytes)
        {
            let _ = self.waiting.extend_from_slice(bytes); // whole or not at all; the host sees the gap in the sequence
        }
    }

    /// Hands what waits to the DMA when it is free.
    pub(crate) fn flush(&mut self, dma: &DMA2) {
        let stream = dma.st(7);
        if self.waiting.is_empty() || stream.cr().read().en().bit_is_set() {
            return;
        }
        for (slot, byte) in SENDING.iter().zip(&self.waiting) {
            slot.store(*byte, Ordering::Relaxed);
        }
        dma.hifcr().write(|w| w.ctcif7().set_bit().chtif7().set_bit().cteif7().set_bit().cdmeif7().set_bit().cfeif7().set_bit());
        stream.ndtr().write(|w| w.ndt().set(self.waiting.len() as u16));
        core::sync::atomic::fence(Ordering::Release); // the bytes are in memory before the DMA may read them
        stream.cr().write(|w| w.chsel().set(4).minc().incremented().dir().memory_to_peripheral().en().enabled());
        self.waiting.clear();
    }

    /// Decodes what arrived; whether a stop is among it.
    pub(crate) fn listen(&mut self, dma: &DMA2) -> bool {
        let left = usize::from(dma.st(2).ndtr().read().ndt().bits());
        let head = IN.saturating_sub(left) % IN;
        while self.tail != head {
            self.line.take(RECEIVED.get(self.tail).map_or(0, |b| b.load(Ordering::Relaxed)));
            self.tail = (self.tail + 1) % IN;
        }
        self.line.stop_waits()
    }

    /// The next command, and what went wrong on the line.
    pub(crate) fn next(&mut self) -> (Option<Command>, LineNews) {
        self.line.next_command()
    }

    /// Frames heard: good, damaged, replayed.
    pub(crate) fn frames(&self) -> [u16; 3] {
        let stats = self.line.stats();
        [stats.good as u16, stats.damaged as u16, self.line.replayed() as u16]
    }
}
