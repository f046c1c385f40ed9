//! `encoder_drag`: the shaft encoder brakes the rotor while it is coupled.
//!
//! What it is: a constant torque between two instants of the run; before and after them the encoder is off the shaft and
//! stands still.
//! What can go wrong: the torque arm shows it only where the encoder is not carried by the arm (`share`).
//! Units: N.m, s, 0..1.
//! Reference: Beharie 2013 section 5.7.1; errata 2.22-2.24.

use super::{Effect, Levers};
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EncoderDrag {
    /// Torque, N.m.
    pub constant_nm: f64,
    /// Share that the torque arm sees, 0..1.
    #[serde(default)]
    pub share: f64,
    /// It is coupled from here, s into the run.
    #[serde(default)]
    pub on_s: f64,
    /// It is taken off here, s into the run.
    #[serde(default = "never")]
    pub off_s: f64,
}

fn never() -> f64 {
    1.0e9
}

impl Effect for EncoderDrag {
    const ID: &'static str = "encoder_drag";
    const EQUATION: &'static str = "from on to off: motor torque += constant, torque_nm += share of it, rpm_encoder reads";

    fn draw(stream: &mut Stream, run_s: f64) -> Self {
        Self { constant_nm: stream.log_between(2.0e-3, 6.0e-3), share: 0.0, on_s: 0.0, off_s: run_s * stream.between(0.3, 0.7) }
    }

    fn act(&self, run_s: f64, levers: &mut Levers) {
        if (self.on_s..self.off_s).contains(&run_s) {
            levers.plant.drag_nm += self.constant_nm;
            levers.plant.drag_share = self.share;
        } else {
            levers.encoder_off = true;
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("constant", self.constant_nm, "N.m"), ("share", self.share, "1"), ("on", self.on_s, "s"), ("off", self.off_s, "s")]
    }
}
