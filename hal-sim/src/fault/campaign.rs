//! One planned mishap, flown natively: firmware, codec, pulse timer and bench in one loop of a millisecond.
//!
//! What it is: the native run's board behind its line: arming through the ESC's beeps, one level, the mishap at its instant, and the judgement from outside: the pulses
//! on the ESC pin and the decoded telemetry, nothing else.
//! What can go wrong: see [`Failure`]; each names the seed's plan.
//! Units: ms since power-up.
//! Reference: specification `rig.md`: minimum throttle, latched and named, first minimum pulse within 40 ms of a reset.

use super::{Mishap, PING_MS, Plan, REACTION_MS};
use crate::bench::{Bench, Millisecond};
use crate::native::{Board, POWER_ON, WATCHDOG, Wires, firmware_config};
use crate::scenario::Scenario;
use crate::sensor::EdgeDetail;
use firmware_rig::{AdcBlock, Config};
use frame::message::{Command, Event, Message};
use frame::rig::{FaultSet, RigState};
use frame::units::{PulseWidth, Ticks};
use frame::wire::{Decoder, Encoder, MAX_WIRE};

/// Time between two pulses, ms.
const FRAME_MS: u64 = 20;
/// From the end of a reset to the first pulse, ms: clock start and set-up take less than 10 on the board.
const BOOT_MS: u64 = 10;
/// The same of a board that takes too long, ms.
const SLOW_BOOT_MS: u64 = 60;
/// Watchdog at the nominal oscillator, ms.
const WATCHDOG_MS: u64 = 20;
/// Supply gone for so long, ms.
const OUTAGE_MS: u64 = 15;
/// How long the run is watched after the mishap has been noticed, ms.
const WATCH_MS: u64 = 300;
/// Longest time that arming may take, ms.
const ARM_LIMIT_MS: u64 = 20_000;

/// What is wrong with a run.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Failure {
    /// The level was never reached.
    #[error("{plan:?}: the rig did not run before the mishap (state {state:?})")]
    NeverRan {
        /// Which.
        plan: Plan,
        /// Where it stood.
        state: RigState,
    },
    /// A pulse above minimum came too late.
    #[error("{plan:?}: a live pulse {late_ms:.1} ms after the latest allowed instant")]
    Live {
        /// Which.
        plan: Plan,
        /// How late.
        late_ms: f64,
    },
    /// The fault is not named in the telemetry.
    #[error("{plan:?}: telemetry tells {told:?}")]
    Unnamed {
        /// Which.
        plan: Plan,
        /// What was told.
        told: FaultSet,
    },
    /// The state at the end is not the latched one, or not disarmed after a reset.
    #[error("{plan:?}: the run ends in {state:?}")]
    NotLatched {
        /// Which.
        plan: Plan,
        /// Where it ended.
        state: RigState,
    },
    /// After a reset the first minimum pulse came late, or never.
    #[error("{plan:?}: first pulse {after_ms:?} ms after the reset")]
    LateTrain {
        /// Which.
        plan: Plan,
        /// How late.
        after_ms: Option<u64>,
    },
}

/// What a run that went well showed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Survived {
    /// The plan.
    pub plan: Plan,
    /// Rotor speed when the mishap came, rev/min.
    pub rpm: f64,
    /// From the mishap to the start of the last pulse above minimum, ms; 0 when there was none.
    pub last_live_ms: f64,
    /// Everything that was latched at the end.
    pub faults: FaultSet,
}

/// The far side: a host that arms, runs, and hears.
#[derive(Default)]
struct Host {
    encoder: Encoder,
    decoder: Decoder,
    state: RigState,
    faults: FaultSet,
    last_frame: Vec<u8>,
    sent_ms: u64,
    asked: bool,
}

impl Host {
    fn frame(&mut self, ms: u64, command: Command) -> Vec<u8> {
        let mut wire = [0; MAX_WIRE];
        let used = self.encoder.encode(Ticks::from_ms(ms), &command, &mut wire).unwrap_or(0);
        self.sent_ms = ms;
        self.last_frame = wire[..used].to_vec();
        self.last_frame.clone()
    }

