//! `lever_arm`: the accelerometer is not where the body turns about.
//!
//! What it is: f += w' x r + w x (w x r), with r from the centre of turning to the sensor, body axes.
//! What can go wrong: a body that is carried freely has no fixed centre; the fit is then poor and the cause not named.
//! Units: m.
//! Reference: Goldstein, *Classical Mechanics*, section 4.10.

use super::super::least::Term;
use super::super::search::{Cause, Instance, Scene};
use super::AXES;
use nalgebra::Vector3;

pub(crate) struct LeverArm;

impl Cause for LeverArm {
    fn id(&self) -> &'static str {
        "lever_arm"
    }

    fn shapes(&self, _: &Scene<'_>) -> Vec<f64> {
        vec![f64::NAN]
    }

    fn instance<'a>(&self, scene: &Scene<'a>, _: f64) -> Instance<'a> {
        let (gyro, turning) = (&scene.recording.gyro, scene.turning);
        let term = |k: usize| {
            let arm = Vector3::ith(k, 1.0);
            Term::new(&format!("arm_{}", AXES[k]), "m", move |i| turning[i].cross(&arm) + gyro[i].cross(&gyro[i].cross(&arm)))
        };
        Instance {
            id: self.id(),
            depends_on: vec!["gx", "gy", "gz"],
            equation: "f += w' x arm + w x (w x arm)",
            terms: (0..3).map(term).collect(),
            shape: None,
            flexible: false,
            summary: None,
        }
    }
}
