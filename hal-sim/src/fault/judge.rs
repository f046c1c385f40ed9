//! What a flight showed, against its rule.
//!
//! What it is: [`judge`] sees a flight from outside: pulses on the ESC pin, decoded telemetry, and the state of the arming machine.
//! What can go wrong: see [`Wrong`].
//! Units: ms since power-up.
//! Reference: specification `rig.md`: minimum throttle, latched and named, first minimum pulse within 40 ms of a reset.

use super::{Answer, Mishap, Phase, Plan, REACTION_MS, Rule};
use frame::rig::{CaptureVerdict, Fault, FaultSet, RigState};

/// Longest time between two pulses of a train that goes on, ms.
const FRAME_MS: f64 = 21.0;

/// What a flight showed.
#[derive(Debug, Clone, PartialEq)]
pub struct Observed {
    /// When the mishap came.
    pub struck: f64,
    /// State of the arming machine when it came.
    pub from: RigState,
    /// Rotor speed when it came, rev/min.
    pub rpm: f64,
    /// Lowest rotor speed from then on while pulses above minimum were given, rev/min.
    pub slowest: f64,
    /// Start of each pulse above minimum.
    pub live: Vec<f64>,
    /// A pulse above minimum in a state that gives none.
    pub surprise: Option<f64>,
    /// Every fault that was told.
    pub faults: FaultSet,
    /// State as last told.
    pub state: RigState,
    /// End of the cause of a reset.
    pub back: f64,
    /// Start of the first pulse after it.
    pub train: Option<f64>,
    /// The board refused something after the mishap.
    pub refused: bool,
    /// What ended the program was told after the reset.
    pub ended: bool,
    /// Verdicts of each sample after the mishap.
    pub verdicts: Vec<[CaptureVerdict; 4]>,
    /// End of the flight.
    pub end: f64,
}

fn faults(faults: &[Fault]) -> String {
    if faults.is_empty() { "no fault".to_owned() } else { faults.iter().map(|f| f.words()).collect::<Vec<_>>().join(", ") }
}

fn verdicts(verdicts: &[CaptureVerdict]) -> String {
    verdicts.iter().map(|v| v.flag().map_or("nominal", |flag| flag.words)).collect::<Vec<_>>().join(", ")
}

/// What is wrong with a flight.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Wrong {
    /// The mishap's instant was never reached.
    #[error("it never came to the mishap: {}, {}", .0.words(), .1)]
    NeverReached(RigState, FaultSet),
    /// A pulse above minimum in a state that gives none.
    #[error("a pulse above minimum at {0:.0} ms in a state that gives none")]
    Surprise(f64),
    /// A pulse above minimum came too late.
    #[error("a pulse above minimum {0:.1} ms after the latest allowed instant")]
    Live(f64),
    /// The fault is not named in the telemetry.
    #[error("telemetry names {}", faults(.0))]
    Unnamed(Vec<Fault>),
    /// A fault is named that nothing justifies.
    #[error("a fault without a cause: {}", faults(.0))]
    Unjustified(Vec<Fault>),
    /// The state at the end is not the one that the rule asks for.
    #[error("it ends {}", .0.words())]
    State(RigState),
    /// The throttle ceased although nothing asked for it.
    #[error("the throttle ceased {0:.0} ms before the end")]
    Ceased(f64),
    /// What was asked for was not refused.
    #[error("the request was not refused")]
    NotRefused,
    /// The channel was not told to be unwell.
    #[error("the channel was not told: {}", verdicts(.0))]
    Untold(Vec<CaptureVerdict>),
    /// A channel that is well was told not to be.
    #[error("channel {} is blamed: {}", .0, verdicts(&[*.1]))]
    Blamed(u8, CaptureVerdict),
    /// After a reset the first minimum pulse came late, or never.
    #[error("first pulse {} after the reset", .0.map_or("never".to_owned(), |ms| format!("{ms:.1} ms")))]
    LateTrain(Option<f64>),
    /// What ended the program was not told.
    #[error("what ended the program was not told")]
    Silent,
}

/// A flight that went wrong.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{}: {wrong}", plan.words())]
pub struct Failure {
    /// Which.
    pub plan: Box<Plan>,
    /// What.
    pub wrong: Wrong,
}

/// A flight that went well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Survived {
    /// The mishap.
    pub mishap: Mishap,
    /// It ended in minimum throttle, with or without a reset.
    pub stopped: bool,
    /// From the mishap to the start of the last pulse above minimum, ms; 0 when there was none.
    pub last_live_ms: f64,
    /// The most that was allowed, ms; `None` where nothing asked for the stop.
    pub limit_ms: Option<f64>,
}

/// Judges a flight.
///
/// # Errors
/// What is wrong with it.
pub fn judge(plan: &Plan, seen: &Observed) -> Result<Survived, Failure> {
    let rule = Rule::of(plan, seen.rpm, seen.slowest);
    weigh(plan, &rule, seen).map_err(|wrong| Failure { plan: Box::new(*plan), wrong })
}

