//! `transmitter`: a transmitter beside the board keys on and off.
//!
//! What it is: the magnetometer's amplifier rectifies its carrier: while it sends, one axis reads off by a constant.
//! What can go wrong: nothing. The library of the identification does not know it.
//! Units: gauss, chip axis 0..2, s.
//! Reference: Analog Devices AN-671, rectification of radio frequency in instrumentation amplifiers.

use super::{ImuEffect, ImuLevers, Instant};
use crate::noise::{Stream, chance};
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Transmitter {
    /// Reading while it sends, gauss.
    pub offset_gauss: f64,
    /// Axis of the body.
    pub axis: usize,
    /// Length of a word, s.
    pub word_s: f64,
    /// Share of words that are sent.
    pub share: f64,
    /// What it sends.
    pub message: u64,
}

impl ImuEffect for Transmitter {
    const ID: &'static str = "transmitter";
    const EQUATION: &'static str = "m[axis] += offset while a word is sent";

    fn draw(stream: &mut Stream, _: f64) -> Self {
        Self {
            offset_gauss: stream.sign() * stream.log_between(0.06, 0.24),
            axis: (stream.uniform() * 3.0) as usize,
            word_s: stream.between(0.3, 0.6),
            share: stream.between(0.2, 0.4),
            message: (stream.uniform() * 1e6) as u64,
        }
    }

    fn act(&self, at: &Instant, levers: &mut ImuLevers) {
        let word = (at.run_s / self.word_s) as u64;
        if chance(self.message, word) < self.share
            && let Some(axis) = levers.body_field.get_mut(self.axis)
        {
            *axis += self.offset_gauss;
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        Vec::new()
    }
}
