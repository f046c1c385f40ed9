//! The flash image of the motor rig, run on the emulated STM32F405 against the simulated bench.
//!
//! Build the image first: `cargo xtask image`

use frame::message::{BoardId, Command, Event, Message};
use frame::rig::{ADC_NAMES, CAPTURE_NAMES, CaptureVerdict, Fault, FaultSet, RigSample, RigState};
use frame::units::PulseWidth;
use hal_sim::emulated::operator::ArmAndRun;
use hal_sim::emulated::rig::{Action, Heard, Operator, RigRun, rig};
use hal_sim::scenario::Schedule;
use hal_sim::{Scenario, native};
use std::sync::LazyLock;

/// Registers that the emulator stores without a model and that the image is known to touch.
const STORED_ONLY: [&str; 0] = [];

/// Levels of the session, us, and how long each is held, ms.
const LEVELS: [u32; 4] = [1000, 1150, 1300, 1450];
const STEP_US: u32 = 150;
const HOLD_MS: u64 = 900;
/// Part of a hold that counts as plateau, ms after its start.
const PLATEAU: std::ops::Range<u64> = 500..880;
/// The stop comes in the middle of the last level.
const STOP_AFTER_MS: u64 = 3 * HOLD_MS + 890;

fn scenario() -> Scenario {
    let schedule = Schedule::Staircase { step_us: 150.0, hold_s: 0.9, top_us: 1450.0 };
    Scenario { schedule, ..Scenario::default() }
}

/// Runs the image and checks that it touched nothing undefined; resets are only those of the key.
fn run<O: Operator + 'static>(operator: O, milliseconds: u64) -> RigRun<O> {
    let mut run = rig(&scenario(), operator, milliseconds).unwrap_or_else(|error| panic!("{error}"));
    let resets = std::mem::take(&mut run.outcome.accesses.resets);
    assert_eq!(resets.len(), run.resets.len(), "{resets:?}");
    run.outcome.accesses.only(&STORED_ONLY).unwrap();
    run
}

fn staircase() -> Command {
    Command::RunStaircase {
        step: PulseWidth::from_us(STEP_US),
        hold_ms: HOLD_MS as u32,
        top: PulseWidth::from_us(LEVELS[3]),
        down: false,
    }
}

/// One whole session: boot, arming through the ESC's beeps, four levels, stop, a second of coasting.
static SESSION: LazyLock<RigRun<ArmAndRun>> = LazyLock::new(|| {
    let begun = std::time::Instant::now();
    let run = run(ArmAndRun::new([staircase()], Some(STOP_AFTER_MS)), 9_500);
    let (simulated, took) = (run.outcome.now_ns as f64 * 1e-9, begun.elapsed().as_secs_f64());
    println!("{simulated:.1} s simulated in {took:.1} s: {:.2} times real time", simulated / took);
    run
});

/// Samples of the plateau of `level` of a run that started at `started` (ms on the board's clock).
fn plateau(samples: &[RigSample], started: u64, level: usize) -> Vec<RigSample> {
    let from = started + level as u64 * HOLD_MS;
    let inside = |s: &&RigSample| (from + PLATEAU.start..from + PLATEAU.end).contains(&s.at.as_ms());
    samples.iter().filter(inside).copied().collect()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), v| (sum + v, n + 1.0));
    sum / n
}

/// When the schedule started, from the state event, ms.
fn started(events: impl Iterator<Item = Event>) -> u64 {
    let running = |e| match e {
        Event::State { to: RigState::Running, at, .. } => Some(at.as_ms()),
        _ => None,
    };
    events.filter_map(running).next().expect("the rig runs")
}

fn session_start() -> u64 {
    started(SESSION.operator.events.iter().map(|(_, e)| *e))
}

/// Nobody at the host.
#[derive(Debug)]
struct Nobody;
impl Operator for Nobody {
    fn millisecond(&mut self, _: u64, _: &[Heard], _: &mut Vec<Action>) {}
}

