//! What is known of a vehicle before its flight is looked at.
//!
//! What it is: where the rotors sit and which way they turn, mass and inertia, from a flight log's metadata.
//! What can go wrong: a layout that is not one of the known ways of writing it is refused; without one nothing is said of moments.
//! Units: m, kg, kg.m^2; body FRD.
//! Reference: specification `flight.md`, "Flight log" and "The body".

use crate::log::Log;
use serde::{Deserialize, Serialize};

/// Longest arm that is taken for granted where none is known, m.
const USUAL_ARM_M: f64 = 0.1;
/// Square of a quadrotor's radius of gyration about a level axis, in arms: its mass sits between hub and motors.
const GYRATION: f64 = 0.3;

/// A rotor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Forward of the middle, m.
    pub x: f64,
    /// To the right of it, m.
    pub y: f64,
    /// +1 clockwise seen from above, -1 the other way.
    pub turns: f64,
}

/// A vehicle.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vehicle {
    /// From the middle to a rotor, m; `None` where the log does not say, places then being in arms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arm_m: Option<f64>,
    /// Mass, kg.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass_kg: Option<f64>,
    /// Moments of inertia about the body axes, kg.m^2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia_kgm2: Option<[f64; 3]>,
    /// Its rotors; empty where the layout is not known.
    #[serde(default)]
    pub rotors: Vec<Place>,
}

impl Vehicle {
    /// From metadata.
    ///
    /// # Errors
    /// A key whose value is none of the ways of writing it: key, value and what is expected.
    pub fn of(log: &Log) -> Result<Self, String> {
        let number = |key: &str| -> Result<Option<f64>, String> {
            let Some(value) = log.meta.get(key) else { return Ok(None) };
            let read = value.as_float().or_else(|| value.as_integer().map(|i| i as f64));
            read.filter(|v| v.is_finite() && *v > 0.0)
                .map(Some)
                .ok_or_else(|| format!("{key} = {value}; expected a number above 0"))
        };
        let inertia_kgm2 = match log.meta.get("inertia_kgm2") {
            None => None,
            Some(value) => Some(
                three(value).ok_or_else(|| format!("inertia_kgm2 = {value}; expected three numbers above 0, as [x, y, z]"))?,
            ),
        };
        let arm_m = number("arm_m")?;
        let rotors = rotors(log, arm_m.unwrap_or(1.0))?;
        Ok(Self { rotors, arm_m, mass_kg: number("mass_kg")?, inertia_kgm2 })
    }

    /// Angular acceleration that the whole weight makes at an arm's length, as far as it is known beforehand, rad/s^2.
    #[must_use]
    pub fn usual_turning(&self) -> f64 {
        let arm = self.arm_m.unwrap_or(USUAL_ARM_M);
        match (self.mass_kg, self.inertia_kgm2) {
            (Some(m), Some([about_x, ..])) => super::G * m * arm / about_x,
            _ => super::G / (GYRATION * arm),
        }
    }
}

fn three(value: &toml::Value) -> Option<[f64; 3]> {
    let list: Vec<f64> = value.as_array()?.iter().map(toml::Value::as_float).collect::<Option<_>>()?;
    <[f64; 3]>::try_from(list).ok().filter(|list| list.iter().all(|v| v.is_finite() && *v > 0.0))
}

/// Rotors from `rotors_m` (a list of [x, y, turns]) or from `layout`.
fn rotors(log: &Log, arm: f64) -> Result<Vec<Place>, String> {
    if let Some(value) = log.meta.get("rotors_m") {
        let one = |v: &toml::Value| -> Option<Place> {
            let list: Vec<f64> = v.as_array()?.iter().map(toml::Value::as_float).collect::<Option<_>>()?;
            let [x, y, turns] = list[..] else { return None };
            (x.is_finite() && y.is_finite() && turns.abs() == 1.0).then_some(Place { x, y, turns })
        };
        let list = value.as_array().and_then(|a| a.iter().map(one).collect::<Option<Vec<Place>>>());
        return list.ok_or_else(|| format!("rotors_m = {value}; expected a list of [x, y, turns], turns being 1.0 or -1.0"));
    }
    match log.meta.get("layout").map(|v| v.as_str().unwrap_or_default()) {
        None | Some("own") => Ok(Vec::new()),
        Some("plus") => Ok(spelled("1 left, 2 rear, 3 right, 4 front; 1 and 3 clockwise", arm).unwrap_or_default()),
        Some(text) => spelled(text.split_once(':').map_or(text, |(_, list)| list), arm).ok_or_else(|| {
            format!("layout = \"{text}\"; expected \"plus\" or places and turns, such as \"1 front right, 2 rear left, ...; 1 and 2 clockwise\"")
        }),
    }
}

/// Reads `1 front right, 2 rear right, ...; 2 and 4 clockwise`.
fn spelled(text: &str, arm: f64) -> Option<Vec<Place>> {
    let (places, turns) = text.split_once(';')?;
    let turning = turns.trim().strip_suffix("clockwise")?;
    let clockwise: Vec<usize> = turning.replace("and", ",").split(',').map(|n| n.trim().parse().ok()).collect::<Option<_>>()?;
    let one = |(k, words): (usize, &str)| -> Option<Place> {
        let mut words = words.split_whitespace();
        let number: usize = words.next()?.parse().ok().filter(|n| *n == k + 1)?;
        let (mut x, mut y) = (0.0, 0.0);
        for word in words {
            match word {
                "front" => x = 1.0,
                "rear" => x = -1.0,
                "right" => y = 1.0,
                "left" => y = -1.0,
                _ => return None,
            }
        }
        let length = f64::hypot(x, y);
        let turns = if clockwise.contains(&number) { 1.0 } else { -1.0 };
        (length > 0.0).then(|| Place { x: arm * x / length, y: arm * y / length, turns })
    };
    places.split(',').enumerate().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vehicle(meta: &str) -> Result<Vehicle, String> {
        Vehicle::of(&Log { meta: meta.parse::<toml::Table>().unwrap().into_iter().collect(), ..Log::default() })
    }

    #[test]
    fn layouts_are_read() {
        let plus = vehicle("layout = \"plus\"\narm_m = 0.3").unwrap();
        assert_eq!(plus.rotors[0], Place { x: 0.0, y: -0.3, turns: 1.0 });
        assert_eq!(plus.rotors[3], Place { x: 0.3, y: 0.0, turns: -1.0 });
        let x = vehicle("layout = \"x: 1 front right, 2 rear right, 3 rear left, 4 front left; 2 and 4 clockwise\"").unwrap();
        let d = std::f64::consts::FRAC_1_SQRT_2;
        assert!((x.rotors[1].x + d).abs() < 1e-15 && (x.rotors[1].y - d).abs() < 1e-15 && x.rotors[1].turns == 1.0);
        assert!(x.arm_m.is_none());
        let own = vehicle("rotors_m = [[0.1, 0.2, 1.0], [-0.1, -0.2, -1.0]]\nmass_kg = 1").unwrap();
        assert_eq!((own.rotors[1].y, own.mass_kg), (-0.2, Some(1.0)));
    }

    #[test]
    fn what_is_no_layout_is_refused() {
        for meta in ["layout = \"star\"", "rotors_m = [[1.0, 2.0, 0.5]]", "mass_kg = -1.0", "inertia_kgm2 = [1.0, 2.0]"] {
            assert!(vehicle(meta).unwrap_err().contains("expected"), "{meta}");
        }
    }
}
