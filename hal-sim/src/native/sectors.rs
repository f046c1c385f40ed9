//! The settings' sectors of a native board.
//!
//! What it is: the two last sectors of the STM32F405's flash as an array that behaves as the part does: an erase fills a sector with ones, a word is
//! programmed from 1 to 0 only. The same bytes as the emulated board's, so that one file serves both.
//! What can go wrong: an operation beyond the sectors, or of less than a word, is refused.
//! Units: bytes, counted from the beginning of the first of the two.
//! Reference: RM0090 table 5 (sectors 10 and 11 of 128 KiB), section 3.6 (programming).

use core::ops::Range;
use embedded_storage_async::nor_flash::{
    ErrorType, MultiwriteNorFlash, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

/// Size of one sector.
const SECTOR: usize = 128 * 1024;
/// Value of an erased byte.
const ERASED: u8 = 0xff;
/// Bytes that are programmed at once.
const WORD: usize = 4;

/// Two sectors.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sectors {
    cells: Vec<u8>,
}

impl Default for Sectors {
    /// As they leave the factory: erased.
    fn default() -> Self {
        Self { cells: vec![ERASED; Self::BYTES] }
    }
}

impl Sectors {
    /// Size of both, bytes.
    pub const BYTES: usize = 2 * SECTOR;
    /// Where the settings lie in them.
    pub const RANGE: Range<u32> = 0..Self::BYTES as u32;

    /// Sectors that hold these bytes; `None` when they are not as many as [`Sectors::BYTES`].
    #[must_use]
    pub fn holding(bytes: Vec<u8>) -> Option<Self> {
        (bytes.len() == Self::BYTES).then_some(Self { cells: bytes })
    }

    /// What they hold.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.cells
    }

    fn part(&mut self, offset: u32, length: usize) -> Result<&mut [u8], Refused> {
        let from = offset as usize;
        self.cells.get_mut(from..from + length).ok_or(Refused)
    }
}

/// The operation reaches beyond the sectors, or is not of whole words.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("beyond the settings' sectors, or less than a word")]
pub struct Refused;

impl NorFlashError for Refused {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::OutOfBounds
    }
}

impl ErrorType for Sectors {
    type Error = Refused;
}

impl ReadNorFlash for Sectors {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Refused> {
        bytes.copy_from_slice(self.part(offset, bytes.len())?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        Self::BYTES
    }
}

impl NorFlash for Sectors {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Refused> {
        self.part(from, to.saturating_sub(from) as usize)?.fill(ERASED);
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Refused> {
        if !(offset as usize).is_multiple_of(WORD) || !bytes.len().is_multiple_of(WORD) {
            return Err(Refused);
        }
        self.part(offset, bytes.len())?.iter_mut().zip(bytes).for_each(|(cell, byte)| *cell &= byte);
        Ok(())
    }
}

impl MultiwriteNorFlash for Sectors {}

#[cfg(test)]
mod tests {
    use super::*;
    use firmware_rig::{Config, RigConfig};
    use frame::message::SettingsNews;

    #[test]
    fn what_was_saved_is_there_in_a_copy_of_the_bytes() {
        let mut sectors = Sectors::default();
        let config = RigConfig { log_period_ms: 20, ..RigConfig::of(&Config::thesis_570kv()) };
        assert_eq!(settings_store::load::<RigConfig, _>(&mut sectors, Sectors::RANGE), (None, SettingsNews::Absent));
        assert_eq!(settings_store::save(&mut sectors, Sectors::RANGE, &config), SettingsNews::Saved);
        let mut copy = Sectors::holding(sectors.bytes().to_vec()).expect("as many bytes");
        assert_eq!(settings_store::load(&mut copy, Sectors::RANGE), (Some(config), SettingsNews::Loaded));
        assert_eq!(Sectors::holding(vec![0; 100]), None);
    }
}
