//! `supply_sag`: the supply's voltage falls with the current, and the rotors with the voltage.
//!
//! What it is: V = V_0 - resistance I; where no current was logged, with the cube of the rotors' speeds, which their power goes with. At the
//! same pulse a rotor's speed goes with the voltage.
//! What can go wrong: in steady flight the current hardly changes and nothing shows.
//! Units: ohm, or V at the usual power; the share of a relative change of voltage that the speed follows.
//! Reference: Ohm's law; Beharie 2013, Eq. 5.11 as corrected.

use super::{About, AirframeEffect, Clause, EffectEntry, FOLLOWED, Form, Found, Scope, Sink, single};
use crate::attribution::columns::Prior;
use crate::flight::channels::Target;
use crate::flight::columns::{Flight, driven};
use crate::verdict::Parameter;

pub(super) struct SupplySag;

/// Usual sag at the usual current, as a share of the voltage.
const USUAL: f64 = 0.1;

/// The speeds' column of the voltage, once in a hypothesis.
pub(super) fn follow(sink: &mut Sink<'_>) {
    let already = FOLLOWED.iter().any(|id| sink.before.contains(id));
    let Some(voltage) = &sink.flight.record.voltage else { return };
    if already || sink.flight.record.speed.is_empty() {
        return;
    }
    let usual = sink.flight.usual.supply[0];
    sink.column("speed_follows", Prior { mean: 0.5, sd: 0.5, sign: 0.0 });
    for rotor in 0..sink.flight.record.rotors() {
        let rpm = sink.flight.usual.rpm;
        let mut values: Vec<f64> = voltage.iter().map(|v| rpm * (v / usual - 1.0)).collect();
        if !sink.flight.record.command.is_empty() {
            // a motor that stands still follows no voltage
            let turns = driven(sink.flight, sink.scene, rotor);
            values.iter_mut().zip(turns).filter(|(_, (_, turns))| !turns).for_each(|(v, _)| *v = 0.0);
        }
        sink.part(Target::Speed(rotor), &values);
    }
}

impl AirframeEffect for SupplySag {
    fn id(&self) -> &'static str {
        "supply_sag"
    }

    fn about(&self) -> About {
        About {
            title: "The supply sags with the load",
            equation: "voltage = V_0 - resistance * current (or - sag * sum w^3 / usual sum w^3); w += speed_follows * w * (voltage / usual voltage - 1)",
            source: "Ohm's law; Beharie 2013, Eq. 5.11 as corrected.",
            depends_on: &["current_a", "rpm"],
            signature: "the voltage mirrors the current, the speeds follow the voltage at the same pulse",
            look_alikes: &["battery_discharge"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        let by_load = || found.tell("sag", |v| format!("drops by {v} under the usual load"), "drops with the load");
        let does = found.tell_in("resistance", "V", |v| format!("drops by {v} for each ampere drawn"), &by_load());
        Clause::new("the supply's voltage", does)
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Rig
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        single(flight.record.voltage.is_some())
    }

    fn columns(&self, _: &Form, _: &[f64], sink: &mut Sink<'_>) {
        let [volts, amperes] = sink.flight.usual.supply;
        if let Some(current) = &sink.flight.record.current {
            let values: Vec<f64> = current.iter().map(|i| -i).collect();
            sink.column("resistance", Prior::positive(USUAL * volts / amperes)).part(Target::Voltage, &values);
        } else {
            let cube = sink.scene.drives(|_| 1.0 / sink.flight.usual.sum);
            let values: Vec<f64> = cube.iter().map(|s| -s.powi(3)).collect();
            sink.column("sag", Prior::positive(USUAL * volts)).part(Target::Voltage, &values);
        }
        follow(sink);
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        let own = |name: &str| found.own.iter().any(|o| o.0 == name);
        let mut out = vec![if own("resistance") { found.plain("resistance", "ohm") } else { found.plain("sag", "V") }];
        if own("speed_follows") {
            out.push(found.plain("speed_follows", "1"));
        }
        out
    }
}
