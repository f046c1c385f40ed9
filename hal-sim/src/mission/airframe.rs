//! The airframe file.
//!
//! What it is: motor, propeller and supply from the catalogue, masses and sizes, the layout of the rotors.
//! What can go wrong: refused with file, line and column, as a mission.
//! Units: each key carries its own.
//! Reference: specification `flight.md`, "The body"; `docs/mission.md`.

use crate::flight::airframe::{ARM_M, Build, DRAG_AREA_M2};
use crate::flight::{Airframe, Rotor};
use crate::number::{not_negative, positive};
use crate::plant::{Parts, supply::Source};
use crate::scenario::{NoiseSection, Scenario, ScenarioError, SupplySection};
use crate::scenario::{motor_name, parsed, propeller_name, text_of};
use serde::{Deserialize, Deserializer, de::Error};
use std::path::Path;

/// An airframe as a file describes it.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AirframeFile {
    /// Title.
    pub name: String,
    /// Motor, by the thesis' names.
    #[serde(deserialize_with = "motor_name")]
    pub motor: String,
    /// Propeller, by the thesis' names.
    #[serde(deserialize_with = "propeller_name")]
    pub propeller: String,
    /// What feeds all rotors together.
    pub supply: SupplySection,
    /// Charge of the battery that the time aloft is told for, A.h; a `lipo` supply brings its own.
    #[serde(deserialize_with = "positive")]
    pub battery_ah: f64,
    /// Arm of the plus layout, m.
    #[serde(deserialize_with = "positive")]
    pub arm_m: f64,
    /// Hub with battery, kg.
    #[serde(deserialize_with = "positive")]
    pub hub_kg: f64,
    /// Radius of the hub, m.
    #[serde(deserialize_with = "positive")]
    pub hub_radius_m: f64,
    /// One motor with its propeller, kg.
    #[serde(deserialize_with = "positive")]
    pub motor_kg: f64,
    /// One arm, kg.
    #[serde(deserialize_with = "positive")]
    pub arm_kg: f64,
    /// Drag coefficient times area, m^2.
    #[serde(deserialize_with = "not_negative")]
    pub drag_area_m2: f64,
    /// Inertia of one rotor about its shaft, kg.m^2; without it, that of motor and propeller.
    pub rotor_inertia_kgm2: Option<f64>,
    /// Rotors in another layout than the plus.
    pub rotor: Vec<RotorSection>,
}

/// One rotor.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotorSection {
    /// Place, body FRD, m.
    pub place_m: [f64; 3],
    /// Clockwise seen from above.
    #[serde(deserialize_with = "sense")]
    pub turns: f64,
}

/// The thesis' battery, A.h (Beharie 2013, Tables 8 and 9).
const BATTERY_AH: f64 = 4.4;

fn sense<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    match String::deserialize(d)?.as_str() {
        "clockwise" => Ok(1.0),
        "counter_clockwise" => Ok(-1.0),
        other => Err(D::Error::custom(format!("expected \"clockwise\" or \"counter_clockwise\" (from above), found {other:?}"))),
    }
}

impl Default for AirframeFile {
    fn default() -> Self {
        let build = Build::default();
        Self {
            name: "thesis quadrotor".to_owned(),
            motor: "570KV".to_owned(),
            propeller: "11x4.7".to_owned(),
            supply: SupplySection::Bench { voltage_v: 11.5 },
            battery_ah: BATTERY_AH,
            arm_m: ARM_M,
            hub_kg: build.hub_kg,
            hub_radius_m: build.hub_radius_m,
            motor_kg: build.motor_kg,
            arm_kg: build.arm_kg,
            drag_area_m2: DRAG_AREA_M2,
            rotor_inertia_kgm2: None,
            rotor: Vec::new(),
        }
    }
}

impl AirframeFile {
    /// Reads an airframe file.
    ///
    /// # Errors
    /// [`ScenarioError::Unreadable`], or [`ScenarioError::Refused`] with line and column.
    pub fn load(file: &Path) -> Result<Self, ScenarioError> {
        parsed(&text_of(file)?, file)
    }

    /// Blades of a rotor.
    #[must_use]
    pub fn blades(&self) -> u32 {
        crate::plant::Propeller::named(&self.propeller).map_or(2, |p| p.blades)
    }

    /// Charge on board, A.h.
    #[must_use]
    pub fn charge_ah(&self) -> f64 {
        match self.supply {
            SupplySection::Lipo { capacity_ah, .. } => capacity_ah,
            SupplySection::Bench { .. } => self.battery_ah,
        }
    }

    /// Its rotors.
    #[must_use]
    pub fn rotors(&self) -> Vec<Rotor> {
        if self.rotor.is_empty() {
            return Airframe::plus(self.arm_m);
        }
        self.rotor.iter().map(|r| Rotor { place: r.place_m, turns: r.turns }).collect()
    }

    /// The parts of one rotor's powerplant. Each draws from its own equal share of a battery, which is exact while the rotors draw
    /// equally.
    #[must_use]
    pub fn parts(&self) -> Parts {
        let scenario = Scenario {
            motor: self.motor.clone(),
            propeller: self.propeller.clone(),
            supply: self.supply,
            noise: NoiseSection { gust: 0.0, ..NoiseSection::default() },
            ..Scenario::default()
        };
        let mut parts = scenario.parts().plant;
        let shares = self.rotors().len() as f64;
        parts.supply.resistance_ohm *= shares;
        if let Source::LiPo { capacity_ah, .. } = &mut parts.supply.source {
            *capacity_ah /= shares;
        }
        parts
    }

    /// What flies.
    #[must_use]
    pub fn airframe(&self) -> Airframe {
        let build = Build { hub_kg: self.hub_kg, hub_radius_m: self.hub_radius_m, motor_kg: self.motor_kg, arm_kg: self.arm_kg };
        let (rotors, parts) = (self.rotors(), self.parts());
        Airframe {
            mass_kg: build.mass_kg(rotors.len()),
            inertia_kgm2: build.inertia(&rotors),
            drag_area_m2: self.drag_area_m2,
            rotor_inertia_kgm2: self.rotor_inertia_kgm2.unwrap_or(parts.motor.inertia_kgm2 + parts.propeller.inertia_kgm2),
            rotors,
        }
    }
}
