//! The sections of a scenario file and their checks.
//!
//! What it is: one type a TOML table, each with its defaults.
//! What can go wrong: a value out of its range is refused where it stands, so that the error has its line and column.
//! Units: each key carries its own.
//! Reference: `docs/scenario.md`.

use crate::number::{checked, not_negative, positive};
use crate::plant::{CutOff, Guard};
use frame::message::MAX_UPLOAD;
use schedule::{Plan, Replay, ScheduleError, part};
use serde::{Deserialize, Deserializer, Serialize, de::Error};
use std::path::{Path, PathBuf};

/// What feeds the ESC.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum SupplySection {
    /// Bench supply.
    Bench {
        /// Set voltage, V.
        #[serde(deserialize_with = "positive")]
        voltage_v: f64,
    },
    /// Battery.
    Lipo {
        /// Cells in series.
        #[serde(deserialize_with = "cells")]
        cells: u32,
        /// Charge from full to empty, A.h.
        #[serde(deserialize_with = "positive")]
        capacity_ah: f64,
        /// Resistance of the pack, ohm.
        #[serde(deserialize_with = "not_negative")]
        resistance_ohm: f64,
    },
}

/// Air at the rig.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AirSection {
    /// Temperature, degC; the rig starts with it.
    #[serde(deserialize_with = "celsius")]
    pub temperature_c: f64,
    /// Pressure, Pa.
    #[serde(deserialize_with = "positive")]
    pub pressure_pa: f64,
}

/// One step of a schedule.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// Pulse, us.
    #[serde(deserialize_with = "pulse")]
    pub pulse_us: f64,
    /// How long to hold it, s.
    #[serde(deserialize_with = "duration")]
    pub hold_s: f64,
    /// Ramp to it during the hold instead of stepping.
    #[serde(default)]
    pub ramp: bool,
}

/// What the throttle does.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Schedule {
    /// Levels upwards from 1000 us.
    Staircase {
        /// Height of a step, us.
        #[serde(deserialize_with = "step")]
        step_us: f64,
        /// Hold of each level, s.
        #[serde(deserialize_with = "duration")]
        hold_s: f64,
        /// Highest level, us.
        #[serde(deserialize_with = "pulse")]
        top_us: f64,
    },
    /// The same, and down again.
    UpDown {
        /// Height of a step, us.
        #[serde(deserialize_with = "step")]
        step_us: f64,
        /// Hold of each level, s.
        #[serde(deserialize_with = "duration")]
        hold_s: f64,
        /// Highest level, us.
        #[serde(deserialize_with = "pulse")]
        top_us: f64,
    },
    /// A list: up to 64 uploaded step by step, more of them sent ahead of their playing.
    Steps {
        /// The list.
        #[serde(deserialize_with = "steps")]
        steps: Vec<Step>,
    },
    /// A sine whose frequency moves linearly.
    Chirp(ChirpSection),
    /// The pulses of a log.
    Replay(ReplaySection),
    /// A schedule file, or a verdict whose next experiment is flown.
    File {
        /// The file, from the scenario's folder.
        file: PathBuf,
        /// What stands in it.
        #[serde(skip)]
        plan: Plan,
    },
}

/// A sine about a level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "ChirpKeys")]
pub struct ChirpSection {
    /// Middle, us.
    pub centre_us: f64,
    /// Amplitude, us.
    pub amplitude_us: f64,
    /// Frequency at the beginning, Hz.
    pub from_hz: f64,
    /// Frequency at the end, Hz.
    pub to_hz: f64,
    /// Duration, s.
    pub length_s: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ChirpKeys {
    #[serde(deserialize_with = "pulse")]
    centre_us: f64,
    #[serde(deserialize_with = "not_negative")]
    amplitude_us: f64,
    #[serde(deserialize_with = "frequency")]
    from_hz: f64,
    #[serde(deserialize_with = "frequency")]
    to_hz: f64,
    #[serde(deserialize_with = "duration")]
    length_s: f64,
}

impl TryFrom<ChirpKeys> for ChirpSection {
    type Error = String;

    fn try_from(keys: ChirpKeys) -> Result<Self, String> {
        let ChirpKeys { centre_us, amplitude_us, from_hz, to_hz, length_s } = keys;
        let room = (centre_us - 1000.0).min(2000.0 - centre_us);
        if amplitude_us <= room {
            Ok(Self { centre_us, amplitude_us, from_hz, to_hz, length_s })
        } else {
            Err(format!(
                "expected an amplitude_us of at most {room}, so that no pulse leaves 1000 to 2000 us; found {amplitude_us}"
            ))
        }
    }
}

/// The pulses of a log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReplaySection {
    /// The log, from the scenario's folder.
    pub file: PathBuf,
    /// Its column.
    #[serde(default = "pulse_column")]
    pub column: String,
    /// Begin, s of the log's own time.
    pub from_s: Option<f64>,
    /// End, s.
    pub until_s: Option<f64>,
    /// What stands in it.
    #[serde(skip)]
    pub plan: Plan,
}

