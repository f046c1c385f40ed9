//! `soft_iron`: iron that the field magnetises, travelling with the sensor.
//!
//! What it is: the sensor reads (1 + S) times the field; the trace of S is one with the size of the field and stays 0. Gains that
//! differ between axes and axes that are not square look the same.
//! What can go wrong: without turning about two axes its entries have wide intervals.
//! Units: 1.
//! Reference: Gebre-Egziabher et al., Journal of Aerospace Engineering 19(2), 2006.

use super::super::least::Term;
use super::super::search::{Cause, Instance, Scene};
use super::AXES;
use nalgebra::Vector3;

pub(crate) struct SoftIron;

impl Cause for SoftIron {
    fn id(&self) -> &'static str {
        "soft_iron"
    }

    fn shapes(&self, _: &Scene<'_>) -> Vec<f64> {
        vec![f64::NAN]
    }

    fn instance<'a>(&self, scene: &Scene<'a>, _: f64) -> Instance<'a> {
        let predicted = scene.predicted;
        let mut terms = Vec::new();
        for (i, j) in [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)] {
            let name = format!("s_{}{}", AXES[i], AXES[j]);
            terms.push(Term::new(&name, "1", move |row| Vector3::ith(i, predicted[row][j])));
        }
        for i in 0..2 {
            let name = format!("s_{0}{0}", AXES[i]);
            terms.push(Term::new(&name, "1", move |row| Vector3::ith(i, predicted[row][i]) - Vector3::ith(2, predicted[row].z)));
        }
        Instance {
            id: self.id(),
            depends_on: vec!["attitude"],
            equation: "m += S m_predicted, s_zz = -s_xx - s_yy",
            terms,
            shape: None,
            flexible: false,
            summary: None,
        }
    }
}
