//! `rotor_gain`: one rotor gives another thrust than its speed (where none was measured, its command) says: a damaged blade.
//!
//! What it is: its thrust and torque times 1 + thrust_change, through the whole flight or from an instant on.
//! What can go wrong: through the whole flight it looks like a centre of gravity off the middle, but for the total and the torque.
//! Units: share.
//! Reference: Beharie 2013, section 2.2 (k_T of each rotor).

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope};
use crate::attribution::columns::Shape;
use crate::flight::columns::Flight;
use crate::flight::scene::Scene;
use crate::verdict::Parameter;

pub(super) struct RotorGain;

/// Changes, as shares, and where the search starts.
const RANGE: (f64, f64) = (-0.6, 0.3);
const START: f64 = -0.2;
/// Instants at which it may set in, as shares of the flight.
const INSTANTS: [f64; 7] = [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8];

impl AirframeEffect for RotorGain {
    fn id(&self) -> &'static str {
        "rotor_gain"
    }

    fn about(&self) -> About {
        About {
            title: "One rotor is weaker",
            equation: "thrust and torque of one rotor *= 1 + thrust_change, from t0 on",
            source: "Beharie 2013, section 2.2.",
            depends_on: &["rpm"],
            signature: "constant angular acceleration about both level axes that the speeds do not explain, and one about z",
            look_alikes: &["mass_offset", "dead_rotor_speed"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        let rotor = found.parameter("rotor").map_or_else(|| "one rotor".to_owned(), |p| format!("rotor {:.0}", p.value));
        let with = |word: &str, v: &str| format!("gives {v} {word} thrust than it should");
        let since = match found.scope {
            Scope::Event => found.tell("t0", |v| format!(" from {v} on"), ""),
            _ => String::new(),
        };
        let other = "gives another thrust than it should";
        Clause::new(rotor, found.tell_signed("thrust_change", (100.0, "%"), ["more", "less"], with, other) + &since)
    }

    fn scope(&self, form: &Form) -> Scope {
        if form.shapes.len() > 1 { Scope::Event } else { Scope::Rig }
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        let record = &flight.record;
        if record.vehicle.rotors.is_empty() || record.rate.is_none() {
            return Vec::new();
        }
        let change = || Shape { name: "thrust_change", unit: "1", range: RANGE, closed: false };
        let (first, last) = (record.t.first().copied().unwrap_or(0.0), record.t.last().copied().unwrap_or(1.0));
        let at = |share: f64| first + share * (last - first);
        let onset = || Shape { name: "t0", unit: "s", range: (at(0.05), at(0.95)), closed: false };
        let rotors = 0..record.vehicle.rotors.len();
        let whole = rotors.clone().map(|index| Form {
            name: format!("rotor {}", index + 1),
            index,
            shapes: vec![change()],
            starts: vec![vec![START]],
            ..Form::default()
        });
        let event = rotors.map(|index| Form {
            name: format!("rotor {} from an instant on", index + 1),
            index,
            shapes: vec![change(), onset()],
            starts: INSTANTS.map(|i| vec![START, at(i)]).to_vec(),
            ..Form::default()
        });
        whole.chain(event).collect()
    }

    fn excludes(&self, form: &Form) -> Vec<(&'static str, String)> {
        let rotor = form.index + 1;
        vec![(self.id(), format!("rotor {rotor}")), (self.id(), format!("rotor {rotor} from an instant on"))]
    }

    fn alters(&self) -> bool {
        true
    }

    fn alter(&self, _: &Flight, form: &Form, shape: &[f64], scene: &mut Scene<'_>) {
        scene.gain[form.index] = [1.0 + shape[0], shape.get(1).copied().unwrap_or(f64::NEG_INFINITY)];
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        let rotor = (found.form.index + 1) as f64;
        let mut out = vec![
            Parameter { name: "rotor".into(), value: rotor, unit: "1".into(), ci95: [rotor, rotor] },
            found.plain("thrust_change", "1"),
        ];
        if found.form.shapes.len() > 1 {
            out.push(found.plain("t0", "s"));
        }
        out
    }
}
