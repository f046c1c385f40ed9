//! One plan, flown natively: firmware, codec, pulse timer and bench in one loop of a millisecond.
//!
//! What it is: the native run's board behind its line; a host that brings the rig to the plan's phase; the mishap at its instant; and what
//! was seen, for [`judge`].
//! What can go wrong: see [`Wrong`]; each failure names its plan.
//! Units: ms since power-up.
//! Reference: specification `rig.md`, "Protection", "The simulator"; house rule 12 (one shell, many hosts).

use super::host::Host;
use super::{Answer, Failure, Injury, Mishap, Observed, Phase, Plan, REACTION_MS, Rule, Survived, Wrong, judge};
use crate::bench::{Bench, Millisecond};
use crate::native::{Board, PIN, POWER_ON, WATCHDOG, Wires};
use crate::sensor::EdgeDetail;
use firmware_rig::Config;
use frame::message::{Command, Crash, CrashCause, Event, Setting};
use frame::rig::RigState;
use frame::units::{PulseWidth, Ticks};

/// Time between two pulses, ms.
const FRAME_MS: u64 = 20;
/// From the end of a reset to the first pulse, ms: clock start and set-up take less than 10 on the board.
const BOOT_MS: u64 = 10;
/// The same of a board that takes too long, ms.
const SLOW_BOOT_MS: u64 = 60;
/// Watchdog at the nominal oscillator, ms.
pub(super) const WATCHDOG_MS: u64 = 20;
/// Supply gone for so long, ms.
pub(super) const OUTAGE_MS: u64 = 15;
/// How long the run is watched after the mishap has been noticed, ms.
const WATCH_MS: u64 = 300;
/// Longest time to the plan's phase, ms.
const REACH_LIMIT_MS: u64 = 20_000;

/// Why the board does nothing.
#[derive(Clone, Copy)]
pub(super) enum Away {
    Hangs { until: u64 },
    Resets { until: u64 },
}

/// The whole flight.
pub(super) struct Flight {
    pub(super) plan: Plan,
    /// The board learns nothing of the mishap and its limits are off; or it stops without a cause where it is to go on.
    pub(super) defenceless: bool,
    pub(super) bench: Bench,
    pub(super) board: Board,
    pub(super) host: Host,
    pub(super) injury: Injury,
    pub(super) ms: u64,
    /// After a reset, while nothing drives the pin and its pull-down holds it low.
    pub(super) undriven: bool,
    pub(super) live: Vec<u64>,
    pub(super) surprise: Option<u64>,
    /// Start of the first pulse after a reset, ms.
    pub(super) train: Option<u64>,
    pub(super) next_frame: u64,
    /// Pulse in flight: its end and its width.
    pub(super) pulse: Option<(u64, PulseWidth)>,
    pub(super) away: Option<Away>,
    /// When the cause of the last reset was over, ms.
    pub(super) back: u64,
    pub(super) skip_ticks: u64,
    /// When the plan's phase was reached.
    pub(super) reached: Option<u64>,
    pub(super) struck: Option<u64>,
    /// What is still to be sent, a frame a millisecond.
    pub(super) queue: Vec<Command>,
    /// What the board has sent in the last millisecond.
    pub(super) echo: Vec<u8>,
    pub(super) slowest: f64,
    pub(super) from: RigState,
}

/// The configuration of a plan's board; without any limit where it is `defenceless`.
fn config(plan: &Plan, defenceless: bool) -> Config {
    let mut config = plan.config.apply(&Config::thesis_570kv());
    if defenceless {
        let limits = &mut config.limits;
        (limits.lost_ms, limits.analogue_ms, limits.sensor_ms) = (u32::MAX, u32::MAX, u32::MAX);
        (limits.stall_ms, limits.link_ms, limits.idle_ms) = (u32::MAX, u32::MAX, u32::MAX);
        (limits.thrust.ms, limits.torque.ms, limits.current.ms) = (u16::MAX, u16::MAX, u16::MAX);
        (limits.speed.ms, limits.voltage.ms, limits.temperature.ms) = (u16::MAX, u16::MAX, u16::MAX);
        config.times.hold_min_ms = u32::MAX;
        config.times.max_powered_ms = u32::MAX;
        if plan.phase == Phase::Holding || plan.mishap == Mishap::OpenSense {
            config.limits.analogue_ms = 100; // how long on and off must last before maximum is given
        }
    }
    config
}

