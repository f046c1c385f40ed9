//! `beam_resonance`: the beam's first mode is excited where once-per-revolution or blade pass meets it.
//!
//! What it is: a bump of the mean, extra scatter of the mean, and a peak of thrust_rms_n around the resonant speed.
//! What can go wrong: a well decimated mean hides it; a sweep that steps over the resonance does not excite it.
//! Units: Hz, 1; bump, scatter and vibration amplitude in N.
//! Reference: rotating imbalance on a one-degree-of-freedom oscillator, Den Hartog 1956, section 2.11; Beharie 2013, section 5.7.1.

use crate::channel::{Context, Relation};
use crate::effects::design::TargetDesign;
use crate::effects::{
    About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, geometric, present,
};

/// See the module.
pub(crate) struct BeamResonance;

impl Effect for BeamResonance {
    fn id(&self) -> &'static str {
        "beam_resonance"
    }

    fn about(&self) -> About {
        About {
            title: "Resonance of the load-cell beam",
            equation: "thrust_n += bump * A with scatter * A, thrust_rms_n += vibration * A, A = r^2 / sqrt((1 - r^2)^2 + (2 damping_ratio r)^2) over its peak, r = f_excitation / natural_frequency",
            source: "Den Hartog 1956, section 2.11; Beharie 2013, section 5.7.1",
            depends_on: &["rpm"],
            signature: "scatter, rms and a small bump of the thrust around one speed, whenever that speed is visited",
            look_alikes: &["unknown"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new("the load cell's beam", found.tell("natural_frequency", |v| format!("resonates at {v}"), "resonates"))
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let channels = present(context, &["thrust_n", "thrust_rms_n"]);
        if channels.first() == Some(&"thrust_n") {
            // blade pass at twice the frequency has the very same curve
            vec![Instance::new(&channels, "once_per_rev")]
        } else {
            Vec::new()
        }
    }

    fn never_beside(&self) -> &'static [&'static str] {
        // a reading between two coarse steps toggles, as if it shook
        &["quantisation"]
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        let order = order(instance);
        let top = context.rpm.iter().copied().fold(1.0, f64::max) / 60.0 * order;
        // the scatter must be seen to fall again beyond the resonance: growth with speed alone is no resonance
        let (lo, hi) = (0.1 * top, 0.92 * top);
        let noise = context.target("thrust_n").map_or(1e-3, |i| context.targets[i].noise.rms);
        vec![
            Shape { name: "natural_frequency", unit: "Hz", range: (lo, hi), starts: geometric(lo, hi, 80) },
            Shape { name: "damping_ratio", unit: "1", range: DAMPING, starts: vec![0.012, 0.035] },
            // the mean moves only where the beam swings: a bump without scatter is something else
            Shape { name: "scatter", unit: "N", range: (0.3 * noise, 300.0 * noise), starts: vec![2.0 * noise] },
        ]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "bump", unit: "N" }, Amplitude { name: "vibration", unit: "N" }]
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let [frequency, damping, scatter] = shape else { return };
        let order = order(instance);
        let peak = 1.0 / (2.0 * damping * (1.0 - damping * damping).sqrt());
        let a: Vec<f64> = context
            .rpm
            .iter()
            .map(|rpm| {
                let r2 = (rpm / 60.0 * order / frequency).powi(2);
                r2 / ((1.0 - r2).powi(2) + 4.0 * damping * damping * r2).sqrt() / peak
            })
            .collect();
        if design.relation == Relation::ThrustRms {
            design.add(position, 1, a);
        } else {
            design.extra_variance = a.iter().map(|v| (scatter * v).powi(2)).collect();
            design.add(position, 0, a);
        }
    }

    fn scatters(&self) -> bool {
        true
    }

    fn plausible(&self, context: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        let value = |name: &str| fitted.iter().find(|e| e.name == name).map_or(0.0, |e| e.value);
        // the bump follows the motion (an amplifier that falls slower than it rises) and is smaller than it
        let seen = fitted.iter().any(|e| e.name == "vibration" && e.value > 5.0 * e.se);
        (seen || swings(context, value("natural_frequency"), value("damping_ratio"), order(instance)))
            // a peak sharper than any structure is a handful of rows, not a beam
            && value("damping_ratio") > 1.02 * DAMPING.0
            && value("vibration") > -1e-6
            && value("bump").abs() < 10.0 * value("scatter").max(value("vibration"))
    }
}

/// Damping ratios of beams with their clamping.
const DAMPING: (f64, f64) = (0.003, 0.08);

/// Variance of second differences near the resonance over that of the noise elsewhere that counts as a swing.
const SWING: f64 = 1.5;

/// Whether successive samples scatter more near the resonance than elsewhere: a beam swings within a sample; a mean that is
/// merely off there is something else.
fn swings(context: &Context, frequency: f64, damping: f64, order: f64) -> bool {
    let Some(target) = context.target("thrust_n").map(|k| &context.targets[k]) else { return false };
    let (mut near, mut far) = ((0.0, 0.0), (0.0, 0.0));
    for (rows, y) in target.rows.windows(3).zip(target.y.windows(3)) {
        let speeds = [context.rpm[rows[0]], context.rpm[rows[1]], context.rpm[rows[2]]];
        // a change of the load is no scatter
        if (speeds[2] - speeds[0]).abs() > 0.01 * speeds[1] || speeds[1] < crate::effects::rotor::blade_damage::STANDSTILL {
            continue;
        }
        let d = y[0] - 2.0 * y[1] + y[2];
        let ratio = d * d / 6.0 / target.noise.variance(speeds[1]);
        let off = (speeds[1] / 60.0 * order / frequency - 1.0).abs();
        let bin = if off < 2.0 * damping.max(0.01) { &mut near } else { &mut far };
        *bin = (bin.0 + ratio, bin.1 + 1.0);
    }
    near.1 >= 5.0 && near.0 / near.1 > SWING * (far.0 / f64::max(far.1, 1.0)).min(1.0)
}

fn order(instance: &Instance) -> f64 {
    if instance.form == "blade_pass" { 2.0 } else { 1.0 }
}
