//! Saving and restoring.
//!
//! What it is: the whole state as words of 32 bits, written and read by one list of fields, so that a filter that was
//! restored continues with the same bits.
//! What can go wrong: words of another version, damaged, no rotation or not finite: refused, and the filter keeps what
//! it had.
//! Units: bits.
//! Reference: IEEE 754 single precision; Fowler, Noll & Vo for the checksum.

use crate::Mat3;
use crate::columns::Column;

/// Anything that is a list of single-precision numbers.
pub(super) trait Words {
    /// Visits every number in a fixed order.
    fn words(&mut self, visit: &mut dyn FnMut(&mut f32));
}

impl<const N: usize, const M: usize> Words for [[f32; N]; M] {
    fn words(&mut self, visit: &mut dyn FnMut(&mut f32)) {
        self.as_flattened_mut().iter_mut().for_each(visit);
    }
}

impl Words for Column {
    fn words(&mut self, visit: &mut dyn FnMut(&mut f32)) {
        self.iter_mut().for_each(visit);
    }
}

impl Words for Mat3 {
    fn words(&mut self, visit: &mut dyn FnMut(&mut f32)) {
        self.iter_mut().for_each(visit);
    }
}

/// A flag as a number.
pub(super) fn flag(value: &mut bool, visit: &mut dyn FnMut(&mut f32)) {
    let mut word = f32::from(u8::from(*value));
    visit(&mut word);
    *value = word != 0.0;
}

/// Checksum of the numbers of a state: FNV-1a, a word at a time. Any change of one word changes it.
pub(super) fn checksum(words: &[u32]) -> u32 {
    words.iter().fold(0x811c_9dc5, |sum, word| (sum ^ word).wrapping_mul(0x0100_0193))
}

/// Why a saved state is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum StateError {
    /// Written by another version of the filter; holds the version found.
    Version(u32),
    /// A number is not finite; holds its place.
    NotFinite(usize),
    /// The matrix is no rotation.
    NoRotation,
    /// The checksum is another: not the words that were saved.
    Damaged,
}
