//! `beam_resonance`: the rotor's unbalance excites the beam's first mode.
//!
//! What it is: once a revolution the unbalance, at its height above the beam, bends it; where that meets the mode the strain
//! swings, and an amplifier whose output falls slower than it rises turns part of the swing into a small bump of the mean.
//! What can go wrong: between two levels of a coarse staircase the peak itself may go unseen.
//! Units: Hz, 1, g.mm, s.
//! Reference: Beharie 2013 section 5.7.1; errata "beam (Table 7)": 41.9 Hz with 244 g at the tip, damping ratio 0.01-0.03.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use crate::plant::Beam;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BeamResonance {
    /// Natural frequency, Hz.
    pub natural_frequency_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Unbalance, g.mm.
    pub unbalance_g_mm: f64,
    /// Time constant of the amplifier's output while it falls, s.
    #[serde(default)]
    pub fall_s: f64,
}

impl Effect for BeamResonance {
    const ID: &'static str = "beam_resonance";
    const EQUATION: &'static str = "y'' + 2 zeta w0 y' + w0^2 y = w0^2 (thrust + 1.5 h/L U w^2 cos(angle))";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        Self {
            natural_frequency_hz: Beam::steel(0.115, stream.between(0.20, 0.30)),
            damping_ratio: stream.between(0.012, 0.03),
            unbalance_g_mm: stream.log_between(0.4, 1.2),
            fall_s: stream.between(2.0e-3, 4.0e-3),
        }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.beam.natural_frequency_hz = self.natural_frequency_hz;
        parts.beam.damping_ratio = self.damping_ratio;
        parts.beam.unbalance_kgm = self.unbalance_g_mm * 1.0e-6;
        if self.fall_s > 0.0 {
            parts.bridge.fall_s = self.fall_s;
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![
            ("natural_frequency", self.natural_frequency_hz, "Hz"),
            ("damping_ratio", self.damping_ratio, "1"),
            ("unbalance", self.unbalance_g_mm, "g.mm"),
            ("fall", self.fall_s, "s"),
        ]
    }
}
