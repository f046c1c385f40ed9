//! `tare_shift`: the load cell's zero jumps once.
//!
//! What it is: thrust_n += offset for t >= t0: a cable touched, a clamp slipped. Against a declared model also an offset of thrust or torque that is
//! older than the run: the cell was tared anew.
//! What can go wrong: a jump at a level change looks like a wrong polynomial.
//! Units: N, s.
//! Reference: step change with unknown instant, Basseville & Nikiforov 1993, section 2.2.

use crate::channel::{Context, STANDSTILL};
use crate::effects::design::TargetDesign;
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, thrust_over_time};

/// See the module.
pub(crate) struct TareShift;

impl Effect for TareShift {
    fn id(&self) -> &'static str {
        "tare_shift"
    }

    fn about(&self) -> About {
        About {
            title: "Step of the load cell's zero",
            equation: "thrust_n (against a declared model also torque_nm) += offset for t >= t0",
            source: "Basseville & Nikiforov 1993, section 2.2",
            depends_on: &["t_s"],
            signature: "the residual is one constant, from one instant on or throughout",
            look_alikes: &["zero_drift", "gain_change"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        let zero = format!("the zero of {}", found.meter());
        let own = (1.0, found.unit());
        if found.is_since_before() {
            let with = |word: &str, v: &str| format!("lies {v} {word} where it was");
            return Clause::new(zero, found.tell_signed("offset", own, ["above", "below"], with, "is another one"));
        }
        let at = found.tell("t0", |t| format!(" at {t}"), "");
        let with = |word: &str, v: &str| format!("jumps {word} by {v}{at}");
        Clause::new(zero, found.tell_signed("offset", own, ["up", "down"], with, &format!("jumps{at}")))
    }

    fn is_of_every_run(&self, context: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        let least = instance.channels.first().and_then(|c| context.targets.get(context.target(c)?)).map_or(0.0, |t| t.noise.rms);
        instance.form == BEFORE && fitted.iter().any(|e| e.name == "offset" && e.value.abs() < least)
    }

    fn scope(&self, instance: &Instance) -> Scope {
        if instance.form == BEFORE { Scope::Run } else { Scope::Event }
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let mut out = thrust_over_time(context);
        let thrust = !context.time_is_row && context.target("thrust_n").is_some();
        if context.against_model && thrust {
            out.push(Instance::new(&["thrust_n"], BEFORE));
        }
        if context.against_model && context.target("torque_nm").is_some() {
            out.push(Instance::new(&["torque_nm"], BEFORE));
        }
        out
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        if instance.form == BEFORE { Vec::new() } else { vec![onset(context)] }
    }

    fn amplitudes(&self, instance: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "offset", unit: if instance.touches("torque_nm") { "N.m" } else { "N" } }]
    }

    fn seen(&self, _: &Context, instance: &Instance) -> f64 {
        if instance.form == BEFORE { TARED_ANEW } else { 0.0 }
    }

    fn apply(&self, context: &Context, _: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let offset = match shape {
            [] => vec![1.0; context.len()],
            [t0, ..] => step(context, *t0),
        };
        design.add(position, 0, offset);
    }

    /// A zero that jumps when the rotor first turns, and never is seen again, is the curve's own way to rest.
    fn plausible(&self, context: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        instance.form == BEFORE || !fitted.iter().any(|e| e.name == "t0" && sets_in_at_the_start(context, e.value))
    }

    fn report(&self, context: &Context, instance: &Instance, fitted: Vec<Estimate>) -> Vec<Estimate> {
        with_first_instant(context, instance, fitted)
    }
}

/// Evidence, nats, that a load cell's zero is another one than on the day of the model: it is tared anew before every run, so that no
/// other name is as likely before anything is seen. As much as a name must bring, but for one.
const TARED_ANEW: f64 = 6.0;

/// Form of an effect that was there before the run began: only a declared model can tell.
pub(crate) const BEFORE: &str = "since before the run";

/// The estimates of an effect that was there before the run, and the run's first instant as the latest at which it set in.
pub(crate) fn with_first_instant(context: &Context, instance: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
    if instance.form == BEFORE {
        let value = context.t.first().copied().unwrap_or(0.0);
        fitted.push(Estimate { name: "t0".into(), value, unit: "s".into(), se: context.step() });
    }
    fitted
}

/// Whether the rotor stands on all rows up to an instant, a second of its way apart, and on none after it.
fn sets_in_at_the_start(context: &Context, t0: f64) -> bool {
    let stands = |i: &usize| context.rpm[*i] < STANDSTILL;
    let rows = || 0..context.rpm.len();
    let on_its_way = |i: &usize| (context.t[*i] - t0).abs() < ON_ITS_WAY;
    let away = || rows().filter(|i| !on_its_way(i));
    let before = away().filter(|i| context.t[*i] < t0).all(|i| stands(&i));
    before && !context.rpm.is_empty() && rows().any(|i| stands(&i)) && !away().any(|i| context.t[i] >= t0 && stands(&i))
}

/// Time about an instant in which a rotor starts, s.
const ON_ITS_WAY: f64 = 1.0;

/// The instant at which something sets in: 48 starts over the run.
pub(crate) fn onset(context: &Context) -> Shape {
    let (t0, span) = (context.t.first().copied().unwrap_or(0.0), context.duration());
    Shape {
        name: "t0",
        unit: "s",
        range: (t0 + 0.02 * span, t0 + 0.98 * span),
        starts: (1..48).map(|k| t0 + span * f64::from(k) / 48.0).collect(),
    }
}

/// The same for an effect that, against a declared model, may have been there before the run.
pub(crate) fn onset_or_before(context: &Context) -> Shape {
    let mut shape = coarse_onset(context);
    if context.against_model {
        let before = context.t.first().copied().unwrap_or(0.0) - 2.0 * context.step();
        shape.range.0 = before;
        shape.starts.insert(0, before);
    }
    shape
}

/// The same with 24 starts, for effects on many channels.
pub(crate) fn coarse_onset(context: &Context) -> Shape {
    let mut shape = onset(context);
    shape.starts = shape.starts.into_iter().skip(1).step_by(2).collect();
    shape
}

/// 0 before `t0`, 1 after it, linear over the sample in between so that the instant can be refined.
pub(crate) fn step(context: &Context, t0: f64) -> Vec<f64> {
    let dt = context.step().max(1e-9);
    context.t.iter().map(|t| ((t - t0) / dt + 0.5).clamp(0.0, 1.0)).collect()
}
