//! The rig through its one door, `Rig::tick`, at 1 kHz with a host that answers.

use firmware_rig::{AdcBlock, Beside, Config, Inputs, LineNews, Outputs, Rig};
use frame::imu_command::ImuCommand;
use frame::message::{Beep, Command, Event, Setting, Trial};
use frame::rig::{AdcVerdict, CaptureVerdict, Fault, FaultSet, Refusals, RigSample, RigState};
use frame::schedule::{ScheduleNews, Segment, SegmentBatch, Shape, Steer};
use frame::units::{PulseWidth, Ticks};
use proptest::prelude::*;

const MS: u64 = 84_000;

/// A bench without physics: counts and a host.
struct Bench {
    rig: Rig,
    ms: u64,
    counts: [u16; 5],
    /// Conversions of each channel in a tick.
    conversions: usize,
    stop_line: bool,
    linked: bool,
    /// Ticks by which the control tick comes after its millisecond.
    late: u64,
    line: LineNews,
    paused: bool,
    pulse: PulseWidth,
    events: Vec<Event>,
    samples: Vec<RigSample>,
}

impl Bench {
    fn new() -> Self {
        Self::with(Config::thesis_570kv())
    }

    fn with(config: Config) -> Self {
        Self {
            rig: Rig::new(config),
            ms: 0,
            counts: [1427, 2048, 248, 0, 900], // nothing powered, 22.5 degC
            conversions: 8,
            stop_line: false,
            linked: true,
            late: 0,
            line: LineNews::default(),
            paused: false,
            pulse: PulseWidth(0),
            events: Vec::new(),
            samples: Vec::new(),
        }
    }

    fn tick_with(&mut self, command: Option<Command>, edges: &[u32]) -> Outputs {
        self.tick_on(0, command, edges)
    }

    fn tick_on(&mut self, channel: usize, command: Option<Command>, edges: &[u32]) -> Outputs {
        let mut all: [&[u32]; 4] = [&[]; 4];
        all[channel] = edges;
        self.tick_all(command, all)
    }

    fn tick_all(&mut self, command: Option<Command>, edges: [&[u32]; 4]) -> Outputs {
        self.ms += 1;
        let keep_alive = (self.linked && self.ms.is_multiple_of(100)).then_some(Command::Ping);
        let adc = self.counts.map(|code| {
            let mut block = AdcBlock::default();
            (0..self.conversions).for_each(|_| block.push(code));
            block
        });
        let inputs = Inputs {
            now: Ticks(self.ms * MS + self.late),
            edges,
            over_capture: [false; 4],
            adc: &adc,
            beside: Beside::UNWIRED,
            command: command.or(keep_alive),
            line: core::mem::take(&mut self.line),
            stop_input: self.stop_line,
            brown_out: false,
            paused: self.paused,
        };
        let outputs = self.rig.tick(&inputs);
        self.pulse = outputs.pulse;
        self.events.extend(outputs.event);
        self.samples.extend(outputs.sample);
        outputs
    }

    fn run(&mut self, ms: u64) {
        (0..ms).for_each(|_| {
            self.tick_with(None, &[]);
        });
    }

    /// Sends a command and gives the answer to it.
    fn say(&mut self, command: Command) -> Option<Event> {
        self.run(20); // let earlier events out
        self.events.clear();
        self.tick_with(Some(command), &[]);
        self.run(10);
        self.events.iter().copied().find(|e| matches!(e, Event::Accepted | Event::Refused(_)))
    }

    fn beep(&mut self, beep: Beep) {
        self.tick_with(Some(Command::Beep(beep)), &[]);
    }

    fn power(&mut self) {
        self.counts[3] = 2379; // 11.5 V
    }

    /// A rig that holds maximum, once it has seen the supply on and off.
    fn holding_max() -> Self {
        let mut bench = Self::new();
        bench.power();
        bench.run(150);
        bench.counts[3] = 0;
        bench.run(150);
        let confirmed = Command::CalibrateRange { confirm: Command::CALIBRATE_CONFIRM };
        assert_eq!(bench.say(confirmed), Some(Event::Accepted));
        assert_eq!(bench.pulse, PulseWidth::MAX);
        bench
    }

    fn arm(&mut self) {
        assert_eq!(self.say(Command::Arm), Some(Event::Accepted));
        self.power();
        self.run(500);
        self.beep(Beep::Long);
        self.run(300);
        self.beep(Beep::Cells(3));
        self.run(300);
        self.beep(Beep::Ready);
        assert_eq!(self.rig.state(), RigState::Armed);
    }

    fn armed() -> Self {
        let mut bench = Self::new();
        bench.arm();
        bench
    }

    fn running(us: u32) -> Self {
        let mut bench = Self::armed();
        assert_eq!(bench.say(Command::SetPulse(PulseWidth::from_us(us))), Some(Event::Accepted));
        bench.run(200);
        assert_eq!(bench.pulse, PulseWidth::from_us(us));
        bench
    }
}

/// Edges of a rotor on every fitted channel; some channels see it faster than it is said to turn.
struct Rotor<'a> {
    marks: [u16; 4],
    /// Channels that see `rpm`; the others see at most 6000.
    fast: &'a [usize],
    /// Marks that have passed.
    turned: [f64; 4],
    rpm: f64,
}

