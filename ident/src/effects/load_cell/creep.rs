//! `creep`: the load cell follows a load change by a few per cent more, slowly.
//!
//! What it is: thrust_n = F + amplitude * lag_tau(F): adhesive and beam relax exponentially.
//! What can go wrong: with levels much longer than tau only the transitions show it, and the gain takes the rest.
//! Units: 1, s.
//! Reference: Hoffmann, *An Introduction to Stress Analysis using Strain Gauges*, section 3.3 (creep).

use crate::channel::Context;
use crate::effects::design::TargetDesign;
use crate::effects::{
    About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, geometric, is_too_quick, operator,
    thrust_over_time,
};

/// See the module.
pub(crate) struct Creep;

impl Effect for Creep {
    fn id(&self) -> &'static str {
        "creep"
    }

    fn about(&self) -> About {
        About {
            title: "Creep of the load cell after a load change",
            equation: "thrust_n = F + amplitude * (F lagged by tau)",
            source: "Hoffmann, An Introduction to Stress Analysis using Strain Gauges, section 3.3",
            depends_on: &["t_s", "thrust_n", "time_since_step"],
            signature: "after each step the thrust residual relaxes exponentially, in proportion to the step",
            look_alikes: &["channel_filter", "hysteresis", "zero_drift"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            "the load cell",
            found.tell(
                "tau",
                |v| format!("creeps after each change of the load, within {v}"),
                "creeps after each change of the load",
            ),
        )
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Output
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        thrust_over_time(context)
    }

    fn shapes(&self, context: &Context, _: &Instance) -> Vec<Shape> {
        let (lo, hi) = ((5.0 * context.step()).max(1.0), (0.5 * context.duration()).max(2.0));
        vec![
            Shape { name: "amplitude", unit: "1", range: (-0.5, 0.5), starts: vec![-0.3, -0.1, -0.02, 0.02, 0.1, 0.3] },
            Shape { name: "tau", unit: "s", range: (lo, hi), starts: geometric(lo, hi, 8) },
        ]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        Vec::new()
    }

    fn plausible(&self, context: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        !is_too_quick(&self.shapes(context, instance), fitted)
    }

    fn apply(&self, context: &Context, _: &Instance, shape: &[f64], _: usize, design: &mut TargetDesign) {
        let [amplitude, tau] = shape else { return };
        let lag = operator::Lag::new(&context.t, *tau, operator::Course::Line);
        design.map_together(|columns| {
            let mut out = lag.of(columns);
            out.iter_mut().zip(columns).for_each(|(slow, column)| {
                slow.iter_mut().zip(column.iter()).for_each(|(s, v)| *s = v + amplitude * *s);
            });
            out
        });
    }
}
