//! ESC pulses on TIM3 channel 1.
//!
//! What it is: PWM mode 1 with preloaded compare and period, so a pulse that has begun is never cut or stretched.
//! What can go wrong: nothing once the constant below compiles; a clock without an exact 20 ms does not compile.
//! Units: nanoseconds in, ticks of 3 MHz in the register.
//! Reference: RM0090 section 18.3.9 (PWM mode), 18.4.13 (compare preload).

use esc_pwm::PulseTimer;
use frame::units::PulseWidth;
use stm32f4xx_hal::pac::TIM3;

/// Arithmetic of the pulse timer, checked by the compiler.
const TIMER: PulseTimer = match PulseTimer::new(84_000_000, 16) {
    Ok(timer) => timer,
    Err(_) => core::panic!("84 MHz divides into 20 ms"),
};

/// Compare value of the minimum pulse.
pub(crate) const MINIMUM: u16 = TIMER.ticks(PulseWidth::MIN) as u16;
/// Compare value of the maximum pulse.
pub(crate) const MAXIMUM: u16 = TIMER.ticks(PulseWidth::MAX) as u16;

/// The pulse output.
pub(crate) struct PulseOutput {
    timer: TIM3,
}

impl PulseOutput {
    /// Starts the train with a minimum pulse; the pin may be switched to the timer afterwards.
    pub(crate) fn start(timer: TIM3) -> Self {
        timer.psc().write(|w| w.psc().set((TIMER.divider() - 1) as u16));
        timer.arr().write(|w| w.arr().set((TIMER.period() - 1) as u16));
        timer.ccr1().write(|w| w.ccr().set(MINIMUM));
        timer.ccmr1_output().write(|w| w.oc1m().pwm_mode1().oc1pe().enabled());
        timer.ccer().write(|w| w.cc1e().set_bit());
        timer.egr().write(|w| w.ug().set_bit());
        timer.cr1().write(|w| w.arpe().set_bit().cen().set_bit());
        Self { timer }
    }

    /// Gives `pulse` from the next period on.
    pub(crate) fn set(&mut self, pulse: PulseWidth) {
        self.timer.ccr1().write(|w| w.ccr().set(TIMER.ticks(pulse) as u16));
    }
}
