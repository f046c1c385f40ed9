//! Settings over a flash in memory that behaves as NOR flash does, and that may be cut off or wear out.

use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use frame::message::SettingsNews;
use settings_store::{MAX_STORED, Stored, load, open, save, seal};

const PAGE: usize = 1024;
const RANGE: core::ops::Range<u32> = 0..2 * PAGE as u32;

/// Settings of any length, all of one byte.
#[derive(Debug, Clone, PartialEq)]
struct Filled {
    byte: u8,
    length: usize,
}

impl Stored for Filled {
    const VERSION: u8 = 5;

    fn write(&self, content: &mut [u8]) -> Option<usize> {
        content.get_mut(..self.length)?.fill(self.byte);
        Some(self.length)
    }

    fn read(content: &[u8]) -> Option<Self> {
        let byte = *content.first()?;
        content.iter().all(|other| *other == byte).then_some(Self { byte, length: content.len() })
    }
}

fn filled(byte: u8) -> Filled {
    Filled { byte, length: 60 }
}

/// Two pages. Each write and each erase uses up one of `left`; after them nothing is done any more, as if the power were gone.
#[derive(Debug, Clone)]
struct Memory {
    cells: Vec<u8>,
    left: usize,
    /// A cell that is programmed wrongly.
    worn: bool,
    /// Protected against writing, and silent about it.
    protected: bool,
}

impl Memory {
    fn new() -> Self {
        Self { cells: vec![0xff; 2 * PAGE], left: usize::MAX, worn: false, protected: false }
    }

    fn may(&mut self) -> Result<(), Gone> {
        self.left = self.left.checked_sub(1).ok_or(Gone)?;
        Ok(())
    }
}

#[derive(Debug)]
struct Gone;

