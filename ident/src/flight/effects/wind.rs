//! `wind`: the air moves over ground, always alike.
//!
//! What it is: a constant velocity of the air in earth axes; what drags does so against it.
//! What can go wrong: it shows through drag or lift alone, so one of them stands beside it; without turning or moving it is an offset.
//! Units: m/s, to the north and to the east.
//! Reference: Beharie 2013, section 2.6 (air-relative velocity).

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope};
use crate::attribution::columns::Shape;
use crate::flight::columns::Flight;
use crate::flight::scene::Scene;
use crate::verdict::Parameter;
use nalgebra::Vector3;

pub(super) struct Wind;

/// Strongest wind, m/s.
const STRONGEST: f64 = 15.0;
/// Winds from which the search starts, m/s.
const STARTS: [[f64; 2]; 4] = [[3.0, 0.0], [-3.0, 0.0], [0.0, 3.0], [0.0, -3.0]];

impl AirframeEffect for Wind {
    fn id(&self) -> &'static str {
        "wind"
    }

    fn about(&self) -> About {
        About {
            title: "A constant wind",
            equation: "v through the air = v over ground - (north, east, 0)",
            source: "Beharie 2013, section 2.6.",
            depends_on: &["vel", "attitude"],
            signature: "a drag that does not vanish where the vehicle stands still over ground, in earth axes",
            look_alikes: &["accelerometer_bias", "mass_offset"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        let speed = found.tell_length_of(&["north", "east"], "m/s", |v| format!("blows at {v}"), "blows");
        Clause::new("a wind", speed)
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Run
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        if flight.record.velocity.is_none() {
            return Vec::new();
        }
        let along = |name| Shape { name, unit: "m/s", range: (-STRONGEST, STRONGEST), closed: false };
        let starts = STARTS.map(|s| s.to_vec()).to_vec();
        vec![Form { shapes: vec![along("north"), along("east")], starts, ..Form::default() }]
    }

    fn needs(&self) -> &'static [&'static str] {
        &["rotor_drag", "body_drag", "hub_moment"]
    }

    fn alters(&self) -> bool {
        true
    }

    fn alter(&self, flight: &Flight, _: &Form, shape: &[f64], scene: &mut Scene<'_>) {
        let (Some(air), Some(to_earth)) = (&mut scene.air, &flight.record.to_earth) else { return };
        let wind = Vector3::new(shape[0], shape[1], 0.0);
        for (row, turn) in to_earth.iter().enumerate() {
            let blown = turn.tr_mul(&wind);
            (0..3).for_each(|k| air[k][row] -= blown[k]);
        }
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        vec![found.plain("north", "m/s"), found.plain("east", "m/s")]
    }
}
