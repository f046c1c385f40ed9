//! `battery_polarisation`: the battery gives way a little later than its current asks, and recovers as slowly.
//!
//! What it is: beside the resistance that answers at once a battery has one that answers through a first-order lag: ions that have to move. After
//! a load the voltage climbs back within seconds, and the speed at a pulse and the current at a speed follow it.
//! What can go wrong: a slow voltmeter beside a sag without a resistance that answers at once looks alike; the charge drawn does where the lag is
//! longer than the run.
//! Units: ohm, s.
//! Reference: Chen & Rincon-Mora 2006, IEEE Trans. Energy Conversion 21:504, the resistor-capacitor pair behind the series resistance.

use super::operator::{self, Course};
use super::supply_voltage::CURRENT_BY_SPEED;
use super::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, geometric, present, speeds};
use crate::context::{Context, Relation};
use crate::design::TargetDesign;

/// See the module.
pub(crate) struct BatteryPolarisation;

/// Shortest time constant, s, of a battery that is told from a resistance: what is faster (the double layer) is over before a meter has read it.
const SHORTEST: f64 = 0.5;

impl Effect for BatteryPolarisation {
    fn id(&self) -> &'static str {
        "battery_polarisation"
    }

    fn about(&self) -> About {
        About {
            title: "Battery recovers slowly from a load",
            equation: "voltage_v = V0 - resistance * i, rpm(pulse) *= 1 - speed_loss * i, current_a *= 1 + 0.875 speed_loss * i, tau d(i)/dt = current_a - i",
            source: "resistor-capacitor pair of a battery, Chen & Rincon-Mora 2006",
            depends_on: &["current_a", "t_s"],
            signature: "voltage goes on falling for seconds after a load has come, and climbs back for seconds after it has gone",
            look_alikes: &["battery_discharge", "supply_sag", "channel_filter"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        let slowly = found.tell("tau", |v| format!("gives way and recovers with a lag of {v}"), "recovers slowly from a load");
        Clause::new("the battery", slowly)
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Gain
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let measured = context.current.is_some() && !present(context, &["voltage_v"]).is_empty();
        if context.time_is_row || context.is_table() || !measured {
            return Vec::new();
        }
        let all: Vec<&str> = ["voltage_v", "current_a"].into_iter().chain(speeds(context)).collect();
        // where something else is slow on speed or current, the voltage alone still tells of the battery
        [all.as_slice(), &all[..1]].map(|set| Instance::new(set, "")).to_vec()
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        // a lag longer than a third of the run is a charge
        let (lo, hi) = (SHORTEST.max(2.0 * context.step()), context.duration() / 3.0);
        let tau = Shape { name: "tau", unit: "s", range: (lo, hi.max(2.0 * lo)), starts: geometric(1.2 * lo, 0.8 * hi, 8) };
        if instance.channels.len() < 2 {
            return vec![tau];
        }
        let most = context.current.iter().flatten().copied().fold(1e-3, f64::max);
        let starts = [0.002, 0.01, 0.05].map(|k| k / most).to_vec();
        vec![tau, Shape { name: "speed_loss", unit: "1/A", range: (-0.02 / most, 0.5 / most), starts }]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "resistance", unit: "ohm" }]
    }

    fn apply(&self, context: &Context, _: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let ([tau, loss @ ..], Some(current)) = (shape, &context.current) else { return };
        let late = operator::Lag::new(&context.t, *tau, Course::Line).of(&[current.as_slice()]).concat();
        if design.relation == Relation::Voltage {
            design.add(position, 0, late.into_iter().map(|i| -i).collect());
            return;
        }
        let follows = match design.relation {
            Relation::Current => CURRENT_BY_SPEED,
            _ => -1.0,
        };
        let factor = follows * loss.first().copied().unwrap_or(0.0);
        design.map_columns(|column| column.iter().zip(&late).map(|(v, i)| v * (1.0 + factor * i)).collect());
    }

    fn plausible(&self, _: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        // a search that ends at its shortest has found a lag of the meters
        fitted.iter().all(|e| match &*e.name {
            "resistance" => e.value > 2.0 * e.se,
            "tau" => e.value > 1.5 * SHORTEST,
            _ => true,
        })
    }
}
