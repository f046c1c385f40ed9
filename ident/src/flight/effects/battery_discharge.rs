//! `battery_discharge`: the open-circuit voltage falls with the charge that was drawn.
//!
//! What it is: V = V_0 - slope Q, Q the integral of the current; without a current, with time. The rotors follow the voltage.
//! What can go wrong: in a flight of a few seconds it is one with any other slow fall.
//! Units: V/(A.h), or V/s.
//! Reference: Beharie 2013, section 5.4 (endurance); the flat part of a LiPo's curve is a straight line.

use super::supply_sag::follow;
use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope, Sink, single};
use crate::attribution::columns::Prior;
use crate::flight::channels::Target;
use crate::flight::columns::Flight;
use crate::verdict::Parameter;

pub(super) struct BatteryDischarge;

/// Usual fall over a flight, as a share of the voltage.
const USUAL: f64 = 0.05;

impl AirframeEffect for BatteryDischarge {
    fn id(&self) -> &'static str {
        "battery_discharge"
    }

    fn about(&self) -> About {
        About {
            title: "The battery discharges during the flight",
            equation: "voltage = V_0 - per_charge * charge (or - per_second * t); w += speed_follows * w * (voltage / usual voltage - 1)",
            source: "Beharie 2013, section 5.4.",
            depends_on: &["charge", "t_s"],
            signature: "the voltage falls steadily, the speeds follow it at the same pulse",
            look_alikes: &["supply_sag"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        let by_time = || found.tell_in("per_second", "V", |v| format!("falls by {v} a second"), "falls during the flight");
        Clause::new(
            "the battery's voltage",
            found.tell_in("per_charge", "V", |v| format!("falls by {v} per ampere-hour"), &by_time()),
        )
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Rig
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        single(flight.record.voltage.is_some())
    }

    fn columns(&self, _: &Form, _: &[f64], sink: &mut Sink<'_>) {
        let record = &sink.flight.record;
        let fall = USUAL * sink.flight.usual.supply[0];
        let first = record.t.first().copied().unwrap_or(0.0);
        let seconds = (record.t.last().copied().unwrap_or(1.0) - first).max(1e-3);
        if let Some(current) = &record.current {
            let mut charge = 0.0;
            let values: Vec<f64> = (0..record.len())
                .map(|row| {
                    if row > 0 && current[row].is_finite() {
                        charge += current[row] * (record.t[row] - record.t[row - 1]) / 3600.0;
                    }
                    -charge
                })
                .collect();
            let whole = sink.flight.usual.supply[1] * seconds / 3600.0;
            sink.column("per_charge", Prior::positive(fall / whole)).part(Target::Voltage, &values);
        } else {
            let values: Vec<f64> = record.t.iter().map(|t| -(t - first)).collect();
            sink.column("per_second", Prior::positive(fall / seconds)).part(Target::Voltage, &values);
        }
        follow(sink);
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        let own = |name: &str| found.own.iter().any(|o| o.0 == name);
        let mut out =
            vec![if own("per_charge") { found.plain("per_charge", "V/(A.h)") } else { found.plain("per_second", "V/s") }];
        if own("speed_follows") {
            out.push(found.plain("speed_follows", "1"));
        }
        out
    }
}
