//! One speed channel against the others.
//!
//! What it is: what the effects on a single speed channel share: the difference from the consensus as evidence, the speed that
//! a term is a function of.
//! What can go wrong: with fewer than three speed channels nobody can be outvoted, and no such effect is offered.
//! Units: rev/min.
//! Reference: Beharie 2013, section 5.7.1 (four speed sensors compared; Fig. 5.54-5.63).

use crate::channel::{Context, DIFFERENCES, Relation, Target};
use crate::effects::design::TargetDesign;
use crate::effects::{Amplitude, Estimate, Instance};
use crate::numeric::order::median;
use crate::numeric::solve::Normal;

/// The instance that touches a speed channel and its difference from the consensus.
pub(crate) fn instance(context: &Context, channel: &str, form: &str) -> Option<Instance> {
    let difference = DIFFERENCES.iter().find(|d| d.0 == channel)?.1;
    context.target(difference)?;
    Some(Instance::new(&[channel, difference], form))
}

/// Instances for every speed channel that can be compared.
pub(crate) fn instances(context: &Context, form: &str) -> Vec<Instance> {
    DIFFERENCES.iter().filter_map(|d| instance(context, d.0, form)).collect()
}

/// The difference target of an instance.
pub(crate) fn difference<'c>(context: &'c Context, instance: &Instance) -> Option<&'c Target> {
    context.targets.iter().find(|t| t.relation == Relation::SpeedDifference && instance.touches(t.name))
}

/// The speed that a term on a channel is a function of: the consensus for the difference; for the channel itself what the
/// command makes of it, because the consensus holds the channel's own fluctuation.
pub(crate) fn speed(context: &Context, relation: Relation) -> Vec<f64> {
    match (&context.pulse, relation) {
        (Some(_), Relation::SpeedFromPulse) => expected(context).to_vec(),
        _ => context.rpm.clone(),
    }
}

/// Speed that the pulse alone makes one expect: a cubic above the starting pulse.
pub(crate) fn expected(context: &Context) -> &[f64] {
    context.facts.expected.get_or_init(|| expected_at(context, 0.0))
}

/// The same at a pulse that is `more` us longer.
pub(crate) fn expected_at(context: &Context, more: f64) -> Vec<f64> {
    let u = crate::effects::throttle(context);
    let row = |u: f64| [1.0, u, u * u, u * u * u];
    let mut normal = Normal::new(4);
    for i in (0..u.len()).step_by((u.len() / 1000).max(1)).filter(|i| u[*i] > 0.0) {
        normal.add(&row(u[i]), context.rpm[i], 1.0);
    }
    let Some(solution) = normal.solve() else { return vec![0.0; u.len()] };
    let at = |u: f64| row(u + more / 1000.0).iter().zip(&solution.coefficients).map(|(a, c)| a * c).sum();
    u.iter().map(|u| if *u > 0.0 { at(*u) } else { 0.0 }).collect()
}

/// Adds `slope` and `bend` of a departure that grows from an onset speed up: (rpm - onset) and its square over the onset. A speed that nothing
/// predicts shows none: there the speed itself would be explained by the speed.
pub(crate) fn add_hinge(context: &Context, onset: f64, position: usize, design: &mut TargetDesign) {
    if design.relation == Relation::SpeedAlone {
        return;
    }
    let over: Vec<f64> = speed(context, design.relation).iter().map(|r| (r - onset).max(0.0)).collect();
    design.add(position, 1, over.iter().map(|v| v * v / onset.max(1.0)).collect());
    design.add(position, 0, over);
}

/// Amplitudes of a departure that grows above an onset: the same of the channel and of its difference from the others.
pub(crate) const HINGE: [Amplitude; 2] = [Amplitude { name: "slope", unit: "1" }, Amplitude { name: "bend", unit: "1" }];

/// Whether a channel leaves the others to one side (`sign`). Where another channel leaves to the other side by more, it takes the others along, and
/// this one only seems to leave.
pub(crate) fn leaves(context: &Context, instance: &Instance, fitted: &[Estimate], sign: f64) -> bool {
    let Some(own) = difference(context, instance) else { return false };
    let by = sign * hinge_at_top(context, fitted);
    let onset = fitted.iter().find(|e| e.name == "onset").map_or(0.0, |e| e.value);
    let others = context.targets.iter().filter(|t| t.relation == Relation::SpeedDifference && t.name != own.name);
    by > 0.0 && others.map(|t| -sign * bends(context, t, onset)).all(|other| other < by)
}

/// How much farther a difference is off at the top speed than its gain below an onset says, rev/min.
fn bends(context: &Context, target: &Target, onset: f64) -> f64 {
    let top = context.rpm.iter().copied().fold(1.0, f64::max);
    let share = |of: &dyn Fn(f64) -> bool| {
        let rows = target.rows.iter().zip(&target.y).filter(|(row, _)| of(context.rpm[**row]));
        median(&mut rows.map(|(row, y)| y / context.rpm[*row].max(1.0)).collect::<Vec<_>>())
    };
    let bent = top * (share(&|rpm| rpm > 0.5 * (onset + top)) - share(&|rpm| rpm < onset && rpm > 0.25 * onset));
    if bent.is_finite() { bent } else { 0.0 }
}

/// Departure at the top speed, rev/min.
fn hinge_at_top(context: &Context, fitted: &[Estimate]) -> f64 {
    let value = |name: &str| fitted.iter().find(|e| e.name == name).map_or(0.0, |e| e.value);
    let top = context.rpm.iter().copied().fold(1.0, f64::max);
    let (onset, over) = (value("onset"), (top - value("onset")).max(0.0));
    value("slope") * over + value("bend") * over * over / onset.max(1.0)
}
