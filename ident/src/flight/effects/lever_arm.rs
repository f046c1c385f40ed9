//! `lever_arm`: the accelerometer is not at the centre of gravity.
//!
//! What it is: f += w' x r + w x (w x r), r from the centre of gravity to the sensor.
//! What can go wrong: a vehicle that hardly turns does not show it.
//! Units: m, body axes.
//! Reference: Goldstein, *Classical Mechanics*, section 4.10.

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope, Sink, by_axis, single};
use crate::attribution::columns::Prior;
use crate::flight::channels::Target;
use crate::flight::columns::Flight;
use crate::flight::scene::{FORCE, GYRO};
use crate::verdict::Parameter;
use nalgebra::Vector3;

pub(super) struct LeverArm;

/// Usual distance, m.
const USUAL_M: f64 = 0.02;
const NAMES: [&str; 3] = by_axis!("arm");

impl AirframeEffect for LeverArm {
    fn id(&self) -> &'static str {
        "lever_arm"
    }

    fn about(&self) -> About {
        About {
            title: "The accelerometer is off the centre of gravity",
            equation: "f += w' x arm + w x (w x arm)",
            source: "Goldstein, Classical Mechanics, section 4.10.",
            depends_on: &["gyro"],
            signature: "specific force goes with the angular acceleration and the square of the rate",
            look_alikes: &["rotor_drag"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            "the accelerometer",
            found.tell_length("arm", "m", |v| format!("sits {v} off the centre of gravity"), "sits off the centre of gravity"),
        )
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Rig
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        single(flight.record.rate.is_some() && flight.record.force.is_some())
    }

    fn columns(&self, _: &Form, _: &[f64], sink: &mut Sink<'_>) {
        let (flight, scene) = (sink.flight, sink.scene);
        let Some(rate) = &flight.record.rate else { return };
        let turning = [0, 1, 2].map(|k| flight.windows.slope(&sink.behind(FORCE, GYRO, &rate[k])));
        for (k, name) in NAMES.into_iter().enumerate() {
            let arm = Vector3::ith(k, 1.0);
            sink.column(name, Prior::about_zero(USUAL_M));
            for axis in 0..3 {
                let swing: Vec<f64> = (0..scene.len())
                    .map(|row| {
                        let w = scene.rate_at(row);
                        w.cross(&w.cross(&arm))[axis]
                    })
                    .collect();
                let turned = (0..flight.windows.len())
                    .map(|i| Vector3::new(turning[0][i], turning[1][i], turning[2][i]).cross(&arm)[axis]);
                sink.said_by(GYRO, Target::Force(axis), &swing).window(Target::Force(axis), turned.collect());
            }
        }
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        NAMES.iter().map(|n| found.plain(n, "m")).collect()
    }
}
