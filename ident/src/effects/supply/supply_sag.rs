//! `supply_sag`: the supply gives way under load.
//!
//! What it is: voltage_v -= resistance * current_a: leads, connectors, the source itself.
//! What can go wrong: without a measured voltage it cannot be told from a lower KV, and is a suspect only; without a measured
//! current the resistance is as uncertain as the efficiency that the current is estimated with. Where no torque was measured either, a
//! propeller's current goes with the cube of its speed, and how many amperes it is stays unknown: the sag is told by the speed.
//! The same power from a lower voltage is more current: form `same_power`, for a current that bends away from its cubic. Its reference is the
//! median voltage of the run, and only says at which voltage the cubic stands. A run without a voltage is taken to have that one.
//! Units: ohm; V for each (1000 rev/min)^3; exponent 1; reference V.
//! Reference: Ohm's law; errata to Beharie 2013, Eq. 5.11 (rpm = KV (V - I R)).

use crate::channel::{Context, Relation};
use crate::effects::design::TargetDesign;
use crate::effects::supply::supply_voltage;
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, present};
use crate::numeric::order::median;

/// See the module.
pub(crate) struct SupplySag;

/// Form of a sag that no voltage shows.
const UNSEEN: &str = "unseen";
/// Form of a sag whose current nobody measured, nor a torque from which it follows.
const BY_SPEED: &str = "by_speed";
/// Form of a sag that the current at a speed shows, too.
const SAME_POWER: &str = "same_power";

