//! What to simulate, as a file.
//!
//! What it is: a TOML description of motor, propeller, supply, air, schedule, sensors, noise, effects and seed, with a default
//! for everything: an empty file is the demonstration rig without an effect.
//! What can go wrong: an unknown key, a wrong type or a value out of its range is refused with file, line and column.
//! Units: each key carries its own.
//! Reference: specification `rig.md`, "The simulator"; `docs/scenario.md` lists every key.

mod blame;
mod fault;
mod imu;
mod possible;
mod section;

pub use fault::{FaultKind, ScheduledFault};
pub use imu::{BodySection, ChipSection, Field, ImuScenario, ImuSection};
pub use section::{
    AirSection, ChirpSection, EscSection, LogSection, NoiseSection, ReplaySection, Schedule, SensorSection, SpeedSensor, Step,
    SupplySection,
};

use crate::bench::Setup;
use crate::effect::{self, Scheduled};
use crate::number::positive;
use crate::parts::BenchParts;
use crate::plant::{
    Air, Beam, Blade, Bridge, Commutation, Esc, Flux, Guard, Limiter, Motor, Mount, Parts, Propeller, RoomAir, Supply, Thermal,
    supply,
};
use crate::sensor::{EscErrors, Geometry};
use frame::rig::CAPTURE_CHANNELS;
use frame::units::PulseWidth;
use serde::{Deserialize, Deserializer, Serialize, de::DeserializeOwned, de::Error};
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
    #[error("{}: cannot be read ({source}); expected a file: check name and folder", file.display())]
    Unreadable {
        /// File that was to be read.
        file: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// The schedule that it names was refused.
    #[error(transparent)]
    Schedule(#[from] schedule::ScheduleError),
    /// No effect has this id.
    #[error("no effect is called {0:?}; expected one of {list}", list = effect_ids())]
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
    /// The ESC.
    pub esc: EscSection,
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
    pub effects: Vec<Scheduled>,
    /// Faults of line, supply and pins.
    #[serde(rename = "fault")]
    pub faults: Vec<ScheduledFault>,
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
            esc: EscSection::default(),
            schedule: Schedule::UpDown { step_us: 50.0, hold_s: 8.0, top_us: 2000.0 },
            rest_s: 2.0,
            sensors: SensorSection::default(),
            log: LogSection::default(),
            noise: NoiseSection::default(),
            effects: Vec::new(),
            faults: Vec::new(),
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
            scenario.effects.push(entry.draw(seed, scenario.run_s()).into());
        }
        Ok(scenario)
    }

    /// Reads a scenario file.
    ///
    /// # Errors
    /// [`ScenarioError::Unreadable`], or [`ScenarioError::Refused`] with line and column.
    pub fn load(file: &Path) -> Result<Self, ScenarioError> {
        Self::parse(&text_of(file)?, file)
    }

    /// Reads a scenario from `text`; `file` names it in errors.
    ///
    /// # Errors
    /// [`ScenarioError::Refused`] with line and column.
    pub fn parse(text: &str, file: &Path) -> Result<Self, ScenarioError> {
        let mut scenario: Self = parsed(text, file)?;
        possible::sizes(text).map_err(|(byte, reason)| refused(text, file, byte, reason))?;
        scenario.schedule.load(file.parent().unwrap_or(Path::new("")))?;
        Ok(scenario)
    }

    /// Refuses an effect or a fault of its file that begins when the run is over: nothing of it would be seen.
    ///
    /// # Errors
    /// [`ScenarioError::Refused`] with line and column.
    pub fn begins_in_time(&self, file: &Path) -> Result<(), ScenarioError> {
        let text = text_of(file)?;
        possible::onsets(&text, self.run_s()).map_err(|(byte, reason)| refused(&text, file, byte, reason))
    }

    /// Length of the logged run, s.
    #[must_use]
    pub fn run_s(&self) -> f64 {
        self.schedule.duration_s() + 2.0 * self.rest_s
    }

    /// The parts of the bench before any effect.
    ///
    /// # Panics
    /// When a caller, not a file, put a motor or propeller in that the catalogue does not know.
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
                flux: Flux::default(),
                room: RoomAir::default(),
                commutation: Commutation::default(),
                propeller,
                air: Air { temperature_c: self.air.temperature_c, pressure_pa: self.air.pressure_pa },
                thermal: Thermal { ambient_c: self.air.temperature_c, ..Thermal::default() },
                air_follows_room: false,
                limiter: Limiter::default(),
                blade: Blade::default(),
                gust: n.gust,
            },
            esc: Esc {
                range_min_ns: pulse_width(self.esc.range_min_us).0,
                range_max_ns: pulse_width(self.esc.range_max_us).0,
                self_test_fails: self.esc.self_test_fails,
                guard: Guard {
                    cutoff_v_per_cell: self.esc.cutoff_v_per_cell,
                    cutoff: self.esc.cutoff,
                    ambient_c: self.air.temperature_c,
                    rise_k_per_a2: self.esc.rise_k_per_a2,
                    ..Guard::default()
                },
            },
            esc_errors: EscErrors::default(),
            telemetry_asked: self.esc.telemetry_asked,
            beam: Beam::default(),
            mount: Mount::default(),
            bridge: Bridge { zero_temperature_c: self.air.temperature_c, ..Bridge::default() },
            noise: [n.thrust_n, n.torque_nm, n.current_a, n.voltage_v, n.temp_k],
        }
    }
}

