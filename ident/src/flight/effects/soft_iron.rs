//! `soft_iron`: iron that bends the field.
//!
//! What it is: what the magnetometer reads is a matrix times the field; here the part that its own readings are multiplied by.
//! What can go wrong: without turning about all axes it is one with the earth's field.
//! Units: share.
//! Reference: Gebre-Egziabher et al., Journal of Aerospace Engineering 19(2), 2006.

use super::{About, AirframeEffect, Clause, EffectEntry, Form, Found, Scope, Sink, single};
use crate::attribution::columns::Prior;
use crate::flight::channels::Target;
use crate::flight::columns::Flight;
use crate::verdict::Parameter;

pub(super) struct SoftIron;

/// Usual size, as a share of the field.
const USUAL: f64 = 0.1;
/// Name of each entry of the symmetric matrix without trace, and where it stands.
const ENTRIES: [(&str, [usize; 2], f64); 5] =
    [("m_xy", [0, 1], 0.0), ("m_xz", [0, 2], 0.0), ("m_yz", [1, 2], 0.0), ("m_xx", [0, 0], 1.0), ("m_yy", [1, 1], 1.0)];

impl AirframeEffect for SoftIron {
    fn id(&self) -> &'static str {
        "soft_iron"
    }

    fn about(&self) -> About {
        About {
            title: "Iron bends the field",
            equation: "m += M m, M symmetric and without trace",
            source: "Gebre-Egziabher et al. 2006.",
            depends_on: &["attitude"],
            signature: "the strength of the field goes with the attitude",
            look_alikes: &["hard_iron"],
        }
    }

    fn said(&self, _: &EffectEntry) -> Clause {
        Clause::new("iron on board", "bends the field")
    }

    fn scope(&self, _: &Form) -> Scope {
        Scope::Rig
    }

    fn forms(&self, flight: &Flight) -> Vec<Form> {
        single(flight.channels.position(Target::Field(0)).is_some())
    }

    fn columns(&self, _: &Form, _: &[f64], sink: &mut Sink<'_>) {
        let Some(field) = &sink.flight.record.field else { return };
        for (name, [i, j], trace) in ENTRIES {
            sink.column(name, Prior::about_zero(USUAL)).part(Target::Field(i), &field[j]);
            if i != j {
                sink.part(Target::Field(j), &field[i]);
            }
            if trace != 0.0 {
                let less: Vec<f64> = field[2].iter().map(|v| -v).collect();
                sink.part(Target::Field(2), &less);
            }
        }
    }

    fn report(&self, found: &Found<'_>) -> Vec<Parameter> {
        ENTRIES.iter().map(|(n, ..)| found.plain(n, "1")).collect()
    }
}
