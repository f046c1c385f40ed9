//! `supply_sag`: resistance between source and ESC.
//!
//! What it is: a lead or connector whose drop lowers the voltage at the ESC, and with it speed, thrust and current; a battery has a second
//! resistance that answers late.
//! What can go wrong: thrust(rpm) stays whole; only what depends on the voltage moves.
//! Units: ohm, s.
//! Reference: Ohm's law; Beharie 2013 section 5.6 measures the supply at the ESC; pair of a battery: `plant/supply.rs`.

use super::{Effect, Levers};
use crate::noise::Stream;
use crate::parts::BenchParts;
use crate::plant::supply::Pair;
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
    /// Resistance that answers late, ohm; it has no onset.
    #[serde(default)]
    pub late_ohm: f64,
    /// Time constant of that, s.
    #[serde(default = "usual_late_s")]
    pub late_s: f64,
}

/// Time constant where the file says none, s.
fn usual_late_s() -> f64 {
    4.0
}

impl Effect for SupplySag {
    const ID: &'static str = "supply_sag";
    const EQUATION: &'static str = "voltage_v = source - resistance * current_a - late_resistance * lag(current_a)";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { resistance_ohm: stream.log_between(0.03, 0.12), t0_s: 0.0, late_ohm: 0.0, late_s: usual_late_s() }
    }

    fn fit(&self, parts: &mut BenchParts) {
        if self.late_ohm > 0.0 {
            parts.plant.supply.pair = Some(Pair { resistance_ohm: self.late_ohm, tau_s: self.late_s, volts: 0.0 });
        }
    }

    fn act(&self, run_s: f64, levers: &mut Levers) {
        if run_s >= self.t0_s {
            levers.plant.resistance_ohm += self.resistance_ohm;
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        let late = [("late_resistance", self.late_ohm, "ohm"), ("late_tau", self.late_s, "s")];
        let told = if self.late_ohm > 0.0 { &late[..] } else { &[] };
        [&[("resistance", self.resistance_ohm, "ohm"), ("t0", self.t0_s, "s")], told].concat()
    }
}