impl Rotor<'_> {
    fn tick(&mut self, bench: &mut Bench) {
        let mut edges: [Vec<u32>; 4] = Default::default();
        for (n, edges) in edges.iter_mut().enumerate() {
            let rpm = if self.fast.contains(&n) { self.rpm } else { self.rpm.min(6000.0) };
            let per_ms = f64::from(self.marks[n]) * rpm / 60_000.0;
            let (from, to) = (self.turned[n], self.turned[n] + per_ms);
            let mut mark = from.floor() + 1.0;
            while mark <= to {
                edges.push(((bench.ms as f64 + (mark - from) / per_ms) * MS as f64) as u64 as u32);
                mark += 1.0;
            }
            self.turned[n] = to;
        }
        bench.tick_all(None, edges.each_ref().map(Vec::as_slice));
    }
}

fn refused(reasons: u16) -> Option<Event> {
    Some(Event::Refused(Refusals(reasons)))
}

#[test]
fn arming_goes_through_every_state_and_tells_it() {
    let mut bench = Bench::new();
    bench.run(50);
    assert_eq!(bench.pulse, PulseWidth::MIN, "the train starts with minimum");
    bench.tick_with(Some(Command::Arm), &[]);
    for beep in [Beep::Long, Beep::Cells(3), Beep::Ready] {
        bench.run(200);
        bench.beep(beep);
        assert_eq!(bench.pulse, PulseWidth::MIN);
    }
    bench.run(10);
    let path: Vec<RigState> =
        bench.events.iter().filter_map(|e| if let Event::State { to, .. } = e { Some(*to) } else { None }).collect();
    assert_eq!(path, [RigState::ArmHoldMin, RigState::ArmCells, RigState::ArmReady, RigState::Armed]);
}

#[test]
fn throttle_needs_arming() {
    let mut bench = Bench::new();
    assert_eq!(bench.say(Command::SetPulse(PulseWidth::from_us(1500))), refused(Refusals::WRONG_STATE));
    assert_eq!(bench.say(Command::RunSchedule), refused(Refusals::WRONG_STATE | Refusals::EMPTY_SCHEDULE));
    bench.run(500);
    assert_eq!(bench.pulse, PulseWidth::MIN);
}

#[test]
fn a_stop_gives_minimum_on_its_own_tick_and_latches() {
    let mut bench = Bench::running(1800);
    let outputs = bench.tick_with(Some(Command::Stop), &[]);
    assert_eq!(outputs.pulse, PulseWidth::MIN);
    assert_eq!(bench.rig.state(), RigState::Faulted);
    assert_eq!(bench.rig.faults(), FaultSet::NONE.with(Fault::OperatorStop));
    assert_eq!(
        bench.say(Command::Arm),
        refused(Refusals::WRONG_STATE | Refusals::FAULT_LATCHED | Refusals::NO_LOW_INTERVAL),
        "every reason at once"
    );
    assert_eq!(bench.say(Command::ClearFaults), Some(Event::Accepted));
    assert_eq!(bench.say(Command::Arm), refused(Refusals::NO_LOW_INTERVAL));
    bench.run(2000);
    assert_eq!(bench.say(Command::Arm), Some(Event::Accepted));
}

/// After a run the ESC hears minimum for as long as it was agreed before the next arming, to the tick.
#[test]
fn the_low_interval_is_kept_in_full() {
    let mut bench = Bench::running(1500);
    let live = bench.ms;
    bench.tick_with(Some(Command::Stop), &[]);
    bench.tick_with(Some(Command::ClearFaults), &[]);
    while bench.rig.state() == RigState::Disarmed && bench.ms < live + 5000 {
        bench.tick_with(Some(Command::Arm), &[]);
    }
    assert_eq!(bench.ms - live, u64::from(bench.rig.config().times.low_interval_ms));
}

#[test]
fn the_stop_line_works_without_a_host() {
    let mut bench = Bench::running(1300);
    bench.stop_line = true;
    assert_eq!(bench.tick_with(None, &[]).pulse, PulseWidth::MIN);
    assert_eq!(bench.say(Command::ClearFaults), refused(Refusals::STOP_OPEN), "held");
    assert_eq!(bench.rig.state(), RigState::Faulted);
    bench.stop_line = false;
    assert_eq!(bench.say(Command::ClearFaults), Some(Event::Accepted));
}

/// A loop that was never closed: broken, unplugged, or the key is pressed already.
#[test]
fn a_stop_loop_open_from_the_start_keeps_the_board_disarmed_and_is_told() {
    let mut bench = Bench::new();
    bench.stop_line = true;
    bench.run(20);
    let told = |bench: &Bench, wanted: bool| {
        bench.events.iter().filter(|e| matches!(e, Event::StopLoop { open, .. } if *open == wanted)).count()
    };
    assert_eq!(told(&bench, true), 1);
    bench.run(2500);
    for command in [Command::Arm, Command::CalibrateRange { confirm: Command::CALIBRATE_CONFIRM }] {
        let Some(Event::Refused(reasons)) = bench.say(command) else { panic!("{command:?} was taken") };
        assert_ne!(reasons.0 & Refusals::STOP_OPEN, 0);
    }
    assert_eq!((bench.rig.state(), bench.pulse), (RigState::Disarmed, PulseWidth::MIN));
    bench.stop_line = false;
    bench.run(20);
    assert_eq!(told(&bench, false), 1);
    bench.arm();
    bench.stop_line = true;
    bench.run(1);
    assert_eq!(bench.rig.state(), RigState::Faulted, "from then on it latches");
}

