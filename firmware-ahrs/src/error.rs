//! What a sensor driver reports.
//!
//! What it is: one error type for the four drivers, generic over the bus error.
//! What can go wrong: nothing here; the variants name it.
//! Units: register values as read.
//! Reference: identities in the data sheets named in each driver.

/// Why a sensor could not be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum SensorError<E> {
    /// The bus failed: nobody acknowledged, the bus is stuck, arbitration was lost.
    Bus(E),
    /// Somebody answered at this address, but it is another chip.
    WrongIdentity {
        /// Seven-bit bus address that was asked.
        address: u8,
        /// What the identity register held (the first differing byte where there are several).
        found: u8,
    },
}

impl<E> From<E> for SensorError<E> {
    fn from(error: E) -> Self {
        Self::Bus(error)
    }
}
