//! The native run: the portable firmware against the bench, as fast as the host allows.
//!
//! What it is: a host, a wire, a board and a bench in one loop of one millisecond. The host arms the rig (it throws the power
//! switch and forwards the beeps it hears), tares it, runs the schedule and records; both directions go through the real codec.
//! What can go wrong: a refused command, a latched fault or a phase that does not end stops the run with a [`SimError`].
//! Units: ms of simulated time in the loop; raw codes in the record.
//! Reference: specification `rig.md`, "ESC pulse and arming" and "Acquisition"; `formats.md`, "Telemetry".

pub mod ahrs;
mod board;
mod desk;
mod host;
mod imu_desk;
mod pins;
mod record;
mod sectors;

pub use board::{Board, PIN, POWER_ON, SOFTWARE, WATCHDOG, Wires};
pub use desk::{PLUGS, RigDesk};
pub use imu_desk::ImuDesk;
pub use pins::{PinRecord, PinsError};
pub use record::{RunRecord, SimError};
pub use sectors::{Refused, Sectors};

use crate::bench::Truth;
use crate::plant::Powerplant;
use crate::scenario::Scenario;
use firmware_rig::{AdcBlock, Config, EscTelemetry};
use frame::message::Message;
use frame::rig::RigSample;
use frame::units::{PulseWidth, Ticks};
use frame::wire::MAX_WIRE;
use host::{Host, Phase};

/// Time beyond the run itself after which a session counts as stuck, ms.
const OVERHEAD_MS: u64 = 90_000;

/// Configuration of the firmware for a scenario.
#[must_use]
pub fn firmware_config(scenario: &Scenario) -> Config {
    let period = Ticks::from_ms(1000 / u64::from(scenario.log.rate_hz));
    let parts = scenario.parts();
    let pole_pairs = parts.plant.motor.pole_pairs as u16;
    let telemetry = EscTelemetry { pole_pairs, asked: scenario.esc.telemetry_asked };
    let mut config = Config {
        marks: parts.geometry.marks(),
        log_period: period,
        esc_telemetry: scenario.sensors.esc_telemetry.then_some(telemetry),
        back_emf: if scenario.sensors.back_emf { pole_pairs } else { 0 },
        ..Config::thesis_570kv()
    };
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
    let mut session = Session::new(scenario, plant);
    while session.step()? {
        if session.desk.ms().is_multiple_of(1000) {
            progress(session.share());
        }
    }
    let record = session.finish()?;
    progress(1.0);
    Ok(record)
}

/// A native run that is taken a millisecond at a time: to pause, to single-step, to watch, to record its pins.
pub struct Session {
    desk: RigDesk,
    host: Host,
    telemetry: Vec<u8>,
    truth: Vec<Truth>,
    run_s: f64,
    limit_ms: u64,
    pins: Option<PinRecord>,
}

impl Session {
    /// A rig, a board and a host, none of them switched on.
    #[must_use]
    pub fn new(scenario: &Scenario, plant: Option<Box<dyn Powerplant>>) -> Self {
        Self {
            desk: RigDesk::new(scenario, plant, Board::new(firmware_config(scenario))),
            host: Host::new(scenario),
            telemetry: Vec::new(),
            truth: Vec::new(),
            run_s: scenario.run_s(),
            limit_ms: (scenario.run_s() * 1000.0) as u64 + OVERHEAD_MS,
            pins: None,
        }
    }

    /// Keeps everything that reaches the board from here on.
    pub fn record_pins(&mut self, scenario: &Scenario) {
        self.pins = Some(PinRecord::new(scenario));
    }

    /// The record of the pins so far.
    #[must_use]
    pub fn pins(&self) -> Option<&PinRecord> {
        self.pins.as_ref()
    }

    /// Simulated time since reset, s.
    #[must_use]
    pub fn now_s(&self) -> f64 {
        self.desk.ms() as f64 * 1.0e-3
    }