#[test]
fn a_silent_host_stops_the_motor_and_only_the_motor() {
    let mut bench = Bench::new();
    bench.linked = false;
    bench.run(5000);
    assert_eq!(bench.rig.state(), RigState::Disarmed, "nobody needs a host while disarmed");
    let mut bench = Bench::running(1500);
    bench.linked = false;
    let mut passed = 0;
    while bench.pulse.is_live() {
        bench.run(1);
        passed += 1;
    }
    assert!((900..=1001).contains(&passed), "{passed} ms");
    assert!(bench.rig.faults().contains(Fault::LinkLost));
}

#[test]
fn a_late_tick_stops_the_motor() {
    let mut bench = Bench::running(1500);
    bench.ms += 6;
    assert_eq!(bench.tick_with(None, &[]).pulse, PulseWidth::MIN);
    assert!(bench.rig.faults().contains(Fault::ControlStalled));
}

/// Ticks come some cycles early or late; what counts is the nearest millisecond.
#[test]
fn the_time_between_two_ticks_is_rounded() {
    for (late, stalled) in [(MS * 4 / 10, false), (MS * 6 / 10, true)] {
        let mut bench = Bench::running(1500);
        bench.ms += 4;
        bench.late = late;
        bench.run(1);
        assert_eq!(bench.rig.faults().contains(Fault::ControlStalled), stalled, "5 ms and {late} ticks");
    }
    let mut bench = Bench::new();
    bench.late = 100; // the first tick is late, all that follow seem early
    bench.run(1);
    bench.late = 0;
    bench.run(1000);
    let times: Vec<u64> = bench.samples.iter().map(|sample| sample.at.as_ms()).collect();
    let period = bench.rig.config().log_period().as_ms();
    assert_eq!(times, (1..).map(|n| 1 + n * period).take_while(|ms| *ms <= 1001).collect::<Vec<_>>());
}

/// Erasing flash holds the board up, which is no stall while it is disarmed. Nothing may hold up a rig that is armed.
#[test]
fn a_pause_is_forgiven_while_disarmed_and_never_else() {
    for (paused, mut bench, forgiven) in [
        (true, Bench::new(), true),
        (false, Bench::new(), false),
        (true, Bench::armed(), false),
        (true, Bench::running(1500), false),
    ] {
        bench.run(10);
        bench.ms += 1500;
        bench.paused = paused;
        bench.tick_with(Some(Command::Ping), &[]);
        assert_eq!(bench.rig.faults().is_empty(), forgiven, "{:?}", bench.rig.faults());
    }
}

/// A host is told that a frame of its was not obeyed because it came again.
#[test]
fn a_replayed_frame_is_told() {
    let mut bench = Bench::new();
    bench.run(50);
    let replayed = Event::Refused(Refusals(Refusals::REPLAYED));
    assert!(!bench.events.contains(&replayed));
    bench.line.replayed = 1;
    bench.run(5);
    assert_eq!(bench.events.iter().filter(|event| **event == replayed).count(), 1);
}

#[test]
fn analogue_limits_trip_in_time() {
    for (channel, counts, fault) in [
        (2, 2200, Fault::OverCurrent),
        (3, 1800, Fault::UnderVoltage),
        (0, 4095, Fault::LoadCellOverload),
        (0, 0, Fault::LoadCellOverload),
    ] {
        let mut bench = Bench::running(1500);
        bench.counts[channel] = counts;
        bench.run(99);
        assert!(bench.pulse.is_live(), "{fault:?} trips too early");
        bench.run(1);
        assert_eq!(bench.pulse, PulseWidth::MIN, "{fault:?} does not trip");
        assert!(bench.rig.faults().contains(fault), "{fault:?}");
    }
}

/// A wire that breaks reads an end of its range for good; a converter that stands gives nothing. Either ends the run.
#[test]
fn a_lost_channel_stops_the_motor() {
    let after = |change: fn(&mut Bench)| {
        let mut bench = Bench::running(1500);
        let (begun, limit) = (bench.ms, u64::from(bench.rig.config().limits.analogue_ms));
        change(&mut bench);
        while bench.pulse.is_live() && bench.ms < begun + 1000 {
            bench.run(1);
        }
        (bench.ms - begun <= limit, bench.rig.faults().contains(Fault::AdcLost))
    };
    assert_eq!(after(|bench| bench.counts[2] = 0), (true, true), "the current's wire is open");
    assert_eq!(after(|bench| bench.counts[1] = 4095), (true, true), "the torque's lies on the supply");
    assert_eq!(after(|bench| bench.conversions = 0), (true, true), "no conversion comes");
}

