//! What the specification asks of the board for each plan.
//!
//! What it is: [`Rule::of`]: the answer, which faults may and must be named, and how long it may take until the board can know.
//! What can go wrong: a rule that allows too much judges nothing; `hal-sim/tests/fault.rs` flies each kind without its protection.
//! Units: ms.
//! Reference: specification `rig.md`, "Protection", "Four RPM capture channels", "On a real bench"; the limits' own times.

use super::{Mishap, PING_MS, Phase, Plan, Request};
use frame::rig::CaptureVerdict::{self, Alternating, BladeTwist, Disagrees, Doubled, Lost, Missed, OverCapture, Stopped};
use frame::rig::{Fault, FaultSet};

/// Reaction after detection: two frames of the ESC.
pub const REACTION_MS: f64 = 40.0;

/// What the board must do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Answer {
    /// Go on as it was, without a fault.
    GoesOn,
    /// Go on, and say in the samples that this channel, and no other, is not well.
    Tells {
        /// Capture channel.
        channel: u8,
        /// What may be said of it.
        verdicts: &'static [CaptureVerdict],
    },
    /// Go on, and refuse what was asked.
    Refuses,
    /// Minimum throttle, latched, and one of these faults named.
    Stops(FaultSet),
    /// Minimum throttle without a fault.
    Ends,
    /// A reset that ends disarmed, with the first minimum pulse in time.
    Resets,
    /// No pulse above minimum, ever.
    StaysDown,
}

/// A rule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rule {
    /// What the board must do.
    pub answer: Answer,
    /// Faults that may be named in a run that goes on, and stop it.
    pub may: FaultSet,
    /// Highest time from the mishap to the instant at which the board can know it, ms.
    pub within_ms: f64,
    /// Where that comes from.
    pub why: &'static str,
}

const fn set(fault: Fault) -> FaultSet {
    FaultSet::NONE.with(fault)
}

fn stops(fault: Fault, within_ms: f64, why: &'static str) -> Rule {
    Rule { answer: Answer::Stops(set(fault)), may: FaultSet::NONE, within_ms, why }
}

fn plain(answer: Answer, within_ms: f64, why: &'static str) -> Rule {
    Rule { answer, may: FaultSet::NONE, within_ms, why }
}

/// The run goes on. `watched`: how long it is looked at, ms.
fn goes_on(watched: f64, why: &'static str) -> Rule {
    plain(Answer::GoesOn, watched, why)
}

impl Rule {
    /// The rule of a plan, at a rotor speed of `rpm` when the mishap came and of at least `slowest` until the stop.
    #[must_use]
    pub fn of(plan: &Plan, rpm: f64, slowest: f64) -> Self {
        match plan.mishap {
            Mishap::StuckLine { .. }
            | Mishap::Stray { .. }
            | Mishap::Misses { .. }
            | Mishap::Doubles { .. }
            | Mishap::Uneven { .. }
            | Mishap::Skewed { .. }
            | Mishap::Fast { .. }
            | Mishap::Screams { .. }
            | Mishap::Overwritten { .. }
            | Mishap::TwoMiss { .. }
            | Mishap::TwoSkewed { .. }
            | Mishap::TwoFast { .. } => of_speed(plan, rpm, slowest),
            Mishap::Saturated { .. } | Mishap::NoConversions => of_inputs(plan),
            Mishap::Overload { .. }
            | Mishap::Twist { .. }
            | Mishap::OverCurrent
            | Mishap::Supply { .. }
            | Mishap::Temperature { .. }
            | Mishap::Overspeed
            | Mishap::PowerCut => of_limits(plan),
            Mishap::CorruptFrames
            | Mishap::Garbage
            | Mishap::Partial { .. }
            | Mishap::Echo
            | Mishap::Replay
            | Mishap::Silence => of_line(plan),
            Mishap::Nothing
            | Mishap::FloatingLine { .. }
            | Mishap::FloatingInput { .. }
            | Mishap::Contact { .. }
            | Mishap::Gap
            | Mishap::PulseWire
            | Mishap::OneCorrupt => goes_on(600.0, "it is none of the faults"),
            Mishap::LateHost => goes_on(f64::from(plan.config.link_ms) + 100.0, "the host comes back in time"),
            other => of_board(plan, other),
        }
    }
}

/// Milliseconds between two marks of a channel.
fn period(plan: &Plan, channel: u8, rpm: f64) -> f64 {
    60_000.0 / rpm / f64::from(plan.config.marks[usize::from(channel)].max(1))
}

