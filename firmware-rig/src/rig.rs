//! One control tick of the rig.
//!
//! What it is: [`Rig::tick`], which orders protection, command, time-out, schedule and sample, and owns the small mutable
//! state beside the immutable [`Config`].
//! What can go wrong: faults latch and are told as events; a full event queue drops the newest event, never a state.
//! Units: ticks of the capture timer; the tick is called at 1 kHz.
//! Reference: specification `rig.md`; house rule "ticks without I/O".

use crate::bank::CaptureBank;
use crate::config::Config;
use crate::course::Course;
use crate::cross::{Beside, CrossChecks};
use crate::elapsed::Elapsed;
use crate::esc_line::EscCounts;
use crate::hold_max::{HoldWatch, SupplyProof};
use crate::line::LineNews;
use crate::rig_config::{Answers, RigConfig};
use crate::sampling::AdcBlock;
use crate::stop::StopLoop;
use crate::transfer::Incoming;
use esc_pwm::{ArmingEvent, Objections, Outcome, Protection, Readings, Track, step, time_out};
use frame::calibration::Calibration;
use frame::message::{BoardId, Command, Event, Hello, Trial};
use frame::rig::{ADC_CHANNELS, AdcCode, AdcVerdict, CAPTURE_CHANNELS, Fault, FaultSet, Refusals, RigSample, RigState};
use frame::units::{Ampere, Celsius, Newton, NewtonMetre, PulseWidth, RevPerMin, Ticks, Volt};
use heapless::Deque;

/// What the peripherals delivered since the last tick.
#[derive(Debug, Clone, Copy)]
pub struct Inputs<'a> {
    /// 64-bit extended ticks of the capture timer.
    pub now: Ticks,
    /// Raw 32-bit captures since the last tick, a slice a channel, in order.
    pub edges: [&'a [u32]; CAPTURE_CHANNELS],
    /// The channel's over-capture flag was set, or its queue was full.
    pub over_capture: [bool; CAPTURE_CHANNELS],
    /// What the converter delivered since the last tick.
    pub adc: &'a [AdcBlock; ADC_CHANNELS],
    /// What arrived for the cross-checks since the last tick.
    pub beside: Beside<'a>,
    /// At most one decoded command of the host.
    pub command: Option<Command>,
    /// What went wrong on the host's line since the last tick.
    pub line: LineNews,
    /// The stop loop is open: its key is pressed, or it is broken or unplugged. Closed, it lies on ground.
    pub stop_input: bool,
    /// The voltage detector sees the board's own supply too low.
    pub brown_out: bool,
    /// The board itself held the tick up since the last one (it erased flash, which stops the processor): no stall.
    pub paused: bool,
}

/// What the board has to do now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs {
    /// Pulse for the ESC, from its next frame on.
    pub pulse: PulseWidth,
    /// A sample, once a log period.
    pub sample: Option<RigSample>,
    /// The oldest event that has not been told yet.
    pub event: Option<Event>,
    /// The operator asks for the settings in force to be stored.
    pub store: bool,
    /// The operator asks for this trial of the last resort.
    pub trial: Option<Trial>,
    /// The operator asks for every conversion of this channel.
    pub burst: Option<u8>,
    /// The ESC is to be asked for a frame of telemetry, where its next command can ask: by a DShot frame's telemetry bit.
    pub ask_esc: bool,
}

/// The rig.
#[derive(Debug, Clone)]
pub struct Rig {
    pub(crate) config: Config,
    pub(crate) calibration: Calibration,
    pub(crate) untared: Calibration,
    pub(crate) state: RigState,
    pub(crate) faults: FaultSet,
    /// Faults that no command clears.
    standing: FaultSet,
    pub(crate) course: Course,
    /// Since when it is followed: milliseconds counted on, and the instant.
    pub(crate) started: Elapsed,
    pub(crate) began: Ticks,
    pub(crate) track: Track,
    pub(crate) bank: CaptureBank,
    cross: CrossChecks,
    pub(crate) codes: [AdcCode; ADC_CHANNELS],
    pub(crate) factory: Config,
    pub(crate) settings: RigConfig,
    pub(crate) store: bool,
    pub(crate) trial: Option<Trial>,
    pub(crate) burst: Option<u8>,
    pub(crate) incoming: Incoming,
    /// Counts the configurations that were put in force.
    revision: u8,
    /// Since when the throttle is open.
    pub(crate) live_since: Option<Ticks>,
    entered: Elapsed,
    pub(crate) setting: PulseWidth,
    pub(crate) last_live: Option<Ticks>,
    blocks: [AdcBlock; ADC_CHANNELS],
    supply: Option<Volt>,
    stop_loop: StopLoop,
    proof: SupplyProof,
    hold: HoldWatch,
    protection: Protection,
    heard: Elapsed,
    last_tick: Option<Ticks>,
    next_sample: Ticks,
    events: Deque<Event, 16>,
}