fn pulse_column() -> String {
    Replay::default().column
}

/// Speed sensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorSection {
    /// Which are fitted.
    pub fitted: Vec<SpeedSensor>,
    /// Deviation of the hall sensor's second magnet from 180 degrees, deg.
    pub magnet_error_deg: f64,
    /// The board listens to the ESC's telemetry.
    pub esc_telemetry: bool,
    /// The board counts the edges of a back-EMF meter.
    pub back_emf: bool,
}

/// The four speed sensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SpeedSensor {
    /// Infra-red beam.
    Beam,
    /// Reflective opto sensor.
    Opto,
    /// Hall sensor.
    Hall,
    /// Encoder.
    Encoder,
}

/// The log.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LogSection {
    /// Samples a second, 1 to 1000, a divisor of 1000.
    #[serde(deserialize_with = "log_rate")]
    pub rate_hz: u32,
}

/// The ESC: what it has stored and how it protects itself.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EscSection {
    /// Stored pulse of zero throttle, us.
    #[serde(deserialize_with = "pulse")]
    pub range_min_us: f64,
    /// Stored pulse of full throttle, us.
    #[serde(deserialize_with = "pulse")]
    pub range_max_us: f64,
    /// Threshold of the low-voltage protection, V a cell; 0 for none.
    #[serde(deserialize_with = "not_negative")]
    pub cutoff_v_per_cell: f64,
    /// What the low-voltage protection does.
    pub cutoff: CutOff,
    /// Rise of the ESC's temperature at a steady current, K/A^2; beyond 110 degC it reduces its output.
    #[serde(deserialize_with = "not_negative")]
    pub rise_k_per_a2: f64,
    /// Its self-test fails.
    pub self_test_fails: bool,
    /// It sends its telemetry only when it is asked, as by DShot; otherwise by itself.
    pub telemetry_asked: bool,
}

impl Default for EscSection {
    fn default() -> Self {
        let g = Guard::default();
        Self {
            range_min_us: 1000.0,
            range_max_us: 2000.0,
            cutoff_v_per_cell: g.cutoff_v_per_cell,
            cutoff: g.cutoff,
            rise_k_per_a2: g.rise_k_per_a2,
            self_test_fails: false,
            telemetry_asked: false,
        }
    }
}

/// Noise: standard deviation of the mean over 0.1 s of the analogue channels, jitter of the edges, turbulence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NoiseSection {
    /// Thrust, N.
    #[serde(deserialize_with = "not_negative")]
    pub thrust_n: f64,
    /// Torque, N.m.
    #[serde(deserialize_with = "not_negative")]
    pub torque_nm: f64,
    /// Current, A.
    #[serde(deserialize_with = "not_negative")]
    pub current_a: f64,
    /// Voltage, V.
    #[serde(deserialize_with = "not_negative")]
    pub voltage_v: f64,
    /// Temperature, K.
    #[serde(deserialize_with = "not_negative")]
    pub temp_k: f64,
    /// Angle at which the beam, the reflective and the hall sensor see a mark, deg; the encoder has 0.4 of it.
    #[serde(deserialize_with = "not_negative")]
    pub edge_deg: f64,
    /// Relative fluctuation of the drag torque in the rotor's own wake.
    #[serde(deserialize_with = "not_negative")]
    pub gust: f64,
}

impl Default for AirSection {
    /// 15 degC at 101 325 Pa, where the catalogue's coefficients hold.
    fn default() -> Self {
        Self { temperature_c: 15.0, pressure_pa: 101_325.0 }
    }
}

impl Default for SensorSection {
    fn default() -> Self {
        let fitted = vec![SpeedSensor::Beam, SpeedSensor::Opto, SpeedSensor::Hall, SpeedSensor::Encoder];
        Self { fitted, magnet_error_deg: 0.0, esc_telemetry: false, back_emf: false }
    }
}

impl Default for LogSection {
    fn default() -> Self {
        Self { rate_hz: 10 }
    }
}

impl Default for NoiseSection {
    fn default() -> Self {
        Self { thrust_n: 0.007, torque_nm: 0.0003, current_a: 0.03, voltage_v: 0.01, temp_k: 0.1, edge_deg: 0.12, gust: 0.002 }
    }
}

