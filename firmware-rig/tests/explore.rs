//! The whole rig, explored: from reset, every kind of input in every state that the rig can be brought into, until nothing new
//! appears. Rules are checked on every tick of every walk.

use esc_pwm::ArmingTimes;
use esc_pwm::dshot::{EscOutput, Frame, Throttle};
use firmware_rig::{AdcBlock, Beside, Config, Inputs, LineNews, Rig, StopWatch};
use frame::message::{Beep, Command};
use frame::rig::{FaultSet, RigState};
use frame::schedule::{Segment, SegmentBatch, Shape, Steer};
use frame::units::{PulseWidth, Ticks};
use std::collections::{BTreeMap, VecDeque};

const MS: u64 = 84_000;
const LOW_MS: u64 = 60;
/// How long supply and current must last to count, ms.
const ANALOGUE_MS: u64 = 10;
/// Longest maximum towards a supply that came on, ms.
const MAX_POWERED_MS: u64 = 150;
/// Time between two edges of the rotor that turns here, ms.
const EDGE_MS: u64 = 10;
/// Longest maximum while it turns, ms: two edges, and before them the first capture of all, which is the timer's own.
const TURNING_MS: u64 = 3 * EDGE_MS;
/// Longest time from the beginning of a tick to its pulse in the timer, us: the tick's whole budget of 40 000 cycles at 168 MHz.
const TICK_US: u64 = 239;
/// When a DShot frame starts after the beginning of the tick, and when the DMA fetches its first bit, us: `board/pulse.rs`.
const FRAME_US: u64 = 926;
const FETCH_US: u64 = 760;
/// Steps of the phase at which a stop comes, us.
const PHASE_US: usize = 50;

/// Times shortened in proportion, so that every time-out is walked through.
const TIMES: ArmingTimes = ArmingTimes {
    hold_min_ms: 400,
    cells_ms: 200,
    ready_ms: 200,
    armed_ms: 700,
    hold_max_ms: 300,
    max_powered_ms: MAX_POWERED_MS as u32,
    calibrate_min_ms: 300,
    low_interval_ms: LOW_MS as u32,
};

/// What may happen.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Happening {
    Say(Command),
    StopKey,
    Power(bool),
    SenseWire(bool),
    Rotor(bool),
    OverCurrent,
    AboveIdle,
    SagOfSupply,
    BrownOut,
    Replay,
    Damage,
    LateTick,
    Wait(u64),
    Silence,
}

/// A segment that the host may move.
const STEERED: Segment = Segment {
    pulse: PulseWidth::from_us(1300),
    length_ms: 600,
    shape: Shape::Steered { low: PulseWidth::from_us(1100), high: PulseWidth::from_us(1500) },
};

fn happenings() -> Vec<Happening> {
    let us = PulseWidth::from_us;
    let mut list: Vec<Happening> = [
        Command::Ping,
        Command::Arm,
        Command::CalibrateRange { confirm: 0 },
        Command::CalibrateRange { confirm: Command::CALIBRATE_CONFIRM },
        Command::ScheduleStep { index: 0, pulse: us(1400), hold_ms: 30, ramp: true },
        Command::Segments(SegmentBatch { last: false, ..SegmentBatch::of(0, &[STEERED]) }), // more was to come: it runs dry
        Command::Steer { segment: 0, how: Steer::Pulse(us(1450)) },
        Command::Steer { segment: 0, how: Steer::GoOn },
        Command::RunSchedule,
        Command::RunStaircase { step: us(200), hold_ms: 10, top: us(1400), down: true },
        Command::RunVisits { step: us(200), hold_ms: 10, top: us(1200), down: false, visits: 2 },
        Command::RunRamp { from: us(1000), to: us(1500), length_ms: 30 },
        Command::RunStep { before: us(1100), after: us(1300), hold_ms: 10 },
        Command::RunChirp { centre: us(1300), amplitude: us(100), from_millihertz: 1000, to_millihertz: 5000, length_ms: 40 },
        Command::SetPulse(us(1500)),
        Command::SetPulse(us(1000)),
        Command::SetPulse(us(2500)),
        Command::Stop,
        Command::Tare,
        Command::ClearFaults,
        Command::SaveSettings,
        Command::Burst { channel: 0 },
        Command::Burst { channel: 200 },
    ]
    .map(Happening::Say)
    .into();
    list.extend(
        [Beep::Long, Beep::Cells(3), Beep::Ready, Beep::Double, Beep::Programming, Beep::NoSignal, Beep::SelfTestFailed]
            .map(|beep| Happening::Say(Command::Beep(beep))),
    );
    list.extend([
        Happening::StopKey,
        Happening::Power(true),
        Happening::Power(false),
        Happening::SenseWire(false),
        Happening::SenseWire(true),
        Happening::Rotor(true),
        Happening::Rotor(false),
        Happening::OverCurrent,
        Happening::AboveIdle,
        Happening::SagOfSupply,
        Happening::BrownOut,
        Happening::Replay,
        Happening::Damage,
        Happening::LateTick,
        Happening::Wait(LOW_MS / 2),
        Happening::Wait(LOW_MS + 10),
        Happening::Wait(800),
        Happening::Silence,
    ]);
    list
}

