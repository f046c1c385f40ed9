//! `current_induced_field`: the field of the motors' leads.
//!
//! What it is: a vector in body axes for each ampere of the column `current_a`.
//! What can go wrong: without that column it is not asked.
//! Units: uT/A.
//! Reference: law of Biot and Savart: the field of a conductor is proportional to its current.

use super::super::least::Term;
use super::super::search::{Cause, Instance, Scene};
use super::AXES;
use nalgebra::Vector3;

pub(crate) struct CurrentInducedField;

impl Cause for CurrentInducedField {
    fn id(&self) -> &'static str {
        "current_induced_field"
    }

    fn shapes(&self, scene: &Scene<'_>) -> Vec<f64> {
        if scene.recording.current.is_empty() { Vec::new() } else { vec![f64::NAN] }
    }

    fn instance<'a>(&self, scene: &Scene<'a>, _: f64) -> Instance<'a> {
        let current = &scene.recording.current;
        let amperes = move |row: usize| current.get(row).copied().filter(|c| c.is_finite()).unwrap_or(0.0);
        let term = |k: usize| Term::new(&format!("per_ampere_{}", AXES[k]), "uT/A", move |i| Vector3::ith(k, amperes(i)));
        Instance {
            id: self.id(),
            depends_on: vec!["current_a"],
            equation: "m += per_ampere * current_a",
            terms: (0..3).map(term).collect(),
            shape: None,
            flexible: false,
            summary: None,
        }
    }
}
