//! `ground_effect`: near the ground the same speed lifts more.
//!
//! What it is: T = T_0 / (1 - (radius / 4 h)^2), h the height of the log.
//! What can go wrong: without a height in the log it is not asked; at one height it is one with the thrust coefficient.
//! Units: m. The radius is that of one rotor with the size of the whole vehicle's footing.
//! Reference: Cheeseman & Bennett, ARC R&M 3021, 1955.

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope};
use crate::attribution::columns::Shape;
use crate::flight::columns::Flight;
use crate::flight::scene::Scene;
use crate::verdict::Parameter;

pub(super) struct GroundEffect;

/// Largest square of radius over four heights that the form stands for.
const LARGEST: f64 = 0.5;
/// Radius over arm (or, without one, over a tenth of a metre): range and starts.
const RADII: (f64, f64) = (0.1, 5.0);
const STARTS: [f64; 3] = [0.6, 1.2, 2.4];

impl AirframeEffect for GroundEffect {
    fn id(&self) -> &'static str {
        "ground_effect"
    }

    fn about(&self) -> About {
        About {
            title: "The ground carries",
            equation: "T = T_0 / (1 - (radius / (4 h))^2)",
            source: "Cheeseman & Bennett, ARC R&M 3021, 1955.",
            depends_on: &["pos_z"],
            signature: "specific force along the rotors grows near the ground, and the same for all speeds",
            look_alikes: &["translational_lift"],
        }
    }

    fn said(&self, _: &EffectEntry) -> Clause {
        Clause::new("the ground", "adds thrust close to it")
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Rig
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        let Some(height) = &flight.record.height else { return Vec::new() };
        let record = &flight.record;
        let lowest = height
            .iter()
            .zip(&record.flying)
            .filter(|(h, f)| **f && h.is_finite())
            .map(|(h, _)| *h)
            .fold(f64::INFINITY, f64::min);
        let arm = record.vehicle.arm_m.unwrap_or(0.1);
        // out of every reach of it nothing is asked; a height below nothing is no height over ground
        if !(lowest > 0.0 && lowest < RADII.1 * arm * 2.0) || record.force.is_none() {
            return Vec::new();
        }
        let shape = Shape { name: "radius", unit: "m", range: (RADII.0 * arm, RADII.1 * arm), closed: false };
        vec![Form { shapes: vec![shape], starts: STARTS.map(|s| vec![s * arm]).to_vec(), ..Form::default() }]
    }

    fn alters(&self) -> bool {
        true
    }

    fn alter(&self, flight: &Flight, _: &Form, shape: &[f64], scene: &mut Scene<'_>) {
        let Some(height) = &flight.record.height else { return };
        let factor = |h: &f64| 1.0 / (1.0 - (shape[0] / (4.0 * h)).powi(2).min(LARGEST));
        scene.cushion = height.iter().map(factor).collect();
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        vec![found.plain("radius", "m")]
    }
}