#[test]
fn range_calibration() {
    let confirmed = Command::CalibrateRange { confirm: Command::CALIBRATE_CONFIRM };
    let mut bench = Bench::new();
    bench.run(1000);
    let unproven = Refusals::SUPPLY_UNPROVEN;
    assert_eq!(bench.say(Command::CalibrateRange { confirm: 1 }), refused(Refusals::NOT_CONFIRMED | unproven));
    assert_eq!(bench.say(confirmed), refused(unproven), "an open sense wire reads the same");
    bench.power();
    bench.run(150);
    assert_eq!(bench.say(confirmed), refused(Refusals::ESC_POWERED | unproven));
    bench.counts[3] = 0;
    assert_eq!(bench.say(confirmed), refused(unproven), "30 ms of nothing are a loose contact");
    let mut bench = Bench::holding_max();
    bench.power();
    bench.run(1000);
    assert_eq!(bench.pulse, PulseWidth::MAX);
    bench.beep(Beep::Double);
    assert_eq!(bench.pulse, PulseWidth::MIN, "minimum at once, 5 s before the programming mode");
    for beep in [Beep::Long, Beep::Cells(3), Beep::Ready] {
        assert_eq!(bench.rig.state(), RigState::CalibrateHoldMin);
        bench.beep(beep);
    }
    assert_eq!(bench.rig.state(), RigState::Armed);
}

#[test]
fn current_above_idle_ends_maximum_pulses() {
    let mut bench = Bench::holding_max();
    bench.counts[2] = 248 + 125; // 2 A
    bench.run(4);
    assert_eq!(bench.pulse, PulseWidth::MAX, "the ESC's capacitors charge");
    bench.run(1);
    assert_eq!((bench.pulse, bench.rig.state()), (PulseWidth::MIN, RigState::Faulted));
    assert!(bench.rig.faults().contains(Fault::OverCurrent));
}

/// The supply sense came off after it was seen on and off, the ESC has power: the rotor tells.
#[test]
fn a_rotor_that_turns_ends_maximum_pulses() {
    for channel in 0..4 {
        let mut bench = Bench::holding_max();
        let before = bench.ms;
        while bench.pulse == PulseWidth::MAX && bench.ms < before + 30_000 {
            // 6000 rev/min: an edge each 10 ms where there is one mark, and the channels with more have more
            let edge = [(bench.ms * MS) as u32];
            let turns = bench.ms.is_multiple_of(10);
            bench.tick_on(channel, None, if turns { &edge } else { &[] });
        }
        let passed = bench.ms - before;
        assert!(passed <= 31, "channel {channel}: maximum for {passed} ms"); // the first capture is the timer's own
        assert!(bench.rig.faults().contains(Fault::RotorTurned), "{:?}", bench.rig.faults());
    }
}

/// Nobody passes the beeps on.
#[test]
fn maximum_is_held_for_a_bounded_time_from_the_power_edge() {
    let mut bench = Bench::holding_max();
    bench.run(5_000); // towards an ESC without power it may wait
    assert_eq!(bench.pulse, PulseWidth::MAX);
    bench.power();
    bench.run(6_490);
    assert_eq!(bench.pulse, PulseWidth::MAX);
    bench.run(20);
    assert_eq!((bench.pulse, bench.rig.state()), (PulseWidth::MIN, RigState::ProgrammingEscape));
}

/// Two of four channels: the second-fastest counts.
#[test]
fn overspeed_stops_within_20_ms() {
    for (marks, fast, stops) in [
        ([2, 1, 2, 25], &[2usize, 3][..], true),
        ([2, 1, 2, 25], &[2], false), // one of four alone may be wrong; it disagrees
        ([0, 0, 2, 25], &[2], true),
        ([0, 1, 0, 0], &[1], true),
    ] {
        let mut bench = Bench::with(Config { marks, ..Config::thesis_570kv() });
        bench.arm();
        assert_eq!(bench.say(Command::SetPulse(PulseWidth::from_us(1500))), Some(Event::Accepted));
        let mut rotor = Rotor { marks, fast, turned: [0.0; 4], rpm: 6000.0 };
        for _ in 0..500 {
            rotor.tick(&mut bench);
        }
        assert!(bench.pulse.is_live(), "{:?}", bench.rig.faults());
        rotor.rpm = 12_000.0;
        let from = bench.ms;
        while bench.pulse.is_live() && bench.ms < from + 100 {
            rotor.tick(&mut bench);
        }
        let passed = bench.ms - from;
        assert_eq!(passed <= 20, stops, "{marks:?}, {fast:?} fast: {passed} ms");
        assert_eq!(bench.rig.faults().contains(Fault::Overspeed), stops);
    }
}

#[test]
fn trials_of_the_last_resort_need_a_rig_at_rest() {
    for trial in [Trial::Panic, Trial::Hang, Trial::Late] {
        let ask = Command::SelfTest { confirm: Command::SELF_TEST_CONFIRM, trial };
        for mut bench in [Bench::running(2000), Bench::armed(), Bench::holding_max()] {
            let outputs = bench.tick_with(Some(ask), &[]);
            assert_eq!(outputs.trial, None, "{trial:?} in {:?}", bench.rig.state());
            assert_eq!(bench.say(ask), refused(Refusals::WRONG_STATE));
        }
        let mut bench = Bench::new();
        assert_eq!(bench.tick_with(Some(ask), &[]).trial, Some(trial));
    }
}

#[test]
fn the_programming_mode_is_left_through_unpowered() {
    let mut bench = Bench::holding_max();
    bench.power();
    bench.beep(Beep::Programming);
    assert_eq!((bench.pulse, bench.rig.state()), (PulseWidth::MIN, RigState::ProgrammingEscape));
    assert_eq!(bench.say(Command::ClearFaults), refused(Refusals::ESC_POWERED));
    bench.counts[3] = 0;
    assert_eq!(bench.say(Command::ClearFaults), Some(Event::Accepted));
    assert_eq!(bench.rig.state(), RigState::Disarmed);
}