impl From<&Scenario> for Setup {
    fn from(scenario: &Scenario) -> Self {
        Self { parts: scenario.parts(), effects: scenario.effects.clone(), seed: scenario.seed }
    }
}

/// A scenario of either board.
#[derive(Debug, Clone, PartialEq)]
pub enum AnyScenario {
    /// A run of the rig.
    Rig(Box<Scenario>),
    /// A run of the IMU board: the file has a table `[imu]`.
    Imu(Box<ImuScenario>),
}

impl AnyScenario {
    /// Reads a scenario file of either kind.
    ///
    /// # Errors
    /// [`ScenarioError::Unreadable`], or [`ScenarioError::Refused`] with line and column.
    pub fn load(file: &Path) -> Result<Self, ScenarioError> {
        let text = text_of(file)?;
        let of_the_imu = text.parse::<toml::Table>().is_ok_and(|table| table.contains_key("imu"));
        if of_the_imu {
            return parsed(&text, file).map(|s| Self::Imu(Box::new(s)));
        }
        Scenario::parse(&text, file).map(|s| Self::Rig(Box::new(s)))
    }
}

/// What is said of a file that is no text.
const NO_TEXT: &str =
    "bytes that are no text in UTF-8; expected a text: a scenario or a mission in TOML, as in docs/scenario.md, or pulses in CSV";

pub(crate) fn text_of(file: &Path) -> Result<String, ScenarioError> {
    std::fs::read_to_string(file).map_err(|source| match source.kind() {
        std::io::ErrorKind::InvalidData => refused("", file, 0, NO_TEXT.to_owned()),
        _ => ScenarioError::Unreadable { file: file.to_owned(), source },
    })
}

/// A refusal of what stands at a byte of `text`.
pub(crate) fn refused(text: &str, file: &Path, byte: usize, reason: String) -> ScenarioError {
    let (line, column) = place_of(text, byte);
    ScenarioError::Refused { file: file.to_owned(), line, column, reason }
}

/// What `text` describes, or where it does not.
pub(crate) fn parsed<T: DeserializeOwned>(text: &str, file: &Path) -> Result<T, ScenarioError> {
    let refused = |byte: usize, reason: String| refused(text, file, byte, reason);
    if let Some(format) = text.lines().next().and_then(|first| first.strip_prefix("# quadrig-")) {
        return Err(refused(
            0,
            format!("a file of the format quadrig-{format}; expected a description in TOML, as in docs/scenario.md"),
        ));
    }
    if text.trim_start_matches('\u{feff}').trim_start().starts_with('<') {
        let expected = "expected a description in TOML, as in docs/scenario.md: was a link saved, and not the file behind it?";
        return Err(refused(0, format!("a web page, or another file in tags; {expected}")));
    }
    let format = text.parse::<toml::Table>().ok().and_then(|table| Some(table.get("format")?.as_str()?.to_owned()));
    if let Some(format) = format.filter(|format| format.starts_with("quadrig-")) {
        let way_out = "`--model` of close-loop, sim and fly takes a model, and so do predict and export";
        let reason = format!("a model ({format}); expected a description in TOML, as in docs/scenario.md: {way_out}");
        return Err(refused(0, reason));
    }
    if let Some((byte, key)) = blame::endless(text) {
        return Err(refused(byte, format!("{key}: expected a number with an end")));
    }
    let value = toml::from_str(text).map_err(|error| {
        let (byte, key) = blame::blame::<T>(text, &error);
        if let Some(open) = blame::open_brace(text, &error) {
            return refused(open, "an inline table that does not end on its line; expected `}`".to_owned());
        }
        let mut reason = in_words(&error.message().replace('\n', " "), "docs/scenario.md");
        if let Some(key) = key.filter(|key| !reason.contains(&format!("`{key}`"))) {
            reason = format!("{key}: {reason}");
        }
        refused(byte, reason)
    })?;
    possible::windows(text).map_err(|(byte, reason)| refused(byte, reason))?;
    Ok(value)
}

