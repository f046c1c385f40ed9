//! The ESC's telemetry and the back-EMF meter on the flash image: USART3 and TIM1 channel 4 against the simulated bench.
//!
//! What it is: a board that is configured for them is armed and run; the ESC sends what its own sensors say, the comparator's edges reach the
//! capture at their instants, and then something happens to each of the lines.
//! What can go wrong: an error flag that is not cleared would leave the receiver deaf: after each fault the values have to come back.
//! Build the image first: `cargo xtask image`

use esc_pwm::dshot::{EscOutput, Frame};
use firmware_rig::{Config, EscTelemetry, RigConfig};
use frame::esc::EscVerdict;
use frame::message::{Command, Event, Health, Message, SettingsNews};
use frame::rig::{CaptureVerdict, FaultSet, RigSample, RigState};
use frame::units::PulseWidth;
use hal_sim::emulated::Machine;
use hal_sim::emulated::operator::ArmAndRun;
use hal_sim::emulated::rig::{Action, Heard, Operator, RigRun, rig_on};
use hal_sim::native::{PLUGS, Sectors};
use hal_sim::scenario::EscSection;
use hal_sim::sensor::EscWire;
use hal_sim::{Scenario, Truth};
use quadrig_tests::budget;

const PULSE_US: u32 = 1450;
const POLE_PAIRS: u16 = 11;
const MS: u64 = 1_000_000;
/// When the configuration is sent, ms; a part each three milliseconds.
const CONFIGURE_AT: u64 = 40;
const METER: usize = PLUGS - 1;

/// Configures, arms, runs, and does things at their times after the start of the run, ms.
#[derive(Debug)]
struct Scripted {
    inner: ArmAndRun,
    config: Vec<Command>,
    script: Vec<(u64, Action)>,
}

impl Operator for Scripted {
    fn millisecond(&mut self, ms: u64, heard: &[Heard], actions: &mut Vec<Action>) {
        self.inner.millisecond(ms, heard, actions);
        if ms >= CONFIGURE_AT && ms.is_multiple_of(3) && !self.config.is_empty() {
            actions.push(Action::Send(self.config.remove(0)));
        }
        if let Some(started) = self.inner.started {
            let since = ms.saturating_sub(started);
            actions.extend(self.script.extract_if(.., |(at, _)| *at <= since).map(|(_, action)| action));
        }
    }
}

/// Where a board has its configuration from.
enum From {
    Flash(RigConfig),
    Line(RigConfig),
    Factory,
}

fn fly(from: From, script: Vec<(u64, Action)>, milliseconds: u64) -> RigRun<Scripted> {
    fly_with(&Scenario::default(), from, script, milliseconds)
}

fn fly_with(scenario: &Scenario, from: From, script: Vec<(u64, Action)>, milliseconds: u64) -> RigRun<Scripted> {
    let mut machine = Machine::new().unwrap_or_else(|error| panic!("{error}"));
    let mut commands = Vec::new();
    match from {
        From::Flash(config) => {
            let mut sectors = Sectors::default();
            assert_eq!(settings_store::save(&mut sectors, Sectors::RANGE, &config), SettingsNews::Saved);
            machine = machine.with_settings(sectors.bytes());
        }
        From::Line(config) => {
            let mut length = 0;
            for part in config.parts() {
                length = part.length;
                commands.push(Command::ConfigPart(part));
            }
            commands.push(Command::ConfigApply { length, crc: config.digest() });
        }
        From::Factory => {}
    }
    let level = Command::SetPulse(PulseWidth::from_us(PULSE_US));
    let operator = Scripted { inner: ArmAndRun::new([level], None), config: commands, script };
    let run = rig_on(machine, scenario, operator, milliseconds).unwrap_or_else(|error| panic!("{error}"));
    run.outcome.accesses.only(&[]).unwrap();
    assert_eq!((run.link.damaged, run.link.missing), (0, 0));
    run
}

fn fitted(log_period_ms: u16) -> RigConfig {
    let esc_telemetry = Some(EscTelemetry { pole_pairs: POLE_PAIRS, asked: false });
    RigConfig { esc_telemetry, back_emf: POLE_PAIRS, log_period_ms, ..RigConfig::of(&Config::thesis_570kv()) }
}

fn samples(run: &RigRun<Scripted>, from_ms: u64, until_ms: u64) -> Vec<RigSample> {
    let started = run.operator.inner.started.expect("the rig ran");
    let inside = |s: &&RigSample| (started + from_ms..started + until_ms).contains(&s.at.as_ms());
    run.operator.inner.samples.iter().filter(inside).copied().collect()
}

