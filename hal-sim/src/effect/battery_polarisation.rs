//! `battery_polarisation`: a battery whose voltage answers the load late, and recovers as slowly.
//!
//! What it is: a large lithium-polymer pack with a resistor-capacitor pair behind its small resistance.
//! What can go wrong: the speed follows the voltage, so that levels creep for some time constants.
//! Units: ohm, s.
//! Reference: Chen & Rincon-Mora 2006, IEEE Trans. Energy Conversion 21:504; pair in `plant/supply.rs`.

use super::Effect;
use crate::noise::Stream;
use crate::parts::BenchParts;
use crate::plant::supply::{Pair, Source, Supply};
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BatteryPolarisation {
    /// Resistance of the pair, ohm.
    pub resistance_ohm: f64,
    /// Its resistance times its capacitance, s.
    pub tau_s: f64,
}

/// A pack so large that a run does not empty it, A.h.
const LARGE_AH: f64 = 60.0;

impl Effect for BatteryPolarisation {
    const ID: &'static str = "battery_polarisation";
    const EQUATION: &'static str = "voltage_v = source - resistance * i, tau d(i)/dt = current_a - i";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { resistance_ohm: stream.log_between(0.03, 0.08), tau_s: stream.log_between(2.0, 10.0) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        let pack = Supply::new(Source::LiPo { cells: 3, capacity_ah: LARGE_AH, charge: 0.6 }, 0.0);
        let pair = Pair { resistance_ohm: self.resistance_ohm, tau_s: self.tau_s, volts: 0.0 };
        parts.plant.supply = Supply { pair: Some(pair), ..pack };
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("resistance", self.resistance_ohm, "ohm"), ("tau", self.tau_s, "s")]
    }
}
