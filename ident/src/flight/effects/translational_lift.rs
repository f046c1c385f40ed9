//! `translational_lift`: thrust grows with the speed across the rotors and falls while the vehicle climbs.
//!
//! What it is: across, the blades meet more air in the mean and less of their own downwash; along the axis the inflow takes angle of attack
//! away: T = k_T sum w^2 + across v_xy^2 - climb sum w v_up.
//! What can go wrong: without a velocity in the log it is not asked.
//! Units: N/(m/s)^2; N/(m/s) with all rotors at their usual speed.
//! Reference: Leishman, *Principles of Helicopter Aerodynamics*, 2006, section 3.3; Svacha, Mohta & Kumar, ICUAS 2017.

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope, Sink, single};
use crate::attribution::columns::Prior;
use crate::flight::channels::Target;
use crate::flight::columns::Flight;
use crate::verdict::Parameter;

pub(super) struct TranslationalLift;

/// Usual thrust over mass for each (m/s)^2 across, 1/m.
const ACROSS: f64 = 0.05;
/// Usual thrust over mass that each m/s of climb takes, 1/s.
const CLIMB: f64 = 0.5;

impl AirframeEffect for TranslationalLift {
    fn id(&self) -> &'static str {
        "translational_lift"
    }

    fn about(&self) -> About {
        About {
            title: "Thrust changes across the air and in a climb",
            equation: "T = k_T sum w^2 + across * v_xy^2 - climb * (sum w / usual sum w) * v_up, v through the air, up along the rotors",
            source: "Leishman 2006, section 3.3; Svacha, Mohta & Kumar, ICUAS 2017.",
            depends_on: &["vel", "rpm"],
            signature: "specific force along the rotors goes with the square of the speed across, and with the climb",
            look_alikes: &["body_drag", "ground_effect"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        // what has an interval of both signs has no direction
        let word = |name: &str, [up, down]: [&'static str; 2]| match found.parameter(name) {
            Some(p) if p.ci95[0] * p.ci95[1] <= 0.0 => "changes",
            Some(p) if p.value < 0.0 => down,
            _ => up,
        };
        let said = match [word("across", ["grows", "falls"]), word("climb", ["falls", "grows"])] {
            [across, climb] if across == climb => format!("{across} across the air and in a climb"),
            [across, climb] => format!("{across} across the air and {climb} in a climb"),
        };
        Clause::new("thrust", said)
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
        let across: Vec<f64> = (0..scene.len())
            .map(|row| {
                let v = scene.air_at(row);
                -(v.x * v.x + v.y * v.y)
            })
            .collect();
        sink.column("across", Prior::about_zero(ACROSS)).part(Target::Force(2), &across);
        // down is positive: a climb has v_z < 0 and lifts less
        let climb: Vec<f64> = share.iter().enumerate().map(|(row, s)| -s * scene.air_at(row).z).collect();
        sink.column("climb", Prior::positive(CLIMB)).part(Target::Force(2), &climb);
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        let (mass, unit) = found.mass();
        vec![
            found.scaled("across", "across", &format!("{unit}/(m/s)^2"), mass),
            found.scaled("climb", "climb", &format!("{unit}/(m/s)"), mass),
        ]
    }
}
