//! The ESC's telemetry and the back-EMF meter beside the rig's own sensors: told, and never a reason to stop where a speed sensor is fitted.

mod desk;

use desk::{BEEPS, MS, POWERED, UNPOWERED, blocks, passes};
use firmware_rig::esc_line::{LINE_ERROR, crc8};
use firmware_rig::{Beside, Config, EscTelemetry, Inputs, LineNews, Rig, RigConfig};
use frame::esc::EscVerdict;
use frame::message::{Command, Event};
use frame::rig::{CaptureVerdict, Fault, FaultSet, RigSample, RigState};
use frame::units::{PulseWidth, Ticks};

const POLE_PAIRS: u16 = 11;

/// What is wired up, and what goes wrong with it.
#[derive(Clone, Copy, PartialEq)]
struct Wires {
    /// Marks of the four sensors.
    marks: [u16; 4],
    /// Electrical turns that the meter sees in one of the rotor.
    meter: f64,
    /// What the ESC's line gives.
    esc: Line,
}

#[derive(Clone, Copy, PartialEq)]
enum Line {
    Good,
    Dead,
    Garbage,
}

struct Desk {
    rig: Rig,
    wires: Wires,
    ms: u64,
    counts: [u16; 5],
    rpm: f64,
    turned: f64,
    events: Vec<Event>,
    samples: Vec<RigSample>,
    asked: Vec<u64>,
}

impl Desk {
    fn new(config: Config, marks: [u16; 4]) -> Self {
        let config = Config { marks, ..config };
        let wires = Wires { marks, meter: f64::from(POLE_PAIRS), esc: Line::Good };
        Self {
            rig: Rig::new(config),
            wires,
            ms: 0,
            counts: UNPOWERED,
            rpm: 0.0,
            turned: 0.0,
            events: Vec::new(),
            samples: Vec::new(),
            asked: Vec::new(),
        }
    }

    /// Instants at which `marks` a revolution pass in this millisecond, ticks.
    fn edges(&self, marks: f64) -> Vec<u32> {
        passes(self.ms, self.turned * marks, (self.turned + self.rpm / 60_000.0) * marks)
    }

    /// What the ESC's line brings in this millisecond: a frame each 31 ms.
    fn telemetry(&self) -> Vec<u16> {
        if self.wires.esc == Line::Dead || !self.ms.is_multiple_of(31) {
            return Vec::new();
        }
        let [n1, n0] = ((self.rpm * f64::from(POLE_PAIRS) / 100.0) as u16).to_be_bytes();
        let mut bytes = vec![35, 0x04, 0x7e, 0x00, 0xc8, 0, 9, n1, n0];
        bytes.push(crc8(&bytes));
        let damage = if self.wires.esc == Line::Garbage { LINE_ERROR } else { 0 };
        bytes.into_iter().map(|byte| u16::from(byte) | damage).collect()
    }

    fn tick(&mut self, command: Option<Command>) {
        self.ms += 1;
        let edges: [Vec<u32>; 4] = self.wires.marks.map(|marks| self.edges(f64::from(marks)));
        let back_emf = self.edges(self.wires.meter);
        let esc = self.telemetry();
        self.turned += self.rpm / 60_000.0;
        let adc = blocks(self.counts);
        let outputs = self.rig.tick(&Inputs {
            now: Ticks(self.ms * MS),
            edges: edges.each_ref().map(Vec::as_slice),
            over_capture: [false; 4],
            adc: &adc,
            beside: Beside { esc: &esc, back_emf: &back_emf, over_capture: false },
            command: command.or(self.ms.is_multiple_of(100).then_some(Command::Ping)),
            line: LineNews::default(),
            stop_input: false,
            brown_out: false,
            paused: false,
        });
        self.events.extend(outputs.event);
        self.samples.extend(outputs.sample);
        self.asked.extend(outputs.ask_esc.then_some(self.ms));
    }

    fn run(&mut self, ms: u64) {
        (0..ms).for_each(|_| self.tick(None));
    }

