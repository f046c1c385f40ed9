//! `recirculation`: the room's air begins to turn with the wake.
//!
//! What it is: the wake comes back to the inlet as a draught that builds up while the rotor runs; it takes thrust, and some
//! torque, at the same speed.
//! What can go wrong: a large share at low speed meets the floor of the factors.
//! Units: 1, s.
//! Reference: momentum theory with inflow, Leishman 2006, 2.3 and 3.3. Not in the library of `ident`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recirculation {
    /// Draught as a share of the induced velocity.
    pub share: f64,
    /// Turn-over time of the room, s.
    pub tau_s: f64,
}

impl Effect for Recirculation {
    const ID: &'static str = "recirculation";
    const EQUATION: &'static str = "v' = (share * v_induced - v) / tau; thrust_n *= 1 - 9.5 v / tip speed, torque_nm *= 1 - 3 v / tip speed";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { share: stream.log_between(0.1, 0.4), tau_s: stream.log_between(8.0, 40.0) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.plant.room.share = self.share;
        parts.plant.room.tau_s = self.tau_s;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("share", self.share, "1"), ("tau", self.tau_s, "s")]
    }
}