#[test]
fn an_esc_that_does_not_answer_ends_in_a_fault() {
    let mut bench = Bench::new();
    bench.say(Command::Arm);
    bench.run(59_900);
    assert_eq!(bench.rig.state(), RigState::ArmHoldMin);
    bench.run(200);
    assert_eq!(bench.rig.state(), RigState::Faulted);
    assert!(bench.rig.faults().contains(Fault::ArmingTimeout));
}

#[test]
fn a_staircase_runs_to_its_end() {
    let mut bench = Bench::armed();
    let us = PulseWidth::from_us;
    let stairs = Command::RunStaircase { step: us(100), hold_ms: 500, top: us(1300), down: true };
    assert_eq!(bench.say(stairs), Some(Event::Accepted));
    bench.run(3500);
    assert_eq!(bench.rig.state(), RigState::Armed);
    assert!(bench.events.iter().any(|e| matches!(e, Event::ScheduleDone { .. })));
    let mut levels: Vec<u32> = bench.samples.iter().filter(|s| s.state == RigState::Running).map(|s| s.pulse.0 / 1000).collect();
    levels.dedup();
    assert_eq!(levels, [1000, 1100, 1200, 1300, 1200, 1100, 1000]);
}

#[test]
fn an_upload_runs_and_manual_override_ends_it() {
    let mut bench = Bench::armed();
    let us = PulseWidth::from_us;
    let step = |index, pulse, ramp| Command::ScheduleStep { index, pulse: us(pulse), hold_ms: 1000, ramp };
    assert_eq!(bench.say(Command::RunSchedule), refused(Refusals::EMPTY_SCHEDULE));
    assert_eq!(bench.say(step(0, 1400, true)), Some(Event::Accepted));
    assert_eq!(bench.say(step(2, 1400, true)), refused(Refusals::OUT_OF_RANGE));
    assert_eq!(bench.say(step(1, 1200, false)), Some(Event::Accepted));
    assert_eq!(bench.say(Command::RunSchedule), Some(Event::Accepted));
    bench.run(490);
    assert_eq!(bench.pulse, us(1200), "half-way up the ramp");
    assert_eq!(bench.say(Command::SetPulse(us(2500))), refused(Refusals::OUT_OF_RANGE));
    assert_eq!(bench.say(Command::SetPulse(us(1600))), Some(Event::Accepted));
    bench.run(3000);
    assert_eq!(bench.pulse, us(1600));
    assert_eq!(bench.say(Command::SetPulse(PulseWidth::MIN)), Some(Event::Accepted));
    assert_eq!(bench.rig.state(), RigState::Armed);
}

fn segment(us: u32, length_ms: u32, shape: Shape) -> Segment {
    Segment { pulse: PulseWidth::from_us(us), length_ms, shape }
}

/// Sends segments or steers, and gives the news that answers.
fn news(bench: &mut Bench, command: Command) -> ScheduleNews {
    bench.run(20);
    bench.events.clear();
    bench.tick_with(Some(command), &[]);
    bench.run(3);
    assert!(!bench.events.iter().any(|e| matches!(e, Event::Accepted | Event::Refused(_))), "one answer is enough");
    bench.events.iter().find_map(|e| if let Event::Schedule(news) = e { Some(*news) } else { None }).expect("news")
}

#[test]
fn a_stream_that_runs_dry_is_minimum_and_a_fault() {
    let mut bench = Bench::armed();
    let part =
        |first, last| Command::Segments(SegmentBatch { last, ..SegmentBatch::of(first, &[segment(1500, 300, Shape::Hold)]) });
    news(&mut bench, part(0, false));
    assert_eq!(bench.say(Command::RunSchedule), refused(Refusals::SHORT_STREAM), "300 ms are too little to begin with");
    let told = news(&mut bench, part(1, false));
    assert_eq!((told.next, told.playing, told.refused), (2, None, Refusals::default()));
    assert_eq!(bench.say(Command::RunSchedule), Some(Event::Accepted));
    bench.run(580);
    assert_eq!(bench.pulse, PulseWidth::from_us(1500));
    bench.run(20);
    assert_eq!((bench.pulse, bench.rig.state()), (PulseWidth::MIN, RigState::Faulted));
    assert_eq!(bench.rig.faults(), FaultSet::NONE.with(Fault::StreamDry));
}

#[test]
fn a_batch_that_says_more_than_it_holds_is_refused_whole() {
    let mut bench = Bench::armed();
    let batch = SegmentBatch { count: 9, ..SegmentBatch::of(0, &[segment(1500, 300, Shape::Hold); 8]) };
    let told = news(&mut bench, Command::Segments(batch));
    assert_eq!((told.next, told.refused), (0, Refusals(Refusals::OUT_OF_RANGE)));
}

