//! What a sensor driver reports.
//!
//! What it is: one error type for the four drivers, generic over the bus error.
//! What can go wrong: nothing here; the variants name it.
//! Units: register values as read.
//! Reference: identities in the data sheets named in each driver.

use core::fmt;

/// Why a sensor could not be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum SensorError<E> {
    /// The bus failed: nobody acknowledged, the bus is stuck, arbitration was lost.
    Bus(E),
    /// Somebody answered, but it is another chip.
    WrongIdentity {
        /// What the identity register of this chip holds.
        expected: u8,
        /// What it held (the first differing byte where there are several).
        found: u8,
    },
}

impl<E> From<E> for SensorError<E> {
    fn from(error: E) -> Self {
        Self::Bus(error)
    }
}

impl<E: fmt::Debug> fmt::Display for SensorError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bus(error) => write!(f, "the bus failed: {error:?}"),
            Self::WrongIdentity { expected, found } => {
                write!(f, "another chip answers: its identity is {found:#04x}, expected {expected:#04x}")
            }
        }
    }
}

impl<E: fmt::Debug> core::error::Error for SensorError<E> {}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use std::string::ToString;

    #[test]
    fn an_error_says_what_was_found() {
        let other = SensorError::<()>::WrongIdentity { expected: 0xE5, found: 0x03 };
        assert_eq!(other.to_string(), "another chip answers: its identity is 0x03, expected 0xe5");
        assert_eq!(SensorError::Bus("held low").to_string(), "the bus failed: \"held low\"");
    }
}
