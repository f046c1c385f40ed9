//! `glitch_rows`: single rows hold absurd values.
//!
//! What it is: a spark nearby couples a burst into the wire of one channel; at random instants the pin jumps for a twentieth
//! of a second.
//! What can go wrong: a burst across two rows spoils both.
//! Units: 1/s, V at the pin, channel number.
//! Reference: electrostatic discharge and switching bursts, IEC 61000-4-4; Poisson process in slots of 0.05 s.

use super::{Effect, Levers};
use crate::noise::{Stream, chance};
use serde::{Deserialize, Serialize};

/// Length of a burst, s.
const SLOT_S: f64 = 0.05;

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GlitchRows {
    /// Channel: 0 thrust, 1 torque, 2 current, 3 voltage, 4 temperature.
    pub channel: u8,
    /// Bursts a second.
    pub rate_per_s: f64,
    /// Height at the pin, V; its sign is drawn each time.
    pub jump_v: f64,
}

impl Effect for GlitchRows {
    const ID: &'static str = "glitch_rows";
    const EQUATION: &'static str = "a pin jumps by +-jump for 0.05 s at random instants";

    fn draw(stream: &mut Stream, run_s: f64) -> Self {
        Self { channel: (stream.uniform() * 2.0) as u8, rate_per_s: stream.between(4.0, 12.0) / run_s, jump_v: stream.log_between(0.3, 1.0) }
    }

    fn act(&self, run_s: f64, levers: &mut Levers) {
        let slot = (run_s / SLOT_S) as u64;
        let drawn = chance(levers.seed, slot);
        if drawn < self.rate_per_s * SLOT_S
            && let Some(spike) = levers.spike_v.get_mut(usize::from(self.channel))
        {
            *spike += if chance(levers.seed, !slot) < 0.5 { -self.jump_v } else { self.jump_v };
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("channel", f64::from(self.channel), "1"), ("rate", self.rate_per_s, "1/s"), ("jump", self.jump_v, "V")]
    }
}
