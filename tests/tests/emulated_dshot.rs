//! DShot on the flash image, against the plant: frames as the pin really shows them, bit by bit, read as an ESC reads them.
//!
//! What it is: flights at both rates, a stop at every phase, a hard fault, a hang and a failing crystal in flight, the change of the output,
//! and frames whose checksum the wire has spoilt.
//! What can go wrong: the first bit of a frame is heard to the nanosecond; what the world does at an instant is done within 0.1 ms.
//! Build the image first: `cargo xtask image`

use esc_pwm::dshot::{EscOutput, Frame, Throttle};
use firmware_rig::rig_config::Answers;
use firmware_rig::{Config, RigConfig};
use frame::message::{Command, Event, Message, Setting, SettingsNews};
use frame::rig::{Fault, Refusals, RigState};
use frame::units::PulseWidth;
use hal_sim::Scenario;
use hal_sim::emulated::operator::ArmAndRun;
use hal_sim::emulated::rig::{Action, Heard, Operator, RigRun, rig, rig_on};
use hal_sim::emulated::{Machine, SeenFrame};
use hal_sim::fault::Mishap;
use hal_sim::native::Sectors;
use quadrig_tests::budget::{self, judge_tick};

const MS: u64 = 1_000_000;
/// Level of every flight.
const LEVEL: PulseWidth = PulseWidth::from_us(1450);

fn settings(output: EscOutput) -> RigConfig {
    RigConfig { output, ..RigConfig::of(&Config::thesis_570kv()) }
}

/// A board that has stored `settings`.
fn board(settings: &RigConfig) -> Machine {
    let mut sectors = Sectors::default();
    assert_eq!(settings_store::save(&mut sectors, Sectors::RANGE, settings), SettingsNews::Saved);
    Machine::new().unwrap_or_else(|error| panic!("{error}")).with_settings(sectors.bytes())
}

/// Arms, runs, and does each thing so many milliseconds after the run began.
#[derive(Debug)]
struct Flight {
    inner: ArmAndRun,
    plan: Vec<(u64, Action)>,
    done: Vec<u64>,
}

impl Operator for Flight {
    fn millisecond(&mut self, ms: u64, heard: &[Heard], actions: &mut Vec<Action>) {
        self.inner.millisecond(ms, heard, actions);
        let Some((after, action)) = self.plan.get(self.done.len()) else { return };
        if self.inner.started.is_some_and(|at| ms >= at + after) {
            self.done.push(ms);
            actions.push(*action);
        }
    }
}

fn fly(output: EscOutput, plan: &[(u64, Action)], stop_after: Option<u64>, milliseconds: u64) -> RigRun<Flight> {
    fly_at(LEVEL, output, plan, stop_after, milliseconds)
}

fn fly_at(
    level: PulseWidth,
    output: EscOutput,
    plan: &[(u64, Action)],
    stop_after: Option<u64>,
    milliseconds: u64,
) -> RigRun<Flight> {
    let inner = ArmAndRun::new([Command::SetPulse(level)], stop_after);
    let operator = Flight { inner, plan: plan.to_vec(), done: Vec::new() };
    let run = rig_on(board(&settings(output)), &Scenario::default(), operator, milliseconds);
    let run = run.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(run.operator.done.len(), plan.len(), "the rig ran");
    assert!(run.pulses.is_empty(), "{:?}", run.pulses);
    run
}

/// The frame that an ESC reads.
fn heard(frame: &SeenFrame) -> Frame {
    let word = frame.word.unwrap_or_else(|| panic!("no frame: {frame:?}"));
    Frame::from_word(word).unwrap_or_else(|| panic!("{word:#06x} at {} ns", frame.at_ns))
}

fn is_live(frame: &SeenFrame) -> bool {
    frame.word != Some(Frame::STOP.word())
}

/// Every frame checks, at its rate, a millisecond after the one before.
fn judge(frames: &[SeenFrame], output: EscOutput) {
    let bit_ns = 1_000_000_000 / u64::from(output.bit_hz().expect("digital"));
    for frame in frames {
        assert!(!heard(frame).telemetry && frame.bit_ns.abs_diff(bit_ns) <= 1, "{frame:?}");
    }
    for pair in frames.windows(2) {
        assert!((pair[1].at_ns - pair[0].at_ns).abs_diff(MS) <= 1, "{pair:?}");
    }
}

