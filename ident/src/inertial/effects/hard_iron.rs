//! `hard_iron`: a magnet that travels with the sensor.
//!
//! What it is: a constant vector in body axes, from the beginning (the calibration does not hold) or from an instant on (something
//! was attached).
//! What can go wrong: without turning it is one with the earth's field and stays unnamed.
//! Units: uT, s.
//! Reference: Gebre-Egziabher et al., Journal of Aerospace Engineering 19(2), 2006.

use super::super::least::Term;
use super::super::search::{Cause, Instance, Scene};
use super::{AXES, instants};
use nalgebra::Vector3;

pub(crate) struct HardIron;

impl Cause for HardIron {
    fn id(&self) -> &'static str {
        "hard_iron"
    }

    fn shapes(&self, scene: &Scene<'_>) -> Vec<f64> {
        std::iter::once(f64::NAN).chain(instants(scene)).collect()
    }

    fn resolution(&self) -> f64 {
        0.1
    }

    fn instance<'a>(&self, scene: &Scene<'a>, shape: f64) -> Instance<'a> {
        let from = if shape.is_nan() { f64::NEG_INFINITY } else { shape };
        let t = &scene.recording.t;
        let term =
            |k: usize| Term {
                support: (from, f64::INFINITY),
                ..Term::new(&format!("offset_{}", AXES[k]), "uT", move |i| {
                    if t[i] >= from { Vector3::ith(k, 1.0) } else { Vector3::zeros() }
                })
            };
        Instance {
            id: self.id(),
            depends_on: if shape.is_nan() { vec!["attitude"] } else { vec!["attitude", "t_s"] },
            equation: "m += offset, constant in body axes from t0 on",
            terms: (0..3).map(term).collect(),
            shape: Some(("t0", "s", shape)),
            flexible: false,
            summary: None,
        }
    }
}
