//! A fault that the board found at its start stands: no command brings the rig above minimum.

use firmware_rig::{AdcBlock, Beside, Config, Inputs, LineNews, Rig};
use frame::message::{Command, Event};
use frame::rig::{Fault, Refusals, RigState};
use frame::units::{PulseWidth, Ticks};

/// Milliseconds of quiet and one command a hundred of them; the answers.
fn say(rig: &mut Rig, commands: &[Command]) -> Vec<Event> {
    let mut answers = Vec::new();
    for ms in 1..=100 * (commands.len() as u64 + 1) {
        let command = if ms % 100 == 0 { commands.get(ms as usize / 100 - 1).copied() } else { None };
        let adc = [1427, 2048, 248, 0, 900].map(|code| {
            let mut block = AdcBlock::default();
            (0..8).for_each(|_| block.push(code));
            block
        });
        let inputs = Inputs {
            now: Ticks(ms * 84_000),
            edges: [&[]; 4],
            over_capture: [false; 4],
            adc: &adc,
            beside: Beside::UNWIRED,
            command,
            line: LineNews::default(),
            stop_input: false,
            brown_out: false,
            paused: false,
        };
        let outputs = rig.tick(&inputs);
        assert_eq!(outputs.pulse, PulseWidth::MIN, "at {ms} ms");
        answers.extend(outputs.event.filter(|e| matches!(e, Event::Accepted | Event::Refused(_))));
    }
    answers
}

#[test]
fn a_rig_without_a_trusted_clock_refuses_every_way_to_throttle() {
    let mut rig = Rig::new(Config::thesis_570kv());
    rig.stand(Fault::ClockFailed);
    let ways = [
        Command::ClearFaults,
        Command::Arm,
        Command::CalibrateRange { confirm: Command::CALIBRATE_CONFIRM },
        Command::SetPulse(PulseWidth::from_us(1500)),
        Command::Stop,
        Command::ClearFaults,
        Command::Arm,
    ];
    let answers = say(&mut rig, &ways);
    assert_eq!(answers.len(), ways.len(), "{answers:?}");
    assert!(rig.faults().contains(Fault::ClockFailed));
    assert_ne!(rig.state(), RigState::Running);
    let refused = |n: usize| matches!(answers[n], Event::Refused(Refusals(bits)) if bits & Refusals::FAULT_LATCHED != 0);
    assert!(refused(1) && refused(2) && refused(6), "{answers:?}");
}
