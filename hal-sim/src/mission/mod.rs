//! What to fly, as a file.
//!
//! What it is: a TOML description of a flight (start, air, wind, pulses) and one of the airframe, with a default for everything: an
//! empty mission is the thesis' quadrotor that hovers for 10 s at 63 m.
//! What can go wrong: an unknown key, a wrong type, a value out of its range or a rotor that the airframe does not have is refused
//! with file, line and column.
//! Units: each key carries its own.
//! Reference: specification `flight.md`, "Missions"; `docs/mission.md` lists every key.

mod aboard;
mod airframe;
mod bounds;
mod fly;
mod hovering;
mod pulses;
mod sections;
mod steering;

pub use aboard::{Seen, apart};
pub use airframe::{AirframeFile, RotorSection};
pub use bounds::{LONGEST_S, MOST_ROWS};
pub use fly::{Flight, Touch, catalogue_plants, fly, fly_again, fly_whole};
pub use hovering::{Catalogue, HoverPoint, Modes, RotorCurves, hover, modes};
pub use pulses::PulseTable;
pub use sections::{Chips, ControllerSection, FailureSection, ImuSection, PositioningSection, WayPoint};

use crate::flight::attitude::from_euler;
use crate::flight::vehicle::Surroundings;
use crate::flight::wind::Blowing;
use crate::flight::{Motion, Vector};
use crate::number::not_negative;
use crate::scenario::{ScenarioError, Step, parsed, refused, text_of};
use serde::{Deserialize, Deserializer, Serialize, de::Error};
use std::path::{Path, PathBuf};
use toml::Spanned;

/// A flight.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mission {
    /// Title.
    pub name: String,
    /// Seed of the gusts.
    pub seed: u64,
    /// Longest flight, s; 0 for as long as the longest list of pulses.
    #[serde(deserialize_with = "not_negative")]
    pub duration_s: f64,
    /// The flight ends as soon as a rotor touches the ground.
    pub ends_on_ground: bool,
    /// Rows of the log a second: a divisor of 1000.
    #[serde(deserialize_with = "rate")]
    pub log_hz: u32,
    /// Airframe file, from the mission's folder; without one, the thesis' quadrotor.
    pub airframe: Option<PathBuf>,
    /// How it begins.
    pub start: StartSection,
    /// The air.
    pub air: AirSection,
    /// The wind.
    pub wind: WindSection,
    /// Pulses.
    pub command: Vec<CommandSection>,
    /// The IMU board that rides along.
    pub imu: Option<ImuSection>,
    /// The controller that steers on the board's attitude, in the place of all pulses.
    pub controller: Option<ControllerSection>,
    /// What fails.
    pub failure: Vec<FailureSection>,
    /// Table of pulses, from the mission's folder, for the rotors that no command names.
    pub pulses: Option<PathBuf>,
    /// What that table says.
    #[serde(skip)]
    pub table: PulseTable,
}

/// How a flight begins.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StartSection {
    /// Height of the body above ground, m; at 0 it stands on it.
    #[serde(deserialize_with = "bounds::height")]
    pub height_m: f64,
    /// Velocity over ground, earth NED, m/s.
    #[serde(deserialize_with = "bounds::speeds")]
    pub velocity_m_s: [f64; 3],
    /// Roll, pitch, yaw, deg.
    #[serde(deserialize_with = "bounds::angles")]
    pub attitude_deg: [f64; 3],
    /// The rotors already run at the first pulses.
    pub spun_up: bool,
}

/// The air of a flight.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AirSection {
    /// Height of the ground above sea level, m.
    #[serde(deserialize_with = "bounds::altitude")]
    pub ground_altitude_m: f64,
    /// Departure from the standard atmosphere, K.
    #[serde(deserialize_with = "bounds::offset")]
    pub temperature_offset_k: f64,
}

/// The wind of a flight.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WindSection {
    /// Mean wind, earth NED, m/s: where the air moves to.
    #[serde(deserialize_with = "bounds::speeds")]
    pub steady_m_s: [f64; 3],
    /// Standard deviation of the gusts along each axis, m/s.
    #[serde(deserialize_with = "bounds::gust")]
    pub gust_m_s: f64,
    /// Length of the turbulence, m.
    #[serde(deserialize_with = "bounds::length")]
    pub gust_length_m: f64,
}

/// Pulses of some rotors.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CommandSection {
    /// Which rotors, from 1, each once.
    #[serde(deserialize_with = "bounds::some_rotors")]
    pub rotors: Vec<Spanned<usize>>,
    /// Their pulses one after the other; the last goes on to the end.
    #[serde(deserialize_with = "steps")]
    pub steps: Vec<Step>,
}

impl Default for Mission {
    fn default() -> Self {
        Self {
            name: "hover".to_owned(),
            seed: 1,
            duration_s: 10.0,
            ends_on_ground: false,
            log_hz: 100,
            airframe: None,
            start: StartSection { height_m: 63.0, ..StartSection::default() },
            air: AirSection::default(),
            wind: WindSection::default(),
            command: Vec::new(),
            imu: None,
            controller: None,
            failure: Vec::new(),
            pulses: None,
            table: PulseTable::default(),
        }
    }
}

impl Default for StartSection {
    fn default() -> Self {
        Self { height_m: 0.0, velocity_m_s: [0.0; 3], attitude_deg: [0.0; 3], spun_up: true }
    }
}

impl Default for WindSection {
    /// No wind; 50 m, should gusts be asked for.
    fn default() -> Self {
        Self { steady_m_s: [0.0; 3], gust_m_s: 0.0, gust_length_m: 50.0 }
    }
}

