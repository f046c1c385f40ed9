//! `battery_discharge`: a battery in place of the bench supply.
//!
//! What it is: a lithium-polymer pack whose open-circuit voltage follows its charge, with a small resistance of its own.
//! What can go wrong: a capacity that the run exceeds leaves the pack at its lowest voltage.
//! Units: A.h, ohm, 0..1 of charge.
//! Reference: Beharie 2013 Table 8 (three-cell packs) and errata 5.59; cell curve in `plant/supply.rs`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use crate::plant::supply::{Source, Supply};
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BatteryDischarge {
    /// Charge from full to empty, A.h.
    pub capacity_ah: f64,
    /// Cells in series.
    #[serde(default = "three")]
    pub cells: u32,
    /// Resistance of the pack, ohm.
    #[serde(default)]
    pub resistance_ohm: f64,
    /// State of charge at power-on, 0..1.
    #[serde(default = "full")]
    pub charge: f64,
}

fn three() -> u32 {
    3
}

fn full() -> f64 {
    1.0
}

impl Effect for BatteryDischarge {
    const ID: &'static str = "battery_discharge";
    const EQUATION: &'static str = "voltage_v = open_circuit(1 - charge_drawn / capacity)";

    fn draw(stream: &mut Stream, run_s: f64) -> Self {
        // The demonstration run draws about 2.6 A on average: 25 to 60 % of the pack.
        let drawn_ah = 2.6 * run_s / 3600.0;
        Self { capacity_ah: drawn_ah / stream.between(0.25, 0.6), cells: 3, resistance_ohm: 0.004, charge: 0.97 }
    }

    fn fit(&self, parts: &mut BenchParts) {
        let source = Source::LiPo { cells: self.cells, capacity_ah: self.capacity_ah, charge: self.charge };
        // what answers late is another effect's
        let pair = parts.plant.supply.pair;
        parts.plant.supply = Supply { pair, ..Supply::new(source, self.resistance_ohm) };
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("capacity", self.capacity_ah, "Ah"), ("resistance", self.resistance_ohm, "ohm"), ("charge", self.charge, "1")]
    }
}
