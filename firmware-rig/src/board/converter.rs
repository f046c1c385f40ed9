//! ADC1 scanning five channels into a circular buffer.
//!
//! What it is: continuous scan, DMA2 stream 0 in a circle, polled by the tick through the stream's remaining count.
//! What can go wrong: a tick later than 6.5 ms would be lapped by the DMA; the portable half trips at 5 ms already. When the DMA did not
//! fetch a conversion in time (OVR), or met a bus error, no further one is fetched: the tick starts the scan anew, and what was in the
//! buffer is left out.
//! Units: counts of 12 bits at 3.3 V.
//! Reference: RM0090 sections 13.8.1 (DMA, recovery from an overrun), 10.3.17 (stream configuration), table 43 (request mapping).

use core::sync::atomic::{AtomicU16, Ordering};
use firmware_rig::AdcBlock;
use frame::rig::ADC_CHANNELS;
use heapless::Vec;
use stm32f4xx_hal::pac::{ADC_COMMON, ADC1, DMA2};

/// Clock of the converter, Hz; cycles of a conversion beside its sampling time (RM0090 section 13.5).
const CLOCK_HZ: u32 = 21_000_000;
const TWELVE_BITS: u32 = 12;
/// Scans in the buffer: 6.5 ms at the fastest rate.
pub(crate) const SCANS: usize = 1024;
const LENGTH: usize = SCANS * ADC_CHANNELS;

/// Written by the DMA. Atomics, because it changes under the program.
static BUFFER: [AtomicU16; LENGTH] = [const { AtomicU16::new(0) }; LENGTH];

/// Longest wait for the stream to end: a transfer takes some ten cycles.
const PATIENCE: u32 = 1000;

/// Lets the stream fill the buffer in a circle, from its beginning.
fn start_stream(adc: &ADC1, dma: &DMA2) {
    let stream = dma.st(0);
    stream.cr().reset();
    let mut patience = PATIENCE; // EN reads 0 once the stream has ended (RM0090 section 10.3.17)
    while stream.cr().read().en().bit_is_set() && patience > 0 {
        patience -= 1;
    }
    dma.lifcr().write(|w| w.ctcif0().set_bit().chtif0().set_bit().cteif0().set_bit().cdmeif0().set_bit().cfeif0().set_bit());
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
}

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

        start_stream(&adc, dma);
        let this = Self { tail: 0, adc };
        this.begin();
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

    /// Starts the scan anew: converter off (which ends a scan that is under way, section 13.3.1), the stream from its beginning, the flag
    /// down, and everything on again (section 13.8.1).
    fn restart(&mut self, dma: &DMA2) {
        self.adc.cr2().reset();
        start_stream(&self.adc, dma);
        self.adc.sr().write(|w| w.ovr().clear_bit());
        self.tail = 0;
        self.begin();
    }

    /// Switches the converter on and lets it scan without end.
    fn begin(&self) {
        self.adc.cr2().write(|w| w.cont().set_bit().dma().set_bit().dds().set_bit().adon().set_bit());
        cortex_m::asm::delay(168 * 5); // tSTAB, 3 us at most (datasheet table 67)
        self.adc.cr2().modify(|_, w| w.swstart().set_bit());
    }

    /// The whole scans since the last call, and in `codes` the single conversions of the `wanted` channel; false when some were lost.
    pub(crate) fn drain(&mut self, dma: &DMA2, wanted: Option<usize>, codes: &mut Codes) -> ([AdcBlock; ADC_CHANNELS], bool) {
        let lost = self.adc.sr().read().ovr().bit_is_set() || dma.st(0).cr().read().en().bit_is_clear();
        if lost {
            self.restart(dma);
        }
        let left = usize::from(dma.st(0).ndtr().read().ndt().bits());
        let head = (LENGTH.saturating_sub(left) / ADC_CHANNELS) % SCANS;
        let tail = core::mem::replace(&mut self.tail, head);
        let parts = if tail <= head { [scans(tail, head), &[]] } else { [scans(tail, SCANS), scans(0, head)] };
        codes.clear();
        if let Some(channel) = wanted {
            let each = parts.iter().flat_map(|part| part.iter().skip(channel).step_by(ADC_CHANNELS));
            for code in each {
                let _ = codes.push(code.load(Ordering::Relaxed)); // as many as there are scans: it has room
            }
        }
        (core::array::from_fn(|channel| sum(channel, parts)), !lost)
    }
}

/// Conversions of a channel in a second, with `cycles` of sampling time.
pub(crate) fn rate_hz(cycles: u16) -> f32 {
    CLOCK_HZ as f32 / ((u32::from(cycles) + TWELVE_BITS) * ADC_CHANNELS as u32) as f32
}

/// Conversions of one channel since the last tick.
pub(crate) type Codes = Vec<u16, SCANS>;

/// Codes of the scans from one to before another.
fn scans(from: usize, to: usize) -> &'static [AtomicU16] {
    BUFFER.get(from * ADC_CHANNELS..to * ADC_CHANNELS).unwrap_or(&[])
}

/// One channel at a time, so that its sums stay in registers.
fn sum(channel: usize, parts: [&[AtomicU16]; 2]) -> AdcBlock {
    let mut block = AdcBlock::default();
    for part in parts {
        for code in part.iter().skip(channel).step_by(ADC_CHANNELS) {
            block.push(code.load(Ordering::Relaxed));
        }
    }
    block
}
