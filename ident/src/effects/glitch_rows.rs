//! `glitch_rows`: isolated rows hold absurd values.
//!
//! What it is: single readings, far outside the scatter, that leave their neighbours and come back: damaged telemetry, a spike.
//! What can go wrong: such rows are recognised by their own reading, so that nothing is claimed about them: the correction sets
//! them apart from the relation, and a prediction leaves them empty ([`unclaimed`]).
//! Units: rows; size in the channel's unit.
//! Reference: running median as an outlier filter, Tukey 1977, *Exploratory Data Analysis*; Hampel identifier, Pearson 2002.

use super::pulses::PULSES;
use super::quantisation;
use super::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage};
use crate::channel::{Context, Relation, Target};
use crate::effects::design::TargetDesign;
use crate::signal::noise::median;

/// See the module.
pub(crate) struct GlitchRows;

/// Departure from the running median, in robust standard deviations, from which a row is absurd.
const FAR: f64 = 15.0;
/// Rows before and after, whose scatter counts too.
const AROUND: usize = 10;
/// The same as a share of the channel's span.
const WIDE: f64 = 0.02;

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

/// Rows of a channel about which nothing is claimed: its glitches, where they are two at the least and fewer than one in twenty.
/// The log alone decides, so that they are the same before and after, whatever is named.
pub(crate) fn unclaimed(context: &Context, target: &Target) -> Vec<usize> {
    let found = glitches(context, target);
    let few = !target.relation.is_evidence() && found.len() >= 2 && found.len() * 20 < target.rows.len();
    if few { found.into_iter().map(|g| g.0).collect() } else { Vec::new() }
}

fn target<'c>(context: &'c Context, instance: &Instance) -> Option<&'c Target> {
    context.targets.iter().find(|t| instance.touches(t.name))
}

/// Whether the load stepped within a second of a row: what stays within the channel's span there may be a transient.
fn moving(context: &Context, row: usize) -> bool {
    let near = |i: &usize| (context.t[*i] - context.t[row]).abs() <= 1.0;
    let (from, to) =
        ((0..row).rev().take_while(near).last().unwrap_or(row), (row..context.len()).take_while(near).last().unwrap_or(row));
    let largest_step = |x: &[f64]| x.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
    match &context.pulse {
        Some(pulse) => largest_step(&pulse[from..=to]) > 5.0,
        None if context.rpm.is_empty() => false,
        None => largest_step(&context.rpm[from..=to]) > 0.02 * context.rpm.iter().copied().fold(0.0, f64::max),
    }
}

/// Rows that hold a glitch, with their departure from the running median of five.
fn glitches(context: &Context, target: &Target) -> Vec<(usize, f64)> {
    let y = &target.y;
    if y.len() < 50 {
        return Vec::new();
    }
    let middle = |k: usize| median(&mut y[k - 2..=k + 2].to_vec());
    let departures: Vec<f64> = (2..y.len() - 2).map(|k| y[k] - middle(k)).collect();
    let mut sizes: Vec<f64> = departures.iter().map(|d| d.abs()).collect();
    // a coarse reading toggles between its own steps, most of the time not at all
    let scatter = (1.4826 * median(&mut sizes)).max(quantisation::step(target).map_or(0.0, |step| 0.5 * step));
    let mut sorted = y.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let span = sorted[sorted.len() * 99 / 100] - sorted[sorted.len() / 100];
    let least = (FAR * scatter).max(WIDE * span);
    let speed = matches!(target.relation, Relation::SpeedFromPulse | Relation::SpeedAlone);
    // where its neighbours scatter as well, as in a resonance, a reading is not isolated
    let around = |k: usize| &departures[(k - 2).saturating_sub(AROUND)..(k - 1 + AROUND).min(departures.len())];
    let isolated = |k: usize, d: f64| {
        let mut near: Vec<f64> = around(k).iter().map(|d| d.abs()).collect();
        d.abs() > FAR * 1.4826 * median(&mut near)
    };
    let absurd = |k: usize, d: f64| {
        let share = y[k] / (y[k] - d);
        d.abs() > least
            && isolated(k, d)
            && !(speed && PULSES.contains(&share))
            && (d.abs() > span || !moving(context, target.rows[k]))
    };
    departures.iter().enumerate().filter(|(k, d)| absurd(k + 2, **d)).map(|(k, d)| (target.rows[k + 2], *d)).collect()
}