fn of_speed(plan: &Plan, rpm: f64, slowest: f64) -> Rule {
    let fitted = plan.config.marks.iter().filter(|m| **m > 0).count();
    let log = f64::from(plan.config.log_period_ms);
    let settle =
        (0..4).filter(|n| plan.mishap.lines() >> n & 1 == 1).map(|n| 10.0 * period(plan, n, slowest)).fold(60.0, f64::max);
    let told = settle + 6.0 * log + 300.0;
    let tells = |channel, verdicts| Rule {
        answer: Answer::Tells { channel, verdicts },
        // with one or two fitted the fastest is believed, and nobody can say which of two is right
        may: if fitted < 3 { set(Fault::Overspeed).with(Fault::SensorDisagreement) } else { FaultSet::NONE },
        within_ms: told,
        why: "one reading and two samples",
    };
    let none = |rule: Rule| Rule { may: FaultSet::NONE, ..rule };
    let fast = f64::from(plan.config.limits.speed.ms) + 60_000.0 / (1.2 * 10_000.0) + 2.0;
    // what the speed changed lately is allowed for: two medians before this one, each a revolution and a half after the other
    let turn = 60_000.0 / slowest;
    let differ = settle.max(50.0 + turn) + 3.0 * turn + 500.0 + 4.0 * log + 5.0;
    match plan.mishap {
        Mishap::StuckLine { channel } if fitted > 1 => {
            let why = "3 expected periods and 20 ms of silence, then 50 ms";
            stops(Fault::SensorLost, 3.0 * period(plan, channel, slowest) + 71.0, why)
        }
        Mishap::StuckLine { channel } => none(tells(channel, &[Lost, Stopped])),
        Mishap::Stray { channel } => tells(channel, &[Doubled, Missed, Disagrees, Alternating, BladeTwist]),
        Mishap::Misses { channel } => none(tells(channel, &[Missed, Disagrees, Doubled])),
        Mishap::Doubles { channel } => tells(channel, &[Doubled, Missed, Disagrees]),
        Mishap::Uneven { channel } => none(tells(channel, &[Alternating, BladeTwist])),
        Mishap::Skewed { .. } if fitted == 1 => goes_on(700.0, "alone it is believed"),
        Mishap::Skewed { .. } if fitted == 2 => {
            stops(Fault::SensorDisagreement, differ, "one reading, three revolutions and two samples, then 500 ms")
        }
        Mishap::Skewed { channel } => none(tells(channel, &[Disagrees])),
        Mishap::Fast { .. } if fitted < 3 => stops(Fault::Overspeed, fast, "one revolution and the limit's time"),
        Mishap::Fast { channel } => none(tells(channel, &[Disagrees, Missed, Doubled, Alternating])),
        Mishap::Screams { channel } | Mishap::Overwritten { channel } => none(tells(channel, &[OverCapture])),
        Mishap::TwoFast { .. } => stops(Fault::Overspeed, fast, "one revolution and the limit's time"),
        _ if rpm > 0.0 => stops(Fault::SensorDisagreement, differ, "one reading, three revolutions and two samples, then 500 ms"),
        _ => goes_on(0.0, "the rotor stands"),
    }
}

fn of_inputs(plan: &Plan) -> Rule {
    let limits = &plan.config.limits;
    let lost: f64 = 100.0; // what the board takes for any channel that reads nothing
    let (more, ms) = match plan.mishap {
        Mishap::Saturated { channel: 0, .. } => {
            return stops(Fault::LoadCellOverload, f64::from(limits.thrust.ms) + 1.0, "the limit's time");
        }
        Mishap::Saturated { channel: 1, .. } if limits.torque.high.is_some() => (Some(Fault::TorqueLimit), limits.torque.ms),
        Mishap::Saturated { channel: 2, high: true } => (Some(Fault::OverCurrent), limits.current.ms),
        Mishap::Saturated { channel: 3, high: false } => {
            return stops(Fault::UnderVoltage, f64::from(limits.voltage.ms) + 1.0, "the limit's time");
        }
        Mishap::Saturated { channel: 3, high: true } if limits.voltage.high.is_some() => {
            (Some(Fault::OverVoltage), limits.voltage.ms)
        }
        Mishap::Saturated { channel: 4, .. } if limits.temperature.high.is_some() => {
            (Some(Fault::TemperatureLimit), limits.temperature.ms)
        }
        _ => (None, u16::MAX),
    };
    let named = more.map_or(set(Fault::AdcLost), |more| set(Fault::AdcLost).with(more));
    let within_ms = lost.min(f64::from(ms)) + 1.0;
    Rule { answer: Answer::Stops(named), may: FaultSet::NONE, within_ms, why: "100 ms, or the limit's time" }
}