impl Flight {
    fn new(plan: Plan, defenceless: bool) -> Self {
        let mut bench = Bench::new(&plan.rig.scenario(plan.seed), None, EdgeDetail::Captured);
        if !plan.dialogue && plan.mishap != Mishap::OpenSense {
            bench.esc_is_ready();
        }
        let config = config(&plan, defenceless);
        let dead = plan.mishap == Mishap::CrystalDead && !defenceless;
        Self {
            bench,
            board: if dead { Board::without_crystal(config) } else { Board::new(config) },
            host: Host::default(),
            injury: Injury::new(&plan),
            plan,
            defenceless,
            ms: 0,
            undriven: false,
            live: Vec::new(),
            surprise: None,
            train: None,
            next_frame: 1,
            pulse: None,
            away: None,
            back: 0,
            skip_ticks: 0,
            reached: None,
            struck: None,
            queue: Vec::new(),
            echo: Vec::new(),
            slowest: f64::INFINITY,
            from: RigState::Disarmed,
        }
    }

    /// The pulse timer: preloaded compare, a pulse that has begun ends as it began.
    fn pulses(&mut self) {
        if let Some((end, width)) = self.pulse
            && self.ms >= end
        {
            let cut = self.struck.is_some() && self.plan.mishap == Mishap::PulseWire;
            if !cut {
                self.bench.pulse(end * 1_000_000 - 2_000_000 + u64::from(width.0), width.0);
            }
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
                    let live = matches!(self.board.rig().state(), RigState::Running | RigState::CalibrateHoldMax);
                    if !live && self.away.is_none() {
                        self.surprise.get_or_insert(self.ms);
                    }
                }
            }
        }
    }

    /// One millisecond in which the host says `bytes`.
    fn millisecond(&mut self, gathered: &mut Millisecond, bytes: &[u8]) {
        self.pulses();
        self.bench.millisecond(gathered);
        match self.away {
            Some(Away::Hangs { until }) if self.ms >= until => self.reset(self.ms),
            Some(Away::Resets { until }) if self.ms >= until => self.start_anew(),
            _ => {}
        }
        if self.away.is_some() {
            return;
        }
        self.board.hear(bytes);
        if self.skip_ticks > 0 {
            self.skip_ticks -= 1;
            return;
        }
        let since = self.struck.map(|struck| self.ms - struck);
        if let Some(since) = since
            && !self.defenceless
        {
            self.injury.injure(self.ms, since, self.bench.truth().plant.rpm, gathered);
        }
        if self.plan.mishap == Mishap::OpenSense && !self.defenceless {
            let count = std::mem::take(&mut gathered.adc[3]).count;
            (0..count).for_each(|_| gathered.adc[3].push(0));
        }
        let wires = self.wires(since);
        self.board.millisecond(Ticks::from_ms(self.ms), gathered, wires);
        self.echo = self.board.sent();
        self.host.hear(&self.echo);
        if since.is_some() && self.board.pulse().is_live() {
            self.slowest = self.slowest.min(self.bench.truth().plant.rpm);
        }
    }

    fn wires(&self, since: Option<u64>) -> Wires {
        let Some(since) = since else { return Wires::SOUND };
        let open = match self.plan.mishap {
            Mishap::StopOpen | Mishap::StopHeld => true,
            Mishap::StopBlink => since == 0,
            _ => false,
        };
        let eager = self.defenceless && self.goes_on();
        Wires {
            stop_open: if self.defenceless { eager && since > 5 } else { open },
            brown_out: self.plan.mishap == Mishap::SupplyDip && !self.defenceless,
        }
    }

    fn goes_on(&self) -> bool {
        let rule = Rule::of(&self.plan, 3000.0, 3000.0);
        matches!(rule.answer, Answer::GoesOn | Answer::Refuses)
    }

    /// The pin goes low at once; the program starts anew a little later.
    pub(super) fn reset(&mut self, from: u64) {
        let boot = if self.defenceless { SLOW_BOOT_MS } else { BOOT_MS };
        self.away = Some(Away::Resets { until: from + boot });
        self.back = from;
        self.undriven = true;
        self.train = None;
        self.pulse = None;
        self.next_frame = u64::MAX;
    }

    fn start_anew(&mut self) {
        let now = Ticks::from_ms(self.ms);
        let crash = |cause| Event::Crashed(Crash { cause, pc: 0, lr: 0, status: 0 });
        self.board = match self.plan.mishap {
            Mishap::Panic => self.board.after_end(now, Event::Panicked { line: 1, file: [0; 24] }),
            Mishap::HardFault => self.board.after_end(now, crash(CrashCause::HardFault)),
            Mishap::CrystalFails => self.board.after_end(now, crash(CrashCause::ClockFailed)),
            Mishap::Hang => self.board.after_reset(now, WATCHDOG),
            Mishap::ResetKey => self.board.after_reset(now, PIN),
            _ => self.board.after_reset(now, POWER_ON),
        };
        self.away = None;
        self.undriven = false;
        self.next_frame = self.ms;
        self.train = None;
        self.pulses();
    }

    /// Up to the mishap; whether it came.
    fn reach(&mut self, gathered: &mut Millisecond) -> bool {
        loop {
            self.ms += 1;
            // a stream runs dry by itself: the flight is there a little before
            let after = if self.plan.mishap == Mishap::StreamDry { self.plan.stream_ms() - 2 } else { self.plan.after_ms };
            if self.reached.is_some_and(|reached| self.ms > reached + after) && self.queue.is_empty() {
                return true;
            }
            if self.ms > REACH_LIMIT_MS || (!self.host.faults.is_empty() && self.plan.phase != Phase::Start) {
                return false;
            }
            if self.plan.mishap == Mishap::SaveCut
                && let Some(reached) = self.reached
            {
                let lead = 1 + (4.0 * self.plan.share) as u64;
                if self.ms + lead == reached + self.plan.after_ms {
                    self.queue = vec![Command::Configure(Setting::LogPeriodMs(50)), Command::SaveSettings];
                }
            }
            let bytes = self.approach();
            self.millisecond(gathered, &bytes);
        }
    }

    fn fly(mut self) -> Observed {
        let mut gathered = Millisecond::default();
        if self.plan.phase == Phase::Start {
            self.ms = 1;
            self.reached = Some(0);
        } else if !self.reach(&mut gathered) {
            return self.seen(0.0, None);
        }
        let rpm = self.bench.truth().plant.rpm;
        self.slowest = rpm;
        let bytes = self.strike();
        let mut from = self.ms;
        self.say(&mut gathered, bytes);
        // a limit that is crossed later begins to count when it is crossed
        if self.plan.mishap == Mishap::Overspeed {
            while self.bench.truth().plant.rpm < 4040.0 && self.ms < from + 3000 {
                self.ms += 1;
                let bytes = self.ping();
                self.say(&mut gathered, bytes);
            }
            from = self.ms;
        }
        let rule = Rule::of(&self.plan, rpm, 0.8 * rpm);
        // after a reset a sample tells the state
        let sample = if rule.answer == Answer::Resets { u64::from(self.plan.config.log_period_ms) } else { 0 };
        let end = from + (rule.within_ms + REACTION_MS).ceil() as u64 + WATCH_MS + sample;
        while self.ms < end {
            self.ms += 1;
            let bytes = self.aftermath(self.ms - from, end);
            self.say(&mut gathered, bytes);
        }
        self.seen(rpm, Some(from))
    }

    /// A millisecond in which the host says `bytes` over an injured line.
    fn say(&mut self, gathered: &mut Millisecond, bytes: Vec<u8>) {
        let asked = matches!(self.plan.mishap, Mishap::Replay | Mishap::Asked(_) | Mishap::EscNoSignal | Mishap::EscFails);
        let first = self.struck == Some(self.ms) && asked;
        let echo = std::mem::take(&mut self.echo);
        let bytes = match self.defenceless {
            true if first => Vec::new(),
            true => bytes,
            false => self.injury.line(bytes, &echo),
        };
        self.millisecond(gathered, &bytes);
    }

    fn seen(self, rpm: f64, struck: Option<u64>) -> Observed {
        Observed {
            struck: struck.map_or(f64::NAN, |ms| ms as f64),
            from: self.from,
            rpm,
            slowest: self.slowest,
            live: self.live.iter().map(|ms| *ms as f64).collect(),
            surprise: self.surprise.map(|ms| ms as f64),
            faults: self.host.faults,
            state: self.host.state,
            back: self.back as f64,
            train: self.train.map(|ms| ms as f64),
            refused: self.host.refused,
            ended: self.host.ended,
            verdicts: self.host.verdicts,
            end: self.ms as f64,
        }
    }
}

/// Flies a plan and judges it.
///
/// # Errors
/// What is wrong with the flight.
pub fn fly(plan: Plan) -> Result<Survived, Failure> {
    flown(plan, false)
}

/// Flies a plan with a board that lacks what answers the plan's mishap, or that stops where nothing asks for it. It shows that [`fly`] can
/// fail.
///
/// # Errors
/// What is wrong with the flight; `Ok` would mean that the campaign judges nothing.
pub fn fly_defenceless(plan: Plan) -> Result<Survived, Failure> {
    flown(plan, true)
}

fn flown(plan: Plan, defenceless: bool) -> Result<Survived, Failure> {
    let seen = Flight::new(plan, defenceless).fly();
    let turns = !matches!(plan.phase, Phase::Running | Phase::Moving) || seen.rpm > 500.0;
    if seen.struck.is_nan() || !turns {
        return Err(Failure { plan: Box::new(plan), wrong: Wrong::NeverReached(seen.state, seen.faults) });
    }
    judge(&plan, &seen)
}
