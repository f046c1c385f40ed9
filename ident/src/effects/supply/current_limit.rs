//! `current_limit`: the speed controller or the supply caps the current.
//!
//! What it is: above the pulse at which `limit` is reached, more throttle brings no more speed; current(rpm) holds. Against a declared model also
//! a limit that is reached only while the rotor speeds up (`current_limit/spin_up.rs`).
//! What can go wrong: a throttle end point below the longest pulse looks alike; the flat current tells.
//! Units: A; internally us.
//! Reference: constant-current limit of bench supplies and of speed controllers' firmware.

use crate::channel::Context;
use crate::channel::Draw;
use crate::effects::design::{Label, TargetDesign};
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, speeds};
use crate::verdict::OF_THE_SUPPLY;
use std::sync::Arc;

mod spin_up;

use spin_up::SPIN_UP;

/// See the module.
pub(crate) struct CurrentLimit;

impl Effect for CurrentLimit {
    fn id(&self) -> &'static str {
        "current_limit"
    }

    fn about(&self) -> About {
        About {
            title: "Current is limited",
            equation: "rpm(pulse) = rpm(min(pulse, reached_at)), current_a <= limit; against a declared model also d(rpm^2)/dt <= gain (limit - draw(rpm)) efficiency(rpm)",
            source: "constant-current limit of supplies and speed controllers",
            depends_on: &["pulse_us", "current_a"],
            signature: "above one pulse speed and current stand still; thrust, torque and current go on following the speed",
            look_alikes: &["thermal_derate", "throttle_quantisation"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        if found.equation.contains(OF_THE_SUPPLY) {
            let holds = found.tell("limit", |v| format!("holds the current to {v}"), "holds the current");
            return Clause::new("the supply", format!("{holds}, and its voltage gives way"));
        }
        Clause::new("the current", found.tell("limit", |v| format!("is held to {v}"), "is limited"))
    }

    fn scope(&self, instance: &Instance) -> Scope {
        // how a bench supply is set is a matter of the day
        if instance.form == OF_THE_SUPPLY { Scope::Run } else { Scope::Rig }
    }

    fn stage(&self) -> Stage {
        Stage::Input
    }

    fn stage_of(&self, instance: &Instance) -> Stage {
        // how fast the rotor is known to be without a limit holds its lag
        if instance.form == SPIN_UP { Stage::Output } else { self.stage() }
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let channels = speeds(context);
        if channels.is_empty() {
            return Vec::new();
        }
        let mut out = vec![Instance::new(&channels, "")];
        if context.against_model && draw(context).is_some() {
            out.push(Instance::new(&channels, SPIN_UP));
        }
        out
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        if instance.form == SPIN_UP {
            return spin_up::shapes(draw(context));
        }
        let top = context.pulse.as_ref().map_or(2000.0, |p| p.iter().copied().fold(1000.0, f64::max));
        let (from, to) = (context.start_pulse_us, top);
        let at = |u: f64| from + u * (to - from);
        vec![Shape {
            name: "reached_at",
            unit: "us",
            range: (at(0.1), at(0.998)),
            // evenly, and once as close beneath the highest level as a limit can be told
            starts: (0..22).map(|k| at(0.3 + 0.0328 * f64::from(k))).chain([top - 1.25 * BEYOND_US]).collect(),
        }]
    }

    fn amplitudes(&self, instance: &Instance) -> Vec<Amplitude> {
        if instance.form == SPIN_UP { vec![Amplitude { name: DEPTH.0, unit: "1" }] } else { Vec::new() }
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        if instance.form == SPIN_UP {
            while_it_speeds_up(context, shape, position, design);
            return;
        }
        let ([reached], Some(pulse)) = (shape, &context.pulse) else { return };
        crate::effects::load_cell::amplifier_saturation::hold_above(&mut design.fixed, pulse, *reached);
        for column in &mut design.columns {
            if let Label::Base(power) = column.label {
                let at = ((reached - 1000.0) / 1000.0).powi(power as i32);
                Arc::make_mut(&mut column.values).iter_mut().zip(pulse).filter(|(_, p)| *p > reached).for_each(|(v, _)| *v = at);
            }
        }
    }

    fn report(&self, context: &Context, instance: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        if instance.form == SPIN_UP {
            return fitted;
        }
        let (Some(reached), Some(pulse)) = (fitted.iter().find(|e| e.name == "reached_at").map(|e| e.value), &context.pulse)
        else {
            return fitted;
        };
        let Some(target) = context.target("current_a").map(|k| &context.targets[k]) else { return fitted };
        // a little after each arrival, so that spin-up is over
        let settled = |i: usize| i >= 10 && pulse[i - 10..=i].iter().all(|p| *p > reached + 5.0);
        let above: Vec<f64> = target.rows.iter().zip(&target.y).filter(|(i, _)| settled(**i)).map(|(_, y)| *y).collect();
        let n = above.len() as f64;
        let limit = above.iter().sum::<f64>() / n;
        let se = above.iter().map(|v| (v - limit).powi(2)).sum::<f64>().sqrt() / n;
        if limit.is_finite() {
            fitted.insert(0, Estimate { name: "limit".into(), unit: "A".into(), value: limit, se });
        }
        fitted
    }

    fn plausible(&self, context: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        if instance.form == SPIN_UP {
            return fitted.iter().filter(|e| e.name == DEPTH.0).all(|e| DEPTH.1.contains(&e.value));
        }
        // the run must go well beyond, and the current must stand as still there as it does in steady stretches
        let reached = fitted.iter().find(|e| e.name == "reached_at").map_or(f64::INFINITY, |e| e.value);
        let top = context.pulse.as_ref().map_or(0.0, |p| p.iter().copied().fold(0.0, f64::max));
        top > reached + BEYOND_US
    }
}

/// How far the highest command must go beyond the limit, us: less does not tell it from the noise of the last level.
const BEYOND_US: f64 = 4.0;
/// The speed's departure over what a limit that is reached while the rotor speeds up makes of it, and where it may lie.
const DEPTH: (&str, std::ops::Range<f64>) = ("depth", 0.7..1.3);

/// The draw of the run, and its highest speed.
fn draw(context: &Context) -> Option<&(Draw, f64)> {
    context.facts.draw.get_or_init(|| Draw::of(context)).as_ref()
}

/// Adds what a limit makes of a rotor that speeds up.
fn while_it_speeds_up(context: &Context, shape: &[f64], position: usize, design: &mut TargetDesign) {
    let (Some(limit), Some(known)) = (spin_up::Limit::of_shape(shape), design.known()) else { return };
    let held = limit.of(&context.t, &known);
    design.add(position, 0, held.iter().zip(&known).map(|(held, known)| held - known).collect());
}
