//! `supply_sag`: resistance between source and ESC.
//!
//! What it is: a lead or connector whose drop lowers the voltage at the ESC, and with it speed, thrust and current.
//! What can go wrong: thrust(rpm) stays whole; only what depends on the voltage moves.
//! Units: ohm, s.
//! Reference: Ohm's law; Beharie 2013 section 5.6 measures the supply at the ESC.

use super::{Effect, Levers};
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SupplySag {
    /// Resistance, ohm.
    pub resistance_ohm: f64,
    /// Onset, s into the run.
    #[serde(default)]
    pub t0_s: f64,
}

impl Effect for SupplySag {
    const ID: &'static str = "supply_sag";
    const EQUATION: &'static str = "voltage_v = source - resistance * current_a";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { resistance_ohm: stream.log_between(0.03, 0.12), t0_s: 0.0 }
    }

    fn act(&self, run_s: f64, levers: &mut Levers) {
        if run_s >= self.t0_s {
            levers.plant.resistance_ohm += self.resistance_ohm;
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("resistance", self.resistance_ohm, "ohm"), ("t0", self.t0_s, "s")]
    }
}
