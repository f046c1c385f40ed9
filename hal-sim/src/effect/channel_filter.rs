//! `channel_filter`: a slow meter on the thrust channel.
//!
//! What it is: a resistor and a capacitor ahead of the ADC, integrated in time.
//! What can go wrong: plateaus stay where they were; the time after a step shows it, and so does the quieter signal of the beam.
//! Units: s.
//! Reference: specification `closing-the-loop.md`, `channel_filter` (`tau`).

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChannelFilter {
    /// Time constant, s.
    pub tau_s: f64,
}

impl Effect for ChannelFilter {
    const ID: &'static str = "channel_filter";
    const EQUATION: &'static str = "tau * d(thrust_n)/dt + thrust_n = thrust";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { tau_s: stream.log_between(0.4, 1.5) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.bridge.filter_s = self.tau_s;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("tau", self.tau_s, "s")]
    }
}