#[test]
fn a_stream_that_is_fed_ends_as_any_schedule_does() {
    let mut bench = Bench::armed();
    let pulse = |n: u32| 1100 + 10 * (n % 40);
    let batch = |first: u32| {
        let list: Vec<Segment> = (first..first + 8).map(|n| segment(pulse(n), 50, Shape::Hold)).collect();
        Command::Segments(SegmentBatch { last: first == 392, ..SegmentBatch::of(first, &list) })
    };
    let mut sent = 0;
    while sent < 128 {
        bench.tick_with(Some(batch(sent)), &[]);
        sent += 8;
    }
    assert_eq!(bench.say(Command::RunSchedule), Some(Event::Accepted));
    bench.run(1); // 10 ms and this one have been played
    for ms in 12..20_000u32 {
        let feed = (ms % 100 == 0 && sent < 400 && ms / 50 >= sent - 118).then(|| batch(sent));
        sent += if feed.is_some() { 8 } else { 0 };
        bench.tick_with(feed, &[]);
        if ms % 50 >= 45 {
            assert_eq!(bench.pulse, PulseWidth::from_us(pulse(ms / 50)), "{ms} ms");
        }
    }
    bench.run(2);
    assert_eq!(bench.rig.state(), RigState::Armed);
    assert!(bench.events.iter().any(|e| matches!(e, Event::ScheduleDone { .. })));
}

#[test]
fn only_a_steered_segment_that_is_being_played_is_steered() {
    let us = PulseWidth::from_us;
    let mut bench = Bench::armed();
    let list = [segment(1300, 60_000, Shape::Steered { low: us(1200), high: us(1400) }), segment(1250, 100, Shape::Hold)];
    news(&mut bench, Command::Segments(SegmentBatch::of(0, &list)));
    let steer = |segment, how| Command::Steer { segment, how };
    assert_eq!(news(&mut bench, steer(0, Steer::GoOn)).refused, Refusals(Refusals::WRONG_STATE), "it does not run");
    assert_eq!(bench.say(Command::RunSchedule), Some(Event::Accepted));
    bench.run(100);
    assert_eq!(news(&mut bench, steer(0, Steer::Pulse(us(1401)))).refused, Refusals(Refusals::OUT_OF_RANGE));
    assert_eq!(bench.pulse, us(1300));
    assert_eq!(news(&mut bench, steer(0, Steer::Pulse(us(1400)))).refused, Refusals::default());
    bench.run(10);
    assert_eq!(bench.pulse, us(1400));
    let told = news(&mut bench, steer(0, Steer::GoOn)).playing.expect("it runs");
    assert_eq!((told.segment, told.since.as_ms()), (1, bench.ms - 3), "since the tick that took the command");
    bench.run(20);
    assert_eq!(bench.pulse, us(1250));
    bench.run(100);
    assert_eq!(bench.rig.state(), RigState::Armed);
    assert_eq!(bench.say(Command::SetPulse(us(1500))), Some(Event::Accepted));
    assert_eq!(
        news(&mut bench, steer(0, Steer::Pulse(us(1200)))).refused,
        Refusals(Refusals::WRONG_STATE),
        "another course is followed"
    );
}

#[test]
fn tare_takes_the_last_means_as_zero() {
    let mut bench = Bench::new();
    assert_eq!(bench.say(Command::Tare), refused(Refusals::OUT_OF_RANGE), "no sample yet");
    bench.counts[0] = 2081; // the motor's weight
    bench.run(250);
    let last = *bench.samples.last().unwrap();
    let before = bench.rig.calibration().convert(&last).adc[0].unwrap();
    assert!((before + 2.39).abs() < 0.02, "244 g before: {before}");
    assert_eq!(bench.say(Command::Tare), Some(Event::Accepted));
    assert_eq!(bench.rig.calibration().convert(&last).adc[0], Some(0.0));
    let mut bench = Bench::running(1500);
    assert_eq!(bench.say(Command::Tare), refused(Refusals::WRONG_STATE));
}

/// A bench whose rotor turns although the rig is disarmed: by hand, by wind, or it coasts.
fn turning() -> Bench {
    let mut bench = Bench::new();
    let marks = bench.rig.config().marks;
    let mut rotor = Rotor { marks, fast: &[], turned: [0.0; 4], rpm: 3000.0 };
    for _ in 0..500 {
        rotor.tick(&mut bench);
    }
    bench
}

/// What changes the board itself is done while it is disarmed and nothing turns, and then once.
#[test]
fn settings_are_changed_and_stored_at_rest_only() {
    let change = Command::Configure(Setting::LogPeriodMs(50));
    for command in [Command::SaveSettings, change] {
        assert_eq!(Bench::armed().say(command), refused(Refusals::WRONG_STATE), "{command:?}");
        assert_eq!(Bench::running(1500).say(command), refused(Refusals::WRONG_STATE), "{command:?}");
        let mut bench = turning();
        assert_eq!(bench.say(command), refused(Refusals::ROTOR_TURNING), "{command:?}");
        assert_eq!(bench.rig.settings().log_period_ms, Bench::new().rig.settings().log_period_ms);
    }
    let mut bench = Bench::new();
    assert_eq!(bench.say(change), Some(Event::Accepted));
    assert_eq!(bench.rig.settings().log_period_ms, 50);
    assert_eq!(bench.say(Command::Configure(Setting::LogPeriodMs(0))), refused(Refusals::OUT_OF_RANGE));
    assert!(!bench.tick_with(None, &[]).store);
    assert!(bench.tick_with(Some(Command::SaveSettings), &[]).store);
    assert!(!bench.tick_with(None, &[]).store, "once");
    assert!(!Bench::armed().tick_with(Some(Command::SaveSettings), &[]).store);
}

