//! `glitch_rows`: isolated rows hold absurd values.
//!
//! What it is: single readings, far outside the scatter, that leave their neighbours and come back: damaged telemetry, a spike.
//! What can go wrong: such rows are recognised by their own reading, so that nothing is claimed about them: the correction sets
//! them apart from the relation, and a prediction leaves them empty ([`unclaimed`]).
//! Units: rows; size in the channel's unit.
//! Reference: running median as an outlier filter, Tukey 1977, *Exploratory Data Analysis*; Hampel identifier, Pearson 2002.

use crate::channel::glitches::glitches;
use crate::channel::{Context, Target};
use crate::effects::design::TargetDesign;
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage};

/// See the module.
pub(crate) struct GlitchRows;

impl Effect for GlitchRows {
    fn id(&self) -> &'static str {
        "glitch_rows"
    }

    fn about(&self) -> About {
        About {
            title: "Isolated rows hold absurd values",
            equation: "reading = anything on `count` rows",
            source: "Hampel identifier, Pearson 2002",
            depends_on: &["row"],
            signature: "single readings leave their neighbours by many times the scatter and come back",
            look_alikes: &["missed_pulses", "double_pulses"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            found.meter(),
            found.tell_in("count", "rows", |v| format!("holds absurd values in {v}"), "holds absurd values in single rows"),
        )
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Event
    }

    fn stage(&self) -> Stage {
        Stage::Readings
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        context.targets.iter().filter(|t| !t.unclaimed.is_empty()).map(|t| Instance::new(&[t.name], "")).collect()
    }

    fn is_of_moments(&self, _: &Instance) -> bool {
        true
    }

    fn never_beside(&self) -> &'static [&'static str] {
        // two pulses lost within one sample look absurd
        &["missed_pulses", "double_pulses"]
    }

    fn shapes(&self, _: &Context, _: &Instance) -> Vec<Shape> {
        Vec::new()
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "depth", unit: "1" }]
    }

    fn apply(&self, context: &Context, instance: &Instance, _: &[f64], position: usize, design: &mut TargetDesign) {
        let Some(target) = target(context, instance) else { return };
        let mut column = vec![0.0; context.len()];
        for (row, departure) in glitches(context, target) {
            column[row] = departure;
        }
        design.add(position, 0, column);
    }

    fn report(&self, context: &Context, instance: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        if let Some(target) = target(context, instance) {
            let found = glitches(context, target);
            let n = found.len().max(1) as f64;
            let size = (found.iter().map(|g| g.1 * g.1).sum::<f64>() / n).sqrt();
            fitted.insert(0, Estimate { name: "size".into(), unit: "channel".into(), value: size, se: size / n.sqrt() });
            fitted.insert(0, Estimate { name: "count".into(), unit: "1".into(), value: found.len() as f64, se: 0.0 });
        }
        fitted
    }
}

fn target<'c>(context: &'c Context, instance: &Instance) -> Option<&'c Target> {
    context.targets.iter().find(|t| instance.touches(t.name))
}