    /// Arms through the beeps and runs at 1400 us with the rotor at `rpm`.
    fn running(mut self, rpm: f64) -> Self {
        self.run(20);
        self.tick(Some(Command::Arm));
        self.counts = POWERED;
        for beep in BEEPS {
            self.run(300);
            self.tick(Some(Command::Beep(beep)));
        }
        self.run(600);
        self.tick(Some(Command::SetPulse(PulseWidth::from_us(1400))));
        self.rpm = rpm;
        self.run(1_000);
        assert_eq!(self.rig.state(), RigState::Running, "{:?}", self.rig.faults());
        self
    }

    fn last(&self) -> &RigSample {
        self.samples.last().expect("a sample")
    }
}

fn fitted() -> Config {
    let esc_telemetry = Some(EscTelemetry { pole_pairs: POLE_PAIRS, asked: false });
    Config { esc_telemetry, back_emf: POLE_PAIRS, ..Config::thesis_570kv() }
}

const ALL: [u16; 4] = [2, 1, 2, 25];

#[test]
fn what_is_not_fitted_is_not_told_whatever_its_wires_do() {
    let desk = Desk::new(Config::thesis_570kv(), ALL).running(4_000.0);
    assert!(desk.samples.iter().all(|s| s.esc.is_none() && s.back_emf.is_none()));
    assert!(!desk.events.iter().any(|e| matches!(e, Event::EscTelemetry { .. })));
    assert_eq!((desk.rig.hello(0).present, desk.asked.len()), (0b1111, 0));
    assert_eq!(desk.rig.esc_counts(), Default::default());
}

#[test]
fn both_agree_with_the_sensors_in_the_samples() {
    let desk = Desk::new(fitted(), ALL).running(4_321.0);
    let values = desk.rig.calibration().convert(desk.last());
    let (encoder, meter) = (values.rpm[3].expect("a speed"), values.rpm_bemf.expect("a speed"));
    assert!((encoder - 4_321.0).abs() < 1.0 && (meter - 4_321.0).abs() < 1.0, "{encoder} and {meter}");
    let [rpm, current, voltage, temperature, charge] = values.esc.map(|v| v.expect("a figure"));
    assert!((rpm - 4_321.0).abs() <= 100.0 / f64::from(POLE_PAIRS), "{rpm}");
    assert_eq!((current, voltage, temperature, charge), (2.0, 11.5, 35.0, 9.0));
    assert_eq!(desk.last().back_emf.expect("fitted").verdict, CaptureVerdict::Nominal);
    assert_eq!(desk.rig.hello(0).present, 0b11_1111);
    let told: Vec<_> = desk.events.iter().filter(|e| matches!(e, Event::EscTelemetry { .. })).collect();
    assert!(matches!(told[..], [Event::EscTelemetry { verdict: EscVerdict::Nominal, .. }]), "{told:?}");
}

#[test]
fn a_line_that_dies_or_garbles_is_told_and_the_run_goes_on() {
    for (line, verdict) in [(Line::Dead, EscVerdict::Silent), (Line::Garbage, EscVerdict::Garbled)] {
        let mut desk = Desk::new(fitted(), ALL).running(4_000.0);
        desk.wires.esc = line;
        let died = desk.ms;
        desk.run(2_000);
        assert_eq!((desk.rig.state(), desk.rig.faults()), (RigState::Running, FaultSet::NONE), "{verdict:?}");
        let code = desk.last().esc.expect("fitted");
        assert_eq!((code.verdict, code.voltage), (verdict, 0), "no figure of it is told any more");
        let when = desk.events.iter().find_map(|e| match e {
            Event::EscTelemetry { verdict: told, at } if *told == verdict => Some(at.as_ms()),
            _ => None,
        });
        assert!(when.is_some_and(|ms| ms > died && ms <= died + 255), "{when:?}, died at {died}");
        assert_eq!(desk.rig.esc_counts().damaged > 50, line == Line::Garbage, "{:?}", desk.rig.esc_counts());
        desk.wires.esc = Line::Good;
        desk.run(300);
        assert_eq!(desk.last().esc.expect("fitted").verdict, EscVerdict::Nominal, "and it comes back");
    }
}

