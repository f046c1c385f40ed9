//! The arming machine as a table.
//!
//! What it is: (state, event, standing objections) -> next state, pure, so that it can be explored exhaustively;
//! beside it the pulse each state gives, its time-out and its message to the operator.
//! What can go wrong: an event without a row changes nothing; a command without a row is refused as `WRONG_STATE`
//! together with every other objection that the command would meet.
//! Units: milliseconds.
//! Reference: Beharie 2013, Fig. 3.10 and Appendix C; specification `rig.md`, "ESC pulse and arming".

use crate::fault::{Fault, Refusals};
use crate::state::State;
use crate::units::PulseWidth;

/// What the machine reacts to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ArmingEvent {
    /// The operator asks for the normal start.
    Arm,
    /// The operator asks for the throttle-range calibration.
    Calibrate,
    /// A setting or a schedule asks for throttle.
    Run,
    /// One long beep: the ESC recognised minimum throttle.
    Long,
    /// Short beeps: number of cells.
    Cells,
    /// "1-2-3": the ESC is ready.
    Ready,
    /// Two beeps: the ESC stored maximum throttle.
    Double,
    /// The special tone: the ESC is in its programming mode.
    Programming,
    /// Continuous beeping: the ESC sees no signal.
    NoSignal,
    /// Twenty short beeps: the ESC's self-test failed.
    SelfTestFailed,
    /// The state lasted longer than its time-out.
    TimeOut,
    /// The schedule ended or the setting went back to minimum.
    Finished,
    /// The operator's stop.
    Stop,
    /// A protection tripped.
    Trip,
    /// The operator clears the latched faults.
    Clear,
}

impl ArmingEvent {
    /// All of them, for exploration.
    pub const ALL: [Self; 15] = [
        Self::Arm,
        Self::Calibrate,
        Self::Run,
        Self::Long,
        Self::Cells,
        Self::Ready,
        Self::Double,
        Self::Programming,
        Self::NoSignal,
        Self::SelfTestFailed,
        Self::TimeOut,
        Self::Finished,
        Self::Stop,
        Self::Trip,
        Self::Clear,
    ];

    /// A command of the operator, which is refused rather than ignored where it does not belong.
    #[must_use]
    pub const fn is_command(self) -> bool {
        matches!(self, Self::Arm | Self::Calibrate | Self::Run | Self::Clear)
    }

    /// The fault that this event latches when the machine takes it to `Faulted`.
    #[must_use]
    pub const fn fault(self) -> Option<Fault> {
        match self {
            Self::Stop => Some(Fault::OperatorStop),
            Self::SelfTestFailed => Some(Fault::EscSelfTest),
            Self::TimeOut | Self::NoSignal => Some(Fault::ArmingTimeout),
            _ => None,
        }
    }
}

/// Every state, for exploration.
pub const STATES: [State; 10] = [
    State::Disarmed,
    State::ArmHoldMin,
    State::ArmCells,
    State::ArmReady,
    State::Armed,
    State::Running,
    State::CalibrateHoldMax,
    State::CalibrateHoldMin,
    State::ProgrammingEscape,
    State::Faulted,
];

/// What speaks against commands at this moment: bits of [`Refusals`], each a guard that does not hold.
pub type Objections = Refusals;

/// One row of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Transition {
    /// State in which the row applies.
    pub from: State,
    /// Event that it answers.
    pub on: ArmingEvent,
    /// Objections that forbid it.
    pub unless: u16,
    /// State that follows.
    pub to: State,
}

const ARM_UNLESS: u16 = Refusals::FAULT_LATCHED
    | Refusals::THROTTLE_NOT_LOW
    | Refusals::NO_LOW_INTERVAL
    | Refusals::ROTOR_TURNING
    | Refusals::STOP_OPEN;
const CALIBRATE_UNLESS: u16 = ARM_UNLESS
    | Refusals::ESC_POWERED
    | Refusals::NOT_CONFIRMED
    | Refusals::SUPPLY_UNPROVEN
    | Refusals::NO_WITNESS
    | Refusals::NO_RANGE;
const RUN_UNLESS: u16 = Refusals::FAULT_LATCHED | Refusals::OUT_OF_RANGE | Refusals::EMPTY_SCHEDULE | Refusals::SHORT_STREAM;

const fn row(from: State, on: ArmingEvent, unless: u16, to: State) -> Transition {
    Transition { from, on, unless, to }
}

