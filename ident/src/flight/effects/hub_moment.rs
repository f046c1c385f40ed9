//! `hub_moment`: the air across the rotors pitches the body against its motion, and holds its turning back.
//!
//! What it is: blades flap back, and drag acts above the centre of gravity: a moment proportional to the speed through the air and to the
//! rotors' speed; and one against the rate, because a rotor that is carried down lifts more.
//! What can go wrong: without a velocity or a layout in the log it is not asked.
//! Units: rad/s^2 for each m/s; 1/s; both at the rotors' usual speed.
//! Reference: Faessler, Franchi & Scaramuzza, IEEE RA-L 3:620, 2018 (the matrices A and B); Huang et al., ICRA 2009 (blade flapping).

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope, Sink, single};
use crate::attribution::columns::Prior;
use crate::flight::channels::Target;
use crate::flight::columns::Flight;
use crate::verdict::Parameter;

pub(super) struct HubMoment;

/// Usual moment for each m/s, as a share of the whole weight at an arm's length, s/m.
const USUAL: f64 = 0.015;
/// Usual share of the rate that is lost each second, 1/s.
const DAMPING: f64 = 2.0;

impl AirframeEffect for HubMoment {
    fn id(&self) -> &'static str {
        "hub_moment"
    }

    fn about(&self) -> About {
        About {
            title: "Air across the rotors pitches the body back",
            equation: "dw_x += (sum w / usual sum w) * (-flow * v_y - damping * w_x), dw_y += (sum w / usual sum w) * (flow * v_x - damping * w_y)",
            source: "Faessler, Franchi & Scaramuzza, IEEE RA-L 3:620, 2018; Huang et al., ICRA 2009.",
            depends_on: &["vel", "gyro", "rpm"],
            signature: "angular acceleration about the axis across the motion grows with the speed",
            look_alikes: &["mass_offset", "rotor_gain"],
        }
    }

    fn said(&self, _: &EffectEntry) -> Clause {
        Clause::new("air across the rotors", "pitches the body back")
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Rig
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        let record = &flight.record;
        single(record.velocity.is_some() && record.rate.is_some() && !record.vehicle.rotors.is_empty())
    }

    fn columns(&self, _: &Form, _: &[f64], sink: &mut Sink<'_>) {
        let scene = sink.scene;
        let share: Vec<f64> = scene.drives(|_| 1.0).iter().map(|s| s / sink.flight.usual.sum).collect();
        let by = |of: &dyn Fn(usize) -> f64| -> Vec<f64> { share.iter().enumerate().map(|(row, s)| s * of(row)).collect() };
        let usual = USUAL * sink.flight.usual.turning;
        sink.column("flow", Prior::about_zero(usual))
            .part(Target::Turning(0), &by(&|row| -scene.air_at(row).y))
            .part(Target::Turning(1), &by(&|row| scene.air_at(row).x));
        sink.column("damping", Prior::about_zero(DAMPING))
            .part(Target::Turning(0), &by(&|row| -scene.rate_at(row).x))
            .part(Target::Turning(1), &by(&|row| -scene.rate_at(row).y));
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        vec![found.plain("flow", "rad/s^2/(m/s)"), found.plain("damping", "1/s")]
    }
}
