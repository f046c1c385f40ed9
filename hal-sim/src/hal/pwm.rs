//! The pulse output: a PWM channel with preloaded compare value, and the ESC at the end of its wire.
//!
//! What it is: `embedded_hal::pwm::SetDutyCycle` whose period is the pulse timer's; a new value counts from the next period on, so a pulse
//! that has begun is never cut or stretched.
//! What can go wrong: a duty cycle above the maximum is taken as the maximum; after a reset nothing drives the pin (see [`super::pins`]), and writing to the channel of
//! the program that was reset does nothing.
//! Units: timer ticks; ns since power-up.
//! Reference: RM0090 sections 18.3.9 (PWM mode) and 18.4.13 (compare preload); embedded-hal 1.0, `pwm`.

use super::pins::RigPins;
use core::convert::Infallible;
use embedded_hal::pwm::{ErrorType, SetDutyCycle};
use esc_pwm::PulseTimer;

const NS_PER_S: u64 = 1_000_000_000;

/// What the timer does by itself.
#[derive(Debug, Clone, Copy)]
pub(super) struct Train {
    timer: PulseTimer,
    preload: u16,
    /// Start of the period that runs, or of the next one when this one's pulse has ended.
    period_ns: u64,
    /// Compare value of the pulse that is up.
    compare: Option<u16>,
}

impl Train {
    /// End and width of the next pulse that ends by `until_ns`, ns.
    pub(super) fn next_pulse(&mut self, until_ns: u64) -> Option<(u64, u32)> {
        loop {
            match self.compare {
                Some(ticks) => {
                    let width_ns = u64::from(ticks) * NS_PER_S / u64::from(self.timer.counter_hz());
                    let end_ns = self.period_ns + width_ns;
                    if end_ns > until_ns {
                        return None;
                    }
                    self.compare = None;
                    self.period_ns += u64::from(self.timer.period()) * NS_PER_S / u64::from(self.timer.counter_hz());
                    if ticks > 0 {
                        return Some((end_ns, width_ns as u32));
                    }
                }
                None if self.period_ns <= until_ns => self.compare = Some(self.preload),
                None => return None,
            }
        }
    }
}

/// The ESC's pin.
pub struct PulsePin {
    pins: RigPins,
    timer: PulseTimer,
    life: u32,
}

impl PulsePin {
    /// Starts the train now, with pulses of `ticks`.
    #[must_use]
    pub fn start(pins: &RigPins, timer: PulseTimer, ticks: u16) -> Self {
        let period_ns = pins.clock().now_ns();
        let mut behind = pins.now();
        behind.train = Some(Train { timer, preload: ticks, period_ns, compare: None });
        Self { pins: pins.clone(), timer, life: behind.life }
    }
}

impl ErrorType for PulsePin {
    type Error = Infallible;
}

impl SetDutyCycle for PulsePin {
    fn max_duty_cycle(&self) -> u16 {
        u16::try_from(self.timer.period()).unwrap_or(u16::MAX)
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        let most = self.max_duty_cycle();
        let mut behind = self.pins.now();
        if behind.life == self.life
            && let Some(train) = &mut behind.train
        {
            train.preload = duty.min(most);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn train(ticks: u16) -> Train {
        let timer = PulseTimer::new(84_000_000, 16).unwrap();
        Train { timer, preload: ticks, period_ns: 0, compare: None }
    }

    #[test]
    fn periods_are_exact_and_a_new_value_waits_for_its_period() {
        let mut train = train(3_000);
        assert_eq!(train.next_pulse(999_999), None);
        train.preload = 6_000; // the first pulse is up already
        assert_eq!(train.next_pulse(1_000_000), Some((1_000_000, 1_000_000)));
        for k in 1..1000 {
            let at = k * 20_000_000 + 2_000_000;
            assert_eq!(train.next_pulse(at - 1), None);
            assert_eq!(train.next_pulse(at), Some((at, 2_000_000)));
        }
    }

    #[test]
    fn no_duty_is_no_pulse() {
        assert_eq!(train(0).next_pulse(1_000_000_000), None);
    }
}
