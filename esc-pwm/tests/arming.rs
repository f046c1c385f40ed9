//! The arming machine, explored: every state, event and combination of objections.

use esc_pwm::PulseWidth;
use esc_pwm::arming::{STATES, TABLE, message};
use esc_pwm::dshot::{Frame, Throttle};
use esc_pwm::{ArmingEvent, ArmingTimes, Objections, Outcome, pulse_for, step, time_out};
use esc_pwm::{Fault, Refusals, State};
use std::collections::BTreeSet;

const RUN_UNLESS: u16 = Refusals::FAULT_LATCHED | Refusals::OUT_OF_RANGE | Refusals::EMPTY_SCHEDULE | Refusals::SHORT_STREAM;
const ARM_UNLESS: u16 = Refusals::FAULT_LATCHED
    | Refusals::THROTTLE_NOT_LOW
    | Refusals::NO_LOW_INTERVAL
    | Refusals::ROTOR_TURNING
    | Refusals::STOP_OPEN;
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

/// Each reason alone is enough, every other one is none; elsewhere the same reasons are told beside the wrong state.
#[test]
fn each_command_has_its_own_reasons() {
    use ArmingEvent::{Arm, Calibrate, Run};
    let all = Refusals(u16::MAX);
    for (state, command, reasons, to, elsewhere) in [
        (State::Disarmed, Arm, ARM_UNLESS, State::ArmHoldMin, State::Running),
        (State::Disarmed, Calibrate, CALIBRATE_UNLESS, State::CalibrateHoldMax, State::Armed),
        (State::Armed, Run, RUN_UNLESS, State::Running, State::Disarmed),
        (State::Running, Run, RUN_UNLESS, State::Running, State::Faulted),
    ] {
        for bit in (0..16).map(|n| 1 << n) {
            let expected = if reasons & bit == 0 { Outcome::To(to) } else { Outcome::Refused(Refusals(bit)) };
            assert_eq!(step(state, command, Refusals(bit)), expected, "{command:?}: {}", Refusals(bit));
        }
        assert_eq!(step(elsewhere, command, all), Outcome::Refused(Refusals(reasons | Refusals::WRONG_STATE)), "{command:?}");
    }
}

/// What is heard of the ESC and of the clock is no command: where it does not belong nobody is told of a refusal.
#[test]
fn what_nobody_commands_is_ignored_where_it_does_not_belong() {
    use ArmingEvent::{Cells, Double, Finished, Long, NoSignal, Programming, Ready, SelfTestFailed, TimeOut};
    for event in [Long, Cells, Ready, Double, Programming, NoSignal, SelfTestFailed, TimeOut, Finished] {
        assert_eq!(step(State::Disarmed, event, Refusals::default()), Outcome::Ignored, "{event:?}");
        assert!(!event.is_command());
    }
}

/// Every way to `Faulted` that the machine finds itself names a fault; a tripped limit brings its own.
#[test]
fn what_stops_the_rig_names_its_fault() {
    use ArmingEvent::{NoSignal, SelfTestFailed, Stop, TimeOut, Trip};
    for row in TABLE.iter().filter(|row| row.to == State::Faulted) {
        assert!(row.on == Trip || row.on.fault().is_some(), "{row:?}");
    }
    let named = |fault: Fault| ArmingEvent::ALL.into_iter().filter(move |event| event.fault() == Some(fault));
    assert!(named(Fault::OperatorStop).eq([Stop]));
    assert!(named(Fault::EscSelfTest).eq([SelfTestFailed]));
    assert!(named(Fault::ArmingTimeout).eq([NoSignal, TimeOut]));
    assert_eq!(ArmingEvent::ALL.into_iter().filter_map(ArmingEvent::fault).count(), 4);
}

/// The operator knows from the words where the machine stands, and when maximum pulses are given.
#[test]
fn every_state_tells_the_operator_something_of_its_own() {
    let told: BTreeSet<&str> = STATES.into_iter().map(message).collect();
    assert_eq!(told.len(), STATES.len());
    for state in STATES {
        assert_eq!(message(state).contains("MAXIMUM"), state == State::CalibrateHoldMax, "{state:?}");
    }
    let named: BTreeSet<&str> = STATES.into_iter().map(State::words).collect();
    assert_eq!(named.len(), STATES.len());
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