#[test]
fn a_flight_at_either_rate_arms_runs_and_stops() {
    for output in [EscOutput::DShot300, EscOutput::DShot600] {
        let begun = std::time::Instant::now();
        let run = fly(output, &[], Some(1_500), 6_500);
        judge(&run.frames, output);
        assert!(run.frames[0].at_ns < 40 * MS, "the first at {} ns", run.frames[0].at_ns);
        let (started, stopped) =
            (run.operator.inner.started.expect("it ran"), run.operator.inner.stopped.expect("it was stopped"));
        let before = run.frames.iter().filter(|f| f.at_ns < started * MS - 10 * MS);
        assert!(before.clone().count() > 3_000 && before.clone().all(|f| !is_live(f)), "nothing but zero until the run");
        let level = Frame { throttle: Throttle::of(LEVEL), telemetry: false };
        let ran = run.frames.iter().filter(|f| heard(f) == level).count();
        assert!(ran > 1_300, "{ran} frames of the level");
        assert!(run.frames.iter().all(|f| heard(f).throttle <= level.throttle), "none above it");
        let after: Vec<_> = run.frames.iter().filter(|f| f.at_ns > (stopped + 1) * MS).collect();
        assert!(after.len() > 500 && after.iter().all(|f| !is_live(f)), "zero from a millisecond after the stop");
        let truth = |ms: u64| run.truth.iter().find(|(at, _)| *at >= ms * MS).expect("it was there").1;
        let level_us = truth(stopped - 1).pulse_us;
        println!(
            "{output:?}: {} frames, the first after {:.1} ms; the ESC followed {level_us:.2} us, {:.0} rev/min",
            run.frames.len(),
            run.frames[0].at_ns as f64 * 1e-6,
            truth(stopped - 1).plant.rpm
        );
        assert!((level_us - LEVEL.as_us()).abs() < 0.26 && truth(stopped - 1).plant.rpm > 1_500.0);
        assert!(truth(stopped + 3).pulse_us == 1000.0);
        let cycles = run.messages.iter().filter_map(|(_, m)| if let Message::Health(h) = m { Some(h.tick_cycles) } else { None });
        let cycles = cycles.max().expect("its health");
        println!("{output:?}: longest tick {cycles} cycles, budget {}", budget::rig("tick_cycles"));
        assert!(cycles > 1_000 && cycles <= budget::rig("tick_cycles"));
        run.outcome.accesses.only(&[]).unwrap();
        println!("{:.1} s simulated in {:.1} s", run.outcome.now_ns as f64 * 1e-9, begun.elapsed().as_secs_f64());
    }
}

/// Time from one reset to the next, ms, and in it: arming, the run, the stop, and the reset that lets the key go. The ESC is silent and
/// without power, and the load cell alone is fitted.
const CYCLE_MS: u64 = 2_400;
const ARM: u64 = 60;
const RUN: u64 = 2_150;
const STOP: u64 = 2_330;
const RESET: u64 = 2_390;

/// How long before a frame each stop comes, ns: from just above 1 ms over a whole tick, and two from further away.
const BEFORE: [(bool, u64); 12] = [
    (true, 1_000_001),
    (true, 1_130_000),
    (true, 1_260_000),
    (true, 1_390_000),
    (true, 1_520_000),
    (true, 1_650_000),
    (true, 1_780_000),
    (true, 1_910_000),
    (true, 7_770_000),
    (false, 1_000_001),
    (false, 1_500_000),
    (false, 13_330_000),
];

/// Runs the rig and stops it, again and again.
#[derive(Debug, Default)]
struct Sweep {
    running: usize,
}

impl Operator for Sweep {
    fn millisecond(&mut self, ms: u64, heard: &[Heard], actions: &mut Vec<Action>) {
        let to_running = |h: &&Heard| matches!(h, Heard::Board(Message::Event(Event::State { to: RigState::Running, .. })));
        self.running += heard.iter().filter(to_running).count();
        let Some((key, ns)) = BEFORE.get((ms / CYCLE_MS) as usize).copied() else { return };
        match ms % CYCLE_MS {
            ARM => actions.push(Action::Send(Command::Arm)),
            RUN => actions.push(Action::Send(Command::SetPulse(PulseWidth::MAX))),
            STOP => actions.push(Action::StopBeforePulse { key, ns }),
            RESET => actions.push(Action::Reset),
            at if at > ARM && at % 200 == 0 && at < RUN => actions.push(Action::Send(Command::Ping)),
            _ => {}
        }
    }
}