#[test]
fn after_reset_the_pulse_is_minimum_within_40_ms_and_stays_so() {
    let run = run(Nobody, 300);
    let first = run.pulses.first().expect("a pulse train");
    println!("first pulse {:.3} ms after reset", first.at_ns as f64 * 1e-6);
    assert!(first.at_ns <= 40_000_000, "first pulse at {} ns", first.at_ns);
    assert!(run.pulses.len() >= 14, "{} pulses in 0.3 s", run.pulses.len());
    assert!(run.pulses.iter().all(|p| (p.width_ns, p.period_ns) == (1_000_000, 20_000_000)), "{:?}", run.pulses);
    let Some((_, Message::Hello(hello))) = run.messages.first() else { panic!("no Hello: {:?}", run.messages) };
    assert_eq!((hello.board, hello.core_hz, hello.present), (BoardId::Rig, 168_000_000, 0b1111));
}

#[test]
fn it_arms_through_the_beeps_of_the_esc() {
    let states: Vec<RigState> = (SESSION.operator.events.iter())
        .filter_map(|(_, e)| if let Event::State { to, .. } = e { Some(*to) } else { None })
        .collect();
    let expected = [RigState::ArmHoldMin, RigState::ArmCells, RigState::ArmReady, RigState::Armed, RigState::Running];
    assert_eq!(states.get(..5), Some(&expected[..]), "{:?}", SESSION.operator.events);
    let refused: Vec<_> = SESSION.operator.events.iter().filter(|(_, e)| matches!(e, Event::Refused(_))).collect();
    assert!(refused.is_empty(), "{refused:?}");
    let link = SESSION.link;
    assert_eq!((link.damaged, link.missing, link.foreign), (0, 0, 0));
}

#[test]
fn no_pulse_is_above_minimum_before_the_rig_runs() {
    let before = SESSION.pulses.iter().take_while(|p| p.at_ns < session_start() * 1_000_000);
    let widths: std::collections::BTreeSet<u64> = before.map(|p| p.width_ns).collect();
    assert_eq!(widths, [1_000_000].into());
}

#[test]
fn the_pulse_on_the_pin_is_the_commanded_one_to_the_tick() {
    for (n, level) in LEVELS.iter().enumerate() {
        let from = session_start() + n as u64 * HOLD_MS;
        let inside = |at_ns: u64| (from + PLATEAU.start..from + PLATEAU.end).contains(&(at_ns / 1_000_000));
        let widths: Vec<u64> = SESSION.pulses.iter().filter(|p| inside(p.at_ns)).map(|p| p.width_ns).collect();
        assert!(widths.len() >= 18, "{} pulses", widths.len());
        assert!(widths.iter().all(|w| *w == u64::from(*level) * 1000), "{level} us: {widths:?}");
        for sample in plateau(&SESSION.operator.samples, session_start(), n) {
            assert_eq!(sample.pulse, PulseWidth::from_us(*level), "and so it is told");
        }
    }
}

#[test]
fn four_channels_tell_the_true_speed() {
    let calibration = SESSION.operator.calibration.expect("a calibration");
    for (n, level) in LEVELS.iter().enumerate().skip(1) {
        let samples = plateau(&SESSION.operator.samples, session_start(), n);
        assert!(samples.len() >= 3, "{} samples", samples.len());
        for (channel, name) in CAPTURE_NAMES.iter().enumerate() {
            let mut errors = Vec::new();
            for sample in &samples {
                let code = sample.rpm[channel];
                assert_eq!(code.verdict, CaptureVerdict::Nominal, "{name} at {level} us");
                let told = calibration.speed(channel, &code).expect("a speed");
                // the span that the code covers ends with the last edge before the sample
                let (to, span) = (sample.at.0, u64::from(code.span));
                let window = |at_ns: u64| (to - span..=to).contains(&(at_ns * 84 / 1000));
                let truth = mean(SESSION.truth.iter().filter(|(at, _)| window(*at)).map(|(_, t)| t.plant.rpm));
                errors.push(told / truth - 1.0);
            }
            let worst = errors.iter().fold(0.0f64, |w, e| w.max(e.abs()));
            let average = mean(errors.iter().copied());
            println!("{level} us {name}: mean {:+.4} %, worst {:.4} %", average * 100.0, worst * 100.0);
            assert!(average.abs() < 1.0e-3, "{name} at {level} us: {average}");
            assert!(worst < 2.0e-3, "{name} at {level} us: one sample is off by {worst}");
        }
    }
}