/// What a parser of TOML says, without its names of types: "a number" for "f64", "a table" for "struct Limit". `page` lists the keys of such a file.
#[must_use]
pub fn in_words(message: &str, page: &str) -> String {
    if message.starts_with("data did not match any variant of ") {
        return format!("a value of another kind; expected one of the forms of {page}");
    }
    let Some((before, kind)) = message.rsplit_once("expected ") else {
        let expected = if message.starts_with("missing field") {
            format!("expected this key as well: {page} lists those of each table")
        } else {
            format!("expected TOML, as in {page}")
        };
        return format!("{message}; {expected}");
    };
    let kind = match kind {
        "f64" | "f32" => "a number",
        "u64" | "u32" | "u16" | "usize" => "a whole number from 0",
        "i64" | "i32" => "a whole number",
        "a boolean" | "bool" => "true or false",
        "path string" => "the name of a file, in quotes",
        "a string" | "string" => "a text in quotes",
        "a sequence" | "sequence" => "a list in brackets",
        "a map" | "map" => "a table",
        _ if ["struct ", "internally tagged enum ", "struct variant "].iter().any(|of| kind.starts_with(of)) => {
            "a table: a head in brackets and keys under it"
        }
        _ if kind.starts_with("enum ") => "a word in quotes",
        _ if kind.starts_with("tuple ") || kind.starts_with("a tuple ") || kind.starts_with("an array ") => "a list of numbers",
        other => other,
    };
    let before = before.replace("invalid type: map", "a table").replace("invalid type: sequence", "a list");
    let before = before
        .replace("invalid type: string", "a text")
        .replace("invalid type: integer", "a number")
        .replace("invalid type: floating point", "a number")
        .replace("invalid type: boolean", "true or false,");
    let meant = meant(&before, kind).map_or_else(String::new, |word| format!("did you mean `{word}`? "));
    format!("{before}{meant}expected {kind}")
}

/// Likeness, after Jaro, from which on a word is taken for a mistyped one; clap has the same.
const ALIKE: f64 = 0.7;

/// Of several words that are expected the one that an unknown key or variant is most like, if it is like one.
fn meant<'w>(before: &str, expected: &'w str) -> Option<&'w str> {
    let typed = before.strip_prefix("unknown ")?.split('`').nth(1)?;
    let words = expected.split('`').skip(1).step_by(2);
    let like = |word: &&str| strsim::jaro(typed, word);
    words.filter(|word| like(word) > ALIKE).max_by(|a, b| like(a).total_cmp(&like(b)))
}

/// Line and column of a byte of `text`, from 1.
pub(crate) fn place_of(text: &str, byte: usize) -> (usize, usize) {
    let before = text.get(..byte.min(text.len())).unwrap_or(text);
    (before.matches('\n').count() + 1, before.chars().rev().take_while(|c| *c != '\n').count() + 1)
}

pub(crate) fn motor_name<'de, D: Deserializer<'de>>(d: D) -> Result<String, D::Error> {
    let name = String::deserialize(d)?;
    if Motor::named(&name).is_some() {
        return Ok(name);
    }
    let names = crate::plant::motor::MOTORS.map(|(kv, _)| format!("{kv}KV")).join(", ");
    Err(D::Error::custom(format!("expected one of {names}, found {name:?}")))
}

