//! The last resort tried on purpose, and what the board measures of itself in a run, on the flash image. Faults at the pins fly in
//! `emulated_campaign.rs`.

use frame::message::{Command, Event, Message, SettingsNews, Trial};
use frame::rig::RigState;
use frame::units::PulseWidth;
use hal_sim::Scenario;
use hal_sim::emulated::operator::ArmAndRun;
use hal_sim::emulated::rig::{Action, Heard, Operator, RigRun, rig};
use hal_sim::fault::Mishap;
use quadrig_tests::budget;

/// Level of every run.
const PULSE_US: u32 = 1450;
/// From the accepted command to the mishap, ms.
const AFTER_MS: u64 = 500;

/// Arms, runs, and hears a frame twice half a second later; the rotor is told to turn backwards then.
#[derive(Debug)]
struct Unlucky {
    inner: ArmAndRun,
    met: Option<u64>,
}

impl Operator for Unlucky {
    fn millisecond(&mut self, ms: u64, heard: &[Heard], actions: &mut Vec<Action>) {
        self.inner.millisecond(ms, heard, actions);
        if self.met.is_none() && self.inner.started.is_some_and(|at| ms >= at + AFTER_MS) {
            self.met = Some(ms);
            actions.extend([Action::Mishap(Mishap::Replay), Action::Backwards(true)]);
        }
    }
}

fn fly(watch_ms: u64) -> RigRun<Unlucky> {
    let level = Command::SetPulse(PulseWidth::from_us(PULSE_US));
    let operator = Unlucky { inner: ArmAndRun::new([level], None), met: None };
    let run = rig(&Scenario::default(), operator, 4_200 + watch_ms).unwrap_or_else(|error| panic!("{error}"));
    let met = run.operator.met.expect("the rig ran") * 1_000_000;
    let live = |p: &&hal_sim::emulated::rig::SeenPulse| p.at_ns < met && p.width_ns == u64::from(PULSE_US) * 1000;
    assert!(run.pulses.iter().filter(live).count() > 5, "the rotor was turning");
    run
}

/// A reset of the expected cause, disarmed, the train within 40 ms of it.
fn resets<O>(run: &RigRun<O>, inner: &ArmAndRun, cause: u8) {
    let hello = inner.hello.expect("a second Hello");
    assert_eq!(hello.reset_cause & cause, cause, "{:#x}", hello.reset_cause);
    let sample = inner.samples.last().expect("samples");
    assert_eq!((sample.state, sample.pulse), (RigState::Disarmed, PulseWidth::MIN));
    // no gap in the train is longer than the watchdog's time, the reset's 40 ms and a frame
    let gaps = run.pulses.windows(2).map(|w| w[1].at_ns - w[0].at_ns).max().unwrap_or(0);
    assert!(gaps <= 60_000_000, "longest gap {} ms", gaps / 1_000_000);
    assert_eq!(run.outcome.accesses.resets.len(), 1, "{:?}", run.outcome.accesses.resets);
}

fn panics<O>(run: &RigRun<O>) -> Option<(u32, String)> {
    run.messages.iter().find_map(|(_, m)| match m {
        Message::Event(Event::Panicked { line, file }) => {
            Some((*line, String::from_utf8_lossy(file).trim_end_matches('\0').to_owned()))
        }
        _ => None,
    })
}

/// Asks for a trial of the last resort while disarmed.
#[derive(Debug)]
struct Trier {
    inner: ArmAndRun,
    trial: Trial,
}

/// When the trial is asked for, ms.
const TRY_AT: u64 = 120;

impl Operator for Trier {
    fn millisecond(&mut self, ms: u64, heard: &[Heard], actions: &mut Vec<Action>) {
        self.inner.millisecond(ms, heard, actions);
        actions.clear(); // nothing is armed
        if ms == TRY_AT {
            let trial = self.trial;
            actions.push(Action::Send(Command::SelfTest { confirm: Command::SELF_TEST_CONFIRM, trial }));
        }
    }
}

fn tries(trial: Trial) -> RigRun<Trier> {
    let operator = Trier { inner: ArmAndRun::new([], None), trial };
    let run = rig(&Scenario::default(), operator, 500).unwrap_or_else(|error| panic!("{error}"));
    assert!(run.pulses.iter().all(|p| p.width_ns == 1_000_000), "minimum before, in and after it");
    run
}

#[test]
fn a_panic_resets_and_tells_its_place() {
    let run = tries(Trial::Panic);
    resets(&run, &run.operator.inner, 0x10); // SFTRSTF: the handler's own reset
    let (line, file) = panics(&run).expect("the place of the panic");
    println!("panicked at {file}:{line}");
    assert!(file.ends_with("firmware-rig/src/main.rs") && line > 0, "{file}:{line}");
}

#[test]
fn a_hanging_program_is_reset_by_the_watchdog() {
    let run = tries(Trial::Hang);
    resets(&run, &run.operator.inner, 0x20);
    assert_eq!(panics(&run), None);
}

/// Reads the health reports of a whole run against the committed budgets.
#[test]
fn stack_cycles_and_jitter_stay_within_their_budgets() {
    let run = fly(900);
    let reports: Vec<_> =
        run.messages.iter().filter_map(|(_, m)| if let Message::Health(h) = m { Some(*h) } else { None }).collect();
    let last = reports.last().expect("health reports");
    println!("{last:?}");
    let used = last.stack_size - last.stack_free;
    println!(
        "tick {} cycles, capture {} cycles, stack {used} of {} bytes",
        last.tick_cycles, last.capture_cycles, last.stack_size
    );
    assert!(used > 100 && last.stack_free > 0, "measured at all: {last:?}");
    assert!(last.tick_cycles > 1000 && last.tick_cycles <= budget::rig("tick_cycles"), "tick: {last:?}");
    assert!(last.capture_cycles > 10 && last.capture_cycles <= budget::rig("capture_cycles"), "capture: {last:?}");
    assert!(used <= budget::rig("stack_bytes"), "stack: {used}");
    for report in &reports[1..] {
        let [low, high] = report.tick_span.map(|ticks| f64::from(ticks) / 84_000.0);
        assert!(low > 0.97 && high < 1.03, "ticks {low} to {high} ms apart");
    }
    let (forward, backward) = reports.iter().fold((0, 0), |(f, b), r| (f + r.steps[0], b + r.steps[1]));
    // the encoder's channel B changes sides when the mishap comes, and the rotor coasts on
    assert!(forward > 300 && backward > 50, "{forward} and {backward} encoder steps");
    assert!(last.frames[0] > 5 && last.frames[1] == 0, "{:?}", last.frames);
    let settings = run.messages.iter().find_map(|(_, m)| match m {
        Message::Event(Event::Settings(news)) => Some(*news),
        _ => None,
    });
    assert_eq!(settings, Some(SettingsNews::Absent), "an empty flash holds no settings");
}