impl Schedule {
    /// How long it takes, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        let levels = |step: f64, top: f64| ((top - 1000.0) / step + 1.0e-9).floor() + 1.0;
        match self {
            Self::Staircase { step_us, hold_s, top_us } => levels(*step_us, *top_us) * hold_s,
            Self::UpDown { step_us, hold_s, top_us } => (2.0 * levels(*step_us, *top_us) - 1.0) * hold_s,
            Self::Steps { steps } => steps.iter().map(|s| s.hold_s).sum(),
            Self::Chirp(chirp) => chirp.length_s,
            Self::Replay(ReplaySection { plan, .. }) | Self::File { plan, .. } => plan.longest_s(),
        }
    }

    /// The file that it names, of the scenario in `scenario`, and the files that this one names.
    #[must_use]
    pub fn files(&self, scenario: &Path) -> Vec<PathBuf> {
        let (Self::File { file, .. } | Self::Replay(ReplaySection { file, .. })) = self else { return Vec::new() };
        let file = scenario.parent().unwrap_or(Path::new("")).join(file);
        let more = if matches!(self, Self::File { .. }) { Plan::files(&file) } else { Vec::new() };
        std::iter::once(file).chain(more).collect()
    }

    /// Reads the files that it names, from `folder`.
    ///
    /// # Errors
    /// [`ScheduleError`], with the file's own line and column.
    pub(crate) fn load(&mut self, folder: &Path) -> Result<(), ScheduleError> {
        match self {
            Self::File { file, plan } => *plan = Plan::read(&folder.join(file))?,
            Self::Replay(ReplaySection { file, column, from_s, until_s, plan }) => {
                let whole = Replay::default();
                let (from_s, until_s) = (from_s.unwrap_or(whole.from_s), until_s.unwrap_or(whole.until_s));
                let what = Replay { column: column.clone(), from_s, until_s };
                *plan = Plan::new("replay", vec![schedule::replay(&folder.join(file), &what)?]);
            }
            _ => {}
        }
        Ok(())
    }

    /// What is played by segments; `None` of a schedule that the board knows by itself.
    #[must_use]
    pub fn plan(&self) -> Option<Plan> {
        match self {
            Self::Replay(ReplaySection { plan, .. }) | Self::File { plan, .. } => Some(plan.clone()),
            Self::Steps { steps } if steps.len() > MAX_UPLOAD => {
                let ms = |s: f64| (s * 1000.0 + 0.5) as u32;
                let list: Vec<(part::Level, bool)> =
                    steps.iter().map(|s| ((super::pulse_width(s.pulse_us), ms(s.hold_s)), s.ramp)).collect();
                Some(Plan::new("steps", vec![part::steps(&list)]))
            }
            _ => None,
        }
    }
}

/// Longest time that a schedule may name, s; that of schedule files.
const LONGEST_S: f64 = 86_400.0;

fn duration<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    checked(d, |v| v > 0.0 && v <= LONGEST_S, "a time above 0 and up to 86400 s")
}

fn cells<'de, D: Deserializer<'de>>(d: D) -> Result<u32, D::Error> {
    let cells = u32::deserialize(d)?;
    if (1..=14).contains(&cells) { Ok(cells) } else { Err(D::Error::custom(format!("expected 1 to 14 cells, found {cells}"))) }
}

fn celsius<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    checked(d, |v| (-40.0..=85.0).contains(&v), "a temperature from -40 to 85 degC")
}

fn pulse<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    checked(d, |v| (1000.0..=2000.0).contains(&v), "a pulse from 1000 to 2000 us")
}

/// The staircase of a board has no higher step than the whole range.
fn step<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    checked(d, |v| v > 0.0 && v <= 1000.0, "a step above 0 and up to 1000 us")
}

fn frequency<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    let most = f64::from(frame::schedule::FASTEST_MILLIHERTZ) / 1e3;
    checked(d, |v| (0.0..=most).contains(&v), &format!("a frequency from 0 to {most} Hz"))
}

fn log_rate<'de, D: Deserializer<'de>>(d: D) -> Result<u32, D::Error> {
    let rate = u32::deserialize(d)?;
    if (1..=1000).contains(&rate) && 1000 % rate == 0 {
        Ok(rate)
    } else {
        Err(D::Error::custom(format!("expected a rate from 1 to 1000 Hz that divides 1000, found {rate}")))
    }
}

fn steps<'de, D: Deserializer<'de>>(d: D) -> Result<Vec<Step>, D::Error> {
    let list = Vec::<Step>::deserialize(d)?;
    if list.is_empty() { Err(D::Error::custom("expected at least one step, found none")) } else { Ok(list) }
}