    /// What the host is doing.
    #[must_use]
    pub fn phase(&self) -> &'static str {
        self.host.phase.name()
    }

    /// What is really there.
    #[must_use]
    pub fn truth(&self) -> Truth {
        self.desk.truth()
    }

    /// The sample that arrived last.
    #[must_use]
    pub fn sample(&self) -> Option<RigSample> {
        self.host.samples.last().copied()
    }

    /// Every byte that reached the host so far.
    #[must_use]
    pub fn telemetry(&self) -> &[u8] {
        &self.telemetry
    }

    /// What the board's pulse timer holds: the pulse of the next frame.
    #[must_use]
    pub fn pulse(&self) -> PulseWidth {
        self.desk.board().pulse()
    }

    /// Share of the logged run that is done.
    #[must_use]
    pub fn share(&self) -> f64 {
        let now = Ticks::from_ms(self.desk.ms()).as_s();
        self.host.start.map_or(0.0, |s| (now - s.as_s()) / self.run_s).min(1.0)
    }

    /// One millisecond; `false` once the run is over.
    ///
    /// # Errors
    /// See [`SimError`].
    pub fn step(&mut self) -> Result<bool, SimError> {
        if self.host.phase == Phase::Done {
            return Ok(false);
        }
        self.desk.turn();
        let ms = self.desk.ms();
        let now = Ticks::from_ms(ms);
        self.host.step(ms, &mut self.desk);
        let mut wire = [0; MAX_WIRE];
        let mut said = 0;
        if let Some(wanted) = self.host.send(ms) {
            said = self.host.encoder.encode(now, &wanted, &mut wire).map_err(|_| SimError::Codec)?;
        }
        let heard = self.desk.let_through(wire.get(..said).unwrap_or(&[]));
        if let Some(pins) = &mut self.pins {
            let (gathered, dark) = self.desk.pins();
            pins.take(gathered, heard, dark);
        }
        let mut sent = self.desk.tick(heard);
        self.deliver(&sent)?;
        self.telemetry.append(&mut sent);
        if self.host.phase != Phase::Done && ms > self.limit_ms {
            return Err(SimError::Stuck { phase: self.host.phase.name(), state: self.host.state, at_s: now.as_s() });
        }
        self.host.give_up(ms, self.desk.run_s() > self.run_s);
        Ok(self.host.phase != Phase::Done)
    }

    /// The board's bytes reach the host.
    fn deliver(&mut self, sent: &[u8]) -> Result<(), SimError> {
        let recorded = self.host.samples.len();
        for byte in sent {
            if let Some(received) = self.host.decoder.push::<Message>(*byte) {
                self.host.take(received.message, self.desk.ms())?;
            }
        }
        if self.host.samples.len() > recorded {
            if recorded == 0 {
                self.desk.start_run();
            }
            self.truth.push(Truth { run_s: self.desk.run_s().max(0.0), ..self.desk.truth() });
        }
        Ok(())
    }

    /// What the run leaves behind.
    ///
    /// # Errors
    /// [`SimError::Stuck`] when nothing was recorded.
    pub fn finish(self) -> Result<RunRecord, SimError> {
        let (host, at_s) = (self.host, self.desk.ms() as f64 * 1.0e-3);
        let (Some(hello), Some(calibration), Some(start)) = (host.hello, host.calibration, host.start) else {
            return Err(SimError::Stuck { phase: host.phase.name(), state: host.state, at_s });
        };
        Ok(RunRecord {
            telemetry: self.telemetry,
            hello,
            calibration,
            start,
            samples: host.samples,
            events: host.events,
            link: host.decoder.stats(),
            truth: self.truth,
        })
    }
}

/// Conversions of a pin at an end of its range.
fn stuck(count: u16, high: bool) -> AdcBlock {
    let code = if high { 4095 } else { 0 };
    let wide = u32::from(code);
    AdcBlock { sum: wide * u32::from(count), sum_sq: u64::from(wide * wide) * u64::from(count), count, min: code, max: code }
}
