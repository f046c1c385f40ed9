//! `supply_voltage`: speed and current follow the voltage that the supply gives.
//!
//! What it is: at one pulse an ESC gives a share of its supply to the motor, so the speed goes with the measured voltage; the same power
//! from a higher voltage is less current.
//! What can go wrong: on one run a voltage falls with the load, and nobody can tell it from what the load does: asked of several runs only.
//! Units: exponent 1; reference V.
//! Reference: brushless motor at a fixed duty, V = k omega + R I, I as the square of the speed: the exponent of the speed is one over one and the share
//! of R I in V. On 56 pairs of runs at 7 and 11 V it falls from 0.97 to 0.82 with the load (fivein-static-tables, MIT 2018, Cao and Strawson;
//! the test `the_powers_of_the_supply_s_voltage_are_those_of_the_pairs` computes it).

use crate::channel::Context;
use crate::effects::design::TargetDesign;
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, speeds};
use crate::numeric::order::median;

/// See the module.
pub(crate) struct SupplyVoltage;

/// Least spread of the runs' voltages, as a share, that can tell an exponent.
const LEAST_SPREAD: f64 = 0.005;
/// Exponents that a motor can have, of the speed, and of the current with its sign turned.
const EXPONENTS: (f64, f64) = (0.05, 2.0);
/// What is known of the exponent of the speed before any run: one over one and the share of the voltage that the winding takes, a fifth of it
/// at full speed and next to none of it at the lowest. Mean and standard deviation.
pub(crate) const OF_SPEED: (f64, f64) = (0.8, 0.1);
/// The same of the current at a speed: one for the same power, less where switching loses more at a higher voltage. On 56 pairs of runs at 7 and
/// 11 V (fivein-static-tables, MIT 2018, Cao and Strawson) it is 0.70, and from motor to motor 0.1 about that.
pub(crate) const OF_CURRENT: (f64, f64) = (0.7, 0.1);
/// By how much the current at a speed rises where the speed at a pulse falls with the voltage, both as shares.
pub(crate) const CURRENT_BY_SPEED: f64 = OF_CURRENT.0 / OF_SPEED.0;

/// What is known of an exponent.
fn known(instance: &Instance) -> (f64, f64) {
    if instance.form == CURRENT { OF_CURRENT } else { OF_SPEED }
}

impl Effect for SupplyVoltage {
    fn id(&self) -> &'static str {
        "supply_voltage"
    }

    fn about(&self) -> About {
        About {
            title: "Speed or current follows the supply's voltage",
            equation: "rpm *= (voltage_v / reference)^exponent; current_a *= (voltage_v / reference)^-exponent",
            source: "brushless motor at a fixed duty, V = k omega + R I",
            depends_on: &["voltage_v"],
            signature: "at another supply voltage the speed for the same pulse, and the current at the same speed, are others",
            look_alikes: &["supply_sag", "battery_discharge"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        let of_current = found.channels.iter().any(|c| c == "current_a");
        match of_current {
            true => Clause::new("the current at a speed", "falls as the supply's voltage rises"),
            false => Clause::new("the speed", "follows the supply's voltage"),
        }
    }

    fn is_of_every_rig(&self) -> bool {
        true
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Gain
    }

    fn instances(&self, _: &Context) -> Vec<Instance> {
        Vec::new()
    }

    fn among(&self, runs: &[&Context]) -> Vec<(Instance, Vec<f64>)> {
        let of_run = |c: &&Context| c.voltage.as_ref().map(|v| median(&mut v.clone()));
        let Some(mut voltages) = runs.iter().map(of_run).collect::<Option<Vec<f64>>>() else { return Vec::new() };
        let (lo, hi) = voltages.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), v| (a.min(*v), b.max(*v)));
        let Some(first) = runs.first().filter(|_| hi > (1.0 + LEAST_SPREAD) * lo && lo > 0.0) else { return Vec::new() };
        let reference = median(&mut voltages);
        let mut out = Vec::new();
        if first.pulse.is_some() && !speeds(first).is_empty() {
            out.push((Instance::new(&speeds(first), ""), vec![OF_SPEED.0, reference]));
        }
        if first.target("current_a").is_some() {
            out.push((Instance::new(&["current_a"], CURRENT), vec![OF_CURRENT.0, reference]));
        }
        out
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        shapes(context, known(instance))
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        Vec::new()
    }

    fn prior(&self, _: &Context, instance: &Instance, shape: &[f64]) -> f64 {
        log_prior(known(instance), shape)
    }

    /// The reference is taken, not sought.
    fn priced(&self, _: &Context, _: &Instance) -> usize {
        1
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], _: usize, design: &mut TargetDesign) {
        let [exponent, reference] = shape else { return };
        let exponent = if instance.form == CURRENT { -exponent } else { *exponent };
        scale(context, exponent, *reference, design);
    }

    /// The reference is no finding.
    fn report(&self, _: &Context, _: &Instance, fitted: Vec<Estimate>) -> Vec<Estimate> {
        fitted.into_iter().filter(|e| e.name != REFERENCE).collect()
    }

    fn plausible(&self, _: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        fitted.iter().any(|e| e.name == "exponent" && e.value > 0.0)
    }
}

/// Name of the voltage at which a curve stands.
pub(crate) const REFERENCE: &str = "reference";

/// An exponent of the voltage of which that much is known, and the reference.
pub(crate) fn shapes(context: &Context, known: (f64, f64)) -> Vec<Shape> {
    let usual = context.voltage.as_ref().map_or(1.0, |v| median(&mut v.clone()));
    vec![
        Shape { name: "exponent", unit: "1", range: EXPONENTS, starts: vec![known.0] },
        // known, not fitted: it stands in the model with the rest
        Shape { name: REFERENCE, unit: "V", range: (usual, usual), starts: vec![usual] },
    ]
}

/// What is known of the exponent before any run, nats.
pub(crate) fn log_prior((mean, sd): (f64, f64), shape: &[f64]) -> f64 {
    shape.first().map_or(0.0, |exponent| -0.5 * ((exponent - mean) / sd).powi(2))
}

/// Scales a design by a power of the measured voltage over the reference.
pub(crate) fn scale(context: &Context, power: f64, reference: f64, design: &mut TargetDesign) {
    let Some(voltage) = &context.voltage else { return };
    design.scale(&voltage.iter().map(|v| (v / reference).max(0.1).powf(power)).collect::<Vec<f64>>());
}

/// Form of the current.
const CURRENT: &str = "current";
