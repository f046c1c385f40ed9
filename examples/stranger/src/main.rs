//! A board on a table, by the four crates alone: sensors are read, an attitude is found, a motor is started and stopped, and all of it is told over a line.
//!
//! Bus and pin are pretended: a file of registers, and a channel that remembers its duty cycle.

mod pretended;

use dcm::{Config, Dcm, Measurement, STANDARD_GRAVITY, Vec3};
use esc_pwm::{ArmingEvent, Outcome, PulseOutput, PulseWidth, Refusals, Schedule, State, pulse_for, step};
use frame::wire::{Decoder, Encoder, MAX_WIRE};
use frame::{Event, Message, Ticks};
use imu_sensors::{Adxl345, Hmc5883l, Itg3200, adxl345, hmc5883l, itg3200};
use pretended::{Channel, bus};

const DT: f32 = 1.0 / 200.0;

fn main() {
    let degrees = attitude();
    println!("attitude: roll {:.1}, pitch {:.1}, yaw {:.1} degrees", degrees[0], degrees[1], degrees[2]);
    assert!(degrees.iter().zip([30.0, 0.0, 0.0]).all(|(is, meant)| (is - meant).abs() < 1.0));

    let (highest, told) = motor();
    println!("motor: {} messages, highest pulse {:.0} us", told.len(), highest.as_us());
    let last = told.last().map(|event| match event {
        Event::State { to, .. } => *to,
        other => panic!("only states were told: {other:?}"),
    });
    assert_eq!(highest, PulseWidth::from_us(1299), "the last millisecond of the ramp");
    assert_eq!(last, Some(State::Faulted));
}

/// Roll, pitch and yaw after ten seconds at rest, rolled to the right by thirty degrees, degrees.
fn attitude() -> [f32; 3] {
    let mut bus = bus();
    Itg3200::new(&mut bus, itg3200::Config::DEFAULT).configure().expect("it is there");
    Adxl345::new(&mut bus, adxl345::Config::DEFAULT).configure().expect("it is there");
    Hmc5883l::new(&mut bus, hmc5883l::Config::DEFAULT).configure().expect("it is there");
    let mut filter = Dcm::new(Config::default());
    for _ in 0..2000 {
        let rate = Itg3200::new(&mut bus, itg3200::Config::DEFAULT).read().expect("it answers").deg_s();
        let force = adxl345::g(&Adxl345::new(&mut bus, adxl345::Config::DEFAULT).read().expect("it answers"));
        let words = Hmc5883l::new(&mut bus, hmc5883l::Config::DEFAULT).read().expect("it answers");
        filter.update(
            DT,
            &Measurement {
                gyro: Some(Vec3::from(rate.map(f32::to_radians))),
                accel: Some(Vec3::from(force) * STANDARD_GRAVITY),
                mag: Some(Vec3::from(hmc5883l::Range::Gauss1_3.gauss(&words)) * 100.0), // a gauss is 100 uT
            },
        );
    }
    let angles = filter.euler();
    [angles.roll, angles.pitch, angles.yaw].map(f32::to_degrees)
}

/// A start, a ramp and a stop. The highest pulse that the pin gave, and what the other end of the line heard.
fn motor() -> (PulseWidth, Vec<Event>) {
    use ArmingEvent::{Arm, Cells, Long, Ready, Run, Stop};
    let mut output = PulseOutput::new(Channel::default(), 50).expect("60 000 steps are fine enough");
    let (mut encoder, mut decoder, mut heard) = (Encoder::default(), Decoder::default(), Vec::new());
    let mut state = State::default();
    let mut after = |event, ms| {
        let from = state;
        if let Outcome::To(to) = step(from, event, Refusals::default()) {
            state = to;
            let mut wire = [0; MAX_WIRE];
            let at = Ticks::from_ms(ms);
            let length = encoder.encode(at, &Message::Event(Event::State { from, to, at }), &mut wire).expect("it fits");
            for byte in &wire[..length] {
                if let Some(Message::Event(event)) = decoder.push::<Message>(*byte).map(|received| received.message) {
                    heard.push(event);
                }
            }
        }
        state
    };
    for (ms, event) in [Run, Arm, Long, Cells, Ready, Run].into_iter().enumerate() {
        let state = after(event, ms as u64);
        let given = output.set(pulse_for(state, PulseWidth::MIN)).expect("no errors here");
        assert_eq!(given, PulseWidth::MIN);
    }
    let ramp = Schedule::Ramp { from: PulseWidth::from_us(1100), to: PulseWidth::from_us(1300), length_ms: 200 };
    let mut highest = PulseWidth::MIN;
    for ms in 0.. {
        let Some(target) = ramp.pulse_at(ms) else { break };
        highest = highest.max(output.set(pulse_for(State::Running, target)).expect("no errors here"));
    }
    let stopped = after(Stop, 300);
    assert_eq!(output.set(pulse_for(stopped, PulseWidth::MAX)), Ok(PulseWidth::MIN));
    assert_eq!(output.release().duty, 3000);
    (highest, heard)
}
