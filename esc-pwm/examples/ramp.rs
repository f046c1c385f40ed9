//! A start, a ramp and a stop on a PWM channel: `cargo run --example ramp`.
//!
//! The channel here only remembers its duty cycle; on a board it is a timer's channel of the HAL.

use core::convert::Infallible;
use embedded_hal::pwm::{ErrorType, SetDutyCycle};
use esc_pwm::{ArmingEvent, Outcome, PulseOutput, PulseWidth, Refusals, Schedule, Slew, State, pulse_for, step};

/// A PWM channel of 50 Hz with 60 000 steps.
struct Channel {
    duty: u16,
}

impl ErrorType for Channel {
    type Error = Infallible;
}

impl SetDutyCycle for Channel {
    fn max_duty_cycle(&self) -> u16 {
        60_000
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        self.duty = duty;
        Ok(())
    }
}

/// The state after an event; a refusal is told and changes nothing.
fn after(state: State, event: ArmingEvent) -> State {
    match step(state, event, Refusals::default()) {
        Outcome::To(next) => {
            println!("{event:?}: {}", next.words());
            next
        }
        Outcome::Refused(reasons) => {
            println!("{event:?} refused: {reasons}");
            state
        }
        Outcome::Ignored => state,
    }
}

fn main() {
    let mut output = PulseOutput::new(Channel { duty: 0 }, 50).expect("60 000 steps are fine enough");
    let mut state = State::default();

    // not yet: the ESC has not answered
    state = after(state, ArmingEvent::Run);
    // the normal start; the beeps are what the ESC answers
    for event in [ArmingEvent::Arm, ArmingEvent::Long, ArmingEvent::Cells, ArmingEvent::Ready, ArmingEvent::Run] {
        state = after(state, event);
    }

    let ramp = Schedule::Ramp { from: PulseWidth::from_us(1200), to: PulseWidth::from_us(1600), length_ms: 200 };
    assert!(ramp.check().is_empty());
    let slew = Slew { ns_per_ms: 5_000 };
    let mut setting = PulseWidth::MIN;
    for ms in 0.. {
        let Some(target) = ramp.pulse_at(ms) else { break };
        setting = slew.toward(setting, target, 1);
        let given = output.set(pulse_for(state, setting)).expect("this channel has no errors");
        if ms % 50 == 0 {
            println!("{ms:>4} ms: {:.0} us", given.as_us());
        }
    }

    state = after(state, ArmingEvent::Stop);
    let given = output.set(pulse_for(state, setting)).expect("this channel has no errors");
    println!("stopped at {:.0} us, a duty cycle of {}", given.as_us(), output.release().duty);
}