/// A rig with the little world that its inputs come from.
#[derive(Clone)]
struct Walk {
    rig: Rig,
    ms: u64,
    powered: bool,
    /// The wire of the supply sense is on; open, it reads 0 V.
    wired: bool,
    /// How long the supply has read on, ms, and whether it ever did for long enough.
    read_on: u64,
    seen_on: bool,
    /// How long maximum has been held since the supply was read on, since the rotor turns and since the current is above idle, ms.
    held: [u64; 3],
    turning: bool,
    pulse: PulseWidth,
    last_live: Option<u64>,
    state: RigState,
}

/// What makes two walks the same for the machine.
type Key = (u8, [bool; 8]);

impl Walk {
    fn new(output: EscOutput) -> Self {
        let mut config = Config { times: TIMES, output, ..Config::thesis_570kv() };
        config.limits.analogue_ms = ANALOGUE_MS as u32;
        config.limits.current.ms = ANALOGUE_MS as u16;
        config.limits.voltage.ms = ANALOGUE_MS as u16;
        config.limits.thrust.ms = ANALOGUE_MS as u16;
        config.limits.link_ms = 500;
        config.limits.disagreeing = 4; // the one channel that turns here has no company
        config.limits.lost_ms = 1_000_000;
        let (pulse, state) = (PulseWidth::MIN, RigState::Disarmed);
        Self {
            rig: Rig::new(config),
            ms: 0,
            powered: false,
            wired: true,
            read_on: 0,
            seen_on: false,
            held: [0; 3],
            turning: false,
            pulse,
            last_live: None,
            state,
        }
    }

    fn key(&self) -> Key {
        let recent = self.last_live.is_some_and(|at| self.ms - at < LOW_MS);
        let one = |set: FaultSet| !set.is_empty();
        let live = self.pulse.is_live();
        let world = [self.powered, self.turning, self.wired, self.seen_on];
        let [powered, turning, wired, seen_on] = world;
        let max = self.pulse == PulseWidth::MAX;
        (self.state as u8, [one(self.rig.faults()), live, recent, powered, turning, wired, seen_on, max])
    }