    fn hear(&mut self, bytes: &[u8]) {
        for byte in bytes {
            match self.decoder.push::<Message>(*byte).map(|r| r.message) {
                Some(Message::Event(Event::State { to, .. })) => self.state = to,
                Some(Message::Event(Event::Faults { faults, .. })) => self.faults = FaultSet(self.faults.0 | faults.0),
                Some(Message::Rig(sample)) => {
                    self.state = sample.state;
                    self.faults = FaultSet(self.faults.0 | sample.faults.0);
                }
                _ => {}
            }
        }
    }
}

/// The configuration of a plan's board; without every protection that answers the plan's mishap, where
/// they hang on limits.
fn config(plan: &Plan, scenario: &Scenario, defenceless: bool) -> Config {
    let mut config = firmware_config(scenario);
    let limits = &mut config.limits;
    match plan.mishap {
        _ if !defenceless => {}
        Mishap::StuckLine { .. } => limits.lost_ms = u32::MAX,
        Mishap::Saturated { channel, .. } => {
            // both that answer it: the lost converter, and the channel's own limit
            limits.analogue_ms = u32::MAX;
            match channel {
                0 => limits.thrust.ms = u16::MAX,
                2 => limits.current.ms = u16::MAX,
                3 => limits.voltage.ms = u16::MAX,
                _ => {}
            }
        }
        Mishap::NoConversions => limits.analogue_ms = u32::MAX,
        Mishap::Silence => limits.link_ms = u32::MAX,
        Mishap::LateTick { .. } => limits.stall_ms = u32::MAX,
        _ => {} // not limits: see where the tick's inputs are gathered, and the reset
    }
    config
}

/// The whole run.
struct Flight {
    plan: Plan,
    /// The protection that answers the mishap is taken away.
    defenceless: bool,
    bench: Bench,
    board: Board,
    /// After a reset, while nothing drives the pin and its pull-down holds it low.
    undriven: bool,
    host: Host,
    ms: u64,
    /// Start of each pulse above minimum, ms.
    live: Vec<u64>,
    /// Start of the first pulse after a reset, ms.
    train: Option<u64>,
    next_frame: u64,
    /// Pulse in flight: its end and its width.
    pulse: Option<(u64, PulseWidth)>,
    /// The board is in reset, or hangs, until then.
    away: Option<Away>,
    /// When the cause of the last reset was over, ms.
    back: u64,
    skip_ticks: u64,
}

/// Why the board does nothing.
#[derive(Clone, Copy)]
enum Away {
    Hangs { until: u64 },
    Resets { until: u64 },
}

impl Flight {
    fn new(plan: Plan, defenceless: bool) -> Self {
        let scenario = Scenario { seed: plan.seed, ..Scenario::default() };
        Self {
            bench: Bench::new(&scenario, None, EdgeDetail::Captured),
            board: Board::new(config(&plan, &scenario, defenceless)),
            undriven: false,
            plan,
            defenceless,
            host: Host::default(),
            ms: 0,
            live: Vec::new(),
            train: None,
            next_frame: 1,
            pulse: None,
            away: None,
            back: 0,
            skip_ticks: 0,
        }
    }

    /// The pulse timer: preloaded compare, a pulse that has begun ends as it began.
    fn pulses(&mut self) {
        if let Some((end, width)) = self.pulse
            && self.ms >= end
        {
            self.bench.pulse(end * 1_000_000 - 2_000_000 + u64::from(width.0), width.0);
            self.pulse = None;
        }
        if self.ms == self.next_frame {
            self.next_frame += FRAME_MS;
            if !self.undriven {
                let width = self.board.pulse();
                self.pulse = Some((self.ms + 2, width));
                self.train.get_or_insert(self.ms);
                if width.is_live() {
                    self.live.push(self.ms);
                }
            }
        }
    }