/// The machine. Stop and Trip lead to `Faulted` from everywhere (see [`step`]) except where the row says otherwise.
pub const TABLE: &[Transition] = {
    use ArmingEvent as E;
    use State as S;
    &[
        row(S::Disarmed, E::Arm, ARM_UNLESS, S::ArmHoldMin),
        row(S::Disarmed, E::Calibrate, CALIBRATE_UNLESS, S::CalibrateHoldMax),
        row(S::Disarmed, E::Clear, 0, S::Disarmed),
        // normal start
        row(S::ArmHoldMin, E::Long, 0, S::ArmCells),
        row(S::ArmHoldMin, E::Double, 0, S::ProgrammingEscape), // the ESC believes that it saw full throttle
        row(S::ArmHoldMin, E::Programming, 0, S::ProgrammingEscape),
        row(S::ArmHoldMin, E::NoSignal, 0, S::Faulted),
        row(S::ArmHoldMin, E::SelfTestFailed, 0, S::Faulted),
        row(S::ArmHoldMin, E::TimeOut, 0, S::Faulted),
        row(S::ArmCells, E::Cells, 0, S::ArmReady),
        row(S::ArmCells, E::Programming, 0, S::ProgrammingEscape),
        row(S::ArmCells, E::NoSignal, 0, S::Faulted),
        row(S::ArmCells, E::SelfTestFailed, 0, S::Faulted),
        row(S::ArmCells, E::TimeOut, 0, S::Faulted),
        row(S::ArmReady, E::Ready, 0, S::Armed),
        row(S::ArmReady, E::Programming, 0, S::ProgrammingEscape),
        row(S::ArmReady, E::NoSignal, 0, S::Faulted),
        row(S::ArmReady, E::SelfTestFailed, 0, S::Faulted),
        row(S::ArmReady, E::TimeOut, 0, S::Faulted),
        // work
        row(S::Armed, E::Run, RUN_UNLESS, S::Running),
        row(S::Armed, E::NoSignal, 0, S::Faulted),
        row(S::Armed, E::SelfTestFailed, 0, S::Faulted),
        row(S::Armed, E::TimeOut, 0, S::Disarmed), // left alone: nothing to be blamed, but arm again
        row(S::Running, E::Run, RUN_UNLESS, S::Running),
        row(S::Running, E::Finished, 0, S::Armed),
        row(S::Running, E::NoSignal, 0, S::Faulted),
        // throttle-range calibration
        row(S::CalibrateHoldMax, E::Double, 0, S::CalibrateHoldMin),
        row(S::CalibrateHoldMax, E::Programming, 0, S::ProgrammingEscape),
        row(S::CalibrateHoldMax, E::NoSignal, 0, S::Faulted),
        row(S::CalibrateHoldMax, E::SelfTestFailed, 0, S::Faulted),
        row(S::CalibrateHoldMax, E::TimeOut, 0, S::ProgrammingEscape), // it may have been entered unheard
        row(S::CalibrateHoldMin, E::Ready, 0, S::Armed),
        row(S::CalibrateHoldMin, E::Programming, 0, S::ProgrammingEscape),
        row(S::CalibrateHoldMin, E::NoSignal, 0, S::Faulted),
        row(S::CalibrateHoldMin, E::SelfTestFailed, 0, S::Faulted),
        row(S::CalibrateHoldMin, E::TimeOut, 0, S::Faulted),
        // ways back
        row(S::ProgrammingEscape, E::Stop, 0, S::ProgrammingEscape), // minimum already; the ESC still needs its power cut
        row(S::ProgrammingEscape, E::Trip, 0, S::ProgrammingEscape),
        row(S::ProgrammingEscape, E::Clear, Refusals::ESC_POWERED, S::Disarmed),
        row(S::Faulted, E::Clear, Refusals::STOP_OPEN, S::Disarmed),
    ]
};

/// What came of an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Outcome {
    /// Taken; the state that follows (it may be the same).
    To(State),
    /// Does not concern this state.
    Ignored,
    /// A command that was refused, with every reason.
    Refused(Refusals),
}

/// One step of the machine: no clock, no memory.
#[must_use]
pub fn step(state: State, event: ArmingEvent, objections: Objections) -> Outcome {
    match TABLE.iter().find(|row| row.from == state && row.on == event) {
        Some(row) => match Refusals(objections.0 & row.unless) {
            refusals if refusals.is_empty() => Outcome::To(row.to),
            refusals => Outcome::Refused(refusals),
        },
        None if matches!(event, ArmingEvent::Stop | ArmingEvent::Trip) => Outcome::To(State::Faulted),
        None if event.is_command() => {
            let elsewhere = TABLE.iter().filter(|row| row.on == event).fold(0, |mask, row| mask | row.unless);
            Outcome::Refused(Refusals(objections.0 & elsewhere | Refusals::WRONG_STATE))
        }
        None => Outcome::Ignored,
    }
}