fn of_limits(plan: &Plan) -> Rule {
    let limits = &plan.config.limits;
    let [thrust, torque, current, voltage, temperature] =
        [limits.thrust.ms, limits.torque.ms, limits.current.ms, limits.voltage.ms, limits.temperature.ms]
            .map(|ms| f64::from(ms) + 2.0);
    let why = "the limit's time";
    match plan.mishap {
        Mishap::Overload { .. } => stops(Fault::LoadCellOverload, thrust, why),
        Mishap::Twist { .. } => stops(Fault::TorqueLimit, torque, why),
        // while maximum is held, 5 ms above idle are enough
        Mishap::OverCurrent if plan.phase == Phase::Holding => stops(Fault::OverCurrent, 7.0, "5 ms above idle"),
        Mishap::OverCurrent => stops(Fault::OverCurrent, current, why),
        Mishap::Supply { high: true } if plan.config.fitted[3] => stops(Fault::OverVoltage, voltage, why),
        Mishap::Supply { high: false } | Mishap::PowerCut if plan.config.fitted[3] => stops(Fault::UnderVoltage, voltage, why),
        Mishap::Temperature { .. } => stops(Fault::TemperatureLimit, temperature, why),
        Mishap::Overspeed => {
            let slowest = plan.config.marks.contains(&1);
            let turn = if slowest { 2.0 } else { 1.0 } * 60_000.0 / 4000.0;
            stops(Fault::Overspeed, turn + f64::from(limits.speed.ms) + 2.0, "one revolution and the limit's time")
        }
        _ => goes_on(700.0, "the supply is not measured"),
    }
}

fn of_line(plan: &Plan) -> Rule {
    let linked = plan.phase.is_live() || plan.phase == Phase::Armed;
    if !linked {
        return goes_on(700.0, "nobody needs a host while disarmed");
    }
    let silent = f64::from(plan.config.link_ms) + 1.0;
    let lost = set(Fault::LinkLost).with(Fault::LinkCorrupt);
    match plan.mishap {
        Mishap::CorruptFrames | Mishap::Partial { front: false } => {
            let within_ms = (3.0 * PING_MS as f64 + 2.0).min(silent);
            Rule {
                answer: Answer::Stops(lost),
                may: FaultSet::NONE,
                within_ms,
                why: "the third damaged frame; the host sends one each 0.2 s",
            }
        }
        Mishap::Echo => Rule {
            // "accepted" is a beep, byte by byte, and older than the host's last frame
            answer: Answer::Stops(set(Fault::LinkCorrupt).with(Fault::CommandReplayed)),
            may: FaultSet::NONE,
            within_ms: 3.0 * f64::from(plan.config.log_period_ms.max(30)) + 5.0,
            why: "three frames of its own",
        },
        Mishap::Replay => stops(Fault::CommandReplayed, 2.0, "the frame's end and one tick"),
        Mishap::Silence => stops(Fault::LinkLost, silent, "the link's time after the last frame"),
        _ => Rule {
            answer: Answer::Stops(lost),
            may: FaultSet::NONE,
            within_ms: silent,
            why: "the link's time, or the third damaged frame",
        },
    }
}

fn of_board(plan: &Plan, mishap: Mishap) -> Rule {
    let tick = "one tick";
    match mishap {
        Mishap::SupplyDip => stops(Fault::BrownOut, 1.0, tick),
        Mishap::StopOpen | Mishap::StopBlink | Mishap::Asked(Request::Stop) => stops(Fault::OperatorStop, 1.0, tick),
        Mishap::LateTick { ms } => stops(Fault::ControlStalled, f64::from(ms) + 1.0, "the late tick itself"),
        Mishap::StreamDry => stops(Fault::StreamDry, 4.0, tick),
        Mishap::EscNoSignal => stops(Fault::ArmingTimeout, 2.0, tick),
        Mishap::EscFails if plan.phase != Phase::Running => stops(Fault::EscSelfTest, 2.0, tick),
        Mishap::EscFails => goes_on(500.0, "an ESC that runs has passed its self-test"),
        Mishap::Hang => plain(Answer::Resets, 38.0, "20 ms watchdog, 38 ms with the slowest oscillator"),
        other if other.resets() => plain(Answer::Resets, 0.0, "the reset is the detection"),
        Mishap::Asked(Request::Minimum) => plain(Answer::Ends, 2.0, tick),
        Mishap::Asked(_) => plain(Answer::Refuses, 300.0, tick),
        Mishap::StopHeld | Mishap::OpenSense => plain(Answer::StaysDown, 1500.0, "nothing begins"),
        Mishap::CrystalDead => stops(Fault::ClockFailed, 1.0, "the start itself"),
        Mishap::EscMute => stops(Fault::ArmingTimeout, f64::from(plan.config.esc.hold_min_ms) + 1.0, "the state's time"),
        Mishap::RotorTurns { .. } => stops(Fault::RotorTurned, 26.0, "the second edge"),
        Mishap::NotIdle => stops(Fault::OverCurrent, 7.0, "5 ms above idle"),
        Mishap::Unheard => plain(Answer::Ends, 6_502.0, "6.5 s after the supply came on"),
        _ => goes_on(500.0, "it is none of the faults"),
    }
}
