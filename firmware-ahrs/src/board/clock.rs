//! The board's timestamp.
//!
//! What it is: TIM2 as a free-running 32-bit counter, extended to 64 bits by whoever asks at least once in 51 s.
//! What can go wrong: two wraps between two readings would lose one; the tick asks every 5 ms.
//! Units: ticks of 84 MHz.
//! Reference: RM0090 section 18 (TIM2), 7.2 (timer clock is twice APB1).

use frame::Ticks;
use stm32f4xx_hal::pac::TIM2;
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

/// The running clock.
pub(crate) struct Clock {
    timer: TIM2,
    last: Ticks,
}

impl Clock {
    /// Starts the counter at zero.
    pub(crate) fn new(timer: TIM2, rcc: &mut Rcc) -> Self {
        TIM2::enable(rcc);
        TIM2::reset(rcc);
        timer.psc().write(|w| w.psc().set(0));
        timer.arr().write(|w| w.arr().set(u32::MAX));
        timer.egr().write(|w| w.ug().set_bit());
        timer.cr1().write(|w| w.cen().set_bit());
        Self { timer, last: Ticks(0) }
    }

    /// The present instant.
    pub(crate) fn now(&mut self) -> Ticks {
        self.last = self.last.counted(self.timer.cnt().read().cnt().bits());
        self.last
    }
}
