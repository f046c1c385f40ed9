//! Flash of a part in memory, whose power can be cut.
//!
//! What it is: two pages with the rules of NOR flash, for the tests of stored settings and for what is fuzzed.
//! What can go wrong: a place outside of it is a panic, as it would be a bus fault.
//! Units: bytes.
//! Reference: RM0090 section 3.6 (a word programs what was erased; an erased byte is 0xff).

use embedded_storage_async::nor_flash::{
    ErrorType, MultiwriteNorFlash, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

/// Bytes of a page.
pub const PAGE: usize = 4096;

/// Flash as the part has it: erased to ones, programming clears bits a word at a time. The power can be cut after any number of
/// words programmed or erased.
#[derive(Clone)]
pub struct Chip {
    /// Its bytes.
    pub cells: Vec<u8>,
    /// Operations until the cut.
    pub left: Option<usize>,
    /// Operations so far.
    pub operations: usize,
    /// Erasures of each page.
    pub erases: [usize; 2],
    /// It answers nothing any more.
    pub dead: bool,
}

/// The power is gone.
#[derive(Debug)]
pub struct Gone;
impl NorFlashError for Gone {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl Chip {
    /// Erased to ones, with power.
    #[must_use]
    pub fn erased() -> Self {
        Self { cells: vec![0xff; 2 * PAGE], left: None, operations: 0, erases: [0; 2], dead: false }
    }

    /// One word's worth of work, if there is still power.
    fn work(&mut self) -> Result<(), Gone> {
        if self.dead || self.left == Some(0) {
            self.left = Some(0);
            return Err(Gone);
        }
        self.left = self.left.map(|n| n - 1);
        self.operations += 1;
        Ok(())
    }
}

impl ErrorType for Chip {
    type Error = Gone;
}
impl ReadNorFlash for Chip {
    const READ_SIZE: usize = 1;
    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Gone> {
        if self.left == Some(0) {
            return Err(Gone);
        }
        let at = offset as usize;
        bytes.copy_from_slice(&self.cells[at..at + bytes.len()]);
        Ok(())
    }
    fn capacity(&self) -> usize {
        self.cells.len()
    }
}
impl NorFlash for Chip {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = PAGE;
    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Gone> {
        for word in (from as usize..to as usize).step_by(4) {
            self.work()?;
            self.cells[word..word + 4].fill(0xff); // a cut leaves the page half erased
        }
        self.erases[from as usize / PAGE] += 1;
        Ok(())
    }
    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Gone> {
        for (i, word) in bytes.chunks(4).enumerate() {
            self.work()?;
            for (cell, byte) in self.cells[offset as usize + 4 * i..].iter_mut().zip(word) {
                *cell &= byte;
            }
        }
        Ok(())
    }
}
impl MultiwriteNorFlash for Chip {}
