//! What a mission may say.
//!
//! What it is: the ranges of its start, air and wind, how long a flight may be, and what contradicts itself in it.
//! What can go wrong: each is refused with its place.
//! Units: each key carries its own.
//! Reference: `docs/mission.md`; ISO 2533 (the troposphere ends at 11 km: height and altitude together stay within it).

use super::{AirframeFile, Mission};
use crate::flight::Vector;
use firmware_ahrs::TICK_HZ;
use serde::{Deserialize, Deserializer, de::Error};
use toml::{Spanned, Value};

/// Longest flight, s: a day.
pub const LONGEST_S: f64 = 86_400.0;
/// Most rows that a flight may leave: some 1 kB each while it is written, so 2 GB.
pub const MOST_ROWS: u64 = 2_000_000;
/// What rounding leaves of the height of a rotor on the ground, m.
const SURFACE_M: f64 = 1.0e-9;

fn within<'de, D: Deserializer<'de>>(d: D, low: f64, high: f64, what: &str) -> Result<f64, D::Error> {
    let value = f64::deserialize(d)?;
    if (low..=high).contains(&value) {
        return Ok(value);
    }
    Err(D::Error::custom(format!("expected {what} from {low} to {high}, found {value}")))
}

fn each_within<'de, D: Deserializer<'de>>(d: D, most: f64, what: &str) -> Result<[f64; 3], D::Error> {
    let values = <[f64; 3]>::deserialize(d)?;
    match values.iter().find(|v| !(-most..=most).contains(*v)) {
        Some(bad) => Err(D::Error::custom(format!("expected three {what} from -{most} to {most}, found {bad}"))),
        None => Ok(values),
    }
}

pub(super) fn height<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    within(d, 0.0, 5_000.0, "a height above ground")
}

pub(super) fn altitude<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    within(d, -500.0, 6_000.0, "an altitude of the ground")
}

pub(super) fn offset<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    within(d, -60.0, 60.0, "a difference of temperature")
}

pub(super) fn gust<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    within(d, 0.0, 50.0, "a standard deviation")
}

pub(super) fn length<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    within(d, 0.1, 10_000.0, "a length of the turbulence")
}

pub(super) fn speeds<'de, D: Deserializer<'de>>(d: D) -> Result<[f64; 3], D::Error> {
    each_within(d, 100.0, "speeds")
}

pub(super) fn angles<'de, D: Deserializer<'de>>(d: D) -> Result<[f64; 3], D::Error> {
    each_within(d, 360.0, "angles")
}

pub(super) fn some_rotors<'de, D: Deserializer<'de>>(d: D) -> Result<Vec<Spanned<usize>>, D::Error> {
    let rotors = Vec::<Spanned<usize>>::deserialize(d)?;
    if rotors.is_empty() { Err(D::Error::custom("expected at least one rotor, found none")) } else { Ok(rotors) }
}

/// Where the keys stand that a refusal of the whole belongs to.
#[derive(Deserialize, Default)]
#[serde(default)]
struct Places {
    duration_s: Option<Spanned<Value>>,
    log_hz: Option<Spanned<Value>>,
    pulses: Option<Spanned<Value>>,
    start: Start,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Start {
    height_m: Option<Spanned<Value>>,
    attitude_deg: Option<Spanned<Value>>,
}

/// The first of some keys that is there; the beginning of the file without one.
fn first(keys: &[&Option<Spanned<Value>>]) -> usize {
    keys.iter().find_map(|key| Some(key.as_ref()?.span().start)).unwrap_or(0)
}

/// A byte of the text, and what was expected there.
type Refusal = (usize, String);

impl Mission {
    /// Rows that the flight may leave, of its log and of the IMU board.
    #[must_use]
    pub fn rows(&self) -> u64 {
        let aboard = self.imu.or(self.controller.as_ref().map(|_| Default::default()));
        let of_board = aboard.map_or(0.0, |board| f64::from(TICK_HZ) * (self.length_s() + board.rest_s));
        (self.length_s() * f64::from(self.log_hz) + of_board) as u64
    }

