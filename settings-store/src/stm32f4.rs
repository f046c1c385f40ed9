//! The two last sectors of the flash, for the settings.
//!
//! What it is: sectors 10 and 11 of 128 KiB behind the `embedded-storage` traits, programmed a word at a time.
//! What can go wrong: an erase holds the processor for 1 to 2 s, because the program runs from the same flash: the wait runs from
//! RAM and feeds the watchdog, pulses go on by the timer alone, and the tick is told by [`PAUSED`]. Only a disarmed rig saves; the IMU board misses its ticks.
//! Units: bytes, absolute addresses.
//! Reference: RM0090 sections 3.6 (keys, PSIZE, SER, SNB, caches after an erase), 3.9.1 (ACR), table 5 (sectors); datasheet table 40 (erase times).

use core::sync::atomic::{AtomicBool, Ordering};
use embedded_storage_async::nor_flash::{
    ErrorType, MultiwriteNorFlash, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use stm32f4xx_hal::pac::{FLASH, IWDG};

/// Where the settings live; `memory.x` keeps the program out of it.
pub const RANGE: core::ops::Range<u32> = 0x080C_0000..0x0810_0000;
const SECTOR: u32 = 128 * 1024;
const FIRST_SECTOR: u32 = 10;

/// CR bits.
const PG: u32 = 1;
const SER: u32 = 1 << 1;
const WORDS: u32 = 2 << 8;
const STRT: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;
/// SR: operation, write protection, alignment, parallelism and sequence errors; busy.
const ERRORS: u32 = 0xf2;
const BUSY: u32 = 1 << 16;

/// ACR: instruction cache on, data cache on; their resets, which count only while they are off (RM0090 section 3.9.1).
const CACHES_ON: u32 = 1 << 9 | 1 << 10;
const CACHES_RESET: u32 = 1 << 11 | 1 << 12;

/// Set while an erase held up everything; the tick takes it down.
pub static PAUSED: AtomicBool = AtomicBool::new(false);

/// The settings' sectors.
#[allow(missing_debug_implementations)] // the register block has none
pub struct SettingsFlash(pub FLASH);

/// The flash refused.
#[derive(Debug)]
pub struct Refused;

impl NorFlashError for Refused {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

/// Starts what CR says and waits for its end, from RAM: during an erase the flash gives no instructions.
#[allow(unsafe_code)]
#[unsafe(link_section = ".data.flash_wait")]
#[inline(never)]
fn start_and_wait(cr: *mut u32, sr: *const u32, watchdog: *mut u32, value: u32) {
    // SAFETY: the three addresses are registers of peripherals that this program owns or only feeds
    unsafe {
        cr.write_volatile(value);
        while sr.read_volatile() & BUSY != 0 {
            watchdog.write_volatile(0xAAAA);
        }
    }
}

impl SettingsFlash {
    #[allow(unsafe_code)] // raw register values: the register crate has no names for the keys
    fn unlock(&self) {
        if self.0.cr().read().bits() & LOCK != 0 {
            unsafe {
                self.0.keyr().write(|w| w.bits(0x4567_0123));
                self.0.keyr().write(|w| w.bits(0xCDEF_89AB));
            }
        }
        unsafe { self.0.sr().write(|w| w.bits(ERRORS)) };
    }

    #[allow(unsafe_code)]
    fn lock(&self) {
        unsafe { self.0.cr().write(|w| w.bits(LOCK)) };
    }

    /// Forgets what the caches hold of the sector that was erased: they are switched off, reset, and switched on as they were (RM0090
    /// section 3.6.3). After programming nothing needs this: a store that the data cache holds changes it there as well (section 3.6.4).
    #[allow(unsafe_code)] // bits of one register, each of which is named above
    fn forget_cached(&self) {
        let acr = self.0.acr();
        let before = acr.read().bits();
        unsafe {
            acr.write(|w| w.bits(before & !CACHES_ON));
            acr.write(|w| w.bits(before & !CACHES_ON | CACHES_RESET));
            acr.write(|w| w.bits(before & !CACHES_ON));
            acr.write(|w| w.bits(before));
        }
    }

    fn outcome(&self) -> Result<(), Refused> {
        let bad = self.0.sr().read().bits() & ERRORS != 0;
        self.lock();
        if bad { Err(Refused) } else { Ok(()) }
    }
}

/// Whether `length` bytes at `from` lie in the settings' sectors.
fn inside(from: u32, length: usize) -> bool {
    from >= RANGE.start && u32::try_from(length).ok().and_then(|n| from.checked_add(n)).is_some_and(|end| end <= RANGE.end)
}

impl ErrorType for SettingsFlash {
    type Error = Refused;
}

impl ReadNorFlash for SettingsFlash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Refused> {
        if !inside(offset, bytes.len()) {
            return Err(Refused);
        }
        for (byte, at) in bytes.iter_mut().zip(offset..) {
            #[allow(unsafe_code)] // inside the flash, asked above
            let value = unsafe { (at as *const u8).read_volatile() };
            *byte = value;
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        RANGE.end as usize
    }
}

impl NorFlash for SettingsFlash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR as usize;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Refused> {
        if !inside(from, to.saturating_sub(from) as usize) {
            return Err(Refused);
        }
        for sector in (from - RANGE.start) / SECTOR..(to - RANGE.start) / SECTOR {
            self.unlock();
            let value = SER | WORDS | (FIRST_SECTOR + sector) << 3;
            cortex_m::interrupt::free(|_| {
                #[allow(unsafe_code)] // raw value
                unsafe {
                    self.0.cr().write(|w| w.bits(value));
                }
                let (cr, sr) = (self.0.cr().as_ptr(), self.0.sr().as_ptr());
                start_and_wait(cr, sr, IWDG::ptr().cast_mut().cast(), value | STRT);
                self.forget_cached();
                PAUSED.store(true, Ordering::Release);
            });
            self.outcome()?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Refused> {
        if !inside(offset, bytes.len()) || !offset.is_multiple_of(4) {
            return Err(Refused);
        }
        self.unlock();
        for (word, at) in bytes.chunks_exact(4).zip((offset..).step_by(4)) {
            let [a, b, c, d] = *word else { continue };
            #[allow(unsafe_code)] // inside the flash, aligned, and unlocked
            unsafe {
                self.0.cr().write(|w| w.bits(PG | WORDS));
                (at as *mut u32).write_volatile(u32::from_le_bytes([a, b, c, d]));
            }
            while self.0.sr().read().bits() & BUSY != 0 {}
        }
        self.outcome()
    }
}

impl MultiwriteNorFlash for SettingsFlash {}
