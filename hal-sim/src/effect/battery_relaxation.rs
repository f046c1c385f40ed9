//! `battery_relaxation`: what of a battery's resistance answers late.
//!
//! What it is: a resistor and a capacitor side by side between source and ESC: their voltage builds up under load, and goes within seconds.
//! What can go wrong: thrust(rpm) stays whole; only what depends on the voltage moves.
//! Units: ohm, s.
//! Reference: Thevenin circuit with one pair, Chen & Rincon-Mora 2006; `plant/supply.rs`.

use super::Effect;
use crate::noise::Stream;
use crate::parts::BenchParts;
use crate::plant::supply::Pair;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BatteryRelaxation {
    /// Resistance that answers late, ohm.
    pub resistance_ohm: f64,
    /// Time constant, s.
    #[serde(default = "usual_tau_s")]
    pub tau_s: f64,
}

/// Time constant where the file says none, s.
fn usual_tau_s() -> f64 {
    4.0
}

impl Effect for BatteryRelaxation {
    const ID: &'static str = "battery_relaxation";
    const EQUATION: &'static str = "voltage_v = source - resistance * lag(current_a)";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { resistance_ohm: stream.log_between(0.02, 0.08), tau_s: stream.log_between(2.0, 8.0) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.plant.supply.pair = Some(Pair { resistance_ohm: self.resistance_ohm, tau_s: self.tau_s, volts: 0.0 });
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("resistance", self.resistance_ohm, "ohm"), ("tau", self.tau_s, "s")]
    }
}
