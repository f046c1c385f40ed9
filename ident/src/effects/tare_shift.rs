//! `tare_shift`: the load cell's zero jumps once.
//!
//! What it is: thrust_n += offset for t >= t0: a cable touched, a clamp slipped.
//! What can go wrong: a jump at a level change looks like a wrong polynomial.
//! Units: N, s.
//! Reference: step change with unknown instant, Basseville & Nikiforov 1993, section 2.2.

use super::{About, Amplitude, Effect, Instance, Shape, Stage, thrust_over_time};
use crate::context::Context;
use crate::design::TargetDesign;

/// See the module.
pub(crate) struct TareShift;

impl Effect for TareShift {
    fn id(&self) -> &'static str {
        "tare_shift"
    }

    fn about(&self) -> About {
        About {
            title: "Step of the load cell's zero",
            equation: "thrust_n += offset for t >= t0",
            source: "Basseville & Nikiforov 1993, section 2.2",
            depends_on: &["t_s"],
            signature: "the thrust residual has one step in time and is flat on both sides",
            look_alikes: &["zero_drift", "gain_change"],
        }
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        thrust_over_time(context)
    }

    fn shapes(&self, context: &Context, _: &Instance) -> Vec<Shape> {
        vec![onset(context)]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "offset", unit: "N" }]
    }

    fn apply(&self, context: &Context, _: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let [t0] = shape else { return };
        design.add(position, 0, step(context, *t0));
    }
}

/// The instant at which something sets in: 48 starts over the run.
pub(super) fn onset(context: &Context) -> Shape {
    let (t0, span) = (context.t.first().copied().unwrap_or(0.0), context.duration());
    Shape {
        name: "t0",
        unit: "s",
        range: (t0 + 0.02 * span, t0 + 0.98 * span),
        starts: (1..48).map(|k| t0 + span * f64::from(k) / 48.0).collect(),
    }
}

/// The same with 24 starts, for effects on many channels.
pub(super) fn coarse_onset(context: &Context) -> Shape {
    let mut shape = onset(context);
    shape.starts = shape.starts.into_iter().skip(1).step_by(2).collect();
    shape
}

/// 0 before `t0`, 1 after it, linear over the sample in between so that the instant can be refined.
pub(super) fn step(context: &Context, t0: f64) -> Vec<f64> {
    let dt = context.step().max(1e-9);
    context.t.iter().map(|t| ((t - t0) / dt + 0.5).clamp(0.0, 1.0)).collect()
}
