//! What host and hands do in a native flight.
//!
//! What it is: the way to the plan's phase, the mishap itself, and what is asked for afterwards.
//! What can go wrong: a phase that is not reached in time ends the flight as a failure.
//! Units: ms since power-up.
//! Reference: specification `rig.md`, "ESC pulse and arming"; Beharie 2013, Figure 3.10.

use super::flight::{Away, Flight, OUTAGE_MS, WATCHDOG_MS};
use super::host::arming_beep;
use super::{Answer, Course, Mishap, PING_MS, Phase, Plan, Request, Rule, by_hand};
use frame::message::{Beep, Command};
use frame::rig::RigState;
use frame::units::PulseWidth;

impl Flight {
    /// What the host sends on its way to the plan's phase.
    pub(super) fn approach(&mut self) -> Vec<u8> {
        let ms = self.ms;
        if !self.queue.is_empty() {
            let command = self.queue.remove(0);
            return self.host.frame(ms, command);
        }
        let plan = self.plan;
        let state = self.host.state;
        let beep = self.bench.beep().map(|(_, beep)| beep);
        let there = match plan.phase {
            Phase::Start => true,
            Phase::Resting => ms >= 100,
            Phase::Arming => state == RigState::ArmHoldMin,
            Phase::Armed => state == RigState::Armed,
            Phase::Running | Phase::Moving => self.board.rig().state() == RigState::Running,
            Phase::Holding => state == RigState::CalibrateHoldMax,
        };
        if there {
            self.reached.get_or_insert(ms);
        }
        if let Some(reached) = self.reached {
            return self.next_level(ms - reached);
        }
        if plan.phase == Phase::Holding {
            return match ms {
                20 | 160 => {
                    self.bench.set_power(ms == 20);
                    Vec::new()
                }
                300 => self.host.frame(ms, Request::Calibrate.command()),
                _ => self.ping(),
            };
        }
        match state {
            RigState::Disarmed if ms == 50 && plan.phase != Phase::Resting => self.host.frame(ms, Command::Arm),
            RigState::ArmHoldMin if plan.dialogue && ms == 200 => {
                self.bench.set_power(true);
                Vec::new()
            }
            RigState::Armed if self.host.answered != Some(state) => {
                self.host.answered = Some(state);
                let plan = if self.defenceless && plan.mishap == Mishap::StreamDry {
                    Plan { course: Course::Level, ..plan }
                } else {
                    plan
                };
                self.queue = plan.beginning();
                Vec::new()
            }
            _ => match beep.or(self.answer(state)) {
                Some(beep) => self.host.frame(ms, Command::Beep(beep)),
                None => self.ping(),
            },
        }
    }

    /// The beep that an ESC which is ready already does not give, once a state.
    fn answer(&mut self, state: RigState) -> Option<Beep> {
        if self.plan.dialogue || self.host.answered == Some(state) {
            return None;
        }
        self.host.answered = Some(state);
        arming_beep(state, self.plan.config.esc.answers)
    }

    fn next_level(&mut self, since: u64) -> Vec<u8> {
        match self.plan.next_level(since) {
            Some(level) if self.host.state == RigState::Running => self.host.frame(self.ms, level),
            _ => self.ping(),
        }
    }

    pub(super) fn ping(&mut self) -> Vec<u8> {
        let silent = self.ms - self.host.sent_ms;
        let waits = if self.struck.is_some() { self.injury.host_waits(silent) } else { silent < PING_MS };
        if waits { Vec::new() } else { self.host.frame(self.ms, Command::Ping) }
    }

    /// The mishap comes: what hands, line and supply do about it, and what the host sends with it.
    pub(super) fn strike(&mut self) -> Vec<u8> {
        self.struck = Some(self.ms);
        self.host.refused = false;
        self.host.verdicts.clear();
        self.from = self.host.state;
        self.bench.beep();
        match self.plan.mishap {
            Mishap::Replay => return self.host.last_frame.clone(),
            Mishap::Asked(request) => return self.host.frame(self.ms, request.command()),
            Mishap::EscNoSignal => return self.host.frame(self.ms, Command::Beep(Beep::NoSignal)),
            Mishap::EscFails => return self.host.frame(self.ms, Command::Beep(Beep::SelfTestFailed)),
            Mishap::Overspeed => return self.host.frame(self.ms, Command::SetPulse(PulseWidth::from_us(1950))),
            Mishap::PowerLoss | Mishap::SaveCut => self.reset(self.ms + OUTAGE_MS),
            Mishap::ResetKey | Mishap::Panic | Mishap::HardFault | Mishap::CrystalFails => self.reset(self.ms),
            Mishap::LateTick { ms } => self.skip_ticks = u64::from(ms) - 1,
            Mishap::Hang => {
                let until = if self.defenceless { u64::MAX } else { self.ms + WATCHDOG_MS };
                self.away = Some(Away::Hangs { until });
            }
            _ => by_hand(&self.plan, &mut self.bench),
        }
        Vec::new()
    }

    /// What the host sends from the mishap on, `end` being the end of the flight.
    pub(super) fn aftermath(&mut self, since: u64, end: u64) -> Vec<u8> {
        let ms = self.ms;
        if self.plan.phase == Phase::Start {
            return self.tries(ms);
        }
        let stops = matches!(Rule::of(&self.plan, 3000.0, 3000.0).answer, Answer::Stops(_) | Answer::Resets);
        let mute = matches!(self.plan.mishap, Mishap::Silence | Mishap::LateHost);
        if stops && !mute {
            // whoever asks gets nothing
            match end - ms {
                120 => return self.host.frame(ms, Command::SetPulse(PulseWidth::from_us(1500))),
                90 => return self.host.frame(ms, Command::RunSchedule),
                _ => {}
            }
        }
        let reached = self.reached.unwrap_or(ms);
        if self.plan.course == Course::Steps && !stops {
            self.next_level(since + self.struck.unwrap_or(ms) - reached)
        } else {
            self.ping()
        }
    }

    /// A host that tries to arm and to run a board that was started with something wrong.
    fn tries(&mut self, ms: u64) -> Vec<u8> {
        let calibrates = self.plan.mishap == Mishap::OpenSense;
        if calibrates && matches!(ms, 20 | 160) {
            self.bench.set_power(ms == 20); // on and off, which nobody sees
        }
        let command = match ms {
            60 if !calibrates => Command::Arm,
            300 if calibrates => Request::Calibrate.command(),
            100 | 200 | 300 | 400 if self.plan.mishap != Mishap::EscMute => {
                match arming_beep(self.host.state, self.plan.config.esc.answers) {
                    Some(beep) => Command::Beep(beep),
                    None => Command::SetPulse(PulseWidth::from_us(1500)),
                }
            }
            600 => Command::SetPulse(PulseWidth::from_us(1500)),
            _ => return self.ping(),
        };
        self.host.frame(ms, command)
    }
}