    /// What contradicts itself, or the airframe.
    pub(super) fn sound(&self, text: &str, airframe: &AirframeFile) -> Result<(), Refusal> {
        if let Some((byte, reason)) = self.failure.iter().find_map(|f| f.sound().err()) {
            return Err((byte, reason.to_owned()));
        }
        self.rotors_sound(airframe.rotors().len())?;
        let mut chips = self.failure.iter().filter(|f| f.chip.is_some()).map(|f| f.at_s.span().start);
        if let (Some(at), None, None) = (chips.next(), &self.imu, &self.controller) {
            return Err((at, "expected [imu] or [controller] beside a chip that fails: there is no board".to_owned()));
        }
        if let Some(at) = chips.next() {
            return Err((at, "expected one chip that fails, found another".to_owned()));
        }
        self.above_ground(text, airframe)
    }

    /// Rotors that are there, each once in a list.
    fn rotors_sound(&self, rotors: usize) -> Result<(), Refusal> {
        let dead = self.failure.iter().filter_map(|f| f.rotor.as_ref());
        let mut named = self.command.iter().flat_map(|c| &c.rotors).chain(dead);
        if let Some(rotor) = named.find(|r| !(1..=rotors).contains(r.get_ref())) {
            return Err((rotor.span().start, format!("expected a rotor from 1 to {rotors}, found {}", rotor.get_ref())));
        }
        let again = |rotors: &Vec<Spanned<usize>>| {
            let is_there = |k: usize, rotor: &Spanned<usize>| rotors.iter().take(k).any(|r| r.get_ref() == rotor.get_ref());
            rotors
                .iter()
                .enumerate()
                .find(|(k, rotor)| is_there(*k, rotor))
                .map(|(_, rotor)| (rotor.span().start, *rotor.get_ref()))
        };
        match self.command.iter().find_map(|c| again(&c.rotors)) {
            Some((at, rotor)) => Err((at, format!("expected each rotor once, found {rotor} again"))),
            None => Ok(()),
        }
    }

    /// A start at which no rotor lies below ground, from where it would be thrown.
    fn above_ground(&self, text: &str, airframe: &AirframeFile) -> Result<(), Refusal> {
        let attitude = self.motion().attitude;
        let below = |place: [f64; 3]| (attitude * Vector::from(place)).z;
        let lowest = airframe.rotors().iter().map(|r| below(r.place)).fold(f64::NEG_INFINITY, f64::max);
        if lowest <= self.start.height_m + SURFACE_M {
            return Ok(());
        }
        let start = toml::from_str::<Places>(text).unwrap_or_default().start;
        // rounded up to a millimetre, so that what is said is enough
        let enough = ((lowest - SURFACE_M) * 1000.0).ceil() / 1000.0;
        let found = self.start.height_m;
        Err((
            first(&[&start.height_m, &start.attitude_deg]),
            format!("expected a height of {enough} m at least, or the lowest rotor lies below ground, found {found}"),
        ))
    }

    /// A flight that is not too long to be kept.
    pub(super) fn short_enough(&self, text: &str) -> Result<(), Refusal> {
        let (length_s, rows) = (self.length_s(), self.rows());
        if length_s <= LONGEST_S && rows <= MOST_ROWS {
            return Ok(());
        }
        let places = toml::from_str::<Places>(text).unwrap_or_default();
        let at = first(&[&places.duration_s, &places.pulses, &places.log_hz]);
        let reason = if length_s > LONGEST_S {
            format!("expected a flight of at most {LONGEST_S} s, found {length_s}")
        } else {
            format!(
                "expected at most {MOST_ROWS} rows (log_hz a second, and {TICK_HZ} of the IMU board), found {rows}: fly for a shorter time or lower log_hz"
            )
        };
        Err((at, reason))
    }
}
