//! `rotor_drag`: the rotors' force against the motion, in their plane.
//!
//! What it is: the advancing blade drags more than the retreating one; the force is proportional to the speed through the air and to the
//! rotor's own, and an accelerometer sees it.
//! What can go wrong: without a velocity in the log it is not asked; in steady flight it is one with an offset.
//! Units: N/(m/s) with all rotors at their usual speed.
//! Reference: Martin & Salaun, ICRA 2010; Faessler, Franchi & Scaramuzza, IEEE RA-L 3:620, 2018.

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope, Sink, single};
use crate::attribution::columns::Prior;
use crate::flight::channels::Target;
use crate::flight::columns::Flight;
use crate::verdict::Parameter;

pub(super) struct RotorDrag;

/// Usual size: a force of this times the mass for each m/s, 1/s.
const USUAL: f64 = 0.3;

impl AirframeEffect for RotorDrag {
    fn id(&self) -> &'static str {
        "rotor_drag"
    }

    fn about(&self) -> About {
        About {
            title: "The rotors drag across their axes",
            equation: "F_xy = -coefficient * (sum w / usual sum w) * v_xy, v through the air",
            source: "Martin & Salaun, ICRA 2010; Faessler, Franchi & Scaramuzza, IEEE RA-L 3:620, 2018.",
            depends_on: &["vel", "rpm"],
            signature: "specific force across the rotors falls in proportion to the speed; along them it does not",
            look_alikes: &["body_drag", "wind", "accelerometer_bias"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        let unit = found.parameters.first().map_or("N", |p| p.unit.trim_end_matches("/(m/s)"));
        let with = |v: &str| format!("drag {v} for each m/s across their axes");
        Clause::new("the rotors", found.tell_in("coefficient", unit, with, "drag across their axes"))
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Rig
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        single(flight.record.velocity.is_some() && flight.record.force.is_some())
    }

    fn columns(&self, _: &Form, _: &[f64], sink: &mut Sink<'_>) {
        let scene = sink.scene;
        let share: Vec<f64> = scene.drives(|_| 1.0).iter().map(|s| s / sink.flight.usual.sum).collect();
        sink.column("coefficient", Prior::positive(USUAL));
        for axis in 0..2 {
            let values: Vec<f64> = share.iter().enumerate().map(|(row, s)| -s * scene.air_at(row)[axis]).collect();
            sink.part(Target::Force(axis), &values);
        }
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        let (mass, unit) = found.mass();
        vec![found.scaled("coefficient", "coefficient", &format!("{unit}/(m/s)"), mass)]
    }
}
