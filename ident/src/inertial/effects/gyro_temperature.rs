//! `gyro_temperature`: the gyro's offset follows the temperature.
//!
//! What it is: a vector for each kelvin of the column `temp_c` from the log's first reading of it, seen while the body rests.
//! What can go wrong: without that column, or at one temperature, it is not asked.
//! Units: rad/s/K.
//! Reference: PS-ITG-3200A rev 1.4, table 3.1 (zero-rate output over temperature).

use super::super::least::Term;
use super::super::search::{Cause, Instance, Scene};
use super::AXES;
use nalgebra::Vector3;

/// Temperatures that differ less tell nothing, K.
const LEAST_K: f64 = 0.5;

pub(crate) struct GyroTemperature;

impl Cause for GyroTemperature {
    fn id(&self) -> &'static str {
        "gyro_temperature"
    }

    fn shapes(&self, scene: &Scene<'_>) -> Vec<f64> {
        let known = scene.recording.temperature.iter().copied().filter(|c| c.is_finite());
        let (lo, hi) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), c| (a.min(c), b.max(c)));
        if hi - lo >= LEAST_K { vec![f64::NAN] } else { Vec::new() }
    }

    fn instance<'a>(&self, scene: &Scene<'a>, _: f64) -> Instance<'a> {
        let warm = &scene.recording.temperature;
        let first = warm.iter().copied().find(|c| c.is_finite()).unwrap_or(0.0);
        let kelvin = move |row: usize| warm.get(row).copied().filter(|c| c.is_finite()).map_or(0.0, |c| c - first);
        let term = |k: usize| Term::new(&format!("per_kelvin_{}", AXES[k]), "rad/s/K", move |i| Vector3::ith(k, kelvin(i)));
        Instance {
            id: self.id(),
            depends_on: vec!["temp_c"],
            equation: "w += per_kelvin * (temp_c - first temp_c)",
            terms: (0..3).map(term).collect(),
            shape: None,
            flexible: false,
            summary: None,
        }
    }
}