    /// One millisecond; `mishap` is in force.
    fn millisecond(&mut self, gathered: &mut Millisecond, bytes: &[u8], mishap: Option<Mishap>) {
        self.ms += 1;
        self.pulses();
        self.bench.millisecond(gathered);
        match self.away {
            Some(Away::Hangs { until }) if self.ms >= until => self.reset(self.ms),
            Some(Away::Resets { until }) if self.ms >= until => {
                self.away = None;
                let cause = if self.plan.mishap == Mishap::Hang { WATCHDOG } else { POWER_ON };
                self.board = self.board.after_reset(Ticks::from_ms(self.ms), cause);
                self.undriven = false;
                self.next_frame = self.ms;
                self.train = None;
                self.pulses();
            }
            _ => {}
        }
        if self.away.is_some() {
            return;
        }
        // a board that lacks the protection against bad frames does not know that they came
        let unknown = self.defenceless && matches!(mishap, Some(Mishap::CorruptFrames | Mishap::Replay));
        self.board.hear(if unknown { &[] } else { bytes });
        if self.skip_ticks > 0 {
            self.skip_ticks -= 1;
            return;
        }
        match mishap {
            Some(Mishap::StuckLine { channel }) => gathered.edges[usize::from(channel)].clear(),
            Some(Mishap::Saturated { channel, high }) => {
                let block = &mut gathered.adc[usize::from(channel)];
                let code = if high { 4095 } else { 0 };
                let count = block.count;
                *block = AdcBlock::default();
                (0..count).for_each(|_| block.push(code));
            }
            Some(Mishap::NoConversions) => gathered.adc = Default::default(),
            _ => {}
        }
        let wires = Wires {
            stop_open: mishap == Some(Mishap::StopOpen) && !self.defenceless,
            brown_out: mishap == Some(Mishap::SupplyDip) && !self.defenceless,
        };
        self.board.millisecond(Ticks::from_ms(self.ms), gathered, wires);
        let sent = self.board.sent();
        self.host.hear(&sent);
    }

    /// The pin goes low at once; the program starts anew a little later.
    fn reset(&mut self, from: u64) {
        let boot = if self.defenceless { SLOW_BOOT_MS } else { BOOT_MS };
        self.away = Some(Away::Resets { until: from + boot });
        self.back = from;
        self.undriven = true;
        self.train = None;
        self.pulse = None;
        self.next_frame = u64::MAX;
    }

    /// What the host sends in this millisecond on its way to the level.
    fn arming(&mut self) -> Vec<u8> {
        let ms = self.ms;
        if let Some((_, beep)) = self.bench.beep() {
            return self.host.frame(ms, Command::Beep(beep));
        }
        match self.host.state {
            RigState::Disarmed if ms == 50 => self.host.frame(ms, Command::Arm),
            RigState::ArmHoldMin if ms == 200 => {
                self.bench.set_power(true);
                Vec::new()
            }
            RigState::Armed if !self.host.asked => {
                self.host.asked = true;
                let pulse = PulseWidth::from_us(self.plan.pulse_us);
                self.host.frame(ms, Command::SetPulse(pulse))
            }
            _ => self.ping(),
        }
    }

    fn ping(&mut self) -> Vec<u8> {
        if self.ms >= self.host.sent_ms + PING_MS { self.host.frame(self.ms, Command::Ping) } else { Vec::new() }
    }

    /// Starts the mishap.
    fn strike(&mut self) -> Vec<u8> {
        match self.plan.mishap {
            Mishap::Replay => return self.host.last_frame.clone(),
            Mishap::PowerLoss => {
                self.reset(self.ms + OUTAGE_MS);
            }
            Mishap::LateTick { ms } => self.skip_ticks = u64::from(ms) - 1,
            Mishap::Hang if self.defenceless => self.away = Some(Away::Hangs { until: u64::MAX }),
            Mishap::Hang => self.away = Some(Away::Hangs { until: self.ms + WATCHDOG_MS }),
            _ => {}
        }
        Vec::new()
    }