#[test]
fn the_first_frame_that_starts_a_millisecond_after_a_stop_is_zero() {
    let mut config = settings(EscOutput::DShot600);
    config.esc.answers = Answers::Silent { hold_ms: 2_000 };
    (config.marks, config.fitted) = ([0; 4], [true, false, false, false, false]);
    let cycles = BEFORE.len() as u64;
    let run = rig_on(board(&config), &Scenario::default(), Sweep::default(), cycles * CYCLE_MS);
    let run = run.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((run.stops.len(), run.operator.running), (BEFORE.len(), BEFORE.len()), "every stop came to a rig that ran");
    let full = Some(Frame { throttle: Throttle::HIGHEST, telemetry: false }.word());
    for ((stop, (key, before)), cycle) in run.stops.iter().zip(BEFORE).zip(0u64..) {
        let inside = |at: u64| (cycle * CYCLE_MS..(cycle + 1) * CYCLE_MS).contains(&(at / MS));
        let frames = run.frames.iter().filter(|f| inside(f.at_ns));
        let live = frames.clone().filter(|f| f.at_ns < *stop && f.word == full).count();
        assert!(live >= 40, "{live} frames of full throttle before the stop");
        let late: Vec<_> = frames.clone().filter(|f| f.at_ns > stop + MS).collect();
        assert!(late.len() >= 10 && late.iter().all(|f| !is_live(f)), "cycle {cycle}: {:?}", late.first());
        let last = frames.clone().filter(|f| f.at_ns > *stop && is_live(f)).map(|f| f.at_ns - stop).max();
        println!(
            "{} {:.3} ms before a frame: the last live frame started {:.3} ms after it",
            if key { "key" } else { "command" },
            before as f64 * 1e-6,
            last.unwrap_or(0) as f64 * 1e-6
        );
        let start = frames.clone().find(|f| f.at_ns + 2_000 > stop + before).expect("frames never cease");
        assert!(start.at_ns.abs_diff(stop + before) < 2_000, "the stop came where it was ordered: {start:?}, {stop}");
        frames.for_each(|frame| assert!(heard(frame).throttle <= Throttle::HIGHEST));
    }
}

/// Flies, lets something happen, and gives the run and when it happened, ns. From `most_ms` after it on the line carries zero throttle, never
/// longer than 60 ms nothing, and the ESC lets the rotor stand.
fn ends_at_zero(action: Action, most_ms: u64) -> (RigRun<Flight>, u64) {
    let run = fly(EscOutput::DShot300, &[(400, action)], None, 5_000);
    let done = run.operator.done[0] * MS;
    assert!(run.frames.iter().filter(|f| f.at_ns < done && heard(f).throttle == Throttle::of(LEVEL)).count() > 300);
    let after: Vec<_> = run.frames.iter().filter(|f| f.at_ns > done + most_ms * MS).collect();
    assert!(after.len() > 300, "{action:?}: {} frames", after.len());
    after.iter().for_each(|frame| assert_eq!(heard(frame), Frame::STOP, "{action:?}: {frame:?}, happened at {done}"));
    let gap = run.frames.windows(2).map(|w| w[1].at_ns - w[0].at_ns).max().unwrap_or(0);
    println!("{action:?}: longest gap {:.1} ms", gap as f64 * 1e-6);
    assert!((2 * MS..=60 * MS).contains(&gap), "{gap} ns");
    assert_eq!(run.outcome.accesses.resets.len(), 1, "{:?}", run.outcome.accesses.resets);
    let settled = run.truth.iter().filter(|(at, _)| *at > done + (most_ms + 3) * MS);
    settled.for_each(|(at, truth)| assert_eq!(truth.pulse_us, 1000.0, "{action:?}: {at} ns"));
    let sample = run.operator.inner.samples.last().expect("samples");
    assert_eq!((sample.state, sample.pulse), (RigState::Disarmed, PulseWidth::MIN));
    (run, done)
}

/// The first gap after an instant, its beginning and end, ns.
fn gap_after(run: &RigRun<Flight>, done: u64) -> (u64, u64) {
    let pairs = run.frames.windows(2).filter(|w| w[0].at_ns > done);
    let gap = pairs.map(|w| (w[0].at_ns, w[1].at_ns)).find(|(from, to)| to - from > 2 * MS);
    gap.expect("a reset interrupts the frames")
}

