//! `creep`: the load cell goes on giving after a change of load.
//!
//! What it is: a visco-elastic share of the load that follows with its own time constant (one Kelvin-Voigt element).
//! What can go wrong: with a time constant well below the hold it looks like a gain.
//! Units: share of the load, s.
//! Reference: Kelvin-Voigt element; specification `closing-the-loop.md`, `creep`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Creep {
    /// Share of the load that comes late.
    pub amplitude: f64,
    /// Time constant, s.
    pub tau_s: f64,
}

impl Effect for Creep {
    const ID: &'static str = "creep";
    const EQUATION: &'static str = "thrust_n += z, tau * dz/dt + z = amplitude * thrust";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { amplitude: stream.log_between(0.01, 0.04), tau_s: stream.between(15.0, 60.0) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.bridge.creep_share = self.amplitude;
        parts.bridge.creep_s = self.tau_s;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("amplitude", self.amplitude, "1"), ("tau", self.tau_s, "s")]
    }
}
