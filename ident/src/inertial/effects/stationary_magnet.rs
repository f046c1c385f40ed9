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
use crate::verdict::Parameter;

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
            summary: Some(Box::new(move |c, s| summary(c, s, from, spacing))),
        }
    }
}

/// How large the change is. Its part to the east is one with a slow drift of the heading and is left out.
fn summary(c: &[f64], s: &[f64], from: f64, spacing: f64) -> Vec<Parameter> {
    let count = c.len() / 3;
    let mean = |k: usize| c.iter().skip(k).step_by(3).sum::<f64>() / count.max(1) as f64;
    let (north, down) = (mean(0), mean(2));
    let size = |k: usize| (c[3 * k] - north).hypot(c[3 * k + 2] - down);
    let sigma = |k: usize| s[3 * k].hypot(s[3 * k + 2]);
    let Some(top) = (0..count).max_by(|a, b| size(*a).total_cmp(&size(*b))) else { return Vec::new() };
    let rms = ((0..count).map(|k| size(k).powi(2)).sum::<f64>() / count as f64).sqrt();
    let spread = ((0..count).map(|k| sigma(k).powi(2)).sum::<f64>()).sqrt() / count as f64;
    vec![
        parameter("rms", rms, "uT", spread),
        parameter("peak", size(top), "uT", sigma(top)),
        parameter("peak_time", from + top as f64 * spacing, "s", spacing / 1.96),
    ]
}
