//! The adapter over `SetDutyCycle`: every duty cycle that it writes, and every channel that it refuses.

use embedded_hal::pwm::{ErrorKind, ErrorType, SetDutyCycle};
use embedded_hal_mock::eh1::MockError;
use embedded_hal_mock::eh1::pwm::{Mock, Transaction};
use esc_pwm::timer::TimerError;
use esc_pwm::{OutputError, PulseOutput, PulseWidth};
use proptest::prelude::*;

/// The channel of the rig's own board: 3 MHz, 60 000 ticks.
const BOARD: u16 = 60_000;

/// What a channel is asked for a pulse: how many steps it has, and to take a duty cycle.
fn asked(steps: u16, duty: u16) -> [Transaction; 2] {
    [Transaction::max_duty_cycle(steps), Transaction::set_duty_cycle(duty)]
}

#[test]
fn the_minimum_is_set_before_anything_else() {
    let mut all = vec![Transaction::max_duty_cycle(BOARD)];
    for duty in [3_000, 4_500, 6_000, 3_000, 3_000] {
        all.extend(asked(BOARD, duty));
    }
    let mut output = PulseOutput::new(Mock::new(&all), 50).unwrap();
    assert_eq!(output.set(PulseWidth::from_us(1500)), Ok(PulseWidth::from_us(1500)));
    assert_eq!(output.set(PulseWidth(u32::MAX)), Ok(PulseWidth::MAX), "never above maximum");
    assert_eq!(output.set(PulseWidth(0)), Ok(PulseWidth::MIN), "never below minimum: silence is no stop");
    assert_eq!(output.minimum(), Ok(PulseWidth::MIN));
    output.release().done();
}

#[test]
fn a_channel_that_cannot_is_refused_and_never_touched() {
    let coarse = |steps: u16| {
        let mut channel = Mock::new(&[Transaction::max_duty_cycle(steps)]);
        let error = PulseOutput::new(channel.clone(), 50).unwrap_err();
        channel.done();
        error
    };
    assert_eq!(coarse(19_999), OutputError::Timer(TimerError::TooCoarse { counter_hz: 999_950 }));
    assert_eq!(coarse(255), OutputError::Timer(TimerError::TooCoarse { counter_hz: 12_750 }));
    for hz in [0, 251, u32::MAX] {
        let mut channel = Mock::new(&[]);
        let error = PulseOutput::new(channel.clone(), hz).unwrap_err();
        channel.done();
        assert_eq!(error, OutputError::Rate { hz });
        assert_eq!(error.to_string(), format!("the channel repeats {hz} times a second: an ESC takes 1 to 250"));
    }
}

#[test]
fn the_channel_s_own_errors_are_handed_on() {
    let fails = || Transaction::set_duty_cycle(3_000).with_error(MockError::Io(std::io::ErrorKind::Other));
    let steps = || Transaction::max_duty_cycle(BOARD);
    let mut channel = Mock::new(&[steps(), steps(), fails()]);
    let error = PulseOutput::new(channel.clone(), 50).unwrap_err();
    assert_eq!(error, OutputError::Channel(MockError::Io(std::io::ErrorKind::Other)));
    channel.done();
}

/// A channel that remembers.
#[derive(Debug)]
struct Kept {
    steps: u16,
    duty: u16,
}

impl ErrorType for Kept {
    type Error = ErrorKind;
}

impl SetDutyCycle for Kept {
    fn max_duty_cycle(&self) -> u16 {
        self.steps
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), ErrorKind> {
        self.duty = duty;
        Ok(())
    }
}

proptest! {
    /// Whatever the channel: the pulse is within half a step of what was asked, never out of what the channel has, and what is said is what is given.
    #[test]
    fn within_half_a_step(steps in 4_000u16.., rate_hz in 1u32..=250, ns in 0u32..3_000_000) {
        if let Ok(mut output) = PulseOutput::new(Kept { steps, duty: 0 }, rate_hz) {
            let asked = PulseWidth(ns).clamped();
            let said = output.set(PulseWidth(ns)).unwrap();
            let duty = output.release().duty;
            prop_assert!(duty <= steps / 2 + 1, "at most half of the shortest period");
            let step_ns = 1e9 / (f64::from(steps) * f64::from(rate_hz));
            prop_assert!(step_ns <= 1000.0);
            prop_assert!((f64::from(duty) * step_ns - f64::from(asked.0)).abs() <= step_ns / 2.0 + 1e-3);
            prop_assert!((f64::from(duty) * step_ns - f64::from(said.0)).abs() <= 0.5 + 1e-3);
        }
    }
}