/// What was there when a sample was taken.
fn truth(run: &RigRun<Scripted>, sample: &RigSample) -> Truth {
    let at = sample.at.as_ms() * MS;
    run.truth.iter().min_by_key(|(t, _)| t.abs_diff(at)).expect("the truth").1
}

fn last_health(run: &RigRun<Scripted>) -> Health {
    let health = |(_, m): &(_, Message)| if let Message::Health(h) = m { Some(*h) } else { None };
    run.messages.iter().rev().find_map(health).expect("a report")
}

#[test]
fn values_arrive_and_agree_and_what_happens_to_the_lines_is_told_and_stops_nothing() {
    let script = vec![
        (1_500, Action::EscWire(EscWire::Cut)),
        (2_000, Action::EscWire(EscWire::Sound)),
        (2_300, Action::EscWire(EscWire::Baud(57_600))),
        (2_800, Action::EscWire(EscWire::Sound)),
        (3_100, Action::EscWire(EscWire::Noisy { probability: 1.0 })),
        (3_600, Action::EscWire(EscWire::Sound)),
        (3_900, Action::Plug { plug: METER, out: true }),
        (4_300, Action::Plug { plug: METER, out: false }),
    ];
    let run = fly(From::Flash(fitted(20)), script, 9_500);
    let hello = run.operator.inner.hello.expect("it says who it is");
    assert_eq!((hello.present, hello.config), (0b11_1111, fitted(20).digest()));
    let calibration = run.operator.inner.calibration.expect("its scales");
    let plateau = samples(&run, 1_000, 1_450);
    assert!(plateau.len() > 20, "{} samples", plateau.len());
    let mut ages = Vec::new();
    for sample in &plateau {
        let (plant, row) = (truth(&run, sample).plant, calibration.convert(sample));
        let [rpm, current, voltage, ..] = row.esc.map(|v| v.unwrap_or_else(|| panic!("{:?}", sample.esc)));
        assert!((rpm - plant.rpm).abs() < 12.0 + 0.005 * plant.rpm, "{rpm} of {}", plant.rpm);
        assert!((current - 0.25 - 1.03 * plant.current_a).abs() < 0.2, "{current} of {}", plant.current_a);
        assert!((voltage - 0.995 * plant.voltage_v).abs() < 0.03, "{voltage} of {}", plant.voltage_v);
        let meter = row.rpm_bemf.unwrap_or_else(|| panic!("{:?}", sample.back_emf));
        assert!((meter / plant.rpm - 1.0).abs() < 1.5e-3, "{meter} of {}", plant.rpm);
        assert_eq!(sample.back_emf.map(|c| c.verdict), Some(CaptureVerdict::Nominal));
        ages.extend(sample.esc.map(|code| code.age_ms));
    }
    assert!(ages.iter().all(|ms| *ms <= 36), "each frame is heard: {ages:?}");

    let verdicts =
        |from, until| -> Vec<EscVerdict> { samples(&run, from, until).iter().map(|s| s.esc.expect("fitted").verdict).collect() };
    let all = |from, until, wanted| {
        let told = verdicts(from, until);
        assert!(told.len() > 5 && told.iter().all(|v| *v == wanted), "{from} to {until} ms: {wanted:?}, told {told:?}");
    };
    all(1_800, 2_000, EscVerdict::Silent);
    all(2_100, 2_300, EscVerdict::Nominal);
    all(2_600, 2_800, EscVerdict::Garbled);
    all(2_900, 3_100, EscVerdict::Nominal);
    all(3_400, 3_600, EscVerdict::Garbled);
    all(3_700, 4_900, EscVerdict::Nominal);
    let meter = |from, until, wanted: CaptureVerdict| {
        let told: Vec<_> = samples(&run, from, until).iter().map(|s| s.back_emf.expect("fitted").verdict).collect();
        assert!(told.len() > 5 && told.iter().all(|v| *v == wanted), "{from} to {until} ms: {wanted:?}, told {told:?}");
    };
    meter(4_000, 4_280, CaptureVerdict::Lost);
    meter(4_450, 4_900, CaptureVerdict::Nominal);
    let after = samples(&run, 0, 4_900);
    assert!(after.iter().all(|s| s.faults == FaultSet::NONE && s.state == RigState::Running), "the run goes on");
    let events = run.operator.inner.events.iter().filter(|(_, e)| matches!(e, Event::EscTelemetry { .. })).count();
    assert_eq!(events, 7, "heard, and three times gone and back: {:?}", run.operator.inner.events);

    let health = last_health(&run);
    println!(
        "esc: {:?} good, damaged, errors; tick {} cycles, capture {}",
        health.esc, health.tick_cycles, health.capture_cycles
    );
    let [good, damaged, errors] = health.esc;
    assert!(good > 100 && (20..60).contains(&damaged) && errors > 50, "{:?}", health.esc);
    // above 25 samples a second the conversions are those of a thousand
    assert!(health.tick_cycles <= budget::rig("tick_cycles_at_1_khz") && health.capture_cycles <= budget::rig("capture_cycles"));
}

