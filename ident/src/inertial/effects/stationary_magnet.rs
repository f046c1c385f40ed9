//! `stationary_magnet`: iron or a magnet in the room.
//!
//! What it is: the field is no longer the same everywhere: in earth axes it changes as the sensor is carried about, slowly against
//! its turning. The places are not in the log, so the change is a curve over time in earth axes; what tells it from iron that
//! travels with the sensor is the frame in which it is smooth.
//! What can go wrong: a sensor that hardly turns cannot tell the two; steps past a magnet faster than the knots stay behind.
//! Units: uT, s.
//! Reference: linear splines; specification `closing-the-loop.md`, "Inertial".

use super::super::least::Term;
use super::super::search::{Cause, Instance, Scene, parameter};
use nalgebra::Vector3;

/// Distances of the knots, s.
const KNOTS: [f64; 3] = [1.0, 2.0, 4.0];
/// What a room does to the field, uT: half of the earth's at most, or the heading's drift would hide in it.
const PRIOR_UT: f64 = 20.0;

/// More are not solved for.
const MOST_KNOTS: f64 = 200.0;

pub(crate) struct StationaryMagnet;

impl Cause for StationaryMagnet {
    fn id(&self) -> &'static str {
        "stationary_magnet"
    }

    fn shapes(&self, scene: &Scene<'_>) -> Vec<f64> {
        // as many knots as can be solved for in reasonable time
        let length = scene.heard.1 - scene.heard.0;
        KNOTS.into_iter().filter(|k| length / k <= MOST_KNOTS).chain([(length / MOST_KNOTS).max(4.0)]).collect()
    }

    fn instance<'a>(&self, scene: &Scene<'a>, spacing: f64) -> Instance<'a> {
        let (from, to) = scene.heard;
        let count = ((to - from) / spacing).ceil() as usize + 1;
        let (t, to_earth) = (&scene.recording.t, scene.to_earth);
        let mut terms = Vec::with_capacity(3 * count);
        for knot in 0..count {
            let centre = from + knot as f64 * spacing;
            for k in 0..3 {
                let value = move |row: usize| {
                    let share = (1.0 - (t[row] - centre).abs() / spacing).max(0.0);
                    share * to_earth[row].row(k).transpose()
                };
                let support = (centre - spacing, centre + spacing);
                terms.push(Term { support, prior: PRIOR_UT, ..Term::new("", "uT", value) });
            }
        }
        Instance {
            id: self.id(),
            depends_on: vec!["t_s"],
            equation: "m += R^T d(t), d smooth in earth axes",
            terms,
            shape: Some(("knots", "s", spacing)),
            flexible: true,
            summary: Some(Box::new(move |c, s| {
                let size = |k: usize| Vector3::new(c[3 * k], c[3 * k + 1], c[3 * k + 2]).norm();
                let Some(top) = (0..c.len() / 3).max_by(|a, b| size(*a).total_cmp(&size(*b))) else { return Vec::new() };
                let sigma = s[3 * top..3 * top + 3].iter().map(|s| s * s).sum::<f64>().sqrt();
                let at = from + top as f64 * spacing;
                vec![parameter("peak", size(top), "uT", sigma), parameter("peak_time", at, "s", spacing / 1.96)]
            })),
        }
    }
}
