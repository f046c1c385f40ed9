//! `body_drag`: drag of the body, with the square of the speed.
//!
//! What it is: F = -1/2 rho CdS |v| v in all directions.
//! What can go wrong: without a velocity in the log it is not asked; over a narrow range of speeds it looks like `rotor_drag` across the rotors.
//! Units: m^2 (drag coefficient times area) at 1.225 kg/m^3.
//! Reference: Beharie 2013, Eq. 2.37 and 2.42 as corrected in the errata; Hoerner, *Fluid-Dynamic Drag*, 1965.

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope, Sink, single};
use crate::attribution::columns::Prior;
use crate::flight::channels::Target;
use crate::flight::columns::Flight;
use crate::verdict::Parameter;

pub(super) struct BodyDrag;

/// Usual size of 1/2 rho CdS / m, 1/m: terminal speeds of some 15 m/s.
const USUAL: f64 = 0.04;
/// Density of ISA air at sea level, kg/m^3.
const DENSITY: f64 = 1.225;

impl AirframeEffect for BodyDrag {
    fn id(&self) -> &'static str {
        "body_drag"
    }

    fn about(&self) -> About {
        About {
            title: "The body drags",
            equation: "F = -1/2 rho area |v| v, v through the air",
            source: "Beharie 2013, Eq. 2.42 as corrected in the errata; Hoerner 1965.",
            depends_on: &["vel"],
            signature: "specific force falls with the square of the speed, in every direction alike",
            look_alikes: &["rotor_drag", "wind", "translational_lift"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new("the body", found.tell("area", |v| format!("drags like a plate of {v}"), "drags"))
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Rig
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        single(flight.record.velocity.is_some() && flight.record.force.is_some())
    }

    fn columns(&self, _: &Form, _: &[f64], sink: &mut Sink<'_>) {
        let scene = sink.scene;
        sink.column("per_mass", Prior::positive(USUAL));
        for axis in 0..3 {
            let values: Vec<f64> = (0..scene.len())
                .map(|row| {
                    let v = scene.air_at(row);
                    -v.norm() * v[axis]
                })
                .collect();
            sink.part(Target::Force(axis), &values);
        }
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        match found.flight.record.vehicle.mass_kg {
            Some(mass) => vec![found.scaled("per_mass", "area", "m^2", 2.0 * mass / DENSITY)],
            None => vec![found.scaled("per_mass", "area_per_mass", "m^2/kg", 2.0 / DENSITY)],
        }
    }
}