impl Rig {
    /// A rig after reset: disarmed, at minimum.
    #[must_use]
    pub fn new(config: Config) -> Self {
        Self::with_settings(config.clone(), RigConfig::of(&config))
    }

    /// A rig after reset with `settings` in force in place of what `factory` says.
    #[must_use]
    pub fn with_settings(factory: Config, settings: RigConfig) -> Self {
        let config = settings.apply(&factory);
        let untared = config.calibration();
        Self {
            factory,
            settings,
            store: false,
            trial: None,
            burst: None,
            incoming: Incoming::default(),
            revision: 0,
            live_since: None,
            bank: CaptureBank::new(&config),
            cross: CrossChecks::new(&config),
            calibration: untared,
            untared,
            state: RigState::Disarmed,
            faults: FaultSet::NONE,
            standing: FaultSet::NONE,
            course: Course::MINIMUM,
            started: Elapsed::since(Ticks(0)),
            began: Ticks(0),
            track: Track::new(),
            codes: [AdcCode::default(); ADC_CHANNELS],
            entered: Elapsed::since(Ticks(0)),
            setting: PulseWidth::MIN,
            last_live: None,
            blocks: [AdcBlock::default(); ADC_CHANNELS],
            supply: None,
            stop_loop: StopLoop::default(),
            proof: SupplyProof::default(),
            hold: HoldWatch::default(),
            protection: Protection::default(),
            heard: Elapsed::since(Ticks(0)),
            last_tick: None,
            next_sample: Ticks(0),
            events: Deque::new(),
            config,
        }
    }

    /// State of the arming machine.
    #[must_use]
    pub fn state(&self) -> RigState {
        self.state
    }

    /// A pulse above minimum is being given.
    #[must_use]
    pub fn is_live(&self) -> bool {
        self.live_since.is_some()
    }

    /// Latched faults.
    #[must_use]
    pub fn faults(&self) -> FaultSet {
        self.faults
    }

    /// Latches a fault that the board found at its start. No command clears it: the rig stays at minimum until a reset finds it gone.
    pub fn stand(&mut self, fault: Fault) {
        self.standing = self.standing.with(fault);
        self.latch(Ticks(0), self.standing);
    }

    /// What turns the raw codes into values, with the present tare in it.
    #[must_use]
    pub fn calibration(&self) -> Calibration {
        self.calibration
    }

    /// The settings in force, the load cell's scale included.
    #[must_use]
    pub fn settings(&self) -> RigConfig {
        self.settings
    }

    /// Puts `settings` in force. The tare is gone when the scale of the load cell changes.
    pub(crate) fn put_in_force(&mut self, settings: RigConfig) {
        let config = settings.apply(&self.factory);
        if config.marks != self.config.marks {
            self.bank.refit(&config);
        }
        if (config.esc_telemetry, config.back_emf) != (self.config.esc_telemetry, self.config.back_emf) {
            self.cross.refit(&config);
        }
        let untared = config.calibration();
        if untared != self.untared {
            self.untared = untared;
            self.calibration = untared;
        }
        self.settings = settings;
        self.config = config;
        self.revision = self.revision.wrapping_add(1);
    }

    /// Another number once another configuration is in force.
    #[must_use]
    pub fn revision(&self) -> u8 {
        self.revision
    }

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Who speaks, after a reset of the given cause.
    #[must_use]
    pub fn hello(&self, reset_cause: u8) -> Hello {
        Hello {
            board: BoardId::Rig,
            firmware: VERSION,
            core_hz: self.config.core_hz,
            reset_cause,
            present: self.fitted() | self.cross.fitted(),
            analogue: self.config.fitted.iter().rev().fold(0, |mask, fitted| mask << 1 | u8::from(*fitted)),
            config: self.settings.digest(),
        }
    }