#[test]
fn a_hard_fault_in_flight_sends_zero_before_the_reset_and_after_it() {
    let (run, done) = ends_at_zero(Action::FailAccess, 2);
    let (from, _) = gap_after(&run, done);
    let zeros = run.frames.iter().filter(|f| f.at_ns > done && f.at_ns <= from && !is_live(f)).count();
    println!("{zeros} frames of zero before the reset");
    assert!(zeros >= 3, "{zeros}");
    run.frames.iter().for_each(|frame| assert_eq!(Some(heard(frame).word()), frame.word, "no frame of two halves"));
    assert!(run.messages.iter().any(|(_, m)| matches!(m, Message::Event(Event::Crashed(_)))), "told after the reset");
}

#[test]
fn a_hang_in_flight_ends_at_zero_by_the_watchdog() {
    let (run, done) = ends_at_zero(Action::Mishap(Mishap::Hang), 38 + 40);
    let live = run.frames.iter().filter(|f| f.at_ns > done && is_live(f)).map(|f| f.at_ns - done).max().unwrap_or(0);
    println!("the last live frame {:.1} ms after the hang", live as f64 * 1e-6);
    assert!(live <= 38 * MS, "{live} ns");
}

#[test]
fn a_crystal_that_fails_in_flight_ends_at_zero_from_the_internal_oscillator() {
    let (run, done) = ends_at_zero(Action::FailCrystal, 20);
    let (_, to) = gap_after(&run, done);
    let after: Vec<_> = run.frames.iter().filter(|f| f.at_ns >= to).copied().collect();
    judge(&after, EscOutput::DShot300); // the emulated oscillator is exact
    let sample = run.operator.inner.samples.last().expect("samples");
    assert!(sample.faults.contains(Fault::ClockFailed), "{:?}", sample.faults);
    let spoilt: Vec<_> = run.frames.iter().filter(|f| f.word.is_none()).collect();
    assert!(spoilt.iter().all(|f| (done..done + 20 * MS).contains(&f.at_ns)), "{spoilt:?}");
}

/// The tick comes back late in the midst of what the DMA fetches for a frame, with a stop to be written at once: it waits for the pause.
#[test]
fn a_late_tick_spoils_no_frame() {
    // half throttle and more: the first bit, which is fetched already, is a 1 that no later word has
    let level = PulseWidth::from_us(1700);
    let plan = [(400, Action::Mishap(Mishap::LateTick { ms: 7 })), (405, Action::StopKey(true))];
    let run = fly_at(level, EscOutput::DShot300, &plan, None, 4_600);
    let done = run.operator.done[0] * MS;
    judge(&run.frames, EscOutput::DShot300);
    let before = run.frames.iter().filter(|f| (done - 200 * MS..done).contains(&f.at_ns));
    assert!(before.clone().count() > 190 && before.clone().all(|f| heard(f).throttle == Throttle::of(level)));
    let live = run.frames.iter().filter(|f| f.at_ns > done && is_live(f)).map(|f| f.at_ns - done).max().unwrap_or(0);
    println!("the last live frame {:.2} ms after the tick was held up", live as f64 * 1e-6);
    assert!((6 * MS..9 * MS).contains(&live), "the frames go on, and end with the tick");
    let sample = run.operator.inner.samples.last().expect("samples");
    assert!(sample.faults.contains(Fault::OperatorStop), "{:?}", sample.faults);
}

/// Puts one configuration after the other in force, and asks for what DShot does not have.
#[derive(Debug, Default)]
struct Switching {
    answers: Vec<(u64, Event)>,
}

/// When each output is asked for, ms, and the last while the rig is armed.
const OUTPUTS: [(u64, EscOutput); 5] = [
    (100, EscOutput::DShot600),
    (300, EscOutput::DShot300),
    (500, EscOutput::Pwm),
    (700, EscOutput::DShot300),
    (1_000, EscOutput::Pwm),
];
const CALIBRATE: u64 = 850;
const ARMING: u64 = 900;

