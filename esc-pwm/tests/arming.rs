//! The arming machine, explored: every state, event and combination of objections.

use esc_pwm::PulseWidth;
use esc_pwm::arming::{STATES, TABLE, message};
use esc_pwm::dshot::{Frame, Throttle};
use esc_pwm::{ArmingEvent, ArmingTimes, Objections, Outcome, pulse_for, step, time_out};
use esc_pwm::{Refusals, State};
use std::collections::BTreeSet;

const RUN_UNLESS: u16 = Refusals::FAULT_LATCHED | Refusals::OUT_OF_RANGE | Refusals::EMPTY_SCHEDULE;
const CALIBRATE_UNLESS: u16 = Refusals::FAULT_LATCHED
    | Refusals::THROTTLE_NOT_LOW
    | Refusals::NO_LOW_INTERVAL
    | Refusals::ROTOR_TURNING
    | Refusals::STOP_OPEN
    | Refusals::ESC_POWERED
    | Refusals::NOT_CONFIRMED
    | Refusals::SUPPLY_UNPROVEN
    | Refusals::NO_WITNESS
    | Refusals::NO_RANGE;

/// Every combination of the objections that some row of the table knows, and one that none does.
fn objections() -> impl Iterator<Item = Objections> {
    let known = TABLE.iter().fold(Refusals::REPLAYED, |mask, row| mask | row.unless);
    (0..=u16::MAX).map(Refusals).filter(move |objections| objections.0 & !known == 0)
}

/// Every bit of [`Refusals`] has its words.
const _: () = assert!(Refusals::WORDS.len() == 16);

/// States reachable from reset, with one way each was reached.
fn reachable() -> BTreeSet<u8> {
    let mut seen = BTreeSet::from([State::Disarmed as u8]);
    let mut open = Vec::from([State::Disarmed]);
    while let Some(state) = open.pop() {
        for event in ArmingEvent::ALL {
            for guard in objections() {
                if let Outcome::To(next) = step(state, event, guard)
                    && seen.insert(next as u8)
                {
                    open.push(next);
                }
            }
        }
    }
    seen
}

/// Every state with every event under every combination of objections, once.
#[test]
fn the_whole_table_is_visited() {
    let (mut taken, mut refused, mut ignored) = (0u32, 0u32, 0u32);
    for state in STATES {
        for event in ArmingEvent::ALL {
            for guard in objections() {
                match step(state, event, guard) {
                    Outcome::To(_) => taken += 1,
                    Outcome::Refused(reasons) => {
                        refused += 1;
                        assert!(!reasons.is_empty() && event.is_command(), "{state:?} {event:?}");
                    }
                    Outcome::Ignored => ignored += 1,
                }
            }
        }
    }
    let (states, rows) = (reachable().len(), TABLE.len());
    println!("{states} states, {rows} rows; {taken} transitions taken, {refused} refused, {ignored} without effect");
    assert_eq!(taken + refused + ignored, 10 * 15 * objections().count() as u32);
}

#[test]
fn every_state_is_reachable_and_no_row_is_dead() {
    assert_eq!(reachable().len(), STATES.len());
    for (i, a) in TABLE.iter().enumerate() {
        assert!(!TABLE[..i].iter().any(|b| b.from == a.from && b.on == a.on), "row {a:?} is hidden by an earlier one");
    }
}

/// Pulses above minimum only in Running and CalibrateHoldMax, whatever is commanded.
#[test]
fn live_pulses_in_two_states_only() {
    for state in STATES {
        for commanded in [0, 999_999, 1_000_000, 1_000_001, 1_500_000, 2_000_000, u32::MAX] {
            let pulse = pulse_for(state, PulseWidth(commanded));
            assert!(pulse >= PulseWidth::MIN && pulse <= PulseWidth::MAX);
            if !matches!(state, State::Running | State::CalibrateHoldMax) {
                assert_eq!(pulse, PulseWidth::MIN, "{state:?}");
                assert_eq!(Throttle::of(pulse), Throttle::STOP, "{state:?}");
            }
        }
    }
}

