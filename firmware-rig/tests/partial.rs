//! Rigs with some of the channels: what is not fitted raises no fault, what is fitted still does; ESCs that say little or nothing.

mod desk;

use desk::{BEEPS, MS, POWERED, UNPOWERED, blocks, passes};
use esc_pwm::{Bounds, EscOutput};
use firmware_rig::rig_config::Answers;
use firmware_rig::{Beside, Config, Inputs, LineNews, Rig, RigConfig};
use frame::message::{Beep, Command, ConfigPart, Event};
use frame::rig::{AdcVerdict, CaptureVerdict, Fault, FaultSet, Refusals, RigSample, RigState};
use frame::units::{Ampere, Celsius, NewtonMetre, PulseWidth, RevPerMin, Ticks, Volt};

/// An unplugged input, pulled down.
const OPEN: u16 = 0;

/// A rig whose rotor turns as it is told, seen by the sensors that are wired.
struct Desk {
    rig: Rig,
    ms: u64,
    counts: [u16; 5],
    wired: [u16; 4],
    rpm: f64,
    turned: [f64; 4],
    pulse: PulseWidth,
    events: Vec<Event>,
    last: Option<RigSample>,
    samples: usize,
}

impl Desk {
    fn new(config: Config, wired: [u16; 4]) -> Self {
        Self {
            rig: Rig::new(config),
            ms: 0,
            counts: UNPOWERED,
            wired,
            rpm: 0.0,
            turned: [0.0; 4],
            pulse: PulseWidth::MIN,
            events: Vec::new(),
            last: None,
            samples: 0,
        }
    }

    fn tick(&mut self, command: Option<Command>) {
        self.ms += 1;
        let mut edges: [Vec<u32>; 4] = Default::default();
        for ((edges, turned), marks) in edges.iter_mut().zip(&mut self.turned).zip(self.wired) {
            let from = *turned;
            *turned += f64::from(marks) * self.rpm / 60_000.0;
            *edges = passes(self.ms, from, *turned);
        }
        let adc = blocks(self.counts);
        let outputs = self.rig.tick(&Inputs {
            now: Ticks(self.ms * MS),
            edges: edges.each_ref().map(Vec::as_slice),
            over_capture: [false; 4],
            adc: &adc,
            beside: Beside::UNWIRED,
            command: command.or(self.ms.is_multiple_of(100).then_some(Command::Ping)),
            line: LineNews::default(),
            stop_input: false,
            brown_out: false,
            paused: false,
        });
        self.pulse = outputs.pulse;
        self.events.extend(outputs.event);
        self.samples += usize::from(outputs.sample.is_some());
        self.last = outputs.sample.or(self.last);
    }

    fn run(&mut self, ms: u64) {
        (0..ms).for_each(|_| self.tick(None));
    }

    fn say(&mut self, command: Command) -> Option<Event> {
        self.run(20);
        self.events.clear();
        self.tick(Some(command));
        self.run(10);
        self.events.iter().copied().find(|e| matches!(e, Event::Accepted | Event::Refused(_)))
    }

    fn power(&mut self) {
        for (count, powered) in self.counts.iter_mut().zip(POWERED) {
            *count = if *count == OPEN && powered != 2379 { OPEN } else { powered };
        }
    }

    /// Arms through the beeps and runs at 1400 us with the rotor at `rpm`.
    fn running(mut self, rpm: f64) -> Self {
        assert_eq!(self.say(Command::Arm), Some(Event::Accepted));
        self.power();
        for beep in BEEPS {
            self.run(300);
            self.tick(Some(Command::Beep(beep)));
        }
        assert_eq!(self.rig.state(), RigState::Armed);
        assert_eq!(self.say(Command::SetPulse(PulseWidth::from_us(1400))), Some(Event::Accepted));
        self.rpm = rpm;
        self
    }

    fn faults(&self) -> Vec<Fault> {
        self.rig.faults().iter().collect()
    }
}

#[test]
fn one_fitted_speed_sensor_is_enough() {
    for channel in 0..4 {
        let mut marks = [0; 4];
        marks[channel] = [2, 1, 2, 25][channel];
        let mut desk = Desk::new(Config { marks, ..Config::thesis_570kv() }, marks).running(5_000.0);
        desk.run(5_000);
        assert_eq!(desk.faults(), [], "channel {channel}");
        assert_eq!(desk.rig.state(), RigState::Running);
        let last = desk.last.expect("samples");
        for (n, code) in last.rpm.iter().enumerate() {
            let wanted = if n == channel { CaptureVerdict::Nominal } else { CaptureVerdict::Absent };
            assert_eq!(code.verdict, wanted, "channel {n} beside {channel}");
        }
        // configured as fitted and not wired: that is a fault, as before
        let mut desk = Desk::new(Config::thesis_570kv(), marks).running(5_000.0);
        desk.run(1_000);
        assert_eq!(desk.faults(), [Fault::SensorLost], "channel {channel} alone of four");
    }
}

