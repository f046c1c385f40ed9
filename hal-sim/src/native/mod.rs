//! The native run: the portable firmware against the bench, as fast as the host allows.
//!
//! What it is: a host, a wire, a board and a bench in one loop of one millisecond. The host arms the rig (it throws the power
//! switch and forwards the beeps it hears), tares it, runs the schedule and records; both directions go through the real codec.
//! What can go wrong: a refused command, a latched fault or a phase that does not end stops the run with a [`SimError`].
//! Units: ms of simulated time in the loop; raw codes in the record.
//! Reference: specification `rig.md`, "ESC pulse and arming" and "Acquisition"; `formats.md`, "Telemetry".

pub mod ahrs;
mod board;
mod host;
mod pins;
mod record;

pub use board::{Board, POWER_ON, SOFTWARE, WATCHDOG, Wires};
pub use pins::{PinRecord, PinsError};
pub use record::{RunRecord, SimError};

use crate::bench::{Bench, Millisecond, Truth};
use crate::noise::{Source, Stream};
use crate::plant::Powerplant;
use crate::scenario::{FaultKind, Scenario, ScheduledFault};
use crate::sensor::EdgeDetail;
use firmware_rig::{AdcBlock, Config};
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
    let mut session = Session::new(scenario, plant);
    while session.step()? {
        if session.ms.is_multiple_of(1000) {
            progress(session.share());
        }
    }
    let record = session.finish()?;
    progress(1.0);
    Ok(record)
}

/// A native run that is taken a millisecond at a time: to pause, to single-step, to watch, to record its pins.
pub struct Session {
    bench: Bench,
    host: Host,
    board: Board,
    gathered: Millisecond,
    telemetry: Vec<u8>,
    truth: Vec<Truth>,
    frame_pulse: PulseWidth,
    ms: u64,
    run_s: f64,
    limit_ms: u64,
    faults: Vec<ScheduledFault>,
    line: Stream,
    dark: bool,
    pins: Option<PinRecord>,
}

impl Session {
    /// A rig, a board and a host, none of them switched on.
    #[must_use]
    pub fn new(scenario: &Scenario, plant: Option<Box<dyn Powerplant>>) -> Self {
        let config = firmware_config(scenario);
        Self {
            bench: Bench::new(scenario, plant, EdgeDetail::Captured),
            host: Host::new(scenario),
            board: Board::new(config),
            gathered: Millisecond::default(),
            telemetry: Vec::new(),
            truth: Vec::new(),
            frame_pulse: PulseWidth::MIN,
            ms: 0,
            run_s: scenario.run_s(),
            limit_ms: (scenario.run_s() * 1000.0) as u64 + OVERHEAD_MS,
            faults: scenario.faults.clone(),
            line: Stream::new(scenario.seed, Source::Line, 0),
            dark: false,
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
        self.ms as f64 * 1.0e-3
    }

    /// What the host is doing.
    #[must_use]
    pub fn phase(&self) -> &'static str {
        self.host.phase.name()
    }

    /// What is really there.
    #[must_use]
    pub fn truth(&self) -> Truth {
        self.bench.truth()
    }

    /// The sample that arrived last.
    #[must_use]
    pub fn sample(&self) -> Option<RigSample> {
        self.host.samples.last().copied()
    }

    /// Share of the logged run that is done.
    #[must_use]
    pub fn share(&self) -> f64 {
        let now = Ticks::from_ms(self.ms).as_s();
        self.host.start.map_or(0.0, |s| (now - s.as_s()) / self.run_s).min(1.0)
    }

    /// Time of the run, s; negative before it.
    fn run_time(&self) -> f64 {
        self.host.start.map_or(-1.0, |start| Ticks::from_ms(self.ms).as_s() - start.as_s())
    }

    fn on(&self, wanted: impl Fn(&FaultKind) -> bool) -> Option<FaultKind> {
        if self.faults.is_empty() {
            return None;
        }
        let run_s = self.run_time();
        self.faults.iter().find(|f| f.is_on(run_s) && wanted(&f.kind)).map(|f| f.kind)
    }

