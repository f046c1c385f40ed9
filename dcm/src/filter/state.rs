//! Saving and restoring.
//!
//! What it is: the whole state as words of 32 bits, written and read by one list of fields, so that a filter that was
//! restored continues with the same bits.
//! What can go wrong: words of another version, words that are no rotation or not finite: refused, and the filter keeps what
//! it had.
//! Units: bits.
//! Reference: IEEE 754 single precision.

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
}