#[test]
fn an_analogue_channel_that_is_not_fitted_raises_no_fault() {
    for channel in 0..5 {
        let mut config = Config::thesis_570kv();
        let desk = |config: Config| {
            let mut desk = Desk::new(config, [2, 1, 2, 25]);
            desk.counts[channel] = OPEN;
            desk
        };
        if channel != 3 {
            let mut open = desk(config.clone()).running(5_000.0);
            open.run(1_000);
            assert!(!open.faults().is_empty(), "channel {channel} is fitted and open");
        }
        config.fitted[channel] = false;
        let mut absent = desk(config).running(5_000.0);
        if channel == 3 {
            absent.counts[3] = OPEN;
        }
        absent.run(5_000);
        assert_eq!(absent.faults(), [], "channel {channel}");
        let last = absent.last.expect("samples");
        assert_eq!((last.adc[channel].verdict, last.adc[channel].count), (AdcVerdict::Absent, 0));
    }
}

#[test]
fn a_tare_takes_what_is_fitted() {
    let mut config = Config::thesis_570kv();
    config.fitted[1] = false;
    let mut desk = Desk::new(config.clone(), [2, 0, 0, 0]);
    desk.run(300);
    assert_eq!(desk.say(Command::Tare), Some(Event::Accepted));
    assert_eq!(desk.rig.calibration().adc[0].zero, 1427.0);
    config.fitted[0] = false;
    let mut desk = Desk::new(config, [2, 0, 0, 0]);
    desk.run(300);
    assert!(matches!(desk.say(Command::Tare), Some(Event::Refused(_))), "there is nothing to tare");
}

#[test]
fn the_range_calibration_needs_a_witness_and_a_measured_supply() {
    let mut config = Config { marks: [0; 4], ..Config::thesis_570kv() };
    config.fitted[2] = false;
    let mut desk = Desk::new(config, [0; 4]);
    desk.counts = POWERED;
    desk.run(200);
    desk.counts = UNPOWERED;
    desk.run(200);
    let ask = Command::CalibrateRange { confirm: Command::CALIBRATE_CONFIRM };
    assert_eq!(desk.say(ask), Some(Event::Refused(Refusals(Refusals::NO_WITNESS))));
    let mut config = Config::thesis_570kv();
    config.fitted[3] = false;
    let mut desk = Desk::new(config, [2, 1, 2, 25]);
    desk.run(500);
    assert_eq!(desk.say(ask), Some(Event::Refused(Refusals(Refusals::SUPPLY_UNPROVEN))));
}

#[test]
fn dshot_has_no_range_to_calibrate() {
    let ask = Command::CalibrateRange { confirm: Command::CALIBRATE_CONFIRM };
    for output in EscOutput::ALL {
        let mut desk = Desk::new(Config { output, ..Config::thesis_570kv() }, [2, 1, 2, 25]);
        desk.counts = POWERED;
        desk.run(200);
        desk.counts = UNPOWERED;
        desk.run(200);
        let refused = output.is_digital().then_some(Event::Refused(Refusals(Refusals::NO_RANGE)));
        assert_eq!(desk.say(ask), refused.or(Some(Event::Accepted)), "{output:?}");
        assert_eq!(desk.pulse == PulseWidth::MAX, refused.is_none(), "{output:?}");
    }
}

#[test]
fn the_output_changes_while_disarmed_and_never_else() {
    let say = |desk: &mut Desk, output| {
        let wanted = RigConfig { output, ..desk.rig.settings() };
        let parts: Vec<ConfigPart> = wanted.parts().collect();
        parts.iter().for_each(|part| assert_eq!(desk.say(Command::ConfigPart(*part)), Some(Event::Accepted)));
        desk.say(Command::ConfigApply { length: parts[0].length, crc: wanted.digest() })
    };
    let mut desk = Desk::new(Config::thesis_570kv(), [2, 1, 2, 25]);
    assert_eq!(say(&mut desk, EscOutput::DShot300), Some(Event::Accepted));
    assert_eq!(desk.rig.config().output, EscOutput::DShot300);
    let refused = Some(Event::Refused(Refusals(Refusals::WRONG_STATE)));
    assert_eq!(desk.say(Command::Arm), Some(Event::Accepted));
    assert_eq!(say(&mut desk, EscOutput::Pwm), refused, "while arming");
    desk.power();
    for beep in BEEPS {
        desk.say(Command::Beep(beep));
    }
    assert_eq!(desk.rig.state(), RigState::Armed);
    assert_eq!(say(&mut desk, EscOutput::Pwm), refused, "armed");
    desk.say(Command::SetPulse(PulseWidth::from_us(1400)));
    assert_eq!(say(&mut desk, EscOutput::DShot600), refused, "running");
    desk.say(Command::Stop);
    assert_eq!(say(&mut desk, EscOutput::Pwm), refused, "with a fault");
    assert_eq!(desk.rig.config().output, EscOutput::DShot300);
    assert_eq!(desk.say(Command::ClearFaults), Some(Event::Accepted));
    assert_eq!(say(&mut desk, EscOutput::Pwm), Some(Event::Accepted));
}