impl Effect for SupplySag {
    fn id(&self) -> &'static str {
        "supply_sag"
    }

    fn about(&self) -> About {
        About {
            title: "Supply voltage sags with the current",
            equation: "voltage_v = V0 - resistance * current_a; at the same power also current_a *= (voltage_v / reference)^-exponent; against a declared model also rpm *= 1 - speed_loss * current_a, current_a += current_rise * current_a rpm^3, or voltage_v = V0 - sag * rpm^3 (no current measured)",
            source: "Ohm's law; Beharie 2013, Eq. 5.11 as corrected",
            depends_on: &["current_a"],
            signature: "the voltage residual mirrors the current; thrust(rpm) and torque(rpm) hold",
            look_alikes: &["battery_discharge"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            "the supply lead",
            if found.parameters.iter().any(|p| p.name == "sag") {
                found.tell("sag", |v| format!("sags with the load (by {v} times the cube of the speed)"), "sags with the load")
            } else {
                found.tell_in("resistance", "V", |v| format!("drops {v} per ampere"), "sags with the current")
            },
        )
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Gain
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        if present(context, &["voltage_v"]).is_empty() {
            Vec::new()
        } else if context.draw().is_none() {
            if context.rpm.is_empty() { Vec::new() } else { vec![Instance::new(&["voltage_v"], BY_SPEED)] }
        } else {
            let mut channels = vec!["voltage_v"];
            // against a declared model the speed that the sag takes is news; without one the static curve holds it
            if context.against_model {
                channels.extend(present(context, &["current_a"]));
                channels.extend(crate::effects::speeds(context));
            }
            let both = present(context, &["voltage_v", "current_a"]);
            let of_power = (!context.against_model && both.len() == 2).then(|| Instance::new(&both, SAME_POWER));
            std::iter::once(Instance::new(&channels, "")).chain(of_power).collect()
        }
    }

    /// Without a measured voltage the speed that it takes is left, which a motor that gives way under load takes too.
    fn suspects(&self, context: &Context) -> Vec<Instance> {
        let speeds = crate::effects::speeds(context);
        let unseen = context.draw().is_some() && present(context, &["voltage_v"]).is_empty() && !speeds.is_empty();
        if unseen { vec![Instance::new(&speeds, UNSEEN)] } else { Vec::new() }
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        if instance.form == SAME_POWER {
            return supply_voltage::shapes(context, supply_voltage::OF_CURRENT);
        }
        if instance.touches("voltage_v") && instance.channels.len() < 2 {
            return Vec::new();
        }
        let most = context.draw().map_or(1.0, |(current, _)| current.iter().copied().fold(1e-3, f64::max));
        let starts = [0.0, 0.003, 0.01, 0.03, 0.1].map(|k| k / most).to_vec();
        vec![Shape { name: "speed_loss", unit: "1/A", range: (-0.02 / most, 0.5 / most), starts }]
    }

    fn amplitudes(&self, instance: &Instance) -> Vec<Amplitude> {
        if instance.form == UNSEEN {
            return Vec::new();
        }
        if instance.form == BY_SPEED {
            return vec![Amplitude { name: "sag", unit: "V/krpm3" }];
        }
        let mut out = vec![Amplitude { name: "resistance", unit: "ohm" }];
        if instance.touches("current_a") && instance.form != SAME_POWER {
            out.push(Amplitude { name: "current_rise", unit: "1/krpm3" });
        }
        out
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        if instance.form == BY_SPEED {
            if design.relation == Relation::Voltage {
                design.add(position, 0, context.rpm.iter().map(|r| -(r / 1000.0).powi(3)).collect());
            }
            return;
        }
        if instance.form == SAME_POWER && design.relation == Relation::Current {
            if let [exponent, reference] = shape {
                supply_voltage::scale(context, -exponent, *reference, design);
            }
            return;
        }
        let Some((current, _)) = context.draw() else { return };
        if design.relation == Relation::Current {
            // the same power from a lower voltage
            let rise = current.iter().zip(&context.rpm).map(|(i, r)| i * (r / 1000.0).powi(3));
            design.add(position, 1, rise.collect());
            return;
        }
        if design.relation != Relation::Voltage {
            let loss = shape.first().copied().unwrap_or(0.0);
            design.map_columns(|column| column.iter().zip(current.iter()).map(|(v, i)| v * (1.0 - loss * i)).collect());
            return;
        }
        design.add(position, 0, current.iter().map(|i| -i).collect());
    }

    fn follows_supply(&self, instance: &Instance, channel: &str) -> bool {
        instance.form == SAME_POWER && channel != "voltage_v" && instance.touches(channel)
    }

    /// Between runs the current follows the voltage by `supply_voltage`, about one reference for all.
    fn is_of_one_run(&self, instance: &Instance) -> bool {
        instance.form == SAME_POWER
    }

    /// What follows a voltage that is measured goes as far as that does.
    fn runs_on(&self, instance: &Instance) -> [bool; 2] {
        [instance.form != SAME_POWER; 2]
    }

    fn prior(&self, _: &Context, instance: &Instance, shape: &[f64]) -> f64 {
        if instance.form == SAME_POWER { supply_voltage::log_prior(supply_voltage::OF_CURRENT, shape) } else { 0.0 }
    }

    /// The reference is taken, not sought.
    fn priced(&self, context: &Context, instance: &Instance) -> usize {
        self.shapes(context, instance).len() - usize::from(instance.form == SAME_POWER)
    }

    /// A current that was only estimated is known to a seventh. The reference is no finding.
    fn report(&self, context: &Context, _: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        if context.draw().is_some_and(|(_, measured)| !measured) {
            for e in &mut fitted {
                e.se = e.se.hypot(e.value / 7.0);
            }
        }
        fitted.retain(|e| e.name != supply_voltage::REFERENCE);
        fitted
    }

    fn plausible(&self, context: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        if [UNSEEN, BY_SPEED].contains(&instance.form.as_str()) {
            return fitted.iter().all(|e| e.value > 0.0);
        }
        let of = |name: &str| fitted.iter().find(|e| e.name == name);
        let Some(resistance) = of("resistance") else { return true };
        // the speed falls with the voltage, and with nothing else
        let voltage = context.voltage.clone().map_or(f64::NAN, |mut v| median(&mut v));
        let follows = |loss: &Estimate| SPEED_PER_VOLTAGE.contains(&(loss.value * voltage / resistance.value));
        let sag = resistance.value > 0.0 && resistance.value < 5.0;
        sag && (!context.against_model || resistance.value > 3.0 * resistance.se && of("speed_loss").is_none_or(follows))
    }
}

/// Relative loss of speed over that of voltage: V = k omega + R I with I as omega^2 gives 1 / (1 + R I / V), two thirds to one; with room for a
/// static form, and for a voltage that is measured before half of the leads.
const SPEED_PER_VOLTAGE: std::ops::Range<f64> = 0.25..2.0;