pub(crate) fn propeller_name<'de, D: Deserializer<'de>>(d: D) -> Result<String, D::Error> {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Scenario, ScenarioError> {
        Scenario::parse(text, Path::new("run.toml"))
    }

    #[test]
    fn an_empty_file_is_the_demonstration() {
        assert_eq!(parse("").unwrap(), Scenario { seed: 1, ..Scenario::demo(1, None).unwrap() });
    }

    #[test]
    fn what_is_written_reads_back() {
        for entry in effect::catalogue() {
            let s = Scenario::demo(4, Some(entry.id)).unwrap();
            assert_eq!(parse(&toml::to_string(&s).unwrap()).unwrap(), s);
        }
        assert!(matches!(Scenario::demo(4, Some("gremlin")), Err(ScenarioError::UnknownEffect(_))));
    }

    #[test]
    fn refusals_name_file_line_and_column() {
        for (text, start, word) in [
            ("seed = 1\nmoter = \"570KV\"\n", "run.toml:2:1: ", "moter"),
            ("seed = 1\nmotor = \"571KV\"\n", "run.toml:2:9: ", "570KV"),
            ("[log]\nrate_hz = 7\n", "run.toml:2:11: ", "divides 1000"),
            ("[air]\ntemperature_c = \"warm\"\n", "run.toml:2:17: ", "expected a number"),
            ("rest_s = -1.0\n", "run.toml:1:10: ", "rest_s: expected a number above 0"),
            // keys of a table of several kinds, whose places the parser loses
            (
                "[schedule]\nkind = \"staircase\"\nstep_us = 5\nhold_s = -3\ntop_us = 2000\n",
                "run.toml:4:10: hold_s: ",
                "found -3",
            ),
            ("[schedule]\nkind = \"stairs\"\nstep_us = 5\n", "run.toml:2:8: kind: ", "stairs"),
            ("seed = 1\n[[effect]]\nid = \"nonsense\"\n", "run.toml:3:6: id: ", "nonsense"),
            ("[[effect]]\nid = \"supply_sag\"\nresistance_ohm = \"x\"\n", "run.toml:3:18: resistance_ohm: ", "expected a number"),
            ("seed = -1\n", "run.toml:1:8: seed: ", "expected a whole number from 0"),
            ("seed = 1\nseed = 2\n", "run.toml:2:1: ", "duplicate key; expected TOML"),
            ("[supply]\nkind = \"lipo\"\ncells = 0\n", "run.toml:3:9: cells: ", "1 to 14"),
            (
                "[schedule]\nkind = \"staircase\"\nstep_us = 5\nhold_s = 1e9\ntop_us = 2000\n",
                "run.toml:4:10: hold_s: ",
                "up to 86400 s",
            ),
            ("[[effect]]\nid = \"supply_sag\"\nresistance_ohm = 0.1\nohm = 3\n", "run.toml:4:1: ", "`ohm`"),
            (
                "[schedule]\nkind = \"steps\"\nsteps = [\n{ pulse_us = 1200, hold_s = 3 },\n{ hold_s = 3, pulse_us = 12000 },\n]\n",
                "run.toml:5:26: pulse_us: ",
                "found 12000",
            ),
            ("[supply]\nkind = \"lipo\"\ncells = 3\ncapacity_ah = -1e1\n", "run.toml:4:15: capacity_ah: ", "found -10"),
            ("seed = 1\n[schedule]\nkind = \"staircase\"\nhold_s = 3\ntop_us = 2000\n", "run.toml:2:1: ", "step_us"),
            ("[[effect]]\nid = \"supply_sag\"\n", "run.toml:1:1: ", "resistance_ohm"),
            (
                "seed = 1\n\n[[effect]]\nid = \"supply_sag\"\nresistance_ohm = 0.08\nresistence = 3\n",
                "run.toml:6:1: ",
                "`resistence`",
            ),
            (
                "[[effect]]\nid = \"supply_sag\"\nresistance_ohm = -0.08\n",
                "run.toml:3:18: resistance_ohm: ",
                "a resistance from 0 to 100 ohm, found -0.08",
            ),
            ("[[effect]]\nid = \"supply_sag\"\nresistance_ohm = nan\n", "run.toml:3:18: ", "resistance_ohm"),
            ("[noise]\nthrust_n = inf\n", "run.toml:2:12: ", "a number with an end"),
            ("# quadrig-log 1\nt_s,rpm,thrust_n\n", "run.toml:1:1: ", "quadrig-log 1"),
            ("seed = \n", "run.toml:1:", ""),
        ] {
            let message = parse(text).unwrap_err().to_string();
            assert!(message.starts_with(start), "{message}");
            assert!(message.contains(word) && !message.contains('\n'), "{message}");
        }
    }

    #[test]
    fn durations() {
        assert_eq!(Schedule::UpDown { step_us: 50.0, hold_s: 8.0, top_us: 2000.0 }.duration_s(), 41.0 * 8.0);
        assert_eq!(Schedule::Staircase { step_us: 50.0, hold_s: 30.0, top_us: 2000.0 }.duration_s(), 630.0);
    }
}