/// A biased divider: off is believed as it stands, and an open wire, which reads less than that, is never taken for it.
#[test]
fn a_live_zero_of_the_supply_tells_off_from_unplugged() {
    let ask = Command::CalibrateRange { confirm: Command::CALIBRATE_CONFIRM };
    let mut config = Config::thesis_570kv();
    config.voltage.zero = Volt(0.3);
    config.live_zero[3] = true;
    let bias = (0.3 / 3.3 * 4096.0) as u16;
    let mut desk = Desk::new(config.clone(), [2, 1, 2, 25]);
    desk.counts[3] = OPEN;
    desk.run(500);
    assert_eq!(desk.say(ask), Some(Event::Refused(Refusals(Refusals::SUPPLY_UNPROVEN))), "unplugged");
    assert_eq!(desk.last.map(|s| s.adc[3].verdict), Some(AdcVerdict::Open));
    desk.counts[3] = bias;
    desk.run(50);
    assert_eq!(desk.say(ask), Some(Event::Refused(Refusals(Refusals::SUPPLY_UNPROVEN))), "a loose contact");
    desk.run(150);
    assert_eq!(desk.say(ask), Some(Event::Accepted), "plugged in, and off");
    let mut desk = Desk::new(config, [2, 1, 2, 25]);
    desk.counts[3] = 2379 + bias;
    desk.run(500);
    let reasons = Refusals::ESC_POWERED | Refusals::SUPPLY_UNPROVEN;
    assert_eq!(desk.say(ask), Some(Event::Refused(Refusals(reasons))), "on");
    assert!((desk.rig.calibration().adc[3].gain * f32::from(2379u16) - 11.5).abs() < 0.01);
}

/// When `fault` latches after `change`, ms; `None` within 10 s.
fn latched(config: Config, rpm: f64, fault: Fault, change: impl FnOnce(&mut Desk)) -> Option<u64> {
    let mut desk = Desk::new(config, [2, 1, 2, 25]).running(rpm);
    desk.run(3_000);
    assert_eq!(desk.faults(), []);
    change(&mut desk);
    let begun = desk.ms;
    while desk.rig.faults() == FaultSet::NONE && desk.ms < begun + 10_000 {
        desk.tick(None);
    }
    (desk.faults() == [fault]).then(|| {
        assert_eq!(desk.pulse, PulseWidth::MIN);
        desk.ms - begun
    })
}

#[test]
fn every_channel_has_limits_both_ways_with_a_time() {
    let config = || Config::thesis_570kv();
    let mut with = config();
    with.limits.voltage = Bounds { low: Some(Volt(9.0)), high: Some(Volt(12.0)), ms: 200 };
    assert_eq!(latched(with, 5_000.0, Fault::OverVoltage, |d| d.counts[3] = 2600), Some(200));
    let mut with = config();
    with.limits.torque = Bounds { low: Some(NewtonMetre(-0.05)), high: None, ms: 70 };
    assert_eq!(latched(with, 5_000.0, Fault::TorqueLimit, |d| d.counts[1] = 1000), Some(70));
    let mut with = config();
    with.limits.temperature = Bounds { low: None, high: Some(Celsius(60.0)), ms: 1_500 };
    assert_eq!(latched(with, 5_000.0, Fault::TemperatureLimit, |d| d.counts[4] = 1500), Some(1_500));
    let mut with = config();
    with.limits.current = Bounds { low: Some(Ampere(0.5)), high: Some(Ampere(30.0)), ms: 300 };
    assert_eq!(latched(with, 5_000.0, Fault::BelowLimit, |d| d.counts[2] = 250), Some(300));
    let mut with = config();
    with.limits.speed = Bounds { low: Some(RevPerMin(1_000.0)), high: Some(RevPerMin(10_000.0)), ms: 12 };
    let stalled = latched(with, 5_000.0, Fault::BelowLimit, |d| d.rpm = 0.0);
    assert!(stalled.is_some_and(|ms| ms < 600), "{stalled:?}");
}