    /// Speed sensors that are fitted, a bit a capture channel.
    #[must_use]
    pub fn fitted(&self) -> u8 {
        self.config.marks.iter().rev().fold(0, |mask, marks| mask << 1 | u8::from(*marks > 0))
    }

    /// One control tick.
    pub fn tick(&mut self, inputs: &Inputs<'_>) -> Outputs {
        let now = inputs.now;
        let tick_ms = self.advance(now);
        // only a rig that is disarmed may be held up: it gives minimum pulses whatever happens
        let tick_ms = if inputs.paused && self.state == RigState::Disarmed { 1 } else { tick_ms };
        if inputs.command.is_some() {
            self.heard = Elapsed::since(now);
        }
        if inputs.line.replayed > 0 {
            self.tell(Event::Refused(Refusals(Refusals::REPLAYED)));
        }
        self.bank.take(now, &inputs.edges, &inputs.over_capture);
        if let Some(verdict) = self.cross.take(now, &inputs.beside) {
            self.tell(Event::EscTelemetry { verdict, at: now });
        }
        for (whole, part) in self.blocks.iter_mut().zip(inputs.adc) {
            whole.add(part);
        }
        self.protect(now, tick_ms, inputs);
        self.watch_stop(now, inputs.stop_input);
        if let Some(command) = inputs.command {
            self.obey(now, &command);
        }
        if self.is_overdue(now) {
            self.apply(now, ArmingEvent::TimeOut, Refusals::default());
        }
        if let Some(answer) = self.unspoken(now) {
            self.apply(now, answer, Refusals::default());
        }
        let pulse = self.drive(now, tick_ms);
        let sample = (now >= self.next_sample).then(|| self.sample(now, pulse));
        let store = core::mem::take(&mut self.store);
        let (trial, burst) = (self.trial.take(), self.burst.take());
        let ask_esc = self.cross.asks(now);
        Outputs { pulse, sample, event: self.events.pop_front(), store, trial, burst, ask_esc }
    }

    /// The state has lasted longer than it may: since it was entered, or at maximum since the supply came on.
    fn is_overdue(&mut self, now: Ticks) -> bool {
        let (times, per_ms) = (self.config.times, self.config.ticks_per_ms());
        let held = time_out(self.state, &times).is_some_and(|limit| self.entered.ms(now, per_ms) >= u64::from(limit));
        let at_max = self.state == RigState::CalibrateHoldMax;
        held || (at_max && self.hold.powered_ms(now, per_ms) >= u64::from(times.max_powered_ms))
    }

    /// The answer that this ESC does not give, where it is due: nobody has to type a beep that never came.
    fn unspoken(&mut self, now: Ticks) -> Option<ArmingEvent> {
        match (self.config.answers, self.state) {
            (Answers::LongReady | Answers::Silent { .. }, RigState::ArmCells) => Some(ArmingEvent::Cells),
            (Answers::Silent { .. }, RigState::ArmReady) => Some(ArmingEvent::Ready),
            (Answers::Silent { hold_ms }, RigState::ArmHoldMin) => {
                let [_, _, _, measured, _] = self.config.fitted;
                let per_ms = self.config.ticks_per_ms();
                let held = self.entered.ms(now, per_ms).min(if measured { self.proof.on_ms().into() } else { u64::MAX });
                (held >= u64::from(hold_ms)).then_some(ArmingEvent::Long)
            }
            _ => None,
        }
    }

    /// Notes the tick; milliseconds since the one before, rounded.
    fn advance(&mut self, now: Ticks) -> u32 {
        let per_ms = u64::from(self.config.ticks_per_ms());
        let Some(before) = self.last_tick.replace(now) else {
            self.entered = Elapsed::since(now);
            self.heard = Elapsed::since(now);
            // half a tick early, so that a tick that comes a few cycles late or early takes the sample that is its own
            self.next_sample = Ticks((now.0 + self.config.log_period().0).saturating_sub(per_ms / 2));
            return 1;
        };
        let passed = now.since(before).0 + per_ms / 2;
        if (per_ms..2 * per_ms).contains(&passed) {
            return 1; // as always, and without a division
        }
        let passed = passed.checked_div(per_ms).unwrap_or(u64::MAX);
        u32::try_from(passed).unwrap_or(u32::MAX)
    }

