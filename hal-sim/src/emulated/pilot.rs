//! A plan of the fault campaign, flown on the flash image.
//!
//! What it is: an [`Operator`] that brings the rig to the plan's phase, lets the mishap come, and asks for throttle afterwards; and what was
//! seen, for [`judge`].
//! What can go wrong: a plan that never reaches its mishap is a failure.
//! Units: ms since power-up of the board.
//! Reference: specification `rig.md`, "Protection", "The simulator"; [`crate::fault::flight`] is the same natively.

use super::crystal::Quartz;
use super::machine::{EmulatedError, Machine};
use super::rig::{Action, Heard, Operator, RigRun, rig_on};
use crate::fault::{
    Answer, Failure, Injury, Mishap, Observed, PING_MS, Phase, Plan, REACTION_MS, Request, Rule, Survived, Wrong, arming_beep,
    judge,
};
use crate::native::Sectors;
use frame::message::{Beep, Command, Event, Message, SettingsNews};
use frame::rig::{CaptureVerdict, FaultSet, RigState};
use frame::units::PulseWidth;

/// How long the run is watched after the mishap has been noticed, ms.
const WATCH_MS: u64 = 140;
/// Longest time to the plan's phase, ms.
const REACH_LIMIT_MS: u64 = 1_800;
/// Longest time from a pulse that was begun, or a state that is on the line, to the next that shows it, ms.
const LAG_MS: f64 = 24.0;

/// Who flies a plan.
#[derive(Debug)]
struct Pilot {
    plan: Plan,
    /// Nothing is done to the pins.
    spared: bool,
    injury: Injury,
    state: RigState,
    /// States as they were told, with the time they were heard at.
    states: Vec<(u64, RigState)>,
    faults: FaultSet,
    answered: Option<RigState>,
    queue: Vec<Command>,
    sent: u64,
    reached: Option<u64>,
    struck: Option<u64>,
    strikes: bool,
    end: u64,
    from: RigState,
    refused: bool,
    ended: bool,
    rpm: f64,
    verdicts: Vec<[CaptureVerdict; 4]>,
    ms: u64,
}

impl Pilot {
    fn new(plan: &Plan, spared: bool) -> Self {
        Self {
            plan: *plan,
            spared,
            injury: Injury::new(plan),
            state: RigState::Disarmed,
            states: Vec::new(),
            faults: FaultSet::NONE,
            answered: None,
            queue: Vec::new(),
            sent: 0,
            reached: None,
            struck: None,
            strikes: false,
            end: REACH_LIMIT_MS,
            from: RigState::Disarmed,
            refused: false,
            ended: false,
            rpm: 0.0,
            verdicts: Vec::new(),
            ms: 0,
        }
    }

    fn enter(&mut self, state: RigState) {
        if state != self.state {
            self.states.push((self.ms, state));
        }
        self.state = state;
    }

    fn hear(&mut self, message: &Message) {
        match message {
            Message::Rig(sample) => {
                self.enter(sample.state);
                self.faults = FaultSet(self.faults.0 | sample.faults.0);
                if self.struck.is_some() {
                    self.verdicts.push(sample.rpm.map(|code| code.verdict));
                }
            }
            Message::Event(Event::State { to, .. }) => self.enter(*to),
            Message::Event(Event::Faults { faults, .. }) => self.faults = FaultSet(self.faults.0 | faults.0),
            Message::Event(Event::Refused(_)) => self.refused = true,
            Message::Event(Event::Panicked { .. } | Event::Crashed(_)) => self.ended = true,
            _ => {}
        }
    }

    /// What is done on the way to the plan's phase.
    fn approach(&mut self, actions: &mut Vec<Action>) {
        let (plan, ms, state) = (self.plan, self.ms, self.state);
        if !self.queue.is_empty() {
            actions.push(Action::Send(self.queue.remove(0)));
            return;
        }
        let there = match plan.phase {
            Phase::Start => true,
            Phase::Resting => ms >= 100,
            Phase::Arming => state == RigState::ArmHoldMin,
            Phase::Armed => state == RigState::Armed,
            Phase::Running | Phase::Moving => state == RigState::Running,
            Phase::Holding => state == RigState::CalibrateHoldMax,
        };
        if there {
            self.reached.get_or_insert(ms);
        }
        match (self.reached, plan.phase) {
            (Some(reached), _) => actions.extend(plan.next_level(ms - reached).map(Action::Send)),
            (None, Phase::Holding) => match ms {
                20 | 180 => actions.push(Action::Power(ms == 20)),
                340 => actions.push(Action::Send(Request::Calibrate.command())),
                _ => {}
            },
            (None, Phase::Resting) => {}
            (None, _) if ms == 60 => actions.push(Action::Send(Command::Arm)),
            (None, _) if self.answered != Some(state) => {
                self.answered = Some(state);
                match arming_beep(state, plan.config.esc.answers) {
                    Some(beep) => actions.push(Action::Send(Command::Beep(beep))),
                    None if state == RigState::Armed => self.queue = plan.beginning(),
                    None => {}
                }
            }
            _ => {}
        }
    }