#[test]
fn thrust_is_the_force_on_the_beam() {
    let calibration = SESSION.operator.calibration.expect("a calibration");
    let told = |samples: &[RigSample]| mean(samples.iter().map(|s| calibration.value(0, &s.adc[0]).expect("strain is measured")));
    // the host takes the level at rest as zero, as a tare does
    let zero = told(&plateau(&SESSION.operator.samples, session_start(), 0));
    for (n, level) in LEVELS.iter().enumerate().skip(1) {
        let from = session_start() + n as u64 * HOLD_MS;
        let window = |at_ns: u64| (from + PLATEAU.start - 100..from + PLATEAU.end).contains(&(at_ns / 1_000_000));
        let truth = mean(SESSION.truth.iter().filter(|(at, _)| window(*at)).map(|(_, t)| t.beam_n));
        let thrust = told(&plateau(&SESSION.operator.samples, session_start(), n)) - zero;
        println!("{level} us: thrust {thrust:.4} N, true {truth:.4} N");
        assert!((thrust - truth).abs() < 0.02 + 0.005 * truth, "{level} us: {thrust} N, true {truth} N");
    }
}

#[test]
fn a_stop_gives_minimum_pulses_and_latches() {
    let sent = SESSION.operator.stopped.expect("the operator stopped the run");
    let after: Vec<_> = SESSION.pulses.iter().filter(|p| p.at_ns > sent * 1_000_000).collect();
    let live: Vec<_> = after.iter().filter(|p| p.width_ns > 1_000_000).collect();
    // the command travels for 0.2 ms and waits for the next tick; a pulse that has begun by then is not cut
    assert!(live.iter().all(|p| p.at_ns <= sent * 1_000_000 + 2_000_000), "live pulses after the stop: {live:?}");
    assert!(after.len() > 30, "minimum pulses go on: {}", after.len());
    let last = SESSION.operator.samples.last().expect("samples");
    assert_eq!((last.state, last.pulse), (RigState::Faulted, PulseWidth::MIN));
    assert!(last.faults.contains(Fault::OperatorStop), "{:?}", last.faults);
    let before = SESSION.operator.samples.iter().filter(|s| s.at.as_ms() < sent);
    assert!(before.into_iter().all(|s| s.faults == FaultSet::NONE), "no fault before the stop");
}

/// What goes wrong half a second after the rotor began to turn.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Mishap {
    StopKey,
    Silence,
    Reset,
}

/// Arms and runs, then meets a mishap.
#[derive(Debug)]
struct Unlucky {
    inner: ArmAndRun,
    mishap: Mishap,
    met: Option<u64>,
}

impl Operator for Unlucky {
    fn millisecond(&mut self, ms: u64, heard: &[Heard], actions: &mut Vec<Action>) {
        self.inner.millisecond(ms, heard, actions);
        let due = self.inner.started.is_some_and(|at| ms >= at + HOLD_MS + 500);
        if due && self.met.is_none() {
            self.met = Some(ms);
            match self.mishap {
                Mishap::StopKey => actions.push(Action::StopKey(true)),
                Mishap::Reset => actions.push(Action::Reset),
                Mishap::Silence => {}
            }
        }
        if self.met.is_some() && self.mishap == Mishap::Silence {
            actions.retain(|action| !matches!(action, Action::Send(_)));
        }
    }
}

