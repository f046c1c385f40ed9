//! `channel_filter`: a slow meter: the channel is an average of the past.
//!
//! What it is: the reading is the mean over a window, or a first-order lag, of the true value.
//! What can go wrong: a pure delay looks alike on steps that are longer than the window; the shape of the edge tells.
//! Units: s.
//! Reference: boxcar and RC filters; RCbenchmark load cells average over about half a second.

use super::{About, Amplitude, Effect, Instance, Shape, Stage, geometric, meters, operator};
use crate::context::Context;
use crate::design::TargetDesign;

/// See the module.
pub(crate) struct ChannelFilter;

impl Effect for ChannelFilter {
    fn id(&self) -> &'static str {
        "channel_filter"
    }

    fn about(&self) -> About {
        About {
            title: "Slow meter: the channel is filtered",
            equation: "reading = mean of the truth over the last `window` seconds, or tau d(reading)/dt = truth - reading",
            source: "boxcar and first-order filters",
            depends_on: &["t_s", "time_since_step"],
            signature: "the residual spikes at every change of the load, with the sign of the change, and is flat elsewhere",
            look_alikes: &["channel_delay", "spinup_lag", "creep"],
        }
    }

    fn stage(&self) -> Stage {
        Stage::Output
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        meters(context).iter().flat_map(|s| ["moving_average", "first_order"].map(|form| Instance::new(s, form))).collect()
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        let dt = context.step();
        let (lo, hi) = (0.5 * dt, (60.0 * dt).max(4.0));
        let name = if instance.form == "first_order" { "tau" } else { "window" };
        vec![Shape { name, unit: "s", range: (0.1 * dt, 1.5 * hi), starts: geometric(lo, hi, 14) }]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        Vec::new()
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], _: usize, design: &mut TargetDesign) {
        let [width] = shape else { return };
        let slow = instance.form == "first_order";
        design.map_columns(|column| {
            *column = if slow {
                operator::first_order(&context.t, column, *width)
            } else {
                operator::moving_average(&context.t, column, *width)
            };
        });
    }
}
