//! `sample_hold`: a channel repeats old values between its updates.
//!
//! What it is: the reading stands still until its next update, `period` seconds later; the updates are seen in the channel itself.
//! What can go wrong: a coarse resolution repeats values too, but not at even intervals.
//! Units: s.
//! Reference: zero-order hold; asynchronous telemetry of speed controllers.

use super::{About, Amplitude, Effect, Estimate, Instance, Shape, Stage, through_meter};
use crate::context::{Context, DIFFERENCES, Relation, Target};
use crate::design::TargetDesign;
use crate::noise::median;

/// See the module.
pub(crate) struct SampleHold;

impl Effect for SampleHold {
    fn id(&self) -> &'static str {
        "sample_hold"
    }

    fn about(&self) -> About {
        About {
            title: "A channel repeats old values",
            equation: "reading(t) = truth(last update), an update every `period` seconds",
            source: "zero-order hold",
            depends_on: &["t_s", "time_since_step"],
            signature: "exact repeats at even intervals, and steps of the load arrive late by up to one period",
            look_alikes: &["channel_delay", "quantisation"],
        }
    }

    fn stage(&self) -> Stage {
        Stage::Output
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        if context.time_is_row {
            return Vec::new();
        }
        let held = |t: &&Target| !t.relation.is_evidence() && t.relation != Relation::Voltage && period(context, t).is_some();
        let difference =
            |channel: &str| DIFFERENCES.iter().find(|d| d.0 == channel && context.target(d.1).is_some()).map(|d| d.1);
        context
            .targets
            .iter()
            .filter(held)
            .map(|t| Instance::new(&std::iter::once(t.name).chain(difference(t.name)).collect::<Vec<_>>(), ""))
            .collect()
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        // measured from the repeats, not fitted
        let found = target(context, instance).and_then(|t| period(context, t)).map_or(0.0, |p| p.0);
        vec![Shape { name: "period", unit: "s", range: (found, found), starts: vec![found] }]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        Vec::new()
    }

    fn apply(&self, context: &Context, instance: &Instance, _: &[f64], _: usize, design: &mut TargetDesign) {
        let Some(target) = target(context, instance) else { return };
        let mut fresh = vec![false; context.len()];
        for i in updates(target) {
            fresh[i] = true;
        }
        let held = |column: &&[f64]| -> Vec<f64> {
            let mut value = column.first().copied().unwrap_or(0.0);
            let hold = |(v, fresh): (&f64, &bool)| {
                if *fresh {
                    value = *v;
                }
                value
            };
            column.iter().zip(&fresh).map(hold).collect()
        };
        through_meter(context, design, |columns| columns.iter().map(held).collect());
    }

    fn report(&self, context: &Context, instance: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        if let Some((value, se)) = target(context, instance).and_then(|t| period(context, t)) {
            for e in fitted.iter_mut().filter(|e| e.name == "period") {
                (e.value, e.se) = (value, se);
            }
        }
        fitted
    }
}

fn target<'c>(context: &'c Context, instance: &Instance) -> Option<&'c Target> {
    context.targets.iter().find(|t| instance.touches(t.name))
}

/// Rows on which a channel shows a new value.
fn updates(target: &Target) -> Vec<usize> {
    let changed = target.y.windows(2).zip(&target.rows[1..]).filter(|(w, _)| w[0] != w[1]).map(|(_, row)| *row);
    target.rows.first().copied().into_iter().chain(changed).collect()
}

/// Interval of the updates and its standard error, s, where they come at even intervals of at least one and a half rows.
fn period(context: &Context, target: &Target) -> Option<(f64, f64)> {
    // a standing rotor reads zero again and again
    let live = |row: usize| context.rpm.get(row).is_none_or(|r| *r > super::blade_damage::STANDSTILL);
    let rows = updates(target);
    let gaps: Vec<f64> =
        rows.windows(2).filter(|w| live(w[0]) && live(w[1])).map(|w| context.t[w[1]] - context.t[w[0]]).collect();
    if gaps.len() < 20 {
        return None;
    }
    let dt = context.step();
    let middle = median(&mut gaps.clone());
    // two updates that happen to read the same make one double gap
    let near: Vec<f64> = gaps.iter().copied().filter(|g| (g - middle).abs() < 1.5 * dt).collect();
    let mean = near.iter().sum::<f64>() / near.len() as f64;
    let even = near.len() as f64 > 0.85 * gaps.len() as f64;
    // intervals between 1 and 2 rows show as ones and twos: nearly no interval may then be of another length
    (even && mean > 1.4 * dt).then(|| slope(context, &rows, &live, mean))
}

/// Interval of updates that come at a rate of their own and show on the next row: slope of their times over their count, the
/// count being the rounded number of intervals since the last one.
fn slope(context: &Context, rows: &[usize], live: &dyn Fn(usize) -> bool, first: f64) -> (f64, f64) {
    let dt = context.step();
    let mut period = first;
    let mut se = first;
    for _ in 0..4 {
        // each stretch without a stand-still is a line of its own, all with one slope
        let (mut count, mut n) = (0.0, 0.0);
        let (mut line, mut kk, mut kt): (Vec<(f64, f64)>, f64, f64) = (Vec::new(), 0.0, 0.0);
        let mut close = |line: &mut Vec<(f64, f64)>| {
            let m = line.len() as f64;
            let (k, t) = (line.iter().map(|p| p.0).sum::<f64>() / m, line.iter().map(|p| p.1).sum::<f64>() / m);
            kk += line.iter().map(|p| (p.0 - k).powi(2)).sum::<f64>();
            kt += line.iter().map(|p| (p.0 - k) * (p.1 - t)).sum::<f64>();
            n += m;
            line.clear();
        };
        for w in rows.windows(2) {
            let gap = context.t[w[1]] - context.t[w[0]];
            if !live(w[0]) || !live(w[1]) || gap > 6.0 * first {
                if line.len() > 4 {
                    close(&mut line);
                } else {
                    line.clear();
                }
                continue;
            }
            count += (gap / period).round().max(1.0);
            line.push((count, context.t[w[1]]));
        }
        if line.len() > 4 {
            close(&mut line);
        }
        if kk <= 0.0 {
            break;
        }
        // and a count may have slipped by one
        (period, se) = (kt / kk, (dt / (12.0 * kk).sqrt()).hypot(kt / kk / n.max(1.0)));
    }
    (period, se)
}