/// A zero is taken of a load that stands still and that the channel sees.
#[test]
fn a_tare_needs_a_still_rotor_and_two_good_channels() {
    assert_eq!(turning().say(Command::Tare), refused(Refusals::ROTOR_TURNING));
    assert_eq!(Bench::holding_max().say(Command::Tare), refused(Refusals::WRONG_STATE));
    for channel in [0, 1] {
        let mut bench = Bench::new();
        bench.counts[channel] = 4095;
        bench.run(250);
        assert_eq!(bench.say(Command::Tare), refused(Refusals::OUT_OF_RANGE), "channel {channel} is at its end");
    }
    let mut bench = Bench::new();
    bench.counts = [1500, 2100, 300, 0, 950];
    bench.run(250);
    let before = bench.rig.calibration();
    assert_eq!(bench.say(Command::Tare), Some(Event::Accepted));
    let after = bench.rig.calibration();
    assert_eq!((after.adc[0].zero, after.adc[1].zero), (1500.0, 2100.0));
    assert_eq!((after.adc[0].gain, after.adc[1].gain), (before.adc[0].gain, before.adc[1].gain));
    assert_eq!(after.adc[2..], before.adc[2..], "no other channel is loaded by the motor's weight");
    let fitted = [true, false, true, true, true];
    let mut bench = Bench::with(Config { fitted, ..Config::thesis_570kv() });
    bench.run(250);
    let before = bench.rig.calibration();
    assert_eq!(bench.say(Command::Tare), Some(Event::Accepted));
    assert_eq!(bench.rig.calibration().adc[1], before.adc[1], "what is not fitted keeps its scale");
}

/// The board asks whether a pulse above minimum is given before it changes the form of its pulses.
#[test]
fn it_knows_whether_the_throttle_is_open() {
    assert!(!Bench::new().rig.is_live() && !Bench::armed().rig.is_live());
    assert!(Bench::holding_max().rig.is_live());
    let mut bench = Bench::running(1300);
    assert!(bench.rig.is_live());
    bench.tick_with(Some(Command::Stop), &[]);
    assert!(!bench.rig.is_live());
}

#[test]
fn a_burst_is_of_a_channel_that_is_fitted() {
    let fitted = [true, true, true, false, true];
    let mut bench = Bench::with(Config { fitted, ..Config::thesis_570kv() });
    for channel in 0..7u8 {
        let there = fitted.get(usize::from(channel)) == Some(&true);
        let outputs = bench.tick_with(Some(Command::Burst { channel }), &[]);
        assert_eq!(outputs.burst, there.then_some(channel));
        assert_eq!(bench.tick_with(None, &[]).burst, None, "once");
        let answer = if there { Some(Event::Accepted) } else { refused(Refusals::OUT_OF_RANGE) };
        assert_eq!(bench.say(Command::Burst { channel }), answer, "channel {channel}");
    }
}

#[test]
fn a_command_of_the_other_board_is_refused() {
    assert_eq!(Bench::new().say(Command::Imu(ImuCommand::Once)), refused(Refusals::WRONG_STATE));
}

#[test]
fn samples_come_at_the_log_rate_without_drift() {
    for ms in [10, 100, 1000] {
        let mut bench = Bench::with(Config { log_period: Ticks::from_ms(ms), ..Config::thesis_570kv() });
        bench.run(5001);
        let times: Vec<u64> = bench.samples.iter().map(|s| s.at.as_ms()).collect();
        let expected: Vec<u64> = (1..).map(|i| 1 + i * ms).take_while(|t| *t <= 5001).collect();
        assert_eq!(times, expected);
        let counted: u64 = bench.samples.iter().map(|s| u64::from(s.adc[0].count)).sum();
        assert_eq!(counted, (5000 / ms * ms + 1) * 8, "no conversion is lost or counted twice");
        assert!(bench.samples.iter().all(|s| s.adc[3].verdict == AdcVerdict::Nominal), "an unpowered supply reads zero");
    }
}

/// After a pause of many periods the next sample is the next one of its row: none is made up, none comes early.
#[test]
fn samples_keep_their_row_over_a_pause() {
    let mut bench = Bench::new();
    bench.run(250);
    bench.ms += 1520;
    bench.paused = true;
    bench.run(1);
    bench.paused = false;
    bench.run(500);
    let times: Vec<u64> = bench.samples.iter().map(|sample| sample.at.as_ms()).collect();
    assert_eq!(times, [101, 201, 1771, 1801, 1901, 2001, 2101, 2201]);
}

/// Other marks are other channels: what is fitted from now on is heard, and what is not any more is absent.
#[test]
fn changed_marks_are_listened_to() {
    let mut bench = Bench::with(Config { marks: [0, 0, 2, 0], ..Config::thesis_570kv() });
    assert_eq!(bench.say(Command::Configure(Setting::Marks([2, 0, 0, 0]))), Some(Event::Accepted));
    let mut rotor = Rotor { marks: [2, 0, 0, 0], fast: &[], turned: [0.0; 4], rpm: 3000.0 };
    for _ in 0..500 {
        rotor.tick(&mut bench);
    }
    let last = *bench.samples.last().unwrap();
    assert_eq!([0, 2].map(|channel: usize| last.rpm[channel].verdict), [CaptureVerdict::Nominal, CaptureVerdict::Absent]);
    let speed = bench.rig.calibration().speed(0, &last.rpm[0]).unwrap();
    assert!((speed - 3000.0).abs() < 1.0, "{speed} rev/min");
}

