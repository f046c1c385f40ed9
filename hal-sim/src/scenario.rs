//! What to simulate, as a file.
//!
//! What it is: a TOML description of motor, propeller, supply, air, schedule, sensors, noise, effects and seed, with a default
//! for everything: an empty file is the demonstration rig without an effect.
//! What can go wrong: an unknown key, a wrong type or a value out of its range is refused with file, line and column.
//! Units: each key carries its own.
//! Reference: specification `rig.md`, "The simulator"; `docs/scenario.md` lists every key.

use crate::bench::BenchParts;
use crate::effect::{self, EffectKind};
use crate::plant::{Air, Beam, Bridge, Esc, Motor, Parts, Propeller, Supply, Thermal, supply};
use crate::sensor::Geometry;
use frame::rig::CAPTURE_CHANNELS;
use frame::units::PulseWidth;
use serde::{Deserialize, Deserializer, Serialize, de::Error};
use std::path::{Path, PathBuf};

/// Why a scenario was refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScenarioError {
    /// The text is not a scenario.
    #[error("{}:{line}:{column}: {reason}", file.display())]
    Refused {
        /// File that was read.
        file: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What was expected.
        reason: String,
    },
    /// The file cannot be read.
    #[error("{}: {source}", file.display())]
    Unreadable {
        /// File that was to be read.
        file: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// No effect has this id.
    #[error("no effect is called {0:?}; there are: {list}", list = effect_ids())]
    UnknownEffect(String),
}

fn effect_ids() -> String {
    effect::catalogue().iter().map(|e| e.id).collect::<Vec<_>>().join(", ")
}

/// A simulated run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scenario {
    /// Title.
    pub name: String,
    /// Seed of every random stream.
    pub seed: u64,
    /// Motor, by the thesis' names ("570KV").
    #[serde(deserialize_with = "motor_name")]
    pub motor: String,
    /// Propeller, by the thesis' names ("11x4.7").
    #[serde(deserialize_with = "propeller_name")]
    pub propeller: String,
    /// What feeds the ESC.
    pub supply: SupplySection,
    /// Air at the rig.
    pub air: AirSection,
    /// What the throttle does.
    pub schedule: Schedule,
    /// Motor off before and after the schedule, s.
    #[serde(deserialize_with = "positive")]
    pub rest_s: f64,
    /// Speed sensors.
    pub sensors: SensorSection,
    /// The log.
    pub log: LogSection,
    /// Noise.
    pub noise: NoiseSection,
    /// Hidden effects.
    #[serde(rename = "effect")]
    pub effects: Vec<EffectKind>,
}

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
    #[serde(deserialize_with = "positive")]
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
        #[serde(deserialize_with = "positive")]
        step_us: f64,
        /// Hold of each level, s.
        #[serde(deserialize_with = "positive")]
        hold_s: f64,
        /// Highest level, us.
        #[serde(deserialize_with = "pulse")]
        top_us: f64,
    },
    /// The same, and down again.
    UpDown {
        /// Height of a step, us.
        #[serde(deserialize_with = "positive")]
        step_us: f64,
        /// Hold of each level, s.
        #[serde(deserialize_with = "positive")]
        hold_s: f64,
        /// Highest level, us.
        #[serde(deserialize_with = "pulse")]
        top_us: f64,
    },
    /// A list, uploaded step by step; 64 at most.
    Steps {
        /// The list.
        #[serde(deserialize_with = "steps")]
        steps: Vec<Step>,
    },
}

/// Speed sensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorSection {
    /// Which are fitted.
    pub fitted: Vec<SpeedSensor>,
    /// Deviation of the hall sensor's second magnet from 180 degrees, deg.
    pub magnet_error_deg: f64,
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
    /// Samples a second, 1 to 100, a divisor of 1000.
    #[serde(deserialize_with = "log_rate")]
    pub rate_hz: u32,
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

impl Default for Scenario {
    fn default() -> Self {
        Self {
            name: "demonstration rig".to_owned(),
            seed: 1,
            motor: "570KV".to_owned(),
            propeller: "11x4.7".to_owned(),
            supply: SupplySection::Bench { voltage_v: 11.5 },
            air: AirSection::default(),
            schedule: Schedule::UpDown { step_us: 50.0, hold_s: 8.0, top_us: 2000.0 },
            rest_s: 2.0,
            sensors: SensorSection::default(),
            log: LogSection::default(),
            noise: NoiseSection::default(),
            effects: Vec::new(),
        }
    }
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
        Self { fitted, magnet_error_deg: 0.0 }
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
        }
    }
}

impl Scenario {
    /// The demonstration: 570 KV with 11x4.7 on 11.5 V, 1000 to 2000 us and back in steps of 50 us, 8 s each, with one effect of
    /// the catalogue drawn from the seed, or none.
    ///
    /// # Errors
    /// [`ScenarioError::UnknownEffect`] when the catalogue has no such id.
    pub fn demo(seed: u64, effect: Option<&str>) -> Result<Self, ScenarioError> {
        let mut scenario = Self { seed, ..Self::default() };
        if let Some(id) = effect {
            let entry = effect::find(id).ok_or_else(|| ScenarioError::UnknownEffect(id.to_owned()))?;
            scenario.name = format!("demonstration rig with {id}");
            scenario.effects.push(entry.draw(seed, scenario.run_s()));
        }
        Ok(scenario)
    }

