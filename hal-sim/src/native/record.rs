//! What a native run leaves behind, or why it did not come to its end.
//!
//! What it is: telemetry, its decoded samples and events, the truth beside them; the same of a replay, without truth.
//! What can go wrong: see [`SimError`].
//! Units: as in the messages; s where a name says so.
//! Reference: specification `formats.md`, "Telemetry".

use crate::bench::Truth;
use crate::scenario::Scenario;
use frame::calibration::{Calibration, Converted};
use frame::message::{Command, Event, Hello, Message};
use frame::rig::{FaultSet, Refusals, RigSample, RigState};
use frame::units::Ticks;
use frame::wire::{Decoder, LinkStats};
/// Why a run did not come to its end.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// The firmware refused a command of the host.
    #[error("the rig refused \"{}\" while it was {phase}: {reasons}; expected a scenario in which it does not (docs/scenario.md)", command.words())]
    Refused {
        /// What was asked.
        command: Box<Command>,
        /// What the host was doing.
        phase: &'static str,
        /// Why not.
        reasons: Refusals,
    },
    /// Faults latched.
    #[error(
        "the rig stopped itself while it was {phase}, {at_s:.3} s after reset: {faults}; expected a run within the firmware's limits: a smaller schedule, or less of what is hidden"
    )]
    Faulted {
        /// Which.
        faults: FaultSet,
        /// What the host was doing.
        phase: &'static str,
        /// When, s since reset.
        at_s: f64,
    },
    /// A phase lasted longer than it can.
    #[error("the rig was still {phase} {at_s:.0} s after reset ({}); expected it to be done: has the ESC power, and does it answer?", state.words())]
    Stuck {
        /// What the host was doing.
        phase: &'static str,
        /// State of the arming machine.
        state: RigState,
        /// When, s since reset.
        at_s: f64,
    },
    /// The schedule cannot be played to its end.
    #[error("the schedule was not played to its end: {reason}; expected to play it whole")]
    Schedule {
        /// Why not.
        reason: String,
    },
    /// A message did not fit its frame.
    #[error("a message did not fit its frame; expected it to: this is a defect of the program, please report it")]
    Codec,
}

/// What a run leaves behind.
#[derive(Debug, Clone, PartialEq)]
pub struct RunRecord {
    /// Every byte that the board sent, from reset on.
    pub telemetry: Vec<u8>,
    /// Who spoke.
    pub hello: Hello,
    /// Calibration in force during the run, tare included.
    pub calibration: Calibration,
    /// Time of the first sample; the log's time counts from here.
    pub start: Ticks,
    /// Decoded samples of the run.
    pub samples: Vec<RigSample>,
    /// Decoded events, from reset on.
    pub events: Vec<Event>,
    /// Counters of the host's decoder.
    pub link: LinkStats,
    /// What was really there at each sample.
    pub truth: Vec<Truth>,
}

impl RunRecord {
    /// What a host makes of a board's bytes alone, as of a replay: samples of the run, events, calibration; no truth.
    ///
    /// # Errors
    /// [`SimError`] of a board that refused or latched something.
    pub fn from_telemetry(scenario: &Scenario, telemetry: Vec<u8>) -> Result<Self, SimError> {
        let mut decoder = Decoder::default();
        let (mut hello, mut calibration) = (None, None);
        let (mut samples, mut events) = (Vec::new(), Vec::new());
        let mut begun = false;
        for byte in &telemetry {
            match decoder.push::<Message>(*byte).map(|received| received.message) {
                Some(Message::Hello(told)) => hello = Some(told),
                // a board that was reset in mid-run has lost its tare: the run is read with the one that it began with
                Some(Message::Calibration(told)) if !begun => calibration = Some(told),
                Some(Message::Rig(sample)) => samples.push(sample),
                Some(Message::Event(event)) => {
                    begun |= matches!(event, Event::State { to: RigState::Running, .. });
                    events.push(event);
                }
                _ => {}
            }
        }
        let stuck = SimError::Stuck { phase: "replaying", state: RigState::Disarmed, at_s: 0.0 };
        let running = events.iter().find_map(|e| match e {
            Event::State { to: RigState::Running, at, .. } => Some(*at),
            _ => None,
        });
        // the host begins to record `rest_s` before the schedule
        let rest = Ticks((scenario.rest_s * Ticks::HZ as f64) as u64);
        let (Some(hello), Some(calibration), Some(running)) = (hello, calibration, running) else { return Err(stuck) };
        samples.retain(|s: &RigSample| s.at.0 + rest.0 >= running.0);
        let start = samples.first().map_or(running, |s| s.at);
        Ok(Self { telemetry, hello, calibration, start, samples, events, link: decoder.stats(), truth: Vec::new() })
    }

    /// Physical values of every sample, with time from the start of the run.
    pub fn converted(&self) -> impl Iterator<Item = Converted> + '_ {
        let start = self.start.as_s();
        self.samples.iter().map(move |s| {
            let mut row = self.calibration.convert(s);
            row.t_s -= start;
            row
        })
    }
}