/// The run, when the mishap came (ns), and the starts of the live pulses after it.
fn mishap(mishap: Mishap) -> (RigRun<Unlucky>, u64, Vec<u64>) {
    let run = run(Unlucky { inner: ArmAndRun::new([staircase()], None), mishap, met: None }, 7_200);
    let met = run.operator.met.expect("the rig ran") * 1_000_000;
    assert!(run.pulses.iter().any(|p| p.at_ns < met && p.width_ns == 1_150_000), "the rotor was turning");
    let live = run.pulses.iter().filter(|p| p.at_ns > met && p.width_ns > 1_000_000).map(|p| p.at_ns).collect();
    (run, met, live)
}

#[test]
fn the_stop_key_gives_minimum_pulses() {
    let (run, met, live) = mishap(Mishap::StopKey);
    assert!(live.iter().all(|at| *at <= met + 2_000_000), "{live:?} after {met}");
    let last = run.operator.inner.samples.last().expect("samples");
    assert!(last.state == RigState::Faulted && last.faults.contains(Fault::OperatorStop), "{last:?}");
}

#[test]
fn a_silent_host_stops_the_rotor_after_a_second() {
    let (run, met, live) = mishap(Mishap::Silence);
    // the last ping was at most 0.2 s before the host fell silent, and the link's time-out is 1 s
    let last = live.last().expect("the rig goes on at first") - met;
    println!("last live pulse {:.3} s after the silence", last as f64 * 1e-9);
    assert!((780_000_000..=1_020_000_000).contains(&last), "{last}");
    let sample = run.operator.inner.samples.last().expect("samples");
    assert!(sample.state == RigState::Faulted && sample.faults.contains(Fault::LinkLost), "{sample:?}");
}

#[test]
fn a_reset_in_the_run_gives_minimum_within_40_ms_and_disarms() {
    let (run, met, live) = mishap(Mishap::Reset);
    assert!(live.is_empty(), "nothing above minimum after the reset");
    let first = run.pulses.iter().find(|p| p.at_ns > met).expect("the train goes on").at_ns - met;
    assert!(first <= 40_000_000, "first pulse {first} ns after the reset");
    let last = run.operator.inner.samples.last().expect("samples");
    assert_eq!((last.state, last.pulse), (RigState::Disarmed, PulseWidth::MIN));
    let hello = run.operator.inner.hello.expect("a second Hello");
    assert_eq!(hello.reset_cause, 0x04, "the pin flag of RCC_CSR, and no other");
}

/// The same schedule in the native run: plateau means of every channel agree.
#[test]
fn the_native_run_measures_the_same() {
    let record = native::run(&scenario(), None, &mut |_| {}).expect("the native run");
    let native_start = started(record.events.iter().copied());
    let calibration = SESSION.operator.calibration.expect("a calibration");
    for (n, level) in LEVELS.iter().enumerate() {
        let emulated = plateau(&SESSION.operator.samples, session_start(), n);
        let native = plateau(&record.samples, native_start, n);
        assert!(emulated.len() >= 3 && native.len() >= 3, "{} and {}", emulated.len(), native.len());
        for (channel, name) in CAPTURE_NAMES.iter().enumerate() {
            let speed = |samples: &[RigSample]| {
                mean(samples.iter().map(|s| calibration.speed(channel, &s.rpm[channel]).expect("a speed")))
            };
            let (a, b) = (speed(&emulated), speed(&native));
            println!("{level} us {name}: {a:.2} and {b:.2} rev/min");
            assert!((a - b).abs() <= 2.0e-3 * b, "{name}: {a} and {b}");
        }
        for (channel, name) in ADC_NAMES.iter().enumerate() {
            let counts = |samples: &[RigSample]| {
                mean(samples.iter().map(|s| f64::from(s.adc[channel].sum) / f64::from(s.adc[channel].count)))
            };
            let (a, b) = (counts(&emulated), counts(&native));
            println!("{level} us {name}: {a:.2} and {b:.2} counts");
            // four samples each, of which the noisiest channel has 2.1 counts rms: 6 counts are four sigma of the difference
            assert!((a - b).abs() <= 6.0, "{name}: {a} and {b}");
        }
    }
}
