//! The programmable voltage detector on the board's own supply.
//!
//! What it is: a flag that is up while the supply is below 2.9 V; the tick reads it.
//! What can go wrong: below the brown-out reset level the board resets instead, which the reset cause tells.
//! Units: none.
//! Reference: RM0090 section 5.2.3 (PVD), 5.4.1 (PLS); datasheet table 19 (level 7: 2.9 V falling).

use stm32f4xx_hal::pac::PWR;

/// The detector.
pub(crate) struct SupplyWatch(PWR);

impl SupplyWatch {
    /// Starts it at its highest level.
    pub(crate) fn start(pwr: PWR) -> Self {
        #[allow(unsafe_code)] // three bits, all values valid
        pwr.cr().modify(|_, w| unsafe { w.pls().bits(7).pvde().set_bit() });
        Self(pwr)
    }

    /// The supply is too low.
    pub(crate) fn is_low(&self) -> bool {
        self.0.csr().read().pvdo().bit_is_set()
    }
}
