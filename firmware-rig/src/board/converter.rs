//! ADC1 scanning five channels into a circular buffer.
//!
//! What it is: continuous scan, DMA2 stream 0 in a circle, polled by the tick through the stream's remaining count.
//! What can go wrong: a tick later than 6.5 ms would be lapped by the DMA; the portable half trips at 5 ms already.
//! Units: counts of 12 bits at 3.3 V.
//! Reference: RM0090 section 13.8 (DMA and scan), table 43 (request mapping).

use core::sync::atomic::{AtomicU16, Ordering};
use firmware_rig::AdcBlock;
use frame::rig::ADC_CHANNELS;
use stm32f4xx_hal::pac::{ADC_COMMON, ADC1, DMA2};

/// Scans in the buffer: 6.5 ms at the fastest rate.
const SCANS: usize = 1024;
const LENGTH: usize = SCANS * ADC_CHANNELS;

/// Written by the DMA. Atomics, because it changes under the program.
static BUFFER: [AtomicU16; LENGTH] = [const { AtomicU16::new(0) }; LENGTH];

/// The converter.
pub(crate) struct Converter {
    tail: usize,
    adc: ADC1,
}

impl Converter {
    /// Starts the scan with `cycles` of sampling time.
    pub(crate) fn start(adc: ADC1, common: &ADC_COMMON, dma: &DMA2, cycles: u16) -> Self {
        common.ccr().modify(|_, w| w.adcpre().div4());
        adc.sqr1().write(|w| w.l().set(ADC_CHANNELS as u8 - 1));
        #[allow(unsafe_code)] // the register crate does not know which channel numbers exist; 10 to 14 do
        adc.sqr3().write(|w| unsafe { w.sq1().bits(10).sq2().bits(11).sq3().bits(12).sq4().bits(13).sq5().bits(14) });
        adc.cr1().write(|w| w.scan().set_bit());

        let stream = dma.st(0);
        stream.ndtr().write(|w| w.ndt().set(LENGTH as u16));
        #[allow(unsafe_code)] // the data register of this converter, and a static buffer of the length given above
        unsafe {
            stream.par().write(|w| w.pa().bits(adc.dr().as_ptr() as u32));
            stream.m0ar().write(|w| w.m0a().bits(BUFFER.as_ptr() as u32));
        }
        stream.cr().write(|w| {
            w.chsel().set(0).pl().high().msize().bits16().psize().bits16().minc().incremented().circ().enabled();
            w.dir().peripheral_to_memory().en().enabled()
        });

        adc.cr2().write(|w| w.cont().set_bit().dma().set_bit().dds().set_bit().adon().set_bit());
        cortex_m::asm::delay(168 * 5); // tSTAB, 3 us at most (datasheet table 67)
        adc.cr2().modify(|_, w| w.swstart().set_bit());
        let this = Self { tail: 0, adc };
        this.set_sampling(cycles);
        this
    }

    /// Sampling time of every channel: 15 cycles, or 56.
    pub(crate) fn set_sampling(&self, cycles: u16) {
        self.adc.smpr1().write(|w| {
            if cycles < 56 {
                w.smp10().cycles15().smp11().cycles15().smp12().cycles15().smp13().cycles15().smp14().cycles15()
            } else {
                w.smp10().cycles56().smp11().cycles56().smp12().cycles56().smp13().cycles56().smp14().cycles56()
            }
        });
    }

    /// The whole scans since the last call.
    pub(crate) fn drain(&mut self, dma: &DMA2) -> [AdcBlock; ADC_CHANNELS] {
        let left = usize::from(dma.st(0).ndtr().read().ndt().bits());
        let head = (LENGTH.saturating_sub(left) / ADC_CHANNELS) % SCANS;
        let mut blocks = [AdcBlock::default(); ADC_CHANNELS];
        while self.tail != head {
            let scan = BUFFER.iter().skip(self.tail * ADC_CHANNELS);
            for (block, code) in blocks.iter_mut().zip(scan) {
                block.push(code.load(Ordering::Relaxed));
            }
            self.tail = (self.tail + 1) % SCANS;
        }
        blocks
    }
}
