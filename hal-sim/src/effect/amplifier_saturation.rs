//! `amplifier_saturation`: the strain amplifier reaches its rail.
//!
//! What it is: no reading beyond the level, however much the beam bends.
//! What can go wrong: a level above the run's highest thrust shows nowhere.
//! Units: N.
//! Reference: specification `closing-the-loop.md`, `amplifier_saturation`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AmplifierSaturation {
    /// Highest lift that it can show, N.
    pub level_n: f64,
}

impl Effect for AmplifierSaturation {
    const ID: &'static str = "amplifier_saturation";
    const EQUATION: &'static str = "thrust_n <= level";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { level_n: stream.between(4.2, 5.4) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        let b = &mut parts.bridge;
        b.rails_v.0 = b.resting_v() / b.divider - b.volt_per_newton * self.level_n;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("level", self.level_n, "N")]
    }
}