/// Pulse of a rotor that neither a command nor a table names: 8.36 % of 20 ms, the stated hover (errata, "hover"), us.
pub const HOVER_US: f64 = 1672.0;

impl Mission {
    /// Reads a mission and the airframe that it names.
    ///
    /// # Errors
    /// [`ScenarioError::Unreadable`], or [`ScenarioError::Refused`] with line and column.
    pub fn load(file: &Path) -> Result<(Self, AirframeFile), ScenarioError> {
        let text = text_of(file)?;
        let mut mission: Self = parsed(&text, file)?;
        let [airframe, pulses] = mission.files(file);
        let airframe = airframe.map_or_else(|| Ok(AirframeFile::default()), |path| AirframeFile::load(&path))?;
        let here = |(byte, reason)| refused(&text, file, byte, reason);
        mission.sound(&text, &airframe).map_err(here)?;
        if let Some(path) = pulses {
            mission.table = PulseTable::load(&path, airframe.rotors().len())?;
        }
        mission.short_enough(&text).map_err(here)?;
        Ok((mission, airframe))
    }

    /// The airframe file and the table of pulses that the mission in `file` names.
    #[must_use]
    pub fn files(&self, file: &Path) -> [Option<PathBuf>; 2] {
        let folder = file.parent().unwrap_or(Path::new(""));
        [&self.airframe, &self.pulses].map(|name| name.as_ref().map(|name| folder.join(name)))
    }

    /// Reads a mission for the thesis' quadrotor from `text`; `file` names it in errors.
    ///
    /// # Errors
    /// [`ScenarioError::Refused`] with line and column.
    pub fn parse(text: &str, file: &Path) -> Result<Self, ScenarioError> {
        let mission: Self = parsed(text, file)?;
        let sound = mission.sound(text, &AirframeFile::default()).and_then(|()| mission.short_enough(text));
        sound.map_err(|(byte, reason)| refused(text, file, byte, reason))?;
        Ok(mission)
    }

    /// How long the flight may last, s.
    #[must_use]
    pub fn length_s(&self) -> f64 {
        let longest = self.command.iter().map(|c| c.steps.iter().map(|s| s.hold_s).sum()).fold(self.table.length_s(), f64::max);
        let way = self.controller.as_ref().and_then(|c| c.way.last()).map_or(0.0, |w| w.at_s);
        if self.duration_s > 0.0 { self.duration_s } else { longest.max(way) }
    }

    /// Pulse of a rotor (from 0) at a time, us; the last command that names it counts, then the table of pulses.
    #[must_use]
    pub fn pulse_us(&self, rotor: usize, t_s: f64) -> f64 {
        let of_it = self.command.iter().rev().find(|c| c.rotors.iter().any(|r| *r.get_ref() == rotor + 1));
        of_it.map(|c| at(&c.steps, t_s)).or_else(|| self.table.pulse_us(rotor, t_s)).unwrap_or(HOVER_US)
    }

    /// Whether two rotors (from 0) get the same pulses throughout.
    #[must_use]
    pub fn same_pulses(&self, a: usize, b: usize) -> bool {
        let of = |rotor: usize| self.command.iter().rposition(|c| c.rotors.iter().any(|r| *r.get_ref() == rotor + 1));
        a == b || (of(a).is_some() && of(a) == of(b))
    }

    /// The surroundings.
    #[must_use]
    pub fn surroundings(&self) -> Surroundings {
        Surroundings {
            ground_altitude_m: self.air.ground_altitude_m,
            temperature_offset_k: self.air.temperature_offset_k,
            blowing: Blowing {
                steady: self.wind.steady_m_s,
                gust_m_s: self.wind.gust_m_s,
                gust_length_m: self.wind.gust_length_m,
            },
            seed: self.seed,
        }
    }

    /// Density of the air on the ground, kg/m^3.
    #[must_use]
    pub fn ground_density(&self) -> f64 {
        self.surroundings().density(0.0)
    }

    /// The motion that it begins with.
    #[must_use]
    pub fn motion(&self) -> Motion {
        Motion {
            place: Vector::new(0.0, 0.0, -self.start.height_m),
            velocity: Vector::from(self.start.velocity_m_s),
            attitude: from_euler(self.start.attitude_deg.map(f64::to_radians)),
            ..Motion::default()
        }
    }
}

/// Pulse of a list at a time; a ramp begins at the pulse before it.
fn at(steps: &[Step], t_s: f64) -> f64 {
    let mut begins = 0.0;
    let mut before = steps.first().map_or(1000.0, |s| s.pulse_us);
    for step in steps {
        if t_s < begins + step.hold_s - 1.0e-9 {
            let share = if step.ramp { ((t_s - begins) / step.hold_s).max(0.0) } else { 1.0 };
            return before + share * (step.pulse_us - before);
        }
        begins += step.hold_s;
        before = step.pulse_us;
    }
    before
}

fn steps<'de, D: Deserializer<'de>>(d: D) -> Result<Vec<Step>, D::Error> {
    let list = Vec::<Step>::deserialize(d)?;
    if list.is_empty() { Err(D::Error::custom("expected at least one step, found none")) } else { Ok(list) }
}

fn rate<'de, D: Deserializer<'de>>(d: D) -> Result<u32, D::Error> {
    let rate = u32::deserialize(d)?;
    if rate > 0 && 1000 % rate == 0 {
        Ok(rate)
    } else {
        Err(D::Error::custom(format!("expected a rate from 1 to 1000 Hz that divides 1000, found {rate}")))
    }
}