/// Either a speed sensor or the current sees a rotor that turns while maximum is held; one of the two is enough.
#[test]
fn one_witness_is_enough_for_the_range_calibration() {
    let fitted = |current| [true, true, current, true, true];
    for (marks, current, refused) in [([2, 1, 2, 25], false, false), ([0; 4], true, false), ([0; 4], false, true)] {
        let mut bench = Bench::with(Config { marks, fitted: fitted(current), ..Config::thesis_570kv() });
        let answer = bench.say(Command::CalibrateRange { confirm: 0 });
        let Some(Event::Refused(reasons)) = answer else { panic!("{answer:?}") };
        assert_eq!(reasons.0 & Refusals::NO_WITNESS != 0, refused, "{marks:?}, current {current}: {reasons}");
    }
}

#[test]
fn hello_tells_what_is_fitted() {
    let rig = Rig::new(Config { marks: [2, 0, 2, 25], ..Config::thesis_570kv() });
    let hello = rig.hello(0x14);
    assert_eq!((hello.present, hello.reset_cause, hello.core_hz), (0b1101, 0x14, 168_000_000));
    let fitted = [true, false, true, true, false];
    assert_eq!(Rig::new(Config { fitted, ..Config::thesis_570kv() }).hello(0).analogue, 0b01101);
}

/// A tare outlives every change that leaves the load cell's scale alone, and none that does not.
#[test]
fn a_tare_belongs_to_its_scale() {
    let mut bench = Bench::new();
    bench.counts[0] = 1500;
    bench.run(250);
    assert_eq!(bench.say(Command::Tare), Some(Event::Accepted));
    let tared = bench.rig.calibration();
    assert_eq!(bench.say(Command::Configure(Setting::SlewNsPerMs(500))), Some(Event::Accepted));
    assert_eq!(bench.rig.calibration(), tared);
    assert_eq!(bench.say(Command::Configure(Setting::Marks([1, 0, 0, 0]))), Some(Event::Accepted));
    let other = bench.rig.calibration();
    assert_eq!((other.marks, bench.rig.hello(0).present), ([1, 0, 0, 0], 1), "another calibration is in force");
    assert_eq!(other, Rig::with_settings(Config::thesis_570kv(), bench.rig.settings()).calibration(), "untared");
}

fn any_command() -> impl Strategy<Value = Command> {
    prop_oneof![
        Just(Command::Ping),
        Just(Command::Arm),
        prop_oneof![Just(Command::CALIBRATE_CONFIRM), any::<u32>()].prop_map(|confirm| Command::CalibrateRange { confirm }),
        prop_oneof![
            Just(Beep::Long),
            any::<u8>().prop_map(Beep::Cells),
            Just(Beep::Ready),
            Just(Beep::Double),
            Just(Beep::Programming),
            Just(Beep::NoSignal),
            Just(Beep::SelfTestFailed)
        ]
        .prop_map(Command::Beep),
        (0u8..4, 900_000u32..2_100_000, 0u32..2000, any::<bool>()).prop_map(|(index, pulse, hold_ms, ramp)| {
            Command::ScheduleStep { index, pulse: PulseWidth(pulse), hold_ms, ramp }
        }),
        Just(Command::RunSchedule),
        (0u32..3, 900_000u32..2_100_000, 0u32..700, any::<bool>(), any::<bool>()).prop_map(
            |(first, ns, length_ms, steered, last)| {
                let shape = if steered {
                    Shape::Steered { low: PulseWidth::MIN, high: PulseWidth(ns) }
                } else {
                    Shape::Line { from: None }
                };
                let list = [Segment { pulse: PulseWidth(ns), length_ms, shape }; 2];
                Command::Segments(SegmentBatch { last, ..SegmentBatch::of(first, &list) })
            }
        ),
        (0u32..4, proptest::option::of(900_000u32..2_100_000))
            .prop_map(|(segment, ns)| Command::Steer { segment, how: ns.map_or(Steer::GoOn, |ns| Steer::Pulse(PulseWidth(ns))) }),
        (900_000u32..2_100_000).prop_map(|ns| Command::SetPulse(PulseWidth(ns))),
        Just(Command::Stop),
        Just(Command::Tare),
        Just(Command::ClearFaults),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Whatever the host says and the sensors show: pulses stay within 1000 to 2000 us, above minimum in two states only, and
    /// a latched fault means minimum.
    #[test]
    fn no_sequence_of_commands_breaks_the_pulse_law(
        script in proptest::collection::vec((any_command(), 1u64..300, 0u16..4096, any::<bool>()), 1..40),
    ) {
        let mut bench = Bench::new();
        for (command, wait, counts, stop) in script {
            bench.counts[3] = counts;
            bench.stop_line = stop && wait > 250;
            for i in 0..wait {
                let outputs = bench.tick_with((i == 0).then_some(command), &[]);
                prop_assert_eq!(outputs.pulse, outputs.pulse.clamped());
                if outputs.pulse.is_live() {
                    prop_assert!(matches!(bench.rig.state(), RigState::Running | RigState::CalibrateHoldMax));
                    prop_assert!(bench.rig.faults().is_empty());
                    prop_assert!(!bench.stop_line);
                }
            }
        }
    }
}
