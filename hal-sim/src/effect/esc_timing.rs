//! `esc_timing`: the ESC advances its commutation at speed.
//!
//! What it is: above a speed the ESC switches to a lead angle and takes it back only at a lower one; the torque constant
//! falls with its cosine, so the motor turns faster and draws more.
//! What can go wrong: a band narrower than the speed's own scatter makes it switch to and fro.
//! Units: rev/min, electrical deg.
//! Reference: phase advance, Hendershot & Miller 2010, chapter 8. Not in the library of `ident`.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EscTiming {
    /// Lead angle, electrical degrees.
    pub advance_deg: f64,
    /// Speed above which it advances, rev/min.
    pub on_rpm: f64,
    /// Speed below which it takes that back, rev/min.
    pub off_rpm: f64,
}

impl Effect for EscTiming {
    const ID: &'static str = "esc_timing";
    const EQUATION: &'static str = "K = K0 cos(advance) from on_rpm upwards until off_rpm downwards";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        let on_rpm = stream.between(3200.0, 4800.0);
        Self { advance_deg: stream.between(8.0, 18.0), on_rpm, off_rpm: on_rpm - stream.between(300.0, 900.0) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.plant.flux.advance_deg = self.advance_deg;
        parts.plant.flux.advance_rpm = (self.on_rpm, self.off_rpm);
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("advance", self.advance_deg, "deg"), ("on", self.on_rpm, "rpm"), ("off", self.off_rpm, "rpm")]
    }
}
