//! The independent watchdog, and why the board was reset.
//!
//! What it is: 20 ms on the 32 kHz LSI (14 to 38 ms over its tolerance), fed by the control tick alone.
//! What can go wrong: a tick that stalls longer resets the board; the pulse pin then floats, held low by its pull-down, until the train starts anew.
//! Units: milliseconds.
//! Reference: RM0090 section 21.3 (IWDG), 7.3.21 (RCC_CSR); datasheet table 42 (LSI 17 to 47 kHz).

use stm32f4xx_hal::pac::{IWDG, RCC};

/// 20 ms at 32 kHz / 4.
const RELOAD: u16 = 160 - 1;

/// The watchdog.
pub(crate) struct Watchdog {
    iwdg: IWDG,
}

impl Watchdog {
    /// Starts it; there is no way back.
    pub(crate) fn start(iwdg: IWDG) -> Self {
        iwdg.kr().write(|w| w.key().start());
        iwdg.kr().write(|w| w.key().unlock());
        iwdg.pr().write(|w| w.pr().divide_by4());
        iwdg.rlr().write(|w| w.rl().set(RELOAD));
        // the registers take up to five LSI cycles, 0.3 ms at 17 kHz (RM0090 section 21.4.4); without LSI the default 512 ms stays.
        // The core runs from the internal oscillator here: at least 2 ms
        let mut patience = 10_000u32;
        while iwdg.sr().read().bits() != 0 && patience > 0 {
            patience -= 1;
        }
        let mut this = Self { iwdg };
        this.feed();
        this
    }

    /// Another 20 ms.
    pub(crate) fn feed(&mut self) {
        self.iwdg.kr().write(|w| w.key().feed());
    }
}

/// Reset flags, bits 31..24 of RCC_CSR, read before they are cleared.
pub(crate) fn take_reset_cause(rcc: &RCC) -> u8 {
    let cause = (rcc.csr().read().bits() >> 24) as u8;
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    cause
}