#[test]
fn stop_and_trip_give_minimum_from_every_state() {
    for state in STATES {
        for guard in objections() {
            for event in [ArmingEvent::Stop, ArmingEvent::Trip] {
                let Outcome::To(next) = step(state, event, guard) else { panic!("{event:?} in {state:?} was not taken") };
                assert_eq!(pulse_for(next, PulseWidth::MAX), PulseWidth::MIN);
                assert_eq!(Frame { throttle: Throttle::of(pulse_for(next, PulseWidth::MAX)), telemetry: false }, Frame::STOP);
                assert!(matches!(next, State::Faulted | State::ProgrammingEscape));
            }
        }
    }
}

/// The only ways into the two live states.
#[test]
fn live_states_are_entered_by_their_own_command_only() {
    for state in STATES {
        for event in ArmingEvent::ALL {
            for guard in objections() {
                match step(state, event, guard) {
                    Outcome::To(State::Running) => {
                        assert!(matches!(state, State::Armed | State::Running) && event == ArmingEvent::Run);
                        assert_eq!(guard.0 & RUN_UNLESS, 0);
                    }
                    Outcome::To(State::CalibrateHoldMax) => {
                        assert!(state == State::Disarmed && event == ArmingEvent::Calibrate);
                        let never =
                            Refusals::ESC_POWERED | Refusals::NOT_CONFIRMED | Refusals::FAULT_LATCHED | Refusals::NO_RANGE;
                        assert_eq!(guard.0 & never, 0);
                    }
                    Outcome::To(State::Armed) => assert!(
                        matches!(event, ArmingEvent::Ready | ArmingEvent::Finished),
                        "{state:?} {event:?} armed without the ESC's own answer"
                    ),
                    _ => {}
                }
            }
        }
    }
}

/// A latched state is left by the operator's clearing alone, and never towards a live state.
#[test]
fn faults_latch() {
    for event in ArmingEvent::ALL {
        for guard in objections() {
            for state in [State::Faulted, State::ProgrammingEscape] {
                if let Outcome::To(next) = step(state, event, guard)
                    && next != state
                {
                    assert_eq!((event, next), (ArmingEvent::Clear, State::Disarmed));
                }
            }
        }
    }
}

#[test]
fn a_refusal_lists_every_reason() {
    let all = Refusals(u16::MAX);
    assert_eq!(step(State::Disarmed, ArmingEvent::Calibrate, all), Outcome::Refused(Refusals(CALIBRATE_UNLESS)));
    assert_eq!(
        step(State::Running, ArmingEvent::Arm, Refusals(Refusals::ROTOR_TURNING | Refusals::THROTTLE_NOT_LOW)),
        Outcome::Refused(Refusals(Refusals::WRONG_STATE | Refusals::ROTOR_TURNING | Refusals::THROTTLE_NOT_LOW))
    );
}

#[test]
fn the_two_start_procedures() {
    use ArmingEvent::{Arm, Calibrate, Cells, Double, Long, Ready, Run};
    let walk = |events: &[ArmingEvent]| {
        events.iter().fold(State::Disarmed, |state, event| match step(state, *event, Refusals::default()) {
            Outcome::To(next) => next,
            _ => state,
        })
    };
    assert_eq!(walk(&[Arm, Long, Cells, Ready]), State::Armed);
    assert_eq!(walk(&[Arm, Cells, Ready]), State::ArmHoldMin, "beeps out of order do not arm");
    assert_eq!(walk(&[Calibrate, Double, Long, Cells, Ready, Run]), State::Running);
    assert_eq!(walk(&[Calibrate, Run]), State::CalibrateHoldMax);
}

#[test]
fn every_waiting_state_has_a_time_out_that_is_taken() {
    for state in STATES {
        let taken = matches!(step(state, ArmingEvent::TimeOut, Refusals::default()), Outcome::To(_));
        assert_eq!(time_out(state, &ArmingTimes::default()).is_some(), taken, "{state:?}");
        assert!(!message(state).is_empty());
    }
}
