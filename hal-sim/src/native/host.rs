//! The host's side of a native run.
//!
//! What it is: what an operator and a logging program do, as phases: identify, arm (throw the power switch, forward the beeps
//! that are heard), settle, tare, upload, run, record.
//! What can go wrong: see [`super::SimError`].
//! Units: ms of simulated time.
//! Reference: Beharie 2013 Figure 3.10 and Appendix C; specification `rig.md`, "ESC pulse and arming".

use super::SimError;
use super::desk::RigDesk;
use crate::scenario::{Scenario, Schedule, pulse_width};
use frame::calibration::Calibration;
use frame::message::{Command, Event, Hello, MAX_UPLOAD, Message};
use frame::rig::{RigSample, RigState};
use frame::units::Ticks;
use frame::wire::{Decoder, Encoder};
use schedule::Player;
use std::collections::VecDeque;

/// What the host is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    Identifying,
    Arming,
    Settling,
    Taring,
    Uploading,
    RestBefore,
    Running,
    RestAfter,
    Done,
}

impl Phase {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Identifying => "identifying itself",
            Self::Arming => "arming",
            Self::Settling => "settling",
            Self::Taring => "taring",
            Self::Uploading => "taking the schedule",
            Self::RestBefore => "resting before the schedule",
            Self::Running => "running",
            Self::RestAfter => "resting after the schedule",
            Self::Done => "done",
        }
    }
}

/// Time between "minimum pulses are there" and the power switch, ms.
const SWITCH_AFTER_MS: u64 = 300;
/// Quiet time before the tare, ms; longer than the longest logging interval.
const SETTLE_MS: u64 = 2500;
/// Longest silence of the host, ms.
const PING_MS: u64 = 200;

/// State of the host.
pub(super) struct Host {
    pub(super) encoder: Encoder,
    pub(super) decoder: Decoder,
    outbox: VecDeque<Command>,
    waiting: Option<Command>,
    pub(super) phase: Phase,
    since_ms: u64,
    sent_ms: u64,
    schedule: Vec<Command>,
    /// Plays what the board does not know by itself.
    player: Option<Player>,
    rest_ms: u64,
    pub(super) hello: Option<Hello>,
    pub(super) calibration: Option<Calibration>,
    pub(super) state: RigState,
    state_ms: u64,
    pub(super) start: Option<Ticks>,
    pub(super) samples: Vec<RigSample>,
    pub(super) events: Vec<Event>,
    /// The scenario schedules faults: what the board does about them is recorded, not judged.
    tolerant: bool,
    faulted: bool,
}

impl Host {
    pub(super) fn new(scenario: &Scenario) -> Self {
        Self {
            encoder: Encoder::default(),
            decoder: Decoder::default(),
            outbox: VecDeque::from([Command::Identify]),
            waiting: None,
            phase: Phase::Identifying,
            since_ms: 0,
            sent_ms: 0,
            schedule: commands(&scenario.schedule),
            player: scenario.schedule.plan().map(Player::new),
            rest_ms: (scenario.rest_s * 1000.0) as u64,
            hello: None,
            calibration: None,
            state: RigState::Disarmed,
            state_ms: 0,
            start: None,
            samples: Vec::new(),
            events: Vec::new(),
            tolerant: !scenario.faults.is_empty(),
            faulted: false,
        }
    }

    fn enter(&mut self, phase: Phase, ms: u64) {
        self.phase = phase;
        self.since_ms = ms;
    }

    /// The next command, when one is due. One command is answered before the next is sent.
    pub(super) fn send(&mut self, ms: u64) -> Option<Command> {
        if self.waiting.is_some() {
            return None;
        }
        let plays = matches!(self.phase, Phase::Uploading | Phase::RestBefore | Phase::Running);
        if let Some(command) = self.player.as_mut().filter(|_| plays).and_then(|player| player.command(ms)) {
            self.sent_ms = ms;
            return Some(command);
        }
        let command = match self.outbox.pop_front() {
            Some(command) => command,
            None if ms >= self.sent_ms + PING_MS => Command::Ping,
            None => return None,
        };
        self.sent_ms = ms;
        let answered = !matches!(command, Command::Ping | Command::Identify | Command::Beep(_));
        self.waiting = answered.then_some(command);
        Some(command)
    }