    pub(crate) fn ms_since(&self, now: Ticks, then: Ticks) -> u64 {
        now.since(then).0.checked_div(u64::from(self.config.ticks_per_ms())).unwrap_or(u64::MAX)
    }

    /// Value of an ADC channel over one tick, untared; none of a channel that is not fitted.
    fn value(&self, channel: usize, blocks: &[AdcBlock; ADC_CHANNELS]) -> Option<f32> {
        let scale = self.untared.adc.get(channel).filter(|_| self.config.fitted.get(channel) == Some(&true))?;
        Some((blocks.get(channel)?.mean()? - scale.zero) * scale.gain)
    }

    fn protect(&mut self, now: Ticks, tick_ms: u32, inputs: &Inputs<'_>) {
        let adc = inputs.adc;
        let top = self.config.converter.top();
        let mut ends = [AdcVerdict::Nominal; ADC_CHANNELS];
        for (((end, block), live), fitted) in ends.iter_mut().zip(adc).zip(self.config.live_zero).zip(self.config.fitted) {
            *end = if fitted { block.verdict(top, live) } else { AdcVerdict::Absent };
        }
        let [end, rest @ ..] = &ends;
        let missing = ends.contains(&AdcVerdict::Missing) || rest.iter().any(|end| end.is_stuck());
        // a wire whose zero is alive and that reads none is broken: it says nothing of the supply, least of all that it is off
        let [_, _, _, supply_end, _] = ends;
        let voltage = self.value(3, adc).map(Volt).filter(|_| supply_end != AdcVerdict::Open);
        self.supply = voltage.or(self.supply);
        let powered = self.config.powered;
        self.proof.take(voltage, powered, tick_ms, self.config.limits.analogue_ms);
        if self.state == RigState::CalibrateHoldMax {
            self.hold.take(now, self.bank.taken(), voltage.is_some_and(|v| v >= powered));
        }
        let readings = Readings {
            speed: self.judged_speed(now),
            stirs: self.hold.stirs(),
            current: self.value(2, adc).map(Ampere),
            voltage,
            load: self.value(0, adc).map(Newton),
            torque: self.value(1, adc).map(NewtonMetre),
            temperature: self.value(4, adc).map(Celsius),
            driven: self.live_since.is_some_and(|since| now.since(since) >= START),
            load_saturated: end.is_stuck(),
            disagreeing: self.bank.flagged(),
            // a rotor that coasts to rest falls silent channel by channel: judged under throttle only
            lost: if self.setting.is_live() { self.bank.lost(now) } else { 0 },
            adc_missing: missing,
            damaged: inputs.line.damaged,
            replayed: inputs.line.replayed,
            brown_out: inputs.brown_out,
            silence_ms: u32::try_from(self.heard.ms(now, self.config.ticks_per_ms())).unwrap_or(u32::MAX),
            tick_ms,
        };
        let tripped = self.protection.check(self.state, &readings, &self.config.limits);
        if !tripped.is_empty() {
            self.latch(now, tripped);
            self.apply(now, ArmingEvent::Trip, Refusals::default());
        }
    }

    /// Speed that limits are judged by. No edges at all: the rotor stands, where a sensor would see it turn. Without any, what the back-EMF
    /// meter sees.
    fn judged_speed(&self, now: Ticks) -> Option<RevPerMin> {
        if self.bank.fitted() == 0 {
            return self.cross.speed(now);
        }
        Some(self.bank.judged_speed(now).unwrap_or(RevPerMin(0.0)))
    }

    /// What the ESC's telemetry line has heard.
    #[must_use]
    pub fn esc_counts(&self) -> EscCounts {
        self.cross.counts()
    }

    pub(crate) fn latch(&mut self, now: Ticks, faults: FaultSet) {
        let all = FaultSet(self.faults.0 | faults.0);
        if all != self.faults {
            self.faults = all;
            self.tell(Event::Faults { faults: all, at: now });
        }
    }

    pub(crate) fn tell(&mut self, event: Event) {
        // Full only when sixteen ticks could not drain what they caused; the newest is then the least useful.
        let _ = self.events.push_back(event);
    }

