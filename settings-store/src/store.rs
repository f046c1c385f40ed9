//! Settings in flash.
//!
//! What it is: one item in a log-structured map (crate `sequential-storage`): each save appends, a full page is compacted into the
//! next, so wear spreads and a power cut at any instant leaves the old settings or the new ones.
//! What can go wrong: flash that cannot be written, or whose content is damaged; a save is read back before it counts as one.
//! Units: bytes; addresses as the flash counts them.
//! Reference: RM0090 section 3.5-3.6 (sectors, programming); crate sequential-storage 8.

use crate::seal::{MAX_STORED, Stored, open, seal};
use core::future::Future;
use core::ops::Range;
use core::pin::pin;
use core::task::{Context, Poll, Waker};
use embedded_storage_async::nor_flash::NorFlash;
use frame::message::SettingsNews;
use sequential_storage::cache::Cache;
use sequential_storage::map::{MapConfig, MapStorage};

/// Key of the settings.
const KEY: u8 = 1;
/// Key, item and padding to words.
const BUFFER: usize = MAX_STORED + 32;

/// Runs a future of a flash that never waits.
fn at_once<T>(future: impl Future<Output = T>) -> Option<T> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(value) => Some(value),
        Poll::Pending => None,
    }
}

/// What is stored in `range` of `flash`.
pub fn load<T: Stored, F: NorFlash>(flash: &mut F, range: Range<u32>) -> (Option<T>, SettingsNews) {
    let Ok(config) = MapConfig::try_new(range) else { return (None, SettingsNews::Damaged) };
    let mut storage = MapStorage::<u8, _, _>::new(flash, config, Cache::new_uncached());
    let mut buffer = [0; BUFFER];
    match at_once(storage.fetch_item::<&[u8]>(&mut buffer, &KEY)) {
        Some(Ok(None)) => (None, SettingsNews::Absent),
        Some(Ok(Some(stored))) => match open(stored) {
            Some(settings) => (Some(settings), SettingsNews::Loaded),
            None => (None, SettingsNews::Damaged),
        },
        _ => (None, SettingsNews::Damaged),
    }
}

/// Stores `settings` in `range` of `flash` and reads them back. Damaged content is erased once.
pub fn save<T: Stored, F: NorFlash>(flash: &mut F, range: Range<u32>, settings: &T) -> SettingsNews {
    let mut form = [0; MAX_STORED];
    let Some(stored) = seal(settings, &mut form) else { return SettingsNews::Failed };
    for attempt in 0..2 {
        let Ok(config) = MapConfig::try_new(range.clone()) else { return SettingsNews::Failed };
        let mut storage = MapStorage::<u8, _, _>::new(&mut *flash, config, Cache::new_uncached());
        let mut buffer = [0; BUFFER];
        if attempt > 0 && !matches!(at_once(storage.erase_all()), Some(Ok(()))) {
            return SettingsNews::Failed;
        }
        if matches!(at_once(storage.store_item(&mut buffer, &KEY, &stored)), Some(Ok(()))) {
            break;
        }
    }
    match load::<T, F>(flash, range) {
        (Some(read), SettingsNews::Loaded) if &read == settings => SettingsNews::Saved,
        _ => SettingsNews::Failed,
    }
}