impl Operator for Switching {
    fn millisecond(&mut self, ms: u64, heard: &[Heard], actions: &mut Vec<Action>) {
        for heard in heard {
            if let Heard::Board(Message::Event(event @ (Event::Accepted | Event::Refused(_)))) = heard {
                self.answers.push((ms, *event));
            }
        }
        for (at, output) in OUTPUTS {
            let config = settings(output);
            let parts: Vec<_> = config.parts().collect();
            let nth = ms.checked_sub(at).map(|since| since as usize);
            match nth.filter(|n| n % 4 == 0).map(|n| n / 4) {
                Some(n) if n < parts.len() => actions.push(Action::Send(Command::ConfigPart(parts[n]))),
                Some(n) if n == parts.len() => {
                    let apply = Command::ConfigApply { length: parts[0].length, crc: config.digest() };
                    actions.push(Action::Send(apply));
                }
                _ => {}
            }
        }
        match ms {
            CALIBRATE => actions.push(Action::Send(Command::CalibrateRange { confirm: Command::CALIBRATE_CONFIRM })),
            ARMING => actions.push(Action::Send(Command::Arm)),
            _ => {}
        }
    }
}

#[test]
fn the_output_changes_while_disarmed_with_the_line_low_between() {
    let run = rig(&Scenario::default(), Switching::default(), 1_300).unwrap_or_else(|error| panic!("{error}"));
    let parts = settings(EscOutput::Pwm).parts().count() as u64;
    let applied = |at: u64| {
        let from = at + 4 * parts;
        run.operator.answers.iter().find(|(ms, _)| (from..from + 4).contains(ms)).unwrap_or_else(|| panic!("no answer to {at}")).1
    };
    OUTPUTS[..4].iter().for_each(|(at, _)| assert_eq!(applied(*at), Event::Accepted, "{at} ms"));
    assert_eq!(applied(1_000), Event::Refused(Refusals(Refusals::WRONG_STATE)), "armed");
    let calibrated = run.operator.answers.iter().find(|(ms, _)| (CALIBRATE..ARMING).contains(ms)).expect("an answer").1;
    assert!(matches!(calibrated, Event::Refused(Refusals(r)) if r & Refusals::NO_RANGE != 0), "{calibrated:?}");

    // everything that the line carried, in order: when it began and ended, and in which form
    let pulses = run.pulses.iter().map(|p| (p.at_ns, p.at_ns + p.width_ns, EscOutput::Pwm));
    let frames = run.frames.iter().map(|f| {
        assert_eq!(heard(f), Frame::STOP, "{f:?}");
        let output = if f.bit_ns > 2_000 { EscOutput::DShot300 } else { EscOutput::DShot600 };
        (f.at_ns, f.ended_ns, output)
    });
    assert!(run.pulses.iter().all(|p| p.width_ns == MS), "whole pulses");
    let mut line: Vec<_> = pulses.chain(frames).collect();
    line.sort_by_key(|(at, _, _)| *at);
    let changes: Vec<_> = line.windows(2).filter(|w| w[0].2 != w[1].2).collect();
    let order: Vec<EscOutput> = changes.iter().map(|w| w[1].2).collect();
    assert_eq!(order, OUTPUTS[..4].iter().map(|(_, output)| *output).collect::<Vec<_>>());
    for change in changes {
        let [before, after] = change else { unreachable!("a pair") };
        println!("{:?} to {:?}: low for {:.2} ms", before.2, after.2, (after.0 - before.1) as f64 * 1e-6);
        assert!((MS / 2..25 * MS).contains(&(after.0 - before.1)), "{change:?}");
    }
    let last: Vec<SeenFrame> = run.frames.iter().filter(|f| f.at_ns > 800 * MS).copied().collect();
    judge(&last, EscOutput::DShot300);
    assert!(last.last().is_some_and(|f| f.at_ns > 1_298 * MS), "the refusal changed nothing");
    run.outcome.accesses.only(&[]).unwrap();
}

/// From pulses to DShot and back, again and again, each time a millisecond later in the period of the pulses.
#[derive(Debug, Default)]
struct BackAndForth {
    accepted: usize,
}

/// Time from one change to the next, ms, and in it: the configuration's parts, the change, the way back to the factory's pulses.
const TURN_MS: u64 = 170;
const CHANGE: u64 = 120;
const BACK: u64 = 155;
/// Milliseconds in the period of the pulses.
const TURNS: u64 = 20;