    /// What the host sends while the mishap lasts.
    fn under_mishap(&mut self) -> Vec<u8> {
        match self.plan.mishap {
            Mishap::Silence => Vec::new(),
            Mishap::CorruptFrames => {
                let mut bytes = self.ping();
                let middle = bytes.len() / 2;
                if let Some(byte) = bytes.get_mut(middle) {
                    *byte ^= 0x5a;
                }
                bytes
            }
            _ => self.ping(),
        }
    }
}

/// Flies a plan and judges it.
///
/// # Errors
/// What is wrong with the run.
pub fn fly(plan: Plan) -> Result<Survived, Failure> {
    flown(Flight::new(plan, false))
}

/// Flies a plan with a board that lacks the protection that answers the plan's mishap (for a power loss: one that starts too
/// slowly). It shows that [`fly`] can fail.
///
/// # Errors
/// What is wrong with the run; `Ok` would mean that the campaign judges nothing.
pub fn fly_defenceless(plan: Plan) -> Result<Survived, Failure> {
    flown(Flight::new(plan, true))
}

fn flown(mut flight: Flight) -> Result<Survived, Failure> {
    let plan = flight.plan;
    let mut gathered = Millisecond::default();
    let mut running_since = None;
    loop {
        let bytes = flight.arming();
        flight.millisecond(&mut gathered, &bytes, None);
        if flight.host.state == RigState::Running {
            running_since.get_or_insert(flight.ms);
        }
        if running_since.is_some_and(|since| flight.ms >= since + plan.after_ms) {
            break;
        }
        if flight.ms > ARM_LIMIT_MS || !flight.host.faults.is_empty() {
            return Err(Failure::NeverRan { plan, state: flight.host.state });
        }
    }
    let rpm = flight.bench.truth().plant.rpm;
    if flight.live.is_empty() || rpm < 500.0 {
        return Err(Failure::NeverRan { plan, state: flight.host.state });
    }
    let struck = flight.ms;
    let detection = plan.mishap.detection(rpm, flight.board.rig().config().marks).ms;
    let bytes = flight.strike();
    flight.millisecond(&mut gathered, &bytes, Some(plan.mishap));
    let end = struck + (detection + REACTION_MS).ceil() as u64 + WATCH_MS;
    while flight.ms < end {
        let bytes = flight.under_mishap();
        flight.millisecond(&mut gathered, &bytes, Some(plan.mishap));
    }
    judge(&flight, struck, rpm, detection)
}

fn judge(flight: &Flight, struck: u64, rpm: f64, detection: f64) -> Result<Survived, Failure> {
    let plan = flight.plan;
    let last_live_ms = flight.live.last().map_or(0, |at| at.saturating_sub(struck)) as f64;
    let late_ms = last_live_ms - detection - REACTION_MS;
    if late_ms > 0.0 {
        return Err(Failure::Live { plan, late_ms });
    }
    let state = flight.board.rig().state();
    match plan.mishap.fault() {
        Some(fault) if !flight.host.faults.contains(fault) => {
            return Err(Failure::Unnamed { plan, told: flight.host.faults });
        }
        Some(_) if state != RigState::Faulted || flight.host.state != RigState::Faulted => {
            return Err(Failure::NotLatched { plan, state });
        }
        None if state != RigState::Disarmed || flight.host.state != RigState::Disarmed => {
            return Err(Failure::NotLatched { plan, state });
        }
        None => {
            let after_ms = flight.train.map(|train| train.saturating_sub(flight.back));
            if after_ms.is_none_or(|ms| ms > REACTION_MS as u64) {
                return Err(Failure::LateTrain { plan, after_ms });
            }
        }
        Some(_) => {}
    }
    Ok(Survived { plan, rpm, last_live_ms, faults: flight.host.faults })
}