    /// One tick, and the rules that hold on each.
    fn tick(&mut self, command: Option<Command>, change: impl FnOnce(&mut Inputs<'_>, &mut [u16; 5])) {
        self.ms += 1;
        let edge = [(self.ms * MS) as u32];
        let turn = self.turning && self.ms.is_multiple_of(EDGE_MS);
        let mut counts = [1427, 2048, 248, if self.powered && self.wired { 2379 } else { 0 }, 900];
        let mut inputs = Inputs {
            now: Ticks(self.ms * MS),
            edges: [&[], if turn { &edge } else { &[] }, &[], &[]],
            over_capture: [false; 4],
            adc: &[AdcBlock::default(); 5],
            beside: Beside::UNWIRED,
            command,
            line: LineNews::default(),
            stop_input: false,
            brown_out: false,
            paused: false,
        };
        change(&mut inputs, &mut counts);
        let adc = counts.map(|code| {
            let mut block = AdcBlock::default();
            (0..4).for_each(|_| block.push(code));
            block
        });
        let inputs = Inputs { adc: &adc, ..inputs };
        let outputs = self.rig.tick(&inputs);
        let (before, now) = (self.state, self.rig.state());
        (self.state, self.pulse) = (now, outputs.pulse);
        assert_eq!(outputs.pulse, outputs.pulse.clamped(), "pulses never cease and never leave their range");
        let frame = Frame { throttle: Throttle::of(outputs.pulse), telemetry: false };
        assert_eq!(frame == Frame::STOP, !outputs.pulse.is_live(), "a frame says what the pulse says");
        assert_eq!(Frame::from_word(frame.word()), Some(frame));
        if outputs.pulse.is_live() {
            assert!(matches!(now, RigState::Running | RigState::CalibrateHoldMax), "{:?} in {now:?}", outputs.pulse);
            assert!(self.rig.faults().is_empty(), "{:?} with {:?}", outputs.pulse, self.rig.faults());
        }
        if before == RigState::Disarmed && matches!(now, RigState::ArmHoldMin | RigState::CalibrateHoldMax) {
            let rest = self.last_live.map_or(u64::MAX, |at| self.ms - at);
            assert!(rest >= LOW_MS, "armed again {rest} ms after the last live pulse");
            assert!(self.rig.faults().is_empty(), "armed over a latched fault");
        }
        if now == RigState::CalibrateHoldMax && before != now {
            assert!(self.seen_on, "an open wire was believed");
            assert!(!(self.turning || self.powered && self.wired), "maximum pulses towards a powered ESC");
        }
        self.judge_maximum(counts);
        if outputs.pulse.is_live() {
            self.last_live = Some(self.ms);
        }
    }

    /// Maximum pulses do not outlive what speaks against them.
    fn judge_maximum(&mut self, counts: [u16; 5]) {
        let reads_on = counts[3] > 400;
        self.read_on = if reads_on { self.read_on + 1 } else { 0 };
        self.seen_on |= self.read_on >= ANALOGUE_MS;
        let against = [reads_on || self.held[0] > 0, self.turning, counts[2] > 500];
        for ((held, against), most) in self.held.iter_mut().zip(against).zip([MAX_POWERED_MS, TURNING_MS, 5]) {
            *held =
                if against && self.pulse == PulseWidth::MAX && self.state == RigState::CalibrateHoldMax { *held + 1 } else { 0 };
            assert!(*held <= most, "maximum for {held} ms, at most {most}");
        }
    }

    fn rest(&mut self, ms: u64) {
        (0..ms).for_each(|_| {
            let ping = self.ms.is_multiple_of(40).then_some(Command::Ping);
            self.tick(ping, |_, _| {});
        });
    }

    fn meet(&mut self, happening: Happening) {
        match happening {
            Happening::Say(command) => self.tick(Some(command), |_, _| {}),
            Happening::StopKey => self.tick(None, |inputs, _| inputs.stop_input = true),
            Happening::Power(on) => {
                self.powered = on;
                self.rest(ANALOGUE_MS); // until it counts
            }
            Happening::SenseWire(on) => {
                self.wired = on;
                self.rest(ANALOGUE_MS);
            }
            Happening::AboveIdle => (0..6).for_each(|_| self.tick(None, |_, counts| counts[2] = 800)),
            Happening::Rotor(on) => self.turning = on,
            Happening::OverCurrent => (0..12).for_each(|_| self.tick(None, |_, counts| counts[2] = 2500)),
            Happening::SagOfSupply => (0..12).for_each(|_| self.tick(None, |_, counts| counts[3] = 1000)),
            Happening::BrownOut => self.tick(None, |inputs, _| inputs.brown_out = true),
            Happening::Replay => self.tick(None, |inputs, _| inputs.line.replayed = 1),
            Happening::Damage => self.tick(None, |inputs, _| inputs.line.damaged = 3),
            Happening::LateTick => {
                self.ms += 7;
                self.tick(None, |_, _| {});
            }
            Happening::Wait(ms) => self.rest(ms),
            Happening::Silence => (0..520).for_each(|_| self.tick(None, |_, _| {})),
        }
        self.rest(2);
        if matches!(happening, Happening::Rotor(_)) {
            self.rest(300); // until the rotor is known to turn, or to stand
        }
    }

    /// From here, one stop at every phase of the tick, by key and by command: when the timer last held anything but minimum,
    /// us after the stop. Whatever starts after that instant is a minimum pulse, because the timer takes its compare value when
    /// a pulse starts.
    fn stops(&self) -> u64 {
        let mut worst = 0;
        for (key, late) in [(true, 0), (true, TICK_US), (false, 0), (false, TICK_US)] {
            for event in (0..1000).step_by(PHASE_US) {
                worst = worst.max(self.stop(key, late, event as u64));
            }
        }
        worst
    }

    /// One stop `event` us after a tick that began just before; each tick writes its pulse `late` us after its beginning.
    fn stop(&self, key: bool, late: u64, event: u64) -> u64 {
        let mut copy = self.clone();
        let mut watch = StopWatch::default();
        assert!(!watch.half(false, false).tick, "the half before the tick");
        let (mut live_until, mut taken) = (0, false);
        // what the compare register holds, from when: the pulse of the tick before the stop first
        let mut register = vec![(0, copy.pulse)];
        for half in 0u64.. {
            let at = half * 500;
            let stopped = at > event;
            // the key is let go again after one look, and a command is heard once
            let news = stopped && at <= event + 500;
            let waits = !key && stopped && !taken;
            let due = watch.half(key && news, waits);
            if due.minimum {
                register.push((at, PulseWidth::MIN));
            }
            if due.tick {
                // at half 0 the tick that the stop has just missed
                let pressed = watch.take();
                copy.tick(waits.then_some(Command::Stop), |inputs, _| inputs.stop_input = pressed);
                taken |= waits;
                register.push((at + late, copy.pulse));
            }
            if half > 80 {
                break;
            }
        }
        for pair in register.windows(2) {
            if pair[0].1.is_live() {
                live_until = live_until.max(pair[1].0.saturating_sub(event));
            }
        }
        assert!(!register.last().is_some_and(|(_, pulse)| pulse.is_live()), "{:?} is not stopped for good", self.state);
        // a frame is what the words in memory said when the DMA fetched its first bit
        for frame in (0..40u64).map(|tick| 1000 * tick).filter(|tick| tick + FRAME_US > event + 1000) {
            let fetched = register.iter().rev().find(|(at, _)| *at <= frame + FETCH_US).map_or(PulseWidth::MAX, |(_, p)| *p);
            assert_eq!(Throttle::of(fetched), Throttle::STOP, "key {key}, stop {event} us, frame {frame}");
        }
        assert!(
            live_until <= 1000,
            "{:?}, key {key}, stop {event} us after a tick: live until {live_until} us after it",
            self.state
        );
        live_until
    }
}

#[test]
fn every_state_and_event_of_the_whole_rig() {
    assert_eq!(explored(EscOutput::Pwm), 10, "every state of the arming machine is reached");
}

/// What is sent as numbers obeys the same rules, and there is no range calibration: neither of its states is ever reached.
#[test]
fn every_state_and_event_of_a_rig_that_speaks_dshot() {
    assert_eq!(explored(EscOutput::DShot300), 8);
}

/// Explores everything; how many states of the arming machine were reached.
fn explored(output: EscOutput) -> usize {
    let list = happenings();
    let first = Walk::new(output);
    let mut seen: BTreeMap<Key, usize> = BTreeMap::from([(first.key(), 0)]);
    let mut open = VecDeque::from([first]);
    let (mut transitions, mut states, mut worst_stop) = (0usize, std::collections::BTreeSet::new(), 0);
    while let Some(walk) = open.pop_front() {
        states.insert(walk.state as u8);
        worst_stop = worst_stop.max(walk.stops());
        for happening in &list {
            let mut next = walk.clone();
            next.meet(*happening);
            transitions += 1;
            let visits = seen.entry(next.key()).or_default();
            *visits += 1;
            if *visits <= 2 {
                open.push_back(next); // twice: two walks with one key may still differ in what the key leaves out
            }
        }
    }
    println!("{output:?}: {} arming states, {} states of the rig, {transitions} transitions", states.len(), seen.len());
    println!("a stop is in the pulse timer {worst_stop} us after it came, at most");
    assert!((400..=1000).contains(&worst_stop), "some state was live, and none for longer than a millisecond: {worst_stop}");
    assert!(seen.len() >= 40, "{} states", seen.len());
    states.len()
}
