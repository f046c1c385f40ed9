//! The native run: the portable firmware against the bench, as fast as the host allows.
//!
//! What it is: a host, a wire, a board and a bench in one loop of one millisecond. The host arms the rig (it throws the power
//! switch and forwards the beeps it hears), tares it, runs the schedule and records; both directions go through the real codec.
//! What can go wrong: a refused command, a latched fault or a phase that does not end stops the run with a [`SimError`].
//! Units: ms of simulated time in the loop; raw codes in the record.
//! Reference: specification `rig.md`, "ESC pulse and arming" and "Acquisition"; `formats.md`, "Telemetry".

mod host;

use crate::bench::{Bench, Millisecond, Truth};
use crate::plant::Powerplant;
use crate::scenario::Scenario;
use crate::sensor::EdgeDetail;
use firmware_rig::{Config, Inputs, Rig};
use frame::calibration::{Calibration, Converted};
use frame::message::{Command, Event, Hello, Message};
use frame::rig::{FaultSet, Refusals, RigSample, RigState};
use frame::units::{PulseWidth, Ticks};
use frame::wire::{Decoder, Encoder, LinkStats, MAX_WIRE};
use host::{Host, Phase};

/// Why a run did not come to its end.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// The firmware refused a command of the host.
    #[error("the rig refused {command:?} while it was {phase}: reasons {reasons:?}")]
    Refused {
        /// What was asked.
        command: Command,
        /// What the host was doing.
        phase: &'static str,
        /// Why not.
        reasons: Refusals,
    },
    /// Faults latched.
    #[error("the rig latched faults {faults:?} while it was {phase}, {at_s:.3} s after reset")]
    Faulted {
        /// Which.
        faults: FaultSet,
        /// What the host was doing.
        phase: &'static str,
        /// When, s since reset.
        at_s: f64,
    },
    /// A phase lasted longer than it can.
    #[error("the rig was still {phase} (state {state:?}) {at_s:.0} s after reset")]
    Stuck {
        /// What the host was doing.
        phase: &'static str,
        /// State of the arming machine.
        state: RigState,
        /// When, s since reset.
        at_s: f64,
    },
    /// A message did not fit its frame.
    #[error("a message did not fit its frame")]
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

/// Time beyond the run itself after which a session counts as stuck, ms.
const OVERHEAD_MS: u64 = 90_000;

/// The board's side: firmware, codec and the timer that makes the pulses.
struct Board {
    rig: Rig,
    encoder: Encoder,
    decoder: Decoder,
    pulse: PulseWidth,
    sent: Vec<u8>,
}

impl Board {
    fn tell(&mut self, now: Ticks, message: &Message) -> Result<(), SimError> {
        let mut frame = [0; MAX_WIRE];
        let length = self.encoder.encode(now, message, &mut frame).map_err(|_| SimError::Codec)?;
        self.sent.extend_from_slice(&frame[..length]);
        Ok(())
    }

    /// Takes the bytes that the host sent; at most one command is in them.
    fn hear(&mut self, bytes: &[u8]) -> Option<Command> {
        let mut command = None;
        for byte in bytes {
            if let Some(received) = self.decoder.push(*byte) {
                command = Some(received.message);
            }
        }
        command
    }
}

/// Configuration of the firmware for a scenario.
#[must_use]
pub fn firmware_config(scenario: &Scenario) -> Config {
    let period = Ticks::from_ms(1000 / u64::from(scenario.log.rate_hz));
    let mut config = Config { marks: scenario.parts().geometry.marks(), log_period: period, ..Config::thesis_570kv() };
    if scenario.effects.iter().any(|e| e.takes_a_sensor_off()) {
        config.limits.lost_ms = u32::MAX; // the operator has announced it; otherwise the run would end there
    }
    config
}

/// Flies a scenario. `plant` takes the place of the scenario's own powerplant. `progress` hears the share that is done.
///
/// # Errors
/// See [`SimError`].
pub fn run(
    scenario: &Scenario,
    plant: Option<Box<dyn Powerplant>>,
    progress: &mut dyn FnMut(f64),
) -> Result<RunRecord, SimError> {
    let mut bench = Bench::new(scenario, plant, EdgeDetail::Captured);
    let mut host = Host::new(scenario);
    let mut board = Board {
        rig: Rig::new(firmware_config(scenario)),
        encoder: Encoder::default(),
        decoder: Decoder::default(),
        pulse: PulseWidth::MIN,
        sent: Vec::new(),
    };
    let mut gathered = Millisecond::default();
    let mut telemetry = Vec::new();
    let mut truth = Vec::new();
    let mut frame_pulse = PulseWidth::MIN;
    let limit_ms = (scenario.run_s() * 1000.0) as u64 + OVERHEAD_MS;

    for ms in 1.. {
        // The timer takes a new pulse at the start of a 20 ms frame; the pulse has ended 2 ms later at the latest.
        match ms % 20 {
            0 => frame_pulse = board.pulse,
            2 => bench.pulse((ms - 2) * 1_000_000 + u64::from(frame_pulse.0), frame_pulse.0),
            _ => {}
        }
        bench.millisecond(&mut gathered);
        let now = Ticks::from_ms(ms);

        host.step(ms, &mut bench);
        let mut command = None;
        if let Some(wanted) = host.send(ms) {
            let mut frame = [0; MAX_WIRE];
            let length = host.encoder.encode(now, &wanted, &mut frame).map_err(|_| SimError::Codec)?;
            command = board.hear(&frame[..length]);
        }
        let outputs = board.rig.tick(&Inputs {
            now,
            edges: core::array::from_fn(|i| gathered.edges[i].as_slice()),
            over_capture: [false; 4],
            adc: gathered.adc,
            command,
            line: Default::default(),
            stop_input: false,
            brown_out: false,
            paused: false,
        });
        board.pulse = outputs.pulse;
        if let Some(Command::Identify) = command {
            board.tell(now, &Message::Hello(board.rig.hello(0)))?;
        }
        if let Some(Command::Identify | Command::Tare) = command {
            board.tell(now, &Message::Calibration(board.rig.calibration()))?;
        }
        if let Some(sample) = outputs.sample {
            board.tell(now, &Message::Rig(sample))?;
        }
        if let Some(event) = outputs.event {
            board.tell(now, &Message::Event(event))?;
        }

        let recorded = host.samples.len();
        for byte in &board.sent {
            if let Some(received) = host.decoder.push::<Message>(*byte) {
                host.take(received.message, ms)?;
            }
        }
        telemetry.append(&mut board.sent);
        if host.samples.len() > recorded {
            if recorded == 0 {
                bench.start_run();
            }
            let run_s = (now.as_s() - host.start.unwrap_or(now).as_s()).max(0.0);
            truth.push(Truth { run_s, ..bench.truth() });
        }
        if ms % 1000 == 0 {
            let done = host.start.map_or(0.0, |s| (now.as_s() - s.as_s()) / scenario.run_s());
            progress(done.min(1.0));
        }
        if host.phase == Phase::Done {
            break;
        }
        if ms > limit_ms {
            return Err(SimError::Stuck { phase: host.phase.name(), state: host.state, at_s: now.as_s() });
        }
    }
    let (Some(hello), Some(calibration), Some(start)) = (host.hello, host.calibration, host.start) else {
        return Err(SimError::Stuck { phase: host.phase.name(), state: host.state, at_s: 0.0 });
    };
    progress(1.0);
    Ok(RunRecord {
        telemetry,
        hello,
        calibration,
        start,
        samples: host.samples,
        events: host.events,
        link: host.decoder.stats(),
        truth,
    })
}
