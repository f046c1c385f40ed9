//! The last resort: minimum throttle, a record of the place, then a reset.
//!
//! What it is: the panic handler. It sets the minimum pulse, lets a pulse that has begun end, writes file and line into memory that
//! survives a reset, and resets the core; the next start tells the host.
//! What can go wrong: were the pulse timer not running yet, the wait ends by its own count. The record has a check word: what a
//! power-up leaves in memory is not told.
//! Units: ticks of TIM3.
//! Reference: specification `rig.md`, "a stop is a continuous train of 1000 us pulses".

use crate::board::pulse::{MAXIMUM, MINIMUM};
use core::sync::atomic::{AtomicU32, Ordering};
use frame::message::Event;
use stm32f4xx_hal::pac::TIM3;

/// Words of the file's name.
const NAME: usize = 6;
/// Marks a record.
const MAGIC: u32 = 0x50_41_4e_49;

/// Check word, line, end of the file's name. Not initialised at the start.
#[allow(unsafe_code)] // the section keeps its content over a reset
#[unsafe(link_section = ".uninit.panic")]
static RECORD: [AtomicU32; 2 + NAME] = [const { AtomicU32::new(0) }; 2 + NAME];

/// The check word of what is recorded.
fn check() -> u32 {
    let [_, rest @ ..] = &RECORD;
    rest.iter().fold(MAGIC, |sum, word| sum.rotate_left(5) ^ word.load(Ordering::Relaxed))
}

/// The record of a panic before the last reset, once.
pub(crate) fn take_record() -> Option<Event> {
    let [mark, line, name @ ..] = &RECORD;
    let found = mark.load(Ordering::Relaxed) == check();
    mark.store(0, Ordering::Relaxed);
    if !found {
        return None;
    }
    let mut file = [0; 4 * NAME];
    for (bytes, word) in file.chunks_exact_mut(4).zip(name) {
        bytes.copy_from_slice(&word.load(Ordering::Relaxed).to_le_bytes());
    }
    Some(Event::Panicked { line: line.load(Ordering::Relaxed), file })
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    #[allow(unsafe_code)] // nothing else runs any more: interrupts are off and we never return
    let timer = unsafe { TIM3::steal() };
    timer.ccr1().write(|w| w.ccr().set(MINIMUM));
    if let Some(place) = info.location() {
        let [mark, line, name @ ..] = &RECORD;
        line.store(place.line(), Ordering::Relaxed);
        let bytes = place.file().as_bytes();
        let mut end = bytes.iter().skip(bytes.len().saturating_sub(4 * NAME));
        for word in name {
            let mut next = || u32::from(end.next().copied().unwrap_or(0));
            word.store(next() | next() << 8 | next() << 16 | next() << 24, Ordering::Relaxed);
        }
        mark.store(check(), Ordering::Relaxed);
    }
    let mut patience = 2_000_000u32;
    while timer.cnt().read().cnt().bits() <= MAXIMUM && patience > 0 {
        patience -= 1;
    }
    cortex_m::peripheral::SCB::sys_reset()
}
