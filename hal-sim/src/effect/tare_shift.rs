//! `tare_shift`: the load cell's zero jumps once.
//!
//! What it is: a slipped clamp or a cable that came to lie on the beam.
//! What can go wrong: a jump before the run is part of the tare and shows nowhere.
//! Units: N, s.
//! Reference: specification `closing-the-loop.md`, `tare_shift`.

use super::{Effect, Levers};
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TareShift {
    /// Jump, N.
    pub offset_n: f64,
    /// When, s into the run.
    pub t0_s: f64,
}

impl Effect for TareShift {
    const ID: &'static str = "tare_shift";
    const EQUATION: &'static str = "thrust_n += offset from t0";

    fn draw(stream: &mut Stream, run_s: f64) -> Self {
        Self { offset_n: stream.sign() * stream.log_between(0.03, 0.14), t0_s: run_s * stream.between(0.25, 0.75) }
    }

    fn act(&self, run_s: f64, levers: &mut Levers) {
        if run_s >= self.t0_s {
            levers.strain_zero_n += self.offset_n;
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("offset", self.offset_n, "N"), ("t0", self.t0_s, "s")]
    }
}