    /// Takes a message of the board.
    pub(super) fn take(&mut self, message: Message, ms: u64) -> Result<(), SimError> {
        if let Some(player) = &mut self.player {
            player.take(&message);
            if let Some(reason) = player.failure() {
                return Err(SimError::Schedule { reason: reason.to_owned() });
            }
        }
        match message {
            Message::Hello(hello) => self.hello = Some(hello),
            // a board that was reset in mid-run has lost its tare: the run is read with the one that it began with
            Message::Calibration(calibration) if self.start.is_none() => self.calibration = Some(calibration),
            Message::Rig(sample) => {
                if matches!(self.phase, Phase::RestBefore | Phase::Running | Phase::RestAfter) {
                    self.start.get_or_insert(sample.at);
                    self.samples.push(sample);
                }
            }
            Message::Event(event) => {
                self.events.push(event);
                match event {
                    Event::State { to, .. } => {
                        self.state = to;
                        self.state_ms = ms;
                    }
                    Event::Accepted => self.waiting = None,
                    Event::Refused(_) | Event::Faults { .. } if self.tolerant && self.start.is_some() => self.faulted = true,
                    Event::Refused(reasons) => {
                        let command = Box::new(self.waiting.unwrap_or(Command::Ping));
                        return Err(SimError::Refused { command, phase: self.phase.name(), reasons });
                    }
                    Event::Faults { faults, at } => {
                        return Err(SimError::Faulted { faults, phase: self.phase.name(), at_s: at.as_s() });
                    }
                    Event::ScheduleDone { .. } if self.phase == Phase::Running => self.enter(Phase::RestAfter, ms),
                    _ => {} // the rest tells of settings and masses, which this host leaves alone
                }
            }
            _ => {} // of the IMU board, or its own health
        }
        Ok(())
    }

    /// A run that its faults have stopped is recorded for as long as its schedule would have taken.
    pub(super) fn give_up(&mut self, ms: u64, over: bool) {
        if over && self.tolerant && self.phase != Phase::Done {
            self.enter(Phase::Done, ms);
        }
    }

    /// Goes on to the next phase when this one has come to its end.
    pub(super) fn step(&mut self, ms: u64, desk: &mut RigDesk) {
        let age = ms - self.since_ms;
        let idle = self.outbox.is_empty() && self.waiting.is_none();
        while let Some(beep) = desk.beep() {
            self.outbox.push_back(Command::Beep(beep));
        }
        match self.phase {
            Phase::Identifying if self.hello.is_some() && self.calibration.is_some() && age > 100 => {
                self.outbox.push_back(Command::Arm);
                self.enter(Phase::Arming, ms);
            }
            Phase::Arming => {
                if self.state == RigState::ArmHoldMin && ms == self.state_ms + SWITCH_AFTER_MS {
                    desk.power(true);
                }
                if self.state == RigState::Armed {
                    self.enter(Phase::Settling, ms);
                }
            }
            Phase::Settling if age >= SETTLE_MS => {
                self.outbox.push_back(Command::Tare);
                self.calibration = None;
                self.enter(Phase::Taring, ms);
            }
            Phase::Taring if idle && self.calibration.is_some() => {
                let uploads = self.schedule.len() - 1;
                self.outbox.extend(self.schedule.drain(..uploads));
                self.enter(Phase::Uploading, ms);
            }
            Phase::Uploading if idle && self.player.as_ref().is_none_or(Player::is_ready) => self.enter(Phase::RestBefore, ms),
            Phase::RestBefore if age >= self.rest_ms => {
                self.outbox.extend(self.schedule.drain(..));
                self.enter(Phase::Running, ms);
            }
            Phase::RestAfter if age >= self.rest_ms => self.enter(Phase::Done, ms),
            _ => {}
        }
    }
}

/// The commands that make the rig follow a schedule; the last one starts it.
fn commands(schedule: &Schedule) -> Vec<Command> {
    let ms = |s: f64| (s * 1000.0 + 0.5) as u32;
    let staircase = |step_us, hold_s, top_us, down| {
        vec![Command::RunStaircase { step: pulse_width(step_us), hold_ms: ms(hold_s), top: pulse_width(top_us), down }]
    };
    match schedule {
        Schedule::Staircase { step_us, hold_s, top_us } => staircase(*step_us, *hold_s, *top_us, false),
        Schedule::UpDown { step_us, hold_s, top_us } => staircase(*step_us, *hold_s, *top_us, true),
        Schedule::Chirp(chirp) => {
            let mhz = |hz: f64| (hz * 1000.0).round() as u32;
            let (centre, amplitude) = (pulse_width(chirp.centre_us), pulse_width(chirp.amplitude_us));
            let (from_millihertz, to_millihertz, length_ms) = (mhz(chirp.from_hz), mhz(chirp.to_hz), ms(chirp.length_s));
            vec![Command::RunChirp { centre, amplitude, from_millihertz, to_millihertz, length_ms }]
        }
        Schedule::Replay(_) | Schedule::File { .. } => vec![Command::RunSchedule],
        Schedule::Steps { steps } if steps.len() > MAX_UPLOAD => vec![Command::RunSchedule],
        Schedule::Steps { steps } => {
            let mut list: Vec<_> = steps
                .iter()
                .enumerate()
                .map(|(i, s)| Command::ScheduleStep {
                    index: i as u8,
                    pulse: pulse_width(s.pulse_us),
                    hold_ms: ms(s.hold_s),
                    ramp: s.ramp,
                })
                .collect();
            list.push(Command::RunSchedule);
            list
        }
    }
}