    /// One millisecond; `false` once the run is over.
    ///
    /// # Errors
    /// See [`SimError`].
    pub fn step(&mut self) -> Result<bool, SimError> {
        if self.host.phase == Phase::Done {
            return Ok(false);
        }
        self.ms += 1;
        let ms = self.ms;
        let dark = self.on(|k| matches!(k, FaultKind::BrownOut)).is_some();
        if dark != self.dark {
            self.bench.set_power(!dark);
            self.dark = dark;
        }
        // The timer takes a new pulse at the start of a 20 ms frame; the pulse has ended 2 ms later at the latest.
        match ms % 20 {
            0 => self.frame_pulse = self.board.pulse(),
            2 if !dark => self.bench.pulse((ms - 2) * 1_000_000 + u64::from(self.frame_pulse.0), self.frame_pulse.0),
            _ => {}
        }
        self.bench.millisecond(&mut self.gathered);
        let run_s = if self.faults.is_empty() { -1.0 } else { self.run_time() };
        for fault in self.faults.iter().filter(|f| f.is_on(run_s)) {
            if let FaultKind::AdcStuck { channel, high } = fault.kind
                && let Some(block) = self.gathered.adc.get_mut(usize::from(channel))
            {
                *block = stuck(block.count, high);
            }
        }
        let now = Ticks::from_ms(ms);
        self.host.step(ms, &mut self.bench);
        let mut bytes = Vec::new();
        if let Some(wanted) = self.host.send(ms) {
            let mut frame = [0; MAX_WIRE];
            let length = self.host.encoder.encode(now, &wanted, &mut frame).map_err(|_| SimError::Codec)?;
            if self.on(|k| matches!(k, FaultKind::LinkLost)).is_none() {
                bytes = frame[..length].to_vec();
            }
        }
        if let Some(pins) = &mut self.pins {
            pins.take(&self.gathered, &bytes, dark);
        }
        self.board.pass(now, &self.gathered, &bytes, dark);
        if !dark {
            self.deliver(now)?;
        }
        if self.host.phase != Phase::Done && ms > self.limit_ms {
            return Err(SimError::Stuck { phase: self.host.phase.name(), state: self.host.state, at_s: now.as_s() });
        }
        if !self.faults.is_empty() {
            self.host.give_up(ms, self.run_time() > self.run_s);
        }
        Ok(self.host.phase != Phase::Done)
    }

    /// The board's bytes reach the host, as far as the line lets them.
    fn deliver(&mut self, now: Ticks) -> Result<(), SimError> {
        let mut sent = self.board.sent();
        if sent.is_empty() {
            return Ok(());
        }
        let dropped = self.on(|k| matches!(k, FaultKind::TelemetryDropped { .. }));
        let corrupted = self.on(|k| matches!(k, FaultKind::TelemetryCorrupted { .. }));
        if let Some(FaultKind::TelemetryDropped { probability }) = dropped
            && self.line.uniform() < probability
        {
            sent.clear();
        }
        if let Some(FaultKind::TelemetryCorrupted { probability }) = corrupted {
            for byte in &mut sent {
                if self.line.uniform() < probability {
                    *byte ^= 1 << ((self.line.uniform() * 8.0) as u32).min(7);
                }
            }
        }
        let recorded = self.host.samples.len();
        for byte in &sent {
            if let Some(received) = self.host.decoder.push::<Message>(*byte) {
                self.host.take(received.message, self.ms)?;
            }
        }
        self.telemetry.append(&mut sent);
        if self.host.samples.len() > recorded {
            if recorded == 0 {
                self.bench.start_run();
            }
            let run_s = (now.as_s() - self.host.start.unwrap_or(now).as_s()).max(0.0);
            self.truth.push(Truth { run_s, ..self.bench.truth() });
        }
        Ok(())
    }

    /// What the run leaves behind.
    ///
    /// # Errors
    /// [`SimError::Stuck`] when nothing was recorded.
    pub fn finish(self) -> Result<RunRecord, SimError> {
        let host = self.host;
        let (Some(hello), Some(calibration), Some(start)) = (host.hello, host.calibration, host.start) else {
            return Err(SimError::Stuck { phase: host.phase.name(), state: host.state, at_s: 0.0 });
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
