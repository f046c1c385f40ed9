//! `gyro_bias`: the gyro's offset jumps.
//!
//! What it is: a constant vector from an instant on, seen while the body rests.
//! What can go wrong: between two rests the instant is only known to lie between them, and its interval says so.
//! Units: rad/s, s.
//! Reference: IEEE Std 952, in-run bias; specification `closing-the-loop.md`, "Inertial".

use super::super::least::Term;
use super::super::search::{Cause, Instance, Scene};
use super::{AXES, instants};
use nalgebra::Vector3;

pub(crate) struct GyroBias;

impl Cause for GyroBias {
    fn id(&self) -> &'static str {
        "gyro_bias"
    }

    fn shapes(&self, scene: &Scene<'_>) -> Vec<f64> {
        instants(scene).collect()
    }

    fn resolution(&self) -> f64 {
        0.1
    }

    fn instance<'a>(&self, scene: &Scene<'a>, t0: f64) -> Instance<'a> {
        let t = &scene.recording.t;
        let term =
            |k: usize| Term {
                support: (t0, f64::INFINITY),
                ..Term::new(&format!("step_{}", AXES[k]), "rad/s", move |i| {
                    if t[i] >= t0 { Vector3::ith(k, 1.0) } else { Vector3::zeros() }
                })
            };
        Instance {
            id: self.id(),
            depends_on: vec!["t_s"],
            equation: "w += step from t0 on",
            terms: (0..3).map(term).collect(),
            shape: Some(("t0", "s", t0)),
            flexible: false,
            summary: None,
        }
    }
}
