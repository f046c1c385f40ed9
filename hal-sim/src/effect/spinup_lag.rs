//! `spinup_lag`: the ESC follows a new throttle slowly, up and down at different rates.
//!
//! What it is: a first-order soft response between commanded and applied throttle.
//! What can go wrong: plateaus stay where they were; only the time after a step shows it.
//! Units: s.
//! Reference: first-order spin-up model, Pounds et al. 2010; the ESC's "acceleration" setting, Beharie 2013 Appendix C.

use crate::parts::BenchParts;
use super::Effect;
use crate::noise::Stream;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpinupLag {
    /// Time constant towards a higher throttle, s.
    pub tau_up_s: f64,
    /// Time constant towards a lower throttle, s.
    pub tau_down_s: f64,
}

impl Effect for SpinupLag {
    const ID: &'static str = "spinup_lag";
    const EQUATION: &'static str = "tau * d(throttle)/dt + throttle = commanded, tau_up rising, tau_down falling";

    fn draw(stream: &mut Stream, _run_s: f64) -> Self {
        let tau_up_s = stream.log_between(0.3, 1.0);
        Self { tau_up_s, tau_down_s: tau_up_s * stream.between(1.2, 2.0) }
    }

    fn fit(&self, parts: &mut BenchParts) {
        parts.plant.limiter.lag_s = (self.tau_up_s, self.tau_down_s);
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("tau_up", self.tau_up_s, "s"), ("tau_down", self.tau_down_s, "s")]
    }
}