#[test]
fn a_rotor_that_has_not_started_yet_is_not_below_its_limit() {
    let mut config = Config::thesis_570kv();
    config.limits.speed = Bounds { low: Some(RevPerMin(1_000.0)), high: Some(RevPerMin(10_000.0)), ms: 12 };
    let mut desk = Desk::new(config, [2, 1, 2, 25]).running(0.0);
    desk.run(1_500);
    assert_eq!(desk.faults(), []);
    desk.run(1_000);
    assert_eq!(desk.faults(), [Fault::BelowLimit], "two seconds of open throttle are enough");
}

#[test]
fn an_esc_without_cell_beeps_arms_by_two_answers() {
    let mut desk = Desk::new(Config { answers: Answers::LongReady, ..Config::thesis_570kv() }, [2, 0, 0, 0]);
    assert_eq!(desk.say(Command::Arm), Some(Event::Accepted));
    desk.power();
    desk.run(500);
    desk.tick(Some(Command::Beep(Beep::Long)));
    desk.run(100);
    assert_eq!(desk.rig.state(), RigState::ArmReady);
    desk.tick(Some(Command::Beep(Beep::Ready)));
    assert_eq!(desk.rig.state(), RigState::Armed);
}

#[test]
fn an_esc_that_says_nothing_is_ready_after_minimum_was_held_towards_its_supply() {
    let silent = |measured: bool| {
        let mut config = Config { answers: Answers::Silent { hold_ms: 4_000 }, ..Config::thesis_570kv() };
        config.fitted[3] = measured;
        let mut desk = Desk::new(config, [2, 0, 0, 0]);
        assert_eq!(desk.say(Command::Arm), Some(Event::Accepted));
        desk.run(6_000);
        desk
    };
    let mut desk = silent(true);
    assert_eq!(desk.rig.state(), RigState::ArmHoldMin, "no supply yet");
    desk.power();
    desk.run(3_900);
    assert_eq!(desk.rig.state(), RigState::ArmHoldMin);
    desk.run(200);
    assert_eq!((desk.rig.state(), desk.pulse), (RigState::Armed, PulseWidth::MIN));
    assert_eq!(silent(false).rig.state(), RigState::Armed, "nobody measures the supply: the time alone");
}

#[test]
fn no_run_goes_above_the_highest_pulse() {
    let highest = PulseWidth::from_us(1300);
    let mut desk = Desk::new(Config { highest, ..Config::thesis_570kv() }, [2, 1, 2, 25]).running(3_000.0);
    desk.run(1_000);
    assert_eq!(desk.pulse, highest, "1400 us were asked for");
}

#[test]
fn a_whole_configuration_is_taken_at_rest_only_and_only_whole() {
    let mut desk = Desk::new(Config::thesis_570kv(), [2, 1, 2, 25]);
    let mut wanted = desk.rig.settings();
    (wanted.marks, wanted.log_period_ms) = ([3, 0, 0, 0], 2);
    let parts: Vec<ConfigPart> = wanted.parts().collect();
    let apply = Command::ConfigApply { length: parts[0].length, crc: wanted.digest() };
    for part in &parts[1..] {
        assert!(matches!(desk.say(Command::ConfigPart(*part)), Some(Event::Refused(_))), "the first part is missing");
    }
    assert!(matches!(desk.say(apply), Some(Event::Refused(_))));
    assert_ne!(desk.rig.settings(), wanted);
    for part in &parts {
        assert_eq!(desk.say(Command::ConfigPart(*part)), Some(Event::Accepted));
    }
    assert_eq!(desk.say(apply), Some(Event::Accepted));
    assert_eq!((desk.rig.settings(), desk.rig.hello(0).config), (wanted, wanted.digest()));
    desk.run(200); // the interval that was under way ends as it began
    desk.samples = 0;
    desk.run(1_000);
    assert_eq!(desk.samples, 500, "500 samples a second");
    let mut armed = Desk::new(Config::thesis_570kv(), [2, 1, 2, 25]).running(0.0);
    for part in &parts {
        armed.say(Command::ConfigPart(*part));
    }
    assert!(matches!(armed.say(apply), Some(Event::Refused(Refusals(r))) if r & Refusals::WRONG_STATE != 0));
}

/// A three-blade propeller seen by the beam.
#[test]
fn three_blades_read_their_own_speed() {
    let marks = [3, 0, 0, 0];
    let mut desk = Desk::new(Config { marks, ..Config::thesis_570kv() }, marks).running(6_000.0);
    desk.run(1_000);
    let sample = desk.last.expect("samples");
    let rpm = desk.rig.calibration().speed(0, &sample.rpm[0]).expect("a speed");
    assert!((rpm - 6_000.0).abs() < 6.0, "{rpm}");
}
