//! `current_limit`: the supply current has a ceiling.
//!
//! What it is: the ESC lowers its duty cycle so that the supply current stays at the limit.
//! What can go wrong: a limit above the run's highest current shows nowhere.
//! Units: A.
//! Reference: specification `closing-the-loop.md`, `current_limit`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use crate::plant::rig_plant::ESC_IDLE_A;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurrentLimit {
    /// Ceiling, A.
    pub limit_a: f64,
}

impl Effect for CurrentLimit {
    const ID: &'static str = "current_limit";
    const EQUATION: &'static str = "current_a <= limit: duty falls until it holds";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { limit_a: stream.between(4.5, 6.5) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        // what the supply gives, the ESC's own draw included, is what the limit holds and a meter reads
        parts.plant.limiter.current_a = self.limit_a - ESC_IDLE_A;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("limit", self.limit_a, "A")]
    }
}
