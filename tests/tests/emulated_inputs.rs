//! Inputs that misbehave, on the flash image: a speed input that screams, a conversion that the DMA missed, a sensor that is not fitted.

use frame::message::{Command, Event, Health, Message, Setting};
use frame::rig::{CaptureVerdict, Fault, FaultSet, RigSample, RigState};
use frame::units::PulseWidth;
use hal_sim::Scenario;
use hal_sim::emulated::operator::ArmAndRun;
use hal_sim::emulated::rig::{Action, Heard, Operator, RigRun, rig};

const PULSE_US: u32 = 1450;
const MS: u64 = 1_000_000;

/// Arms, runs, and does things at their times after the start of the run, ms.
#[derive(Debug)]
struct Scripted {
    inner: ArmAndRun,
    before: Vec<(u64, Action)>,
    script: Vec<(u64, Action)>,
}

impl Operator for Scripted {
    fn millisecond(&mut self, ms: u64, heard: &[Heard], actions: &mut Vec<Action>) {
        self.inner.millisecond(ms, heard, actions);
        let due = |list: &mut Vec<(u64, Action)>, now: u64| -> Vec<Action> {
            list.extract_if(.., |(at, _)| *at <= now).map(|(_, action)| action).collect()
        };
        actions.extend(due(&mut self.before, ms));
        if let Some(started) = self.inner.started {
            actions.extend(due(&mut self.script, ms.saturating_sub(started)));
        }
    }
}

fn fly(before: Vec<(u64, Action)>, script: Vec<(u64, Action)>, milliseconds: u64) -> RigRun<Scripted> {
    let level = Command::SetPulse(PulseWidth::from_us(PULSE_US));
    let operator = Scripted { inner: ArmAndRun::new([level], None), before, script };
    rig(&Scenario::default(), operator, milliseconds).unwrap_or_else(|error| panic!("{error}"))
}

fn samples(run: &RigRun<Scripted>, from_ms: u64) -> Vec<RigSample> {
    run.operator.inner.samples.iter().filter(|s| s.at.as_ms() >= from_ms).copied().collect()
}

fn health(run: &RigRun<Scripted>) -> Vec<Health> {
    run.messages.iter().filter_map(|(_, m)| if let Message::Health(h) = m { Some(*h) } else { None }).collect()
}

/// 2.5 million edges a second on one input, more than can be served, and the stop key in the midst of it.
#[test]
fn an_input_that_screams_is_masked_and_flagged_and_the_stop_acts_in_time() {
    let script = vec![(500, Action::Scream { channel: 1, ms: 300 }), (700, Action::StopKey(true))];
    let run = fly(vec![], script, 5_600);
    let started = run.operator.inner.started.expect("the rig ran");
    let stopped = (started + 700) * MS;
    let late = run.pulses.iter().filter(|p| p.at_ns > stopped + 2 * MS && p.width_ns > MS).count();
    assert_eq!(late, 0, "the stop acts while the input screams");
    let screaming = samples(&run, started + 560);
    let screaming: Vec<_> = screaming.iter().filter(|s| s.at.as_ms() < started + 690).collect();
    assert!(screaming.iter().any(|s| s.rpm[1].verdict == CaptureVerdict::OverCapture), "flagged: {screaming:?}");
    assert!(screaming.iter().all(|s| s.rpm[0].verdict == CaptureVerdict::Nominal), "the others go on: {screaming:?}");
    for report in &health(&run)[1..] {
        // the first came before two ticks had passed
        let [low, high] = report.tick_span.map(|ticks| f64::from(ticks) / 84_000.0);
        assert!(low > 0.9 && high < 1.1, "ticks {low} to {high} ms apart");
        assert!(report.tick_cycles <= 84_000, "a tick within its half: {report:?}");
    }
    let last = run.operator.inner.samples.last().expect("samples");
    assert!(!last.faults.contains(Fault::ControlStalled), "{:?}", last.faults);
    assert!(run.outcome.accesses.resets.is_empty(), "{:?}", run.outcome.accesses.resets);
}

#[test]
fn a_conversion_that_was_missed_costs_its_samples_and_the_scan_begins_anew() {
    let run = fly(vec![], vec![(500, Action::OverrunAdc), (700, Action::OverrunAdc)], 5_400);
    let started = run.operator.inner.started.expect("the rig ran");
    let after = samples(&run, started + 900);
    assert!(after.len() > 2, "{} samples", after.len());
    for sample in &after {
        assert!(sample.faults.is_empty(), "{:?}", sample.faults);
        assert!(sample.adc.iter().all(|code| code.count > 1000), "every channel reads again: {sample:?}");
    }
    // the channels are where they were: the scan begins with the first
    let [before, after] = [samples(&run, started + 300)[0], after[1]];
    for (n, (b, a)) in before.adc.iter().zip(&after.adc).enumerate() {
        let [b, a] = [b, a].map(|code| f64::from(code.sum) / f64::from(code.count));
        assert!((a - b).abs() < 60.0, "channel {n}: {b} and {a} counts");
    }
}

/// A sensor that is not fitted interrupts nobody, whatever its pin does.
#[test]
fn only_fitted_channels_interrupt() {
    let scream = |fitted: bool| {
        let marks = Command::Configure(Setting::Marks([2, 0, 2, 25]));
        let mut before = vec![(450, Action::Scream { channel: 1, ms: 1_100 })];
        before.extend((!fitted).then_some((100, Action::Send(marks))));
        let run = fly(before, vec![], 1_600);
        (run.outcome.instructions, samples(&run, 1_000)[0].rpm[1].verdict)
    };
    let (busy, flagged) = scream(true);
    let (quiet, absent) = scream(false);
    println!("{busy} instructions with the sensor fitted, {quiet} without");
    assert_eq!((flagged, absent), (CaptureVerdict::OverCapture, CaptureVerdict::Absent));
    assert!(busy > quiet + 1_000_000, "{busy} and {quiet}");
}

/// The stop loop is normally closed: a wire that breaks stops the rig.
#[test]
fn an_unplugged_stop_loop_stops_the_rig() {
    let run = fly(vec![], vec![(500, Action::UnplugStop)], 4_800);
    let stopped = (run.operator.inner.started.expect("the rig ran") + 500) * MS;
    let live = |p: &&hal_sim::emulated::rig::SeenPulse| p.width_ns > MS;
    assert!(run.pulses.iter().filter(live).any(|p| p.at_ns < stopped), "it ran");
    assert_eq!(run.pulses.iter().filter(live).filter(|p| p.at_ns > stopped + 2 * MS).count(), 0);
    let last = run.operator.inner.samples.last().expect("samples");
    assert!(last.faults.contains(Fault::OperatorStop), "{:?}", last.faults);
}

#[test]
fn a_stop_loop_that_is_open_at_power_on_lets_nothing_be_armed() {
    let run = fly(vec![(0, Action::UnplugStop)], vec![], 1_500);
    assert_eq!(run.operator.inner.started, None);
    assert!(run.pulses.iter().all(|p| p.width_ns == MS), "minimum pulses");
    let says = |m: &Message| matches!(m, Message::Event(Event::StopLoop { open: true, .. }));
    assert!(run.messages.iter().any(|(_, message)| says(message)), "it says so");
    let last = run.operator.inner.samples.last().expect("samples");
    assert_eq!((last.state, last.faults), (RigState::Disarmed, FaultSet::NONE));
}