impl Operator for BackAndForth {
    fn millisecond(&mut self, ms: u64, heard: &[Heard], actions: &mut Vec<Action>) {
        self.accepted += heard.iter().filter(|h| matches!(h, Heard::Board(Message::Event(Event::Accepted)))).count();
        let config = settings(EscOutput::DShot300);
        let parts: Vec<_> = config.parts().collect();
        let Some((turn, at)) = ms.checked_sub(60).map(|since| (since / TURN_MS, since % TURN_MS)) else { return };
        if turn >= TURNS {
            return;
        }
        match at {
            BACK => actions.push(Action::Send(Command::Configure(Setting::Factory))),
            at if at == CHANGE + turn => {
                actions.push(Action::Send(Command::ConfigApply { length: parts[0].length, crc: config.digest() }));
            }
            at if at % 4 == 0 => {
                actions.extend(parts.get((at / 4) as usize).map(|part| Action::Send(Command::ConfigPart(*part))))
            }
            _ => {}
        }
    }
}

#[test]
fn no_pulse_and_no_frame_is_cut_when_the_output_changes() {
    let run = rig(&Scenario::default(), BackAndForth::default(), 60 + TURNS * TURN_MS).unwrap_or_else(|error| panic!("{error}"));
    let parts = settings(EscOutput::DShot300).parts().count();
    assert_eq!(run.operator.accepted, TURNS as usize * (parts + 2), "every part, change and way back");
    // a pulse that is cut is neither a pulse nor a frame
    run.frames.iter().for_each(|frame| assert_eq!(heard(frame), Frame::STOP, "{frame:?}"));
    assert!(run.pulses.iter().all(|p| p.width_ns == MS));
    let trains = 1 + run.frames.windows(2).filter(|w| w[1].at_ns - w[0].at_ns > 2 * MS).count();
    println!("{} pulses, {} frames in {trains} trains", run.pulses.len(), run.frames.len());
    assert_eq!(trains as u64, TURNS);
}

/// Looks on.
#[derive(Debug)]
struct Nobody;

impl Operator for Nobody {
    fn millisecond(&mut self, _: u64, _: &[Heard], _: &mut Vec<Action>) {}
}

/// What a frame costs in each tick, by the difference of two lengths of the same run. A tick that had to wait for the pause each time would
/// show here.
#[test]
fn a_tick_with_its_frame_stays_in_its_budget() {
    let count = |ms: u64| {
        let run = rig_on(board(&settings(EscOutput::DShot600)), &Scenario::default(), Nobody, ms);
        run.unwrap_or_else(|error| panic!("{error}")).outcome.instructions
    };
    judge_tick("rig", "dshot", (count(900) - count(400)) as f64 / 500.0, 168_000.0);
}

/// One bit of each frame is turned over on the wire: first in flight, then from the beginning.
#[test]
fn the_esc_takes_no_frame_whose_checksum_is_wrong() {
    let run = fly(EscOutput::DShot600, &[(500, Action::GarbleFrames(true))], None, 5_000);
    let from = run.operator.done[0] * MS;
    let level = Throttle::of(LEVEL).pulse().as_us();
    for (at, truth) in &run.truth {
        assert!(truth.pulse_us <= level + 0.01, "{at} ns: {} us", truth.pulse_us);
        if (from..from + 200 * MS).contains(at) {
            assert!((truth.pulse_us - level).abs() < 0.01, "{at} ns: the last good frame holds, {} us", truth.pulse_us);
        }
        assert!(*at < from + 260 * MS || truth.pulse_us == 1000.0, "{at} ns: no signal is no throttle");
    }
    judge(&run.frames, EscOutput::DShot600);

    let operator = Deaf::default();
    let run = rig_on(board(&settings(EscOutput::DShot600)), &Scenario::default(), operator, 3_500);
    let run = run.unwrap_or_else(|error| panic!("{error}"));
    assert!(!run.operator.beeps.is_empty(), "it complains");
    assert!(run.operator.beeps.iter().all(|b| *b == frame::message::Beep::NoSignal), "{:?}", run.operator.beeps);
}

/// Powers an ESC that no frame reaches.
#[derive(Debug, Default)]
struct Deaf {
    beeps: Vec<frame::message::Beep>,
}

impl Operator for Deaf {
    fn millisecond(&mut self, ms: u64, heard: &[Heard], actions: &mut Vec<Action>) {
        self.beeps.extend(heard.iter().filter_map(|h| if let Heard::Esc(beep) = h { Some(*beep) } else { None }));
        match ms {
            1 => actions.push(Action::GarbleFrames(true)),
            100 => actions.push(Action::Power(true)),
            _ => {}
        }
    }
}
