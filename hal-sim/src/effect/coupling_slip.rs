//! `coupling_slip`: the encoder's coupling slips at high speed.
//!
//! What it is: the encoder's viscous drag exceeds the friction of its coupling above the onset; the excess of speed is shared
//! between the two viscosities.
//! What can go wrong: a slip of more than 1 % is flagged by the board as disagreement.
//! Units: rev/min, 1.
//! Reference: torque balance of a shaft with viscous drag c behind a friction coupling with viscous part d: slope c/(c + d)
//! of the excess is lost.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CouplingSlip {
    /// Speed above which it slips, rev/min.
    pub onset_rpm: f64,
    /// Share of the excess that is lost, 0..1.
    pub slip: f64,
}

impl Effect for CouplingSlip {
    const ID: &'static str = "coupling_slip";
    const EQUATION: &'static str = "rpm_encoder = rpm - slip (rpm - onset) above the onset";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { onset_rpm: stream.between(3000.0, 4500.0), slip: stream.log_between(0.01, 0.06) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.geometry.slip_onset_rpm = self.onset_rpm;
        parts.geometry.slip = self.slip;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("onset", self.onset_rpm, "rpm"), ("slip", self.slip, "1")]
    }
}