    /// The mishap comes, with what the host sends.
    fn strike(&mut self, actions: &mut Vec<Action>) {
        let rule = Rule::of(&self.plan, self.rpm, 0.8 * self.rpm);
        self.struck = Some(self.ms);
        (self.strikes, self.refused, self.from) = (true, false, self.state);
        self.verdicts.clear();
        let sample = if rule.answer == Answer::Resets { u64::from(self.plan.config.log_period_ms) } else { 0 };
        self.end = self.ms + (rule.within_ms + REACTION_MS) as u64 + WATCH_MS + sample;
        actions.extend(match self.plan.mishap {
            Mishap::Asked(request) => Some(Action::Send(request.command())),
            Mishap::EscNoSignal => Some(Action::Send(Command::Beep(Beep::NoSignal))),
            Mishap::EscFails => Some(Action::Send(Command::Beep(Beep::SelfTestFailed))),
            Mishap::Overspeed => Some(Action::Send(Command::SetPulse(PulseWidth::from_us(1950)))),
            _ => None,
        });
    }

    /// What the host does from the mishap on.
    fn aftermath(&mut self, struck: u64, actions: &mut Vec<Action>) {
        let (plan, ms) = (self.plan, self.ms);
        if plan.phase == Phase::Start {
            self.tries(actions);
            return;
        }
        let stops = matches!(Rule::of(&plan, 3000.0, 3000.0).answer, Answer::Stops(_) | Answer::Resets);
        if stops && !matches!(plan.mishap, Mishap::Silence | Mishap::LateHost) {
            // whoever asks gets nothing
            match self.end - ms.min(self.end) {
                120 => actions.push(Action::Send(Command::SetPulse(PulseWidth::from_us(1500)))),
                90 => actions.push(Action::Send(Command::RunSchedule)),
                _ => {}
            }
        } else {
            let since = ms - self.reached.unwrap_or(struck);
            actions.extend(plan.next_level(since).filter(|_| self.state == RigState::Running).map(Action::Send));
        }
    }

    /// A host that tries to arm and to run a board that was started with something wrong.
    fn tries(&mut self, actions: &mut Vec<Action>) {
        let (ms, mishap) = (self.ms, self.plan.mishap);
        let calibrates = mishap == Mishap::OpenSense;
        actions.extend(match ms {
            20 | 180 if calibrates => Some(Action::Power(ms == 20)),
            340 if calibrates => Some(Action::Send(Request::Calibrate.command())),
            60 if !calibrates => Some(Action::Send(Command::Arm)),
            100 | 200 | 300 | 400 if mishap != Mishap::EscMute => Some(Action::Send(
                arming_beep(self.state, self.plan.config.esc.answers)
                    .map_or(Command::SetPulse(PulseWidth::from_us(1500)), Command::Beep),
            )),
            600 => Some(Action::Send(Command::SetPulse(PulseWidth::from_us(1500)))),
            _ => None,
        });
    }

    /// Whether the mishap is due.
    fn is_due(&self) -> bool {
        let plan = &self.plan;
        let after = if plan.mishap == Mishap::StreamDry { plan.stream_ms() - 4 } else { plan.after_ms };
        self.reached.is_some_and(|reached| self.ms >= reached + after) && self.queue.is_empty()
    }
}

impl Operator for Pilot {
    fn millisecond(&mut self, ms: u64, heard: &[Heard], actions: &mut Vec<Action>) {
        self.ms = ms;
        for heard in heard {
            if let Heard::Board(message) = heard {
                self.hear(message);
            }
        }
        if ms == 0 {
            let calibrates = self.plan.phase == Phase::Holding || self.plan.mishap == Mishap::OpenSense;
            actions.extend((!calibrates && self.plan.mishap != Mishap::EscMute).then_some(Action::EscReady));
            // the wire of the sense is off from the start
            actions.extend((self.plan.mishap == Mishap::OpenSense).then_some(Action::Plug { plug: 7, out: true }));
            if self.plan.phase == Phase::Start {
                self.reached = Some(0);
                self.strike(actions);
            }
        }
        match self.struck {
            Some(struck) => self.aftermath(struck, actions),
            None if self.is_due() => self.strike(actions),
            None => self.approach(actions),
        }
        let silent = ms - self.sent.min(ms);
        let waits = if self.struck.is_some() { self.injury.host_waits(silent) } else { silent < PING_MS };
        if actions.iter().any(|action| matches!(action, Action::Send(_))) {
            self.sent = ms;
        } else if !waits {
            self.sent = ms;
            actions.push(Action::Send(Command::Ping));
        }
    }

