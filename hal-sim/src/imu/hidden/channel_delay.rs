//! `channel_delay`: the magnetometer's readings are of an instant before.
//!
//! What it is: the chip's measurement takes its time before the registers hold it.
//! What can go wrong: nothing.
//! Units: s.
//! Reference: HMC5883L data sheet, "Operational modes" (a measurement takes up to 6 ms; averaging multiplies it).

use super::{ImuEffect, ImuLevers, Instant};
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChannelDelay {
    /// How late, s.
    pub delay_s: f64,
}

impl ImuEffect for ChannelDelay {
    const ID: &'static str = "channel_delay";
    const EQUATION: &'static str = "m(t) = m(t - delay)";

    fn draw(stream: &mut Stream, _: f64) -> Self {
        Self { delay_s: stream.log_between(0.025, 0.08) }
    }

    fn act(&self, _: &Instant, levers: &mut ImuLevers) {
        levers.late_s += self.delay_s;
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("delay", self.delay_s, "s")]
    }
}
