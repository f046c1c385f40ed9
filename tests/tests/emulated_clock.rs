//! The crystal on the flash image: another frequency, none at all, one that fails in flight; and a hard fault in flight.

use frame::message::{ClockNews, Command, CrashCause, Event, Message};
use frame::rig::{Fault, RigState};
use frame::units::PulseWidth;
use hal_sim::Scenario;
use hal_sim::emulated::ahrs::{BusFault, ChipKind, Motion, ahrs};
use hal_sim::emulated::operator::ArmAndRun;
use hal_sim::emulated::rig::{Action, Heard, Operator, RigRun, rig_on};
use hal_sim::emulated::{Machine, Quartz};

/// Level of every run, us.
const PULSE_US: u32 = 1450;
const MS: u64 = 1_000_000;

/// Arms, runs, and does one thing half a second later.
#[derive(Debug)]
struct Late {
    inner: ArmAndRun,
    action: Option<Action>,
    done: Option<u64>,
}

impl Operator for Late {
    fn millisecond(&mut self, ms: u64, heard: &[Heard], actions: &mut Vec<Action>) {
        self.inner.millisecond(ms, heard, actions);
        if self.inner.started.is_some_and(|at| ms >= at + 500)
            && let Some(action) = self.action.take()
        {
            self.done = Some(ms);
            actions.push(action);
        }
    }
}

fn fly(quartz: Quartz, action: Option<Action>, milliseconds: u64) -> RigRun<Late> {
    let level = Command::SetPulse(PulseWidth::from_us(PULSE_US));
    let operator = Late { inner: ArmAndRun::new([level], None), action, done: None };
    let machine = Machine::with(quartz).unwrap_or_else(|error| panic!("{error}"));
    rig_on(machine, &Scenario::default(), operator, milliseconds).unwrap_or_else(|error| panic!("{error}"))
}

fn events(run: &RigRun<Late>) -> impl Iterator<Item = Event> + '_ {
    run.messages.iter().filter_map(|(_, m)| if let Message::Event(event) = m { Some(*event) } else { None })
}

fn clocks(run: &RigRun<Late>) -> Vec<ClockNews> {
    events(run).filter_map(|event| if let Event::Clock(news) = event { Some(news) } else { None }).collect()
}

/// Within 1 % of `wanted`: the measurement of an exact internal oscillator.
fn near(measured: u32, wanted: u32) -> bool {
    measured.abs_diff(wanted) < wanted / 100
}

#[test]
fn a_crystal_of_12_mhz_gives_the_same_pulses_and_the_same_speed_as_one_of_8() {
    for hz in [8_000_000, 12_000_000] {
        let run = fly(Quartz::Good(u64::from(hz)), None, 5_000);
        let [news] = clocks(&run)[..] else { panic!("one report of the clock: {:?}", clocks(&run)) };
        println!("{hz} Hz: {news:?}");
        assert_eq!(news.crystal_hz, hz);
        assert!(near(news.measured_hz, hz), "{news:?}");
        let live = run.pulses.iter().filter(|p| p.width_ns == u64::from(PULSE_US) * 1000).count();
        assert!(live > 20, "{live} pulses of {PULSE_US} us");
        assert!(run.pulses.iter().all(|p| p.width_ns >= MS && p.width_ns <= u64::from(PULSE_US) * 1000), "{hz}");
        assert!(run.pulses.iter().all(|p| p.period_ns == 20 * MS), "{hz}");
        run.outcome.accesses.only(&[]).unwrap();
    }
}

/// Minimum pulses of the right length, a named fault, no throttle, and no reset.
fn stands(quartz: Quartz, measured_hz: u32) {
    let run = fly(quartz, None, 3_000);
    let [news] = clocks(&run)[..] else { panic!("one report of the clock") };
    println!("{quartz:?}: {news:?}, first pulse at {} ms", run.pulses[0].at_ns as f64 * 1e-6);
    assert_eq!(news.crystal_hz, 0);
    assert!(near(news.measured_hz, measured_hz) || measured_hz == 0 && news.measured_hz == 0, "{news:?}");
    assert!(run.pulses[0].at_ns < 40 * MS, "the first pulse within 40 ms");
    assert!(run.pulses.len() > 140, "{} pulses in 3 s", run.pulses.len());
    assert!(run.pulses.iter().all(|p| p.width_ns == MS && p.period_ns == 20 * MS), "minimum pulses of 1000 us at 50 Hz");
    let sample = run.operator.inner.samples.last().expect("samples");
    assert!(sample.faults.contains(Fault::ClockFailed), "{:?}", sample.faults);
    assert_eq!(run.operator.inner.started, None, "it never runs");
    run.outcome.accesses.only(&[]).unwrap();
}

