//! Translations that outlive the core that made them.
//!
//! A process that runs one image on many boards, one after the other, would translate it for each of them, and that takes longer than to run
//! it. A core that ends leaves its blocks here, with the bytes that they were made of; the next one of the same features takes them up, and
//! drops those whose bytes are not in its own memory.
#![expect(unsafe_code, reason = "code is handed from one core to the next, none of which runs meanwhile")]

use super::{BTreeSet, Blocks, Family, Features, Jit, PAGE_BITS};
use crate::emulator::Error;
use std::mem::{ManuallyDrop, take};
use std::sync::{Mutex, PoisonError};

/// Cores whose translations are kept at most: as many as run side by side.
const MOST: usize = 8;

/// What a core leaves.
pub(super) struct Kept {
    features: Features,
    pub(super) jit: Jit,
    pub(super) blocks: Blocks,
    pub(super) looping: BTreeSet<u64>,
    /// The first byte of each block, and the bytes from there.
    pub(super) made_of: Vec<(u64, Vec<u8>)>,
}

// SAFETY: the pointers in it lead into what it owns; nothing runs and nothing is tied to a thread.
unsafe impl Send for Kept {}

static KEPT: Mutex<Vec<Kept>> = Mutex::new(Vec::new());

/// What a core of these features left, or nothing made yet.
pub(super) fn take_up(features: Features) -> Result<Kept, Error> {
    let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    match kept.iter().position(|k| k.features == features) {
        Some(n) => Ok(kept.swap_remove(n)),
        None => {
            let (blocks, looping) = (Blocks::default(), BTreeSet::new());
            Ok(Kept { features, jit: Jit::new()?, blocks, looping, made_of: Vec::new() })
        }
    }
}

impl Family {
    /// The bytes from `first` to `last` as they are in memory.
    fn bytes(&self, first: u64, last: u64) -> Option<Vec<u8>> {
        let byte = |address| {
            let (host, _) = self.pages.host(address)?;
            // SAFETY: a mapped page holds the byte.
            Some(unsafe { host.read() })
        };
        (first..=last).map(byte).collect()
    }

    /// Keeps of what was taken up what is made of the bytes that this core's memory holds.
    pub(super) fn look_at_kept(&mut self) {
        for (first, made_of) in take(&mut self.made_of) {
            let last = first + made_of.len() as u64 - 1;
            if self.bytes(first, last).as_ref() == Some(&made_of) {
                (first >> PAGE_BITS..=last >> PAGE_BITS).for_each(|page| self.pages.hold_code(page << PAGE_BITS));
            } else {
                self.blocks.drop_range(first, last + 1);
            }
        }
    }
}

impl Drop for Family {
    fn drop(&mut self) {
        // SAFETY: this is the end of the core; nothing of it asks for the code generator any more.
        let jit = unsafe { ManuallyDrop::take(&mut self.jit) };
        if std::thread::panicking() || self.mpu.enabled() || !self.breakpoints.is_empty() {
            return;
        }
        self.look_at_kept(); // of a core that never ran
        let (blocks, looping) = (take(&mut self.blocks), take(&mut self.looping));
        let spans = blocks.spans();
        let made_of = spans.iter().filter_map(|(first, last)| Some((*first, self.bytes(*first, *last)?))).collect::<Vec<_>>();
        let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        if made_of.len() == spans.len() && kept.len() < MOST {
            kept.push(Kept { features: self.features, jit, blocks, looping, made_of });
        }
    }
}
