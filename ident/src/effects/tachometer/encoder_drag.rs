//! `encoder_drag`: the shaft encoder brakes the rotor while it is coupled.
//!
//! What it is: while rpm_encoder reads, the rotor carries an extra constant torque: more current, less speed at the same pulse,
//! and the torque arm sees the share that is not carried by the arm itself.
//! What can go wrong: an encoder that is coupled throughout shows only against the rotor at rest: drag needs rotation.
//! Units: N.m, 1; internally as `bearing_friction`.
//! Reference: Beharie 2013, section 5.7.1 (the four speed sensors compared); power balance as `bearing_friction`.

use crate::channel::{Context, Relation};
use crate::effects::design::TargetDesign;
use crate::effects::rotor::bearing_friction::{AMPLITUDES, CONSTANT, SEEN, TURNING, brakes, costs, drag, with_share};
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, load_channels};

/// See the module.
pub(crate) struct EncoderDrag;

impl Effect for EncoderDrag {
    fn id(&self) -> &'static str {
        "encoder_drag"
    }

    fn about(&self) -> About {
        About {
            title: "The shaft encoder brakes the rotor",
            equation: "while rpm_encoder reads: Q_f = constant + viscous omega; current_a += Q_f (omega + 2 rho Q) / V, torque_nm += share Q_f, rpm(pulse) falls",
            source: "Beharie 2013, section 5.7.1; Drela 2007, First-Order DC Electric Motor Model",
            depends_on: &["rpm_encoder", "rpm"],
            signature: "exactly while the encoder is coupled: more current and less speed at the same pulse; thrust(rpm) holds",
            look_alikes: &["bearing_friction"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new("the encoder", found.tell("constant", |v| format!("brakes the rotor with {v}"), "brakes the rotor"))
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let mut channels = load_channels(context, false);
        // the encoder's own channel has no sample with the encoder off: nothing changes on it, but against a model that knows it without
        channels.retain(|c| context.against_model || *c != "rpm_encoder");
        if context.rpm.is_empty() {
            return Vec::new();
        }
        let share = share_coupled(context);
        if share > THROUGHOUT {
            // the static curves of speed and current have the drag in them; the torque arm alone knows what no torque is
            channels.retain(|c| *c == "torque_nm");
        }
        if channels.is_empty() || share < 0.05 {
            Vec::new()
        } else if share > THROUGHOUT {
            vec![Instance::new(&channels, CONSTANT)]
        } else {
            vec![Instance::new(&channels, CONSTANT), Instance::new(&channels, "constant_and_viscous")]
        }
    }

    /// An encoder that is never uncoupled: any friction that was always there looks like it.
    fn suspects(&self, context: &Context) -> Vec<Instance> {
        if context.rpm.is_empty() || share_coupled(context) <= THROUGHOUT {
            return Vec::new();
        }
        vec![Instance::new(&load_channels(context, false), ALWAYS)]
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        if instance.form != ALWAYS {
            return Vec::new();
        }
        let top = context.rpm.iter().copied().fold(1.0, f64::max);
        let starts = [0.03, 0.1, 0.3].map(|k| k * top).to_vec();
        vec![Shape { name: "half_speed", unit: "rev/min", range: (0.002 * top, 2.0 * top), starts }]
    }

    fn amplitudes(&self, instance: &Instance) -> Vec<Amplitude> {
        if instance.form == ALWAYS {
            return vec![AMPLITUDES[1], AMPLITUDES[2], Amplitude { name: "start_current", unit: "A" }];
        }
        if instance.form == CONSTANT { AMPLITUDES[..3].to_vec() } else { AMPLITUDES.to_vec() }
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        if let [half] = shape {
            always(context, *half, position, design);
            return;
        }
        drag(context, &coupled(context), instance.form != CONSTANT, position, design);
    }

    fn report(&self, context: &Context, _: &Instance, fitted: Vec<Estimate>) -> Vec<Estimate> {
        with_share(context, fitted)
    }

    fn plausible(&self, context: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        if instance.form == ALWAYS {
            // what the speed loses is a curve beside another, and stands for what that lacks
            let loads = || fitted.iter().filter(|e| ["arm_constant", "start_current"].contains(&e.name.as_str()));
            return loads().all(|e| e.value > -2.0 * e.se) && loads().any(|e| e.value > SEEN * e.se);
        }
        if instance.channels.iter().all(|c| c == "torque_nm") && share_coupled(context) > THROUGHOUT {
            return fitted.iter().any(|e| e.name == "arm_constant" && e.value > 8.0 * e.se);
        }
        brakes(fitted) && costs(context, fitted)
    }
}

/// Form of a brake that is never released: the static curves hold it, but for what it does where the rotor starts to turn.
const ALWAYS: &str = "always";

/// Adds the columns of a brake that is never released: a torque and a current that are there as soon as the rotor turns, and a loss of speed
/// that is largest at the start, and half of that at a speed `half`.
fn always(context: &Context, half: f64, position: usize, design: &mut TargetDesign) {
    let turning = TURNING * context.rpm.iter().copied().fold(0.0, f64::max);
    let column = |of: &dyn Fn(f64) -> f64| context.rpm.iter().map(|n| if *n > turning { of(*n) } else { 0.0 }).collect();
    match design.relation {
        Relation::Torque => design.add(position, 0, column(&|_| 1.0)),
        Relation::SpeedFromPulse => design.add(position, 1, column(&|n| -1.0 / (1.0 + n / half))),
        Relation::Current => design.add(position, 2, column(&|_| 1.0)),
        _ => {}
    }
}

/// Share of the rows from which on the encoder counts as never uncoupled.
const THROUGHOUT: f64 = 0.95;

fn share_coupled(context: &Context) -> f64 {
    coupled(context).iter().sum::<f64>() / context.len().max(1) as f64
}

/// Longest gap between two samples, s, over which the encoder counts as coupled.
const GAP: f64 = 2.0;

/// 1 while the encoder reads, 0 while it does not; gaps shorter than [`GAP`] are lost samples.
fn coupled(context: &Context) -> Vec<f64> {
    let mut out = vec![0.0; context.len()];
    let Some(target) = context.target("rpm_encoder").map(|k| &context.targets[k]) else { return out };
    let mut last: Option<usize> = None;
    for (i, y) in target.rows.iter().zip(&target.y) {
        // a decoupled shaft that stands still while the rotor turns
        if *y < 0.05 * context.rpm[*i] {
            continue;
        }
        let from = last.filter(|l| context.t[*i] - context.t[*l] < GAP).map_or(*i, |l| l + 1);
        out[from..=*i].fill(1.0);
        last = Some(*i);
    }
    out
}
