//! `channel_delay`: the thrust channel is late.
//!
//! What it is: a digital conditioner with a dead time.
//! What can go wrong: plateaus stay where they were; only the time after a step shows it.
//! Units: s.
//! Reference: specification `closing-the-loop.md`, `channel_delay`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChannelDelay {
    /// Delay, s; positive is late.
    pub delay_s: f64,
}

impl Effect for ChannelDelay {
    const ID: &'static str = "channel_delay";
    const EQUATION: &'static str = "thrust_n(t) = thrust(t - delay)";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self { delay_s: stream.log_between(0.3, 1.5) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.bridge.meter.delay_s = self.delay_s.max(0.0);
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("delay", self.delay_s, "s")]
    }
}
