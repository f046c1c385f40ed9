//! `loosening_mount`: the motor's mount works loose.
//!
//! What it is: revolutions shake the preload out of the bolts; the thrust axis tilts against its end stop, so that part of
//! the thrust bends the torque arm and part of the torque bends the beam.
//! What can go wrong: nothing; the tilt ends at the stop.
//! Units: deg, revolutions.
//! Reference: Junker 1969, self-loosening of bolted joints. Not in the library of `ident`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LooseningMount {
    /// Tilt against the end stop, deg.
    pub tilt_deg: f64,
    /// Revolutions in which 63 % of the preload is lost.
    pub life_rev: f64,
}

impl Effect for LooseningMount {
    const ID: &'static str = "loosening_mount";
    const EQUATION: &'static str = "tilt' = (stop - tilt) rev' / life; lift = T cos + Q sin / L, torque = Q cos - T sin L";

    fn draw(stream: &mut Stream, run_s: f64) -> Self {
        let revolutions = 60.0 * run_s;
        Self { tilt_deg: stream.sign() * stream.between(1.0, 4.0), life_rev: revolutions * stream.between(0.1, 0.5) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.mount.tilt_deg = self.tilt_deg;
        parts.mount.life_rev = self.life_rev;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("tilt", self.tilt_deg, "deg"), ("life", self.life_rev, "1")]
    }
}