impl NorFlashError for Gone {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl ErrorType for Memory {
    type Error = Gone;
}

impl ReadNorFlash for Memory {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Gone> {
        bytes.copy_from_slice(&self.cells[offset as usize..offset as usize + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.cells.len()
    }
}

impl NorFlash for Memory {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Gone> {
        self.may()?;
        if self.protected {
            return Ok(());
        }
        self.cells[from as usize..to as usize].fill(0xff);
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Gone> {
        self.may()?;
        if self.protected {
            return Ok(());
        }
        self.cells[offset as usize..].iter_mut().zip(bytes).for_each(|(cell, byte)| *cell &= byte);
        if self.worn && bytes.len() > 8 {
            self.cells[offset as usize + 8] &= 0x7f;
        }
        Ok(())
    }
}

#[test]
fn what_was_stored_last_comes_back() {
    let mut flash = Memory::new();
    assert_eq!(load::<Filled, _>(&mut flash, RANGE), (None, SettingsNews::Absent));
    for byte in 1..=200 {
        assert_eq!(save(&mut flash, RANGE, &filled(byte)), SettingsNews::Saved, "{byte}");
        assert_eq!(load(&mut flash, RANGE), (Some(filled(byte)), SettingsNews::Loaded));
    }
}

/// The power goes after any number of writes and erases of a save: the old settings or the new ones, never others and never none.
#[test]
fn a_power_cut_leaves_the_old_or_the_new() {
    let mut flash = Memory::new();
    for byte in 1..60 {
        save(&mut flash, RANGE, &filled(byte));
        let mut outcomes = Vec::new();
        for left in 0.. {
            let mut cut = Memory { left, ..flash.clone() };
            let told = save(&mut cut, RANGE, &filled(byte + 100));
            cut.left = usize::MAX;
            let (found, news) = load::<Filled, _>(&mut cut, RANGE);
            let found = found.unwrap_or_else(|| panic!("{byte}, {left}: {news:?}"));
            assert!(found == filled(byte) || found == filled(byte + 100), "{byte}, {left}: {found:?}");
            assert!(told != SettingsNews::Saved || found == filled(byte + 100), "{byte}, {left}: told as stored");
            outcomes.push(told);
            if told == SettingsNews::Saved {
                break;
            }
        }
        assert_eq!(outcomes[0], SettingsNews::Failed, "nothing can be written");
    }
}

/// What is damaged is told as that, and a save after it makes the flash good again.
#[test]
fn damage_is_told_and_mended_by_the_next_save() {
    let mut flash = Memory::new();
    flash.cells.fill(0x5a);
    assert_eq!(load::<Filled, _>(&mut flash, RANGE), (None, SettingsNews::Damaged));
    assert_eq!(save(&mut flash, RANGE, &filled(7)), SettingsNews::Saved);
    assert_eq!(load(&mut flash, RANGE), (Some(filled(7)), SettingsNews::Loaded));
    let mut dead = Memory { left: 0, ..Memory::new() };
    dead.cells.fill(0x5a);
    assert_eq!(save(&mut dead, RANGE, &filled(7)), SettingsNews::Failed);
}

/// Only what reads back the same counts as stored.
#[test]
fn a_worn_cell_is_no_success() {
    let mut flash = Memory { worn: true, ..Memory::new() };
    assert_eq!(save(&mut flash, RANGE, &filled(0xff)), SettingsNews::Failed);
}

/// A flash that takes everything and writes nothing still holds the old settings: those are not the ones that were to be stored.
#[test]
fn old_settings_that_read_back_are_no_success() {
    let mut flash = Memory::new();
    save(&mut flash, RANGE, &filled(1));
    flash.protected = true;
    assert_eq!(save(&mut flash, RANGE, &filled(2)), SettingsNews::Failed);
    assert_eq!(load(&mut flash, RANGE), (Some(filled(1)), SettingsNews::Loaded));
}

/// Settings of another version are there, and are not these.
#[test]
fn stale_settings_are_told_as_damaged() {
    #[derive(Debug, PartialEq)]
    struct Newer(Filled);
    impl Stored for Newer {
        const VERSION: u8 = Filled::VERSION + 1;
        fn write(&self, content: &mut [u8]) -> Option<usize> {
            self.0.write(content)
        }
        fn read(content: &[u8]) -> Option<Self> {
            Filled::read(content).map(Self)
        }
    }
    let mut flash = Memory::new();
    save(&mut flash, RANGE, &filled(3));
    assert_eq!(load::<Newer, _>(&mut flash, RANGE), (None, SettingsNews::Damaged));
    assert_eq!(save(&mut flash, RANGE, &Newer(filled(4))), SettingsNews::Saved);
}

#[test]
fn no_pages_are_no_store() {
    let mut flash = Memory::new();
    for range in [0..0, 0..100, 5..2 * PAGE as u32] {
        assert_eq!(load::<Filled, _>(&mut flash, range.clone()), (None, SettingsNews::Damaged));
        assert_eq!(save(&mut flash, range, &filled(1)), SettingsNews::Failed);
    }
}

/// The longest content fills the stored form to its last byte; one byte more is refused and nothing is written.
#[test]
fn the_longest_settings_are_stored_and_longer_ones_refused() {
    let longest = MAX_STORED - 5; // version and checksum
    let mut buffer = [0; MAX_STORED];
    let fits = Filled { byte: 9, length: longest };
    let form = seal(&fits, &mut buffer).unwrap();
    assert_eq!((form.len(), open::<Filled>(form)), (MAX_STORED, Some(fits.clone())));
    let mut flash = Memory::new();
    assert_eq!(save(&mut flash, RANGE, &fits), SettingsNews::Saved);
    let too_long = Filled { byte: 9, length: longest + 1 };
    assert_eq!(seal(&too_long, &mut [0; MAX_STORED]), None);
    assert_eq!(save(&mut flash, RANGE, &too_long), SettingsNews::Failed);
    assert_eq!(load(&mut flash, RANGE), (Some(fits), SettingsNews::Loaded));
}
