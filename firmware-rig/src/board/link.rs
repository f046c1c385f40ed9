//! The telemetry link on USART1.
//!
//! What it is: what the console has queued leaves by DMA2 stream 7; bytes arrive by DMA2 stream 2 in a circle that the tick polls.
//! What can go wrong: see `firmware_rig::console`.
//! Units: bytes at 2 Mbaud: 84 MHz over 42, without an error of its own. It carries every channel a thousand times a second.
//! Reference: RM0090 section 30.3.13 (DMA), table 43; specification `formats.md`, "Telemetry".

use core::sync::atomic::{AtomicU8, Ordering};
use firmware_rig::RigConsole;
use firmware_rig::console::QUEUED;
use stm32f4xx_hal::pac::{DMA2, USART1};

const BAUD: u32 = 2_000_000;
const APB2_HZ: u32 = 84_000_000;
const IN: usize = 256;

static SENDING: [AtomicU8; QUEUED] = [const { AtomicU8::new(0) }; QUEUED];
static RECEIVED: [AtomicU8; IN] = [const { AtomicU8::new(0) }; IN];

/// The link.
pub(crate) struct Link {
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
        Self { tail: 0, _usart: usart }
    }

    /// Hands what waits to the DMA when it is free.
    pub(crate) fn flush(&mut self, dma: &DMA2, console: &mut RigConsole) {
        let stream = dma.st(7);
        let waiting = console.queued();
        if waiting.is_empty() || stream.cr().read().en().bit_is_set() {
            return;
        }
        for (slot, byte) in SENDING.iter().zip(waiting) {
            slot.store(*byte, Ordering::Relaxed);
        }
        dma.hifcr().write(|w| w.ctcif7().set_bit().chtif7().set_bit().cteif7().set_bit().cdmeif7().set_bit().cfeif7().set_bit());
        stream.ndtr().write(|w| w.ndt().set(waiting.len() as u16));
        core::sync::atomic::fence(Ordering::Release); // the bytes are in memory before the DMA may read them
        stream.cr().write(|w| w.chsel().set(4).minc().incremented().dir().memory_to_peripheral().en().enabled());
        console.sent();
    }

    /// Gives what arrived to the console.
    pub(crate) fn listen(&mut self, dma: &DMA2, console: &mut RigConsole) {
        let left = usize::from(dma.st(2).ndtr().read().ndt().bits());
        let head = IN.saturating_sub(left) % IN;
        while self.tail != head {
            console.hear(RECEIVED.get(self.tail).map_or(0, |b| b.load(Ordering::Relaxed)));
            self.tail = (self.tail + 1) % IN;
        }
    }
}