    fn strikes(&mut self) -> Option<Plan> {
        (std::mem::take(&mut self.strikes) && !self.spared).then_some(self.plan)
    }

    fn see(&mut self, truth: &crate::bench::Truth) {
        self.rpm = truth.plant.rpm;
    }

    fn is_over(&self) -> bool {
        self.ms >= self.end
    }
}

/// Flies a plan on the flash image and judges it.
///
/// # Errors
/// [`EmulatedError`] when there is no image or the emulator gives up; inside, what is wrong with the flight.
pub fn fly(plan: &Plan) -> Result<Result<Survived, Failure>, EmulatedError> {
    flown(plan, false)
}

/// The same without the mishap: a board that does not notice it. It shows that [`fly`] can fail.
///
/// # Errors
/// As [`fly`].
pub fn fly_spared(plan: &Plan) -> Result<Result<Survived, Failure>, EmulatedError> {
    flown(plan, true)
}

fn flown(plan: &Plan, spared: bool) -> Result<Result<Survived, Failure>, EmulatedError> {
    let mut sectors = Sectors::default();
    let saved = settings_store::save(&mut sectors, Sectors::RANGE, &plan.config);
    debug_assert_eq!(saved, SettingsNews::Saved, "the flash of a desk takes what is in range");
    let quartz = if plan.mishap == Mishap::CrystalDead { Quartz::Silent } else { Quartz::Good(8_000_000) };
    let machine = Machine::with(quartz)?.with_settings(sectors.bytes());
    let run = rig_on(machine, &plan.rig.scenario(plan.seed), Pilot::new(plan, spared), 20_000)?;
    let pilot = &run.operator;
    let moving = !matches!(plan.phase, Phase::Running | Phase::Moving) || rpm_at(&run, pilot.struck.unwrap_or(0)) > 500.0;
    let wrong = |wrong| Failure { plan: Box::new(*plan), wrong };
    if pilot.struck.is_none() || !moving {
        return Ok(Err(wrong(Wrong::NeverReached(pilot.state, pilot.faults))));
    }
    Ok(judge(plan, &seen(plan, &run)))
}

fn rpm_at(run: &RigRun<Pilot>, ms: u64) -> f64 {
    run.truth.iter().find(|(at, _)| *at >= ms * 1_000_000).map_or(0.0, |(_, truth)| truth.plant.rpm)
}

/// What a run showed.
fn seen(plan: &Plan, run: &RigRun<Pilot>) -> Observed {
    let pilot = &run.operator;
    let ms = |ns: u64| ns as f64 * 1.0e-6;
    let live: Vec<f64> = run.pulses.iter().filter(|p| p.width_ns > 1_000_000).map(|p| ms(p.at_ns)).collect();
    let mut struck = pilot.struck.unwrap_or(0) as f64;
    if plan.mishap == Mishap::Overspeed {
        // a limit that is crossed later begins to count when it is crossed
        let crossed = run.truth.iter().find(|(at, truth)| ms(*at) > struck && truth.plant.rpm > 4040.0);
        struck = crossed.map_or(struck, |(at, _)| ms(*at));
    }
    let last = live.last().copied().unwrap_or(0.0);
    let speeds = run.truth.iter().filter(|(at, _)| (struck..=last).contains(&ms(*at))).map(|(_, truth)| truth.plant.rpm);
    let rpm = rpm_at(run, struck as u64);
    let state_at = |at: f64| pilot.states.iter().rev().find(|(ms, _)| *ms as f64 <= at).map_or(RigState::Disarmed, |(_, s)| *s);
    let is_open = |at: f64| matches!(state_at(at), RigState::Running | RigState::CalibrateHoldMax);
    let end = ms(run.outcome.now_ns);
    let hang = if plan.mishap == Mishap::Hang { 38.0 } else { 0.0 };
    let back = struck + hang;
    Observed {
        struck,
        from: pilot.from,
        rpm,
        slowest: speeds.fold(rpm, f64::min),
        surprise: live.iter().copied().find(|at| !is_open(at - LAG_MS) && !is_open(at + LAG_MS)),
        live,
        faults: pilot.faults,
        state: pilot.state,
        back,
        train: run.pulses.iter().map(|p| ms(p.at_ns)).find(|at| *at > back),
        refused: pilot.refused,
        ended: pilot.ended,
        verdicts: pilot.verdicts.clone(),
        end,
    }
}