#[test]
fn a_meter_that_is_silent_or_counts_wrong_is_told_and_the_run_goes_on() {
    for (turns, verdict) in [(0.0, CaptureVerdict::Lost), (7.0, CaptureVerdict::Disagrees), (22.0, CaptureVerdict::Disagrees)] {
        let mut desk = Desk::new(fitted(), ALL).running(4_000.0);
        desk.wires.meter = turns;
        desk.run(3_000);
        assert_eq!((desk.rig.state(), desk.rig.faults()), (RigState::Running, FaultSet::NONE), "{turns} turns");
        assert_eq!(desk.last().back_emf.expect("fitted").verdict, verdict, "{turns} turns");
    }
}

/// A meter may be off by what the sensors may, and a sample alone says nothing.
#[test]
fn a_meter_that_is_a_little_off_or_once_is_no_disagreement() {
    let disagrees = |samples: &[RigSample]| {
        let verdicts = samples.iter().map(|sample| sample.back_emf.expect("fitted").verdict);
        verdicts.filter(|verdict| *verdict == CaptureVerdict::Disagrees).count()
    };
    for (off, told) in [(1.005, false), (1.02, true)] {
        let mut desk = Desk::new(fitted(), ALL).running(4_000.0);
        desk.wires.meter *= off;
        desk.samples.clear();
        desk.run(1_000);
        assert_eq!(disagrees(&desk.samples) > 5, told, "{off}");
    }
    let mut desk = Desk::new(fitted(), ALL).running(4_000.0);
    let period = desk.rig.config().log_period().as_ms();
    desk.run(period - desk.ms % period);
    desk.samples.clear();
    desk.wires.meter *= 1.05;
    desk.run(period);
    desk.wires.meter /= 1.05;
    desk.run(1_000);
    assert_eq!(disagrees(&desk.samples), 0, "one sample is off");
}

/// Where no speed sensor is fitted the meter is the only one that sees a rotor that races; where one is, its word stops nothing.
#[test]
fn overspeed_is_judged_by_the_meter_where_nothing_else_sees_the_rotor() {
    for (marks, stops) in [([0; 4], true), ([2, 0, 0, 0], false)] {
        let mut desk = Desk::new(fitted(), marks).running(4_000.0);
        desk.wires.meter *= 3.0;
        desk.run(50);
        assert_eq!(desk.rig.faults().contains(Fault::Overspeed), stops, "{marks:?}");
        assert_eq!(desk.rig.state() == RigState::Faulted, stops, "{marks:?}");
    }
}

#[test]
fn a_telemetry_that_has_to_be_asked_for_is_asked_for() {
    let asked = Some(EscTelemetry { pole_pairs: POLE_PAIRS, asked: true });
    let mut desk = Desk::new(Config { esc_telemetry: asked, ..Config::thesis_570kv() }, ALL);
    desk.run(100);
    assert_eq!(desk.asked, [1, 21, 41, 61, 81]);
    let mut desk = Desk::new(fitted(), ALL);
    desk.run(100);
    assert!(desk.asked.is_empty(), "this ESC sends by itself");
}

/// A configuration that comes over the line fits them or takes them away, from the next tick on.
#[test]
fn a_new_configuration_fits_them() {
    let mut desk = Desk::new(Config::thesis_570kv(), ALL);
    let config = RigConfig { back_emf: POLE_PAIRS, esc_telemetry: fitted().esc_telemetry, ..desk.rig.settings() };
    desk.run(200);
    assert!(desk.last().esc.is_none());
    let mut length = 0;
    for part in config.parts() {
        length = part.length;
        desk.tick(Some(Command::ConfigPart(part)));
    }
    desk.tick(Some(Command::ConfigApply { length, crc: config.digest() }));
    desk.run(200);
    assert_eq!(desk.last().esc.map(|code| code.verdict), Some(EscVerdict::Nominal));
    assert_eq!(desk.rig.calibration().pole_pairs, [POLE_PAIRS; 2]);
    assert!(desk.last().back_emf.is_some());
}