/// Everything fitted, ten and a thousand samples a second: the longest tick and the line.
#[test]
fn a_thousand_samples_a_second_with_all_of_it_fit_the_tick_and_the_line() {
    for (log_ms, key) in [(100u16, "tick_cycles_with_all"), (1, "tick_cycles_at_1_khz")] {
        let run = fly(From::Flash(fitted(log_ms)), vec![], 6_500);
        let told = samples(&run, 1_000, 1_900);
        assert!(told.len() + 5 >= 900 / usize::from(log_ms), "{} samples in 900 ms", told.len());
        assert!(told.iter().all(|s| s.esc.is_some_and(|c| c.verdict == EscVerdict::Nominal) && s.back_emf.is_some()));
        let health = last_health(&run);
        println!("a sample in {log_ms} ms with all of it: tick {} cycles, capture {}", health.tick_cycles, health.capture_cycles);
        assert!(health.tick_cycles <= budget::rig(key), "{health:?}");
        assert!(health.stack_size - health.stack_free <= budget::rig("stack_bytes"), "{health:?}");
    }
}

/// An ESC that sends only when it is asked, by a frame in twenty of DShot600.
#[test]
fn an_esc_that_has_to_be_asked_is_asked_by_frames() {
    let esc_telemetry = Some(EscTelemetry { pole_pairs: POLE_PAIRS, asked: true });
    let config = RigConfig { output: EscOutput::DShot600, esc_telemetry, ..fitted(20) };
    let esc = EscSection { telemetry_asked: true, ..EscSection::default() };
    let run = fly_with(&Scenario { esc, ..Scenario::default() }, From::Flash(config), vec![], 6_000);
    let calibration = run.operator.inner.calibration.expect("its scales");
    let told = samples(&run, 800, 1_400);
    assert!(told.len() > 20, "{} samples", told.len());
    for sample in &told {
        let (plant, row) = (truth(&run, sample).plant, calibration.convert(sample));
        let (code, rpm) = (sample.esc.expect("fitted"), row.esc[0]);
        assert!(rpm.is_some_and(|rpm| (rpm - plant.rpm).abs() < 12.0 + 0.005 * plant.rpm), "{code:?}, {} there", plant.rpm);
        assert!(code.age_ms <= 25, "{code:?}");
    }
    let asked = run.frames.iter().filter_map(|f| Frame::from_word(f.word?)).filter(|f| f.telemetry).count();
    assert!(asked.abs_diff(run.frames.len() / 20) <= 1, "{asked} of {} frames ask", run.frames.len());
    println!("{asked} of {} frames ask; {:?} good, damaged, errors", run.frames.len(), last_health(&run).esc);
}

/// A configuration that comes over the line switches their receivers on, and off again. The tick that takes it reckons its checksum twice: longer
/// than any other, while the rig is disarmed.
#[test]
fn a_new_configuration_fits_them() {
    let bare = RigConfig { log_period_ms: 20, ..RigConfig::of(&Config::thesis_570kv()) };
    for (config, there) in [(bare, false), (fitted(20), true)] {
        let run = fly(From::Line(config), vec![], 5_600);
        assert_eq!(run.operator.inner.hello.map(|h| h.config), Some(config.digest()));
        let told = samples(&run, 500, 1_000);
        let heard =
            |s: &RigSample| s.esc.is_some_and(|c| c.verdict == EscVerdict::Nominal) && s.back_emf.is_some_and(|c| c.edges > 0);
        assert!(told.len() > 20 && told.iter().all(|s| heard(s) == there && s.esc.is_some() == there), "{:?}", told.first());
        let cycles = last_health(&run).tick_cycles;
        println!("the tick that takes a configuration: {cycles} cycles, fitted {there}");
        assert!(cycles < 84_000, "within the half tick");
    }
}

/// A board without them has their receivers off: nothing that their wires do costs it anything.
#[test]
fn what_is_not_fitted_is_neither_told_nor_heard() {
    let run = fly(From::Factory, vec![], 5_600);
    let told = samples(&run, 500, 1_000);
    assert!(told.len() > 3 && told.iter().all(|s| s.esc.is_none() && s.back_emf.is_none()));
    assert_eq!(last_health(&run).esc, [0; 3]);
}
