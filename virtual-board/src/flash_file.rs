//! The settings' sectors of a virtual board in a file.
//!
//! What it is: the 256 KiB of the two last flash sectors, byte for byte as they lie in the chip; native and emulated boards read each other's.
//! What can go wrong: a file of another length is refused; a file that cannot be written is told, and what was there stays.
//! Units: bytes.
//! Reference: RM0090 table 5; `hal_sim::native::Sectors`.

use crate::board::BoardError;
use hal_sim::native::Sectors;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

/// The file.
#[derive(Debug)]
pub struct FlashFile {
    path: PathBuf,
    held: Option<Sectors>,
    saves: u32,
}

impl FlashFile {
    /// Opens the file; one that is not there is a board that never stored anything.
    ///
    /// # Errors
    /// [`BoardError::File`], [`BoardError::Length`].
    pub fn open(path: &Path) -> Result<Self, BoardError> {
        let held = match std::fs::read(path) {
            Ok(bytes) => {
                let found = bytes.len();
                let sectors = Sectors::holding(bytes);
                let length = || BoardError::Length { file: path.to_owned(), found, expected: Sectors::BYTES };
                Some(sectors.ok_or_else(length)?)
            }
            Err(error) if error.kind() == ErrorKind::NotFound => None,
            Err(source) => return Err(BoardError::File { file: path.to_owned(), source }),
        };
        Ok(Self { path: path.to_owned(), held, saves: 0 })
    }

    /// What it held when it was opened; once.
    pub fn take(&mut self) -> Option<Sectors> {
        self.held.take()
    }

    /// Writes the sectors when the board has stored something since, whole or not at all.
    ///
    /// # Errors
    /// [`BoardError::File`].
    pub fn keep(&mut self, bytes: &[u8], saves: u32) -> Result<(), BoardError> {
        if saves == self.saves {
            return Ok(());
        }
        self.saves = saves;
        let folder = self.path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
        let written = tempfile::NamedTempFile::new_in(folder).and_then(|mut file| {
            file.write_all(bytes)?;
            file.as_file().sync_all()?;
            Ok(file.persist(&self.path)?)
        });
        written.map(|_| ()).map_err(|source| BoardError::File { file: self.path.clone(), source })
    }
}
