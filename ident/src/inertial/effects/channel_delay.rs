//! `channel_delay`: the magnetometer is late.
//!
//! What it is: the reading belongs to an instant before its time stamp; a field that is constant in earth axes turns in body axes at
//! -w x m, so a delay adds delay * w x m.
//! What can go wrong: to first order only: delay times rate must be well below one radian.
//! Units: s, positive is late.
//! Reference: Poisson's formula for the derivative of a vector in a turning frame; specification `closing-the-loop.md`, table.

use super::super::least::Term;
use super::super::search::{Cause, Instance, Scene};
use nalgebra::Vector3;

pub(crate) struct ChannelDelay;

impl Cause for ChannelDelay {
    fn id(&self) -> &'static str {
        "channel_delay"
    }

    fn shapes(&self, _: &Scene<'_>) -> Vec<f64> {
        vec![f64::NAN]
    }

    fn instance<'a>(&self, scene: &Scene<'a>, _: f64) -> Instance<'a> {
        let (gyro, predicted) = (&scene.recording.gyro, scene.predicted);
        let turned = move |i: usize| {
            let change = gyro[i].cross(&predicted[i]);
            if change.iter().all(|c| c.is_finite()) { change } else { Vector3::zeros() }
        };
        Instance {
            id: self.id(),
            depends_on: vec!["gx", "gy", "gz", "attitude"],
            equation: "m += delay * w x m_predicted",
            terms: vec![Term::new("delay", "s", turned)],
            shape: None,
            flexible: false,
            summary: None,
        }
    }
}