    /// Reads a scenario file.
    ///
    /// # Errors
    /// [`ScenarioError::Unreadable`], or [`ScenarioError::Refused`] with line and column.
    pub fn load(file: &Path) -> Result<Self, ScenarioError> {
        let text = std::fs::read_to_string(file).map_err(|source| ScenarioError::Unreadable { file: file.to_owned(), source })?;
        Self::parse(&text, file)
    }

    /// Reads a scenario from `text`; `file` names it in errors.
    ///
    /// # Errors
    /// [`ScenarioError::Refused`] with line and column.
    pub fn parse(text: &str, file: &Path) -> Result<Self, ScenarioError> {
        toml::from_str(text).map_err(|error| {
            let at = error.span().map_or(0, |s| s.start).min(text.len());
            let before = text.get(..at).unwrap_or(text);
            let line = before.matches('\n').count() + 1;
            let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
            let reason = error.message().replace('\n', " ");
            ScenarioError::Refused { file: file.to_owned(), line, column, reason }
        })
    }

    /// Length of the logged run, s.
    #[must_use]
    pub fn run_s(&self) -> f64 {
        self.schedule.duration_s() + 2.0 * self.rest_s
    }

    /// The parts of the bench before any effect.
    #[must_use]
    pub fn parts(&self) -> BenchParts {
        let propeller = Propeller::named(&self.propeller).expect("the name was checked on reading");
        let motor = Motor::named(&self.motor).expect("the name was checked on reading");
        let supply = match self.supply {
            SupplySection::Bench { voltage_v } => Supply::new(supply::Source::Bench { voltage_v }, 0.0),
            SupplySection::Lipo { cells, capacity_ah, resistance_ohm } => {
                Supply::new(supply::Source::LiPo { cells, capacity_ah, charge: 1.0 }, resistance_ohm)
            }
        };
        let n = &self.noise;
        let mut fitted = [false; CAPTURE_CHANNELS];
        for sensor in &self.sensors.fitted {
            fitted[*sensor as usize] = true;
        }
        let edge = n.edge_deg;
        BenchParts {
            geometry: Geometry {
                fitted,
                blades: propeller.blades,
                magnet_error_deg: self.sensors.magnet_error_deg,
                jitter_deg: [edge, edge, edge, 0.4 * edge],
                ..Geometry::default()
            },
            plant: Parts {
                supply,
                motor,
                propeller,
                air: Air { temperature_c: self.air.temperature_c, pressure_pa: self.air.pressure_pa },
                thermal: Thermal { ambient_c: self.air.temperature_c, ..Thermal::default() },
                start_throttle: Esc::default().start_throttle,
                throttle_lag_s: (0.0, 0.0),
                gust: n.gust,
            },
            esc: Esc::default(),
            beam: Beam::default(),
            bridge: Bridge { zero_temperature_c: self.air.temperature_c, ..Bridge::default() },
            noise: [n.thrust_n, n.torque_nm, n.current_a, n.voltage_v, n.temp_k],
        }
    }
}

fn checked<'de, D: Deserializer<'de>>(d: D, ok: impl Fn(f64) -> bool, expected: &str) -> Result<f64, D::Error> {
    let value = f64::deserialize(d)?;
    if ok(value) { Ok(value) } else { Err(D::Error::custom(format!("expected {expected}, found {value}"))) }
}

fn positive<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    checked(d, |v| v > 0.0 && v.is_finite(), "a number above 0")
}

fn not_negative<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    checked(d, |v| v >= 0.0 && v.is_finite(), "a number not below 0")
}

fn celsius<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    checked(d, |v| (-40.0..=85.0).contains(&v), "a temperature from -40 to 85 degC")
}

fn pulse<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    checked(d, |v| (1000.0..=2000.0).contains(&v), "a pulse from 1000 to 2000 us")
}

fn log_rate<'de, D: Deserializer<'de>>(d: D) -> Result<u32, D::Error> {
    let rate = u32::deserialize(d)?;
    if (1..=100).contains(&rate) && 1000 % rate == 0 {
        Ok(rate)
    } else {
        Err(D::Error::custom(format!("expected a rate from 1 to 100 Hz that divides 1000, found {rate}")))
    }
}

fn steps<'de, D: Deserializer<'de>>(d: D) -> Result<Vec<Step>, D::Error> {
    let list = Vec::<Step>::deserialize(d)?;
    let most = frame::message::MAX_UPLOAD;
    if (1..=most).contains(&list.len()) {
        Ok(list)
    } else {
        Err(D::Error::custom(format!("expected 1 to {most} steps, found {}", list.len())))
    }
}

fn motor_name<'de, D: Deserializer<'de>>(d: D) -> Result<String, D::Error> {
    let name = String::deserialize(d)?;
    if Motor::named(&name).is_some() {
        return Ok(name);
    }
    let names = crate::plant::motor::MOTORS.map(|(kv, _)| format!("{kv}KV")).join(", ");
    Err(D::Error::custom(format!("expected one of {names}, found {name:?}")))
}

fn propeller_name<'de, D: Deserializer<'de>>(d: D) -> Result<String, D::Error> {
    let name = String::deserialize(d)?;
    if Propeller::named(&name).is_some() {
        return Ok(name);
    }
    let names = Propeller::names().collect::<Vec<_>>().join(", ");
    Err(D::Error::custom(format!("expected one of {names}, found {name:?}")))
}

/// A pulse in whole nanoseconds.
#[must_use]
pub(crate) fn pulse_width(us: f64) -> PulseWidth {
    PulseWidth((us * 1000.0 + 0.5) as u32)
}
