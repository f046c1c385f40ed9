//! `g_sensitivity`: the gyro's offset follows the specific force.
//!
//! What it is: the gyro reads a matrix times the specific force, seen while the body rests in several attitudes.
//! What can go wrong: with rests in one attitude only it is one with the offset and stays unnamed.
//! Units: rad/s per m/s^2.
//! Reference: IEEE Std 952, acceleration-sensitive drift.

use super::super::least::Term;
use super::super::search::{Cause, Instance, Scene};
use super::AXES;
use nalgebra::Vector3;

/// Three times the 0.1 deg/s/g of an ITG-3200 (PS-ITG-3200A rev 1.4, table 3.1), rad/s per m/s^2. With much more, its nine numbers take any
/// jump of the offset between rests in a few attitudes for their own.
const PRIOR: f64 = 5e-4;

pub(crate) struct GSensitivity;

impl Cause for GSensitivity {
    fn id(&self) -> &'static str {
        "g_sensitivity"
    }

    fn shapes(&self, _: &Scene<'_>) -> Vec<f64> {
        vec![f64::NAN]
    }

    fn instance<'a>(&self, scene: &Scene<'a>, _: f64) -> Instance<'a> {
        let accel = &scene.recording.accel;
        let force = move |row: usize, j: usize| Some(accel[row][j]).filter(|f| f.is_finite()).unwrap_or(0.0);
        let mut terms = Vec::with_capacity(9);
        for (i, to) in AXES.iter().enumerate() {
            for (j, of) in AXES.iter().enumerate() {
                let name = format!("g_{to}{of}");
                terms.push(Term { prior: PRIOR, ..Term::new(&name, "rad/s/(m/s^2)", move |row| Vector3::ith(i, force(row, j))) });
            }
        }
        Instance {
            id: self.id(),
            depends_on: vec!["ax", "ay", "az"],
            equation: "w += G f",
            terms,
            shape: None,
            flexible: false,
            summary: None,
        }
    }
}