    pub(crate) fn stop(&mut self, now: Ticks) {
        self.latch(now, FaultSet::NONE.with(Fault::OperatorStop));
        self.apply(now, ArmingEvent::Stop, Refusals::default());
    }

    /// An open stop loop stops. One that was never closed since the reset keeps the rig as the reset left it, disarmed.
    fn watch_stop(&mut self, now: Ticks, open: bool) {
        if open != self.stop_loop.open {
            self.tell(Event::StopLoop { open, at: now });
        }
        self.stop_loop = StopLoop { open, known: self.stop_loop.known || !open };
        if open && self.stop_loop.known {
            self.stop(now);
        }
    }

    /// Everything that speaks against a command at this moment.
    pub(crate) fn objections(&self, now: Ticks) -> Objections {
        let low_ms = u64::from(self.config.times.low_interval_ms);
        let [_, _, _, live_supply, _] = self.config.live_zero;
        let [_, _, current, _, _] = self.config.fitted;
        let recent = self.last_live.is_some_and(|at| self.ms_since(now, at) < low_ms);
        Refusals::default()
            .with_if(Refusals::FAULT_LATCHED, !self.faults.is_empty())
            .with_if(Refusals::THROTTLE_NOT_LOW, self.setting.is_live())
            .with_if(Refusals::NO_LOW_INTERVAL, recent)
            .with_if(Refusals::ESC_POWERED, self.supply.is_some_and(|v| v >= self.config.powered))
            .with_if(Refusals::SUPPLY_UNPROVEN, !self.proof.is_off(self.config.limits.analogue_ms, live_supply))
            .with_if(Refusals::ROTOR_TURNING, self.bank.is_turning())
            .with_if(Refusals::NO_WITNESS, self.bank.fitted() == 0 && !current)
            .with_if(Refusals::STOP_OPEN, self.stop_loop.open)
            .with_if(Refusals::NO_RANGE, self.config.output.is_digital())
    }

    /// Puts `event` to the arming machine and does what follows from it.
    pub(crate) fn apply(&mut self, now: Ticks, event: ArmingEvent, objections: Objections) -> Outcome {
        let from = self.state;
        let answer = step(from, event, objections);
        if let Outcome::To(to) = answer {
            if to == RigState::Faulted
                && let Some(fault) = event.fault()
            {
                self.latch(now, FaultSet::NONE.with(fault));
            }
            if event == ArmingEvent::Clear {
                self.faults = self.standing;
            }
            if to != RigState::Running {
                self.course = Course::MINIMUM;
                self.track.stop();
                self.setting = PulseWidth::MIN;
            }
            if to != from {
                self.state = to;
                self.hold = HoldWatch::default();
                self.entered = Elapsed::since(now);
                self.tell(Event::State { from, to, at: now });
            }
        }
        answer
    }

    fn sample(&mut self, now: Ticks, pulse: PulseWidth) -> RigSample {
        let period = self.config.log_period().0;
        let behind = now.since(self.next_sample).0.checked_div(period).unwrap_or(0);
        self.next_sample = Ticks(self.next_sample.0 + (behind + 1) * period);
        let top = self.config.converter.top();
        let Config { live_zero, fitted, .. } = self.config;
        for (((code, block), live), fitted) in self.codes.iter_mut().zip(&mut self.blocks).zip(live_zero).zip(fitted) {
            let block = core::mem::take(block);
            *code = if fitted { block.code(top, live) } else { ABSENT };
        }
        let rpm = self.bank.sample(now);
        let (esc, back_emf) = self.cross.sample(now, &self.bank);
        RigSample { at: now, pulse, state: self.state, faults: self.faults, rpm, adc: self.codes, esc, back_emf }
    }
}

/// What an analogue channel reads that is not fitted.
const ABSENT: AdcCode = AdcCode { sum: 0, count: 0, rms_q8: 0, verdict: AdcVerdict::Absent };
/// How long the throttle must be open before speed and current have to be above their lower limits.
const START: Ticks = Ticks::from_ms(2000);

/// Firmware version from the package.
const VERSION: [u8; 3] =
    frame::version::of([env!("CARGO_PKG_VERSION_MAJOR"), env!("CARGO_PKG_VERSION_MINOR"), env!("CARGO_PKG_VERSION_PATCH")]);
