//! `hysteresis`: the load cell reads less on the way up than on the way down.
//!
//! What it is: dry friction in the joint of the beam holds back part of each change of load until it slips.
//! What can go wrong: a one-way sweep shows an offset only.
//! Units: N.
//! Reference: Jenkins element (spring and slider); specification `closing-the-loop.md`, `hysteresis`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hysteresis {
    /// Reading on the way down minus that on the way up, N.
    pub width_n: f64,
}

impl Effect for Hysteresis {
    const ID: &'static str = "hysteresis";
    const EQUATION: &'static str = "thrust_n -= z, dz = 0.3 d(thrust) held within +-width / 2";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { width_n: stream.log_between(0.03, 0.14) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.bridge.hysteresis_n = self.width_n;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("width", self.width_n, "N")]
    }
}
