//! `gain_change`: the load cell's gain changes during the run.
//!
//! What it is: thrust_n *= 1 + gain_change for t >= t0 (step), or *= 1 + rate * t (drift).
//! What can go wrong: the tare is not scaled apart from the force: at small loads it looks like nothing.
//! Units: 1, 1/s, s.
//! Reference: Beharie 2013, Eq. 5.34-5.35 (two calibrations differ by 9.7 % in slope).

use crate::channel::Context;
use crate::effects::design::TargetDesign;
use crate::effects::load_cell::tare_shift::{BEFORE, coarse_onset, step, with_first_instant};
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, present};

/// See the module.
pub(crate) struct GainChange;

impl Effect for GainChange {
    fn id(&self) -> &'static str {
        "gain_change"
    }

    fn about(&self) -> About {
        About {
            title: "Gain of the load cell changes",
            equation: "thrust_n *= 1 + gain_change for t >= t0, or thrust_n *= 1 + rate * t",
            source: "Beharie 2013, Eq. 5.34-5.35",
            depends_on: &["t_s", "thrust_n"],
            signature: "the thrust residual grows with the thrust, after an instant or with time; torque(rpm) holds",
            look_alikes: &["blade_damage", "air_density", "creep"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        let at = found.tell("t0", |t| format!(" at {t}"), "");
        let at = if found.is_since_before() { " before the run" } else { at.as_str() };
        let with = |word: &str, v: &str| format!("{word} by {v}{at}");
        let step = found.tell_signed("gain_change", (100.0, "%"), ["rises", "falls"], with, &format!("changes{at}"));
        Clause::new("the load cell's gain", found.tell("rate", |_| "drifts with time".to_owned(), &step))
    }

    fn scope(&self, instance: &Instance) -> Scope {
        match instance.form.as_str() {
            "drift" => Scope::Run,
            BEFORE => Scope::Rig,
            _ => Scope::Event,
        }
    }

    fn leaves_behind(&self, instance: &Instance) -> bool {
        self.scope(instance) == Scope::Event
    }

    fn stage(&self) -> Stage {
        Stage::Gain
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        if context.time_is_row || present(context, &["thrust_n"]).is_empty() {
            Vec::new()
        } else {
            let forms = ["step", "drift", BEFORE];
            let known = if context.against_model { 3 } else { 2 };
            forms.iter().take(known).map(|form| Instance::new(&["thrust_n"], form)).collect()
        }
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        if instance.form == "drift" {
            let most = 0.5 / context.duration().max(1.0);
            vec![Shape {
                name: "rate",
                unit: "1/s",
                range: (-most, most),
                starts: [-0.3, -0.1, -0.03, -0.01, -0.003, 0.003, 0.01, 0.03, 0.1, 0.3].map(|k| k * most).to_vec(),
            }]
        } else {
            // against a model the wrong size of two finds another instant
            let sizes: &[f64] = if context.against_model {
                &[0.3, 0.17, 0.1, 0.055, 0.03, 0.017, 0.01, 0.0055, 0.003]
            } else {
                &[0.3, 0.1, 0.03, 0.01, 0.003]
            };
            let starts = sizes.iter().map(|s| -s).chain(sizes.iter().rev().copied()).collect();
            let change = Shape { name: "gain_change", unit: "1", range: (-0.5, 0.5), starts };
            if instance.form == BEFORE { vec![change] } else { vec![change, coarse_onset(context)] }
        }
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        Vec::new()
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], _: usize, design: &mut TargetDesign) {
        let factor: Vec<f64> = match (instance.form.as_str(), shape) {
            ("drift", [rate]) => {
                let t0 = context.t.first().copied().unwrap_or(0.0);
                context.t.iter().map(|t| 1.0 + rate * (t - t0)).collect()
            }
            (BEFORE, [change]) => vec![1.0 + change; context.len()],
            (_, [change, t0]) => step(context, *t0).iter().map(|s| 1.0 + change * s).collect(),
            _ => return,
        };
        design.scale(&factor);
    }

    fn report(&self, context: &Context, instance: &Instance, fitted: Vec<Estimate>) -> Vec<Estimate> {
        with_first_instant(context, instance, fitted)
    }
}
