//! The flash controller that programs and erases the settings' sectors.
//!
//! What it is: the part's own model of FLASH (keys, lock, status) with the array behind it: words are programmed as the chip does, from 1 to
//! 0 only and by the width that CR says; a sector erase takes no time. The supply can fail at any store: that word is left half
//! programmed, and nothing reaches the array afterwards until the next reset.
//! What can go wrong: the emulator as published maps its flash read-only and drops every store without a word;
//! [`ProgrammableFlash::is_there`] says whether it was built with the one line that `cargo xtask test` adds to it.
//! Units: bytes; addresses as the program sees them.
//! Reference: RM0090 sections 3.6 (programming, erase) and 3.9 (registers), table 5 (sectors of 1 MiB).

use super::part::pass_on_the_rest;
use rigless::{
    device::{Device, DeviceContext, RegisterFile, RequestChange},
    soc::{
        Bus, Width,
        stm32f427::{generated::flash::Register, peripherals::flash::Flash},
    },
    time::{EventId, VirtualNanos},
};

/// Clock of the interface after a reset.
const RESET_CLOCK_HZ: u64 = 16_000_000;
/// The two last sectors of the STM32F405's flash, 10 and 11.
const BASE: u64 = 0x080C_0000;
const SECTOR: usize = 128 * 1024;
const FIRST_SECTOR: u64 = 10;
const SECTORS: u64 = 2;

/// What a damaged array is filled with.
const DAMAGED: u8 = 0x5a;

/// Bits of CR and SR.
const PG: u64 = 1;
const SER: u64 = 1 << 1;
const STRT: u64 = 1 << 16;
const LOCK: u64 = 1 << 31;
const PGPERR: u64 = 1 << 6;
const PGSERR: u64 = 1 << 7;

/// Bits of ACR: caches on, and their resets.
const CACHES_ON: u64 = 1 << 9 | 1 << 10;
const CACHES_RESET: u64 = 1 << 11 | 1 << 12;

/// What the caches may still hold of a sector that was erased.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Caches {
    /// Sectors that were erased.
    pub erases: u32,
    /// A sector was erased, and the caches were not reset since.
    pub stale: bool,
    /// Resets that were asked for while a cache was on, where they have no effect (RM0090 section 3.9.1).
    pub vain: u32,
}

/// The controller and what the settings' sectors hold.
#[derive(Debug)]
pub(super) struct ProgrammableFlash {
    inner: Flash,
    array: Vec<u8>,
    /// Stores so far.
    pub(super) stores: u32,
    /// The supply fails at the store of this number.
    pub(super) fails_at: Option<u32>,
    /// The supply has failed; the next reset brings it back.
    pub(super) failed: bool,
    /// The caches in front of the array.
    pub(super) caches: Caches,
}

impl ProgrammableFlash {
    pub(super) fn new(inner: Flash) -> Self {
        Self {
            inner,
            array: vec![0xff; SECTOR * SECTORS as usize],
            stores: 0,
            fails_at: None,
            failed: false,
            caches: Caches::default(),
        }
    }

    /// Whether the emulator lets a model program its flash.
    pub(super) fn is_there(bus: &Bus) -> bool {
        bus.memory().iter().any(|region| region.contains(BASE) && region.programmer == Some("FLASH"))
    }

    /// Fills the array with what no program has written, before the board is switched on.
    pub(super) fn damage(&mut self) {
        self.array.fill(DAMAGED);
    }

    /// Fills the array with what was stored before.
    pub(super) fn fill(&mut self, sectors: &[u8]) {
        self.array.iter_mut().zip(sectors).for_each(|(cell, byte)| *cell = *byte);
    }

    /// What the array holds.
    pub(super) fn array(&self) -> &[u8] {
        &self.array
    }

    /// What the array holds, and where it lies, unless it is erased.
    pub(super) fn content(&self) -> Option<(u64, Vec<u8>)> {
        self.array.iter().any(|byte| *byte != 0xff).then(|| (BASE, self.array.clone()))
    }

    /// A reset: the registers begin anew, the array stays.
    pub(super) fn restart(&mut self) {
        self.inner = Flash::with_clock(RESET_CLOCK_HZ);
        self.failed = false;
    }

    fn erase(&mut self, sector: u64, context: &mut DeviceContext<'_>) {
        let Some(n) = sector.checked_sub(FIRST_SECTOR).filter(|n| *n < SECTORS) else { return };
        let from = n as usize * SECTOR;
        self.array[from..from + SECTOR].fill(0xff);
        self.caches.erases += 1;
        self.caches.stale = true;
        for word in (0..SECTOR as u64).step_by(8) {
            context.program(BASE + from as u64 + word, Width::W64, u64::MAX, 1);
        }
    }
}

impl Device for ProgrammableFlash {
    type Register = Register;

    fn read(&mut self, register: Register, file: &mut RegisterFile, context: &mut DeviceContext<'_>) -> Option<u64> {
        Device::read(&mut self.inner, register, file, context)
    }

    fn write(&mut self, register: Register, value: u64, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if register == Register::Acr && value & CACHES_RESET != 0 {
            if value & CACHES_ON != 0 {
                self.caches.vain += 1;
            } else if value & CACHES_RESET == CACHES_RESET {
                self.caches.stale = false;
            }
        }
        let starts = register == Register::Cr && value & STRT != 0 && value & LOCK == 0;
        if starts && value & SER != 0 && !self.failed {
            self.erase(value >> 3 & 0x1f, context);
            file.set(register, value & !STRT); // done at once: the program waits for BSY, which never rises
            return;
        }
        Device::write(&mut self.inner, register, value, file, context);
    }

    fn write_region(
        &mut self,
        address: u64,
        width: Width,
        value: u64,
        file: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> bool {
        let bytes = width.bytes() as usize;
        let offset = address.wrapping_sub(BASE) as usize;
        if address < BASE || offset + bytes > self.array.len() {
            return false;
        }
        let control = file.get(Register::Cr);
        let wrong = match control {
            _ if control & PG == 0 || control & LOCK != 0 => PGSERR,
            _ if 1 << (control >> 8 & 3) != bytes => PGPERR,
            _ => 0,
        };
        if wrong != 0 {
            file.set(Register::Sr, file.get(Register::Sr) | wrong);
            return true;
        }
        if self.failed {
            return true;
        }
        let torn = self.fails_at == Some(self.stores);
        self.stores += 1;
        self.failed = torn;
        let mut programmed = 0;
        for (n, cell) in self.array[offset..offset + bytes].iter_mut().enumerate() {
            if !torn || n < bytes / 2 {
                *cell &= (value >> (8 * n)) as u8;
            }
            programmed |= u64::from(*cell) << (8 * n);
        }
        context.program(address, width, programmed, 2);
        true
    }

    fn on_event(&mut self, event: EventId, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::on_event(&mut self.inner, event, file, context);
    }

    pass_on_the_rest!();
}
