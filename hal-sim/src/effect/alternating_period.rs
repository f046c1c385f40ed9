//! `alternating_period`: the two magnets of the hall sensor do not stand opposite each other.
//!
//! What it is: one magnet is glued at an angle; the periods are long and short by turns.
//! What can go wrong: a sensor that times whole revolutions, as this board does, reads the right speed all the same; the
//! board's verdict tells it.
//! Units: deg, deviation from 180.
//! Reference: Beharie 2013 section 5.7.1 and Fig. 5.27.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AlternatingPeriod {
    /// Deviation from 180 degrees, deg.
    pub angle_deg: f64,
}

impl Effect for AlternatingPeriod {
    const ID: &'static str = "alternating_period";
    const EQUATION: &'static str = "second magnet at 180 deg + angle";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { angle_deg: stream.sign() * stream.log_between(10.0, 40.0) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.geometry.magnet_error_deg = self.angle_deg;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("angle", self.angle_deg, "deg")]
    }
}