fn weigh(plan: &Plan, rule: &Rule, seen: &Observed) -> Result<Survived, Wrong> {
    if let Some(at) = seen.surprise {
        return Err(Wrong::Surprise(at));
    }
    let last = seen.live.last().map_or(0.0, |at| at - seen.struck).max(0.0);
    let limit_ms = rule.within_ms + REACTION_MS;
    let survived = |stopped| Survived { mishap: plan.mishap, stopped, last_live_ms: last, limit_ms: Some(limit_ms) };
    let in_time = || if last > limit_ms { Err(Wrong::Live(last - limit_ms)) } else { Ok(()) };
    let only = |allowed: FaultSet| {
        let strange = FaultSet(seen.faults.0 & !allowed.0);
        if strange.is_empty() { Ok(()) } else { Err(Wrong::Unjustified(strange.iter().collect())) }
    };
    let in_state = |wanted: RigState| if seen.state == wanted { Ok(()) } else { Err(Wrong::State(seen.state)) };
    match rule.answer {
        Answer::Stops(named) => {
            in_time()?;
            if FaultSet(seen.faults.0 & named.0).is_empty() {
                return Err(Wrong::Unnamed(seen.faults.iter().collect()));
            }
            only(named)?;
            // a rig that starts on a bad clock is disarmed, with its fault standing
            in_state(if plan.mishap == Mishap::CrystalDead { RigState::Disarmed } else { RigState::Faulted })?;
            Ok(survived(true))
        }
        Answer::Resets => {
            in_time()?;
            let standing = match plan.mishap {
                Mishap::CrystalFails => FaultSet::NONE.with(Fault::ClockFailed),
                _ => FaultSet::NONE,
            };
            only(standing)?;
            in_state(RigState::Disarmed)?;
            let after = seen.train.map(|train| train - seen.back);
            if after.is_none_or(|ms| ms > REACTION_MS) {
                return Err(Wrong::LateTrain(after));
            }
            if !standing.is_empty() && seen.faults != standing {
                return Err(Wrong::Unnamed(seen.faults.iter().collect()));
            }
            let told = matches!(plan.mishap, Mishap::Panic | Mishap::HardFault | Mishap::CrystalFails);
            if told && !seen.ended {
                return Err(Wrong::Silent);
            }
            Ok(survived(true))
        }
        Answer::Ends => {
            in_time()?;
            only(FaultSet::NONE)?;
            in_state(if plan.phase == Phase::Holding { RigState::ProgrammingEscape } else { RigState::Armed })?;
            Ok(survived(true))
        }
        Answer::StaysDown => {
            only(FaultSet::NONE)?;
            in_state(RigState::Disarmed)?;
            if !seen.live.is_empty() {
                return Err(Wrong::Live(last));
            }
            if !seen.refused {
                return Err(Wrong::NotRefused);
            }
            Ok(survived(false))
        }
        Answer::GoesOn | Answer::Refuses | Answer::Tells { .. } => {
            only(rule.may)?;
            if !seen.faults.is_empty() {
                in_state(RigState::Faulted)?;
                return Ok(Survived { limit_ms: None, ..survived(true) });
            }
            in_state(seen.from)?;
            let still = seen.end - seen.live.last().copied().unwrap_or(0.0);
            if plan.phase.is_live() && still > FRAME_MS {
                return Err(Wrong::Ceased(still));
            }
            if rule.answer == Answer::Refuses && !seen.refused {
                return Err(Wrong::NotRefused);
            }
            told(plan, rule, seen)?;
            Ok(Survived { last_live_ms: 0.0, ..survived(false) })
        }
    }
}

/// A channel that is unwell is told, and no other is.
fn told(plan: &Plan, rule: &Rule, seen: &Observed) -> Result<(), Wrong> {
    use CaptureVerdict::{Absent, Nominal};
    if let Answer::Tells { channel, verdicts } = rule.answer {
        let own: Vec<_> = seen.verdicts.iter().map(|all| all[usize::from(channel)]).collect();
        if !own.iter().any(|verdict| verdicts.contains(verdict)) {
            return Err(Wrong::Untold(own));
        }
    }
    // under a throttle that moves, readings that begin and end apart may differ for a sample
    if plan.phase != Phase::Running || plan.config.marks.iter().filter(|m| **m > 0).count() == 2 {
        return Ok(());
    }
    if matches!(plan.mishap, Mishap::PulseWire | Mishap::PowerCut | Mishap::Supply { .. }) {
        return Ok(()); // the rotor slows down
    }
    for channel in (0..4u8).filter(|c| plan.mishap.lines() >> c & 1 == 0) {
        if let Some(all) = seen.verdicts.iter().find(|all| !matches!(all[usize::from(channel)], Nominal | Absent)) {
            return Err(Wrong::Blamed(channel, all[usize::from(channel)]));
        }
    }
    Ok(())
}