#[test]
fn a_silent_crystal_is_a_named_fault_with_minimum_pulses_and_no_hang() {
    stands(Quartz::Silent, 0);
}

#[test]
fn a_crystal_of_another_frequency_is_not_used() {
    stands(Quartz::Good(16_000_000), 16_000_000);
    stands(Quartz::Good(10_000_000), 10_000_000);
}

/// Flies until `action`, which resets the board; gives the run and when it was done, ns.
fn crashes(action: Action) -> (RigRun<Late>, u64) {
    let run = fly(Quartz::Good(8_000_000), Some(action), 4_900);
    let done = run.operator.done.expect("the rig ran") * MS;
    let live = run.pulses.iter().filter(|p| p.at_ns < done && p.width_ns == u64::from(PULSE_US) * 1000).count();
    assert!(live > 20, "{action:?}: the rotor was turning");
    assert_eq!(run.outcome.accesses.resets.len(), 1, "{:?}", run.outcome.accesses.resets);
    let after: Vec<_> = run.pulses.iter().filter(|p| p.at_ns > done + MS).collect();
    assert!(after.len() > 10 && after.iter().all(|p| p.width_ns == MS && p.period_ns == 20 * MS), "{action:?}: {after:?}");
    let gaps = run.pulses.windows(2).map(|w| w[1].at_ns - w[0].at_ns).max().unwrap_or(0);
    assert!(gaps <= 60 * MS, "longest gap {} ms", gaps / MS);
    let sample = run.operator.inner.samples.last().expect("samples");
    assert_eq!((sample.state, sample.pulse), (RigState::Disarmed, PulseWidth::MIN));
    (run, done)
}

fn crash(run: &RigRun<Late>) -> frame::message::Crash {
    let told: Vec<_> =
        events(run).filter_map(|event| if let Event::Crashed(crash) = event { Some(crash) } else { None }).collect();
    let [crash] = told[..] else { panic!("told once: {told:?}") };
    println!("{crash:x?}");
    crash
}

#[test]
fn a_crystal_that_fails_in_flight_ends_in_minimum_pulses_from_the_internal_oscillator() {
    let (run, _) = crashes(Action::FailCrystal);
    assert_eq!(crash(&run).cause, CrashCause::ClockFailed);
    let news = clocks(&run);
    assert_eq!(news.iter().map(|n| n.crystal_hz).collect::<Vec<_>>(), [8_000_000, 0]);
    let sample = run.operator.inner.samples.last().expect("samples");
    assert!(sample.faults.contains(Fault::ClockFailed), "{:?}", sample.faults);
}

#[test]
fn a_hard_fault_in_flight_gives_minimum_and_is_told_with_its_place() {
    let (run, done) = crashes(Action::FailAccess);
    let crash = crash(&run);
    assert_eq!(crash.cause, CrashCause::HardFault);
    assert!((0x0800_0000..0x080c_0000).contains(&crash.pc), "an address of the program");
    assert_ne!(crash.status & 0x8200, 0, "a precise bus fault (CFSR.BFSR): {:#x}", crash.status);
    let live = run.pulses.iter().filter(|p| p.at_ns > done && p.width_ns > MS).count();
    assert_eq!(live, 0, "no live pulse starts after the fault");
}

/// Translations pass from board to board of one process: a later board runs as the first, also with another image in between.
#[test]
fn a_later_board_runs_as_the_first() {
    let runs = [0, 1, 2].map(|n| {
        if n == 2 {
            let other = ahrs(Motion::LEVEL, &ChipKind::ALL, BusFault::None, 300).unwrap_or_else(|error| panic!("{error}"));
            other.outcome.accesses.only(&[]).unwrap();
        }
        fly(Quartz::Good(8_000_000), None, 1_500)
    });
    for later in &runs[1..] {
        assert_eq!(later.outcome.instructions, runs[0].outcome.instructions);
        assert!(later.outcome.telemetry == runs[0].outcome.telemetry && later.pulses == runs[0].pulses);
    }
}