/// The pulse of a state: what the schedule commands only in `Running`, maximum only in `CalibrateHoldMax`, else minimum.
#[must_use]
pub const fn pulse_for(state: State, commanded: PulseWidth) -> PulseWidth {
    match state {
        State::Running => commanded.clamped(),
        State::CalibrateHoldMax => PulseWidth::MAX,
        State::Disarmed
        | State::ArmHoldMin
        | State::ArmCells
        | State::ArmReady
        | State::Armed
        | State::CalibrateHoldMin
        | State::ProgrammingEscape
        | State::Faulted => PulseWidth::MIN,
    }
}

/// How long each waiting state may last, milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ArmingTimes {
    /// Waiting for the operator to power the ESC, and its long beep.
    pub hold_min_ms: u32,
    /// Waiting for the cell-count beeps.
    pub cells_ms: u32,
    /// Waiting for "1-2-3".
    pub ready_ms: u32,
    /// Armed and unused.
    pub armed_ms: u32,
    /// Holding maximum, waiting for power and the two beeps.
    pub hold_max_ms: u32,
    /// Maximum from the instant at which the supply came on.
    pub max_powered_ms: u32,
    /// Back at minimum, waiting for the three answers.
    pub calibrate_min_ms: u32,
    /// Minimum throttle needed after a run before the next arming.
    pub low_interval_ms: u32,
}

impl Default for ArmingTimes {
    /// Time to walk to the battery, and twice what the beeps take.
    fn default() -> Self {
        Self {
            hold_min_ms: 60_000,
            cells_ms: 10_000,
            ready_ms: 10_000,
            armed_ms: 600_000,
            hold_max_ms: 30_000,
            max_powered_ms: DOUBLE_AFTER_POWER_MS + MINIMUM_AFTER_DOUBLE_MS,
            calibrate_min_ms: 20_000,
            low_interval_ms: 2_000,
        }
    }
}

/// Latest return to minimum after the two beeps: at 5 s the ESC stops waiting, at 6 s it programs itself (Appendix C).
///
/// The machine leaves `CalibrateHoldMax` with the event itself; where nobody passes the beeps on, the time from the power edge ends it.
pub const MINIMUM_AFTER_DOUBLE_MS: u32 = 4_500;

/// Latest two beeps after the supply came on: self-test and recognition of maximum take less (Appendix C).
pub const DOUBLE_AFTER_POWER_MS: u32 = 2_000;

/// Time-out of a state, if it has one.
#[must_use]
pub const fn time_out(state: State, times: &ArmingTimes) -> Option<u32> {
    match state {
        State::ArmHoldMin => Some(times.hold_min_ms),
        State::ArmCells => Some(times.cells_ms),
        State::ArmReady => Some(times.ready_ms),
        State::Armed => Some(times.armed_ms),
        State::CalibrateHoldMax => Some(times.hold_max_ms),
        State::CalibrateHoldMin => Some(times.calibrate_min_ms),
        State::Disarmed | State::Running | State::ProgrammingEscape | State::Faulted => None,
    }
}

/// What the operator is told in a state.
#[must_use]
pub const fn message(state: State) -> &'static str {
    match state {
        State::Disarmed => "Disarmed: minimum throttle. Arm, or calibrate with the ESC unpowered.",
        State::ArmHoldMin => "Holding minimum: connect the ESC battery and wait for one long beep.",
        State::ArmCells => "Minimum recognised: wait for the beeps that count the cells.",
        State::ArmReady => "Cells counted: wait for 1-2-3.",
        State::Armed => "Armed: keep clear, the rotor will turn on the next setting.",
        State::Running => "Running: keep clear.",
        State::CalibrateHoldMax => "Holding MAXIMUM: connect the ESC battery now and confirm the two beeps at once.",
        State::CalibrateHoldMin => "Maximum stored: wait for one long beep, the cell beeps and 1-2-3.",
        State::ProgrammingEscape => "The ESC is in its programming mode: cut its power, clear, and start again.",
        State::Faulted => "Stopped: minimum throttle. Remove the cause, then clear the faults.",
    }
}
