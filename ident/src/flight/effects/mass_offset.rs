//! `mass_offset`: the centre of gravity is not in the middle of the rotors.
//!
//! What it is: the whole thrust has a moment about it: dw_x += k y_offset, dw_y -= k x_offset times sum w^2, with the roll and pitch coefficient
//! of the thrust differences.
//! What can go wrong: without a layout it is not asked; rotors of unlike strength look alike, but for the torque about z.
//! Units: m, or arms where no arm is known.
//! Reference: Beharie 2013, section 2.2 (moments about the centre of gravity).

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope, Sink, single};
use crate::attribution::columns::Prior;
use crate::flight::channels::Target;
use crate::flight::columns::Flight;
use crate::verdict::Parameter;

pub(super) struct MassOffset;

/// Usual offset, in arms.
const USUAL: f64 = 0.05;

impl AirframeEffect for MassOffset {
    fn id(&self) -> &'static str {
        "mass_offset"
    }

    fn about(&self) -> About {
        About {
            title: "The centre of gravity is off the middle",
            equation: "moment = -offset x thrust",
            source: "Beharie 2013, section 2.2.",
            depends_on: &["rpm"],
            signature: "constant angular acceleration about the level axes that goes with the thrust",
            look_alikes: &["rotor_gain", "hub_moment"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        let arm = found.parameters.first().is_some_and(|p| p.unit == "arm");
        let unit = if arm { "arm lengths" } else { "m" };
        Clause::new(
            "the centre of gravity",
            found.tell_length("offset", unit, |v| format!("lies {v} off the middle"), "lies off the middle"),
        )
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Rig
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        single(flight.record.rate.is_some() && !flight.record.vehicle.rotors.is_empty())
    }

    fn columns(&self, _: &Form, _: &[f64], sink: &mut Sink<'_>) {
        let usual = &sink.flight.usual;
        let power = if sink.flight.record.speed.is_empty() { 1 } else { 2 };
        let whole = if power == 2 { usual.squares } else { usual.sum };
        let size = USUAL * usual.turning;
        let values: Vec<f64> = sink.scene.thrusts(|_| 1.0, power).iter().map(|s| s / whole).collect();
        let back: Vec<f64> = values.iter().map(|v| -v).collect();
        sink.column("about_x", Prior::about_zero(size)).part(Target::Turning(0), &values);
        sink.column("about_y", Prior::about_zero(size)).part(Target::Turning(1), &back);
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        let usual = &found.flight.usual;
        let (unit, arm) = if found.flight.record.vehicle.arm_m.is_some() { ("m", usual.arm) } else { ("arm", 1.0) };
        // moment of the whole thrust at one unit of length, from the coefficient of the differences
        let per_length = |name: &str| {
            let own = found.other(name).map(|k| k * usual.squares).filter(|k| *k > 0.0);
            own.unwrap_or(usual.turning / arm)
        };
        vec![
            found.scaled("about_y", "offset_x", unit, 1.0 / per_length("pitch")),
            found.scaled("about_x", "offset_y", unit, 1.0 / per_length("roll")),
        ]
    }
}
