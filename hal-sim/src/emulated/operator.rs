//! An operator who arms the rig, lets it follow a schedule and stops it.
//!
//! What it is: the host's side of the thesis' normal start (Figure 3.10): ask for arming, throw the power switch once
//! minimum pulses are there, pass on each beep that the ESC gives, then send the schedule command by command.
//! What can go wrong: a refusal or a fault is kept in [`ArmAndRun::events`] and not answered; the run then stays where it is
//! and a test sees it.
//! Units: ms since power-up of the board.
//! Reference: Beharie 2013 Figure 3.10; specification `rig.md`, "ESC pulse and arming".

use super::rig::{Action, Heard, Operator};
use frame::calibration::Calibration;
use frame::message::{Command, Event, Hello, Message};
use frame::rig::{RigSample, RigState};
use std::collections::VecDeque;

/// Time from power-up until the operator asks for arming, ms.
const ARM_AT: u64 = 150;
/// Time between minimum pulses and the power switch, ms.
const SWITCH_AFTER: u64 = 200;
/// Time between "ready" and the schedule, ms.
const SCHEDULE_AFTER: u64 = 600;
/// Longest silence, ms.
const PING: u64 = 200;

/// Arms and runs; keeps everything that the board said.
#[derive(Debug, Default)]
pub struct ArmAndRun {
    schedule: VecDeque<Command>,
    stop_after: Option<u64>,
    sent_at: u64,
    waiting: bool,
    /// State of the arming machine as last told, and when that was heard, ms.
    pub state: (RigState, u64),
    /// When the last command of the schedule was accepted, ms.
    pub started: Option<u64>,
    /// When the stop command was sent, ms.
    pub stopped: Option<u64>,
    /// Who spoke.
    pub hello: Option<Hello>,
    /// Calibration as last told.
    pub calibration: Option<Calibration>,
    /// Every sample.
    pub samples: Vec<RigSample>,
    /// Every event with the time it was heard, ms.
    pub events: Vec<(u64, Event)>,
}

impl ArmAndRun {
    /// Follows `schedule` (the last command starts it); `stop_after` ms after its start the operator sends a stop.
    #[must_use]
    pub fn new(schedule: impl IntoIterator<Item = Command>, stop_after: Option<u64>) -> Self {
        Self { schedule: schedule.into_iter().collect(), stop_after, ..Self::default() }
    }

    fn take(&mut self, ms: u64, message: Message) {
        match message {
            Message::Hello(hello) => self.hello = Some(hello),
            Message::Calibration(calibration) => self.calibration = Some(calibration),
            Message::Rig(sample) => self.samples.push(sample),
            Message::Event(event) => {
                self.events.push((ms, event));
                match event {
                    Event::State { to, .. } => self.state = (to, ms),
                    Event::Accepted => {
                        let last = self.waiting && self.schedule.is_empty();
                        self.waiting = false;
                        if last && self.started.is_none() && self.sent_at > ARM_AT {
                            self.started = Some(ms);
                        }
                    }
                    _ => {}
                }
            }
            _ => {} // of the IMU board, or its own health
        }
    }
}

impl Operator for ArmAndRun {
    fn millisecond(&mut self, ms: u64, heard: &[Heard], actions: &mut Vec<Action>) {
        let mut send = |command: Command, at: &mut u64| {
            *at = ms;
            actions.push(Action::Send(command));
        };
        for heard in heard {
            match heard {
                Heard::Board(message) => self.take(ms, *message),
                Heard::Esc(beep) => send(Command::Beep(*beep), &mut self.sent_at),
            }
        }
        let (state, since) = self.state;
        let age = ms - since;
        let was_running = self.started;
        match state {
            RigState::Disarmed if ms == ARM_AT => {
                send(Command::Identify, &mut self.sent_at);
                send(Command::Arm, &mut self.sent_at);
            }
            RigState::Armed | RigState::Running if age >= SCHEDULE_AFTER && !self.waiting => {
                if let Some(command) = self.schedule.pop_front() {
                    send(command, &mut self.sent_at);
                    self.waiting = true;
                }
            }
            _ => {}
        }
        if let (Some(started), Some(after), None) = (was_running, self.stop_after, self.stopped)
            && ms >= started + after
        {
            send(Command::Stop, &mut self.sent_at);
            self.stopped = Some(ms);
        }
        if ms >= self.sent_at + PING {
            send(Command::Ping, &mut self.sent_at);
        }
        if state == RigState::ArmHoldMin && age == SWITCH_AFTER {
            actions.push(Action::Power(true));
        }
    }
}
