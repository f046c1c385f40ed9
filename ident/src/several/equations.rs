//! What a run says of the coefficients that all runs of a rig share.
//!
//! What it is: weighted normal equations of one channel of one run, from which what belongs to the run alone (its tare, its own drifts and
//! events) has been eliminated. Those of several runs add up.
//! What can go wrong: a run whose samples do not tell a coefficient leaves it to the others.
//! Units: square sums in independent samples of unit variance.
//! Reference: partitioned least squares, Frisch & Waugh 1933, Econometrica 1:387; Schur complement.

use super::Member;
use crate::channel::Target;
use crate::effects::design::{Label, TargetDesign};
use crate::effects::placed::Placed;
use crate::fit::design;
use crate::model::Declared;
use crate::numeric::solve::Normal;
use nalgebra::DMatrix;

/// The coefficients of a channel that all runs share, in order: powers of the declared polynomial above the constant, then amplitudes.
pub(super) fn shared(rig: &[Placed], target: &Target) -> Vec<Label> {
    let powers = (1..=target.relation.degree()).map(Label::Base);
    let of_effect = |(effect, p): (usize, &Placed)| {
        let count = if p.instance.touches(target.name) { p.effect.amplitudes(&p.instance).len() } else { 0 };
        (0..count).map(move |amplitude| Label::Effect { effect, amplitude })
    };
    powers.chain(rig.iter().enumerate().flat_map(of_effect)).collect()
}

/// Of every value a row those of a target's samples, each `stride`-th.
fn on_samples(target: &Target, values: &[f64], stride: usize) -> Vec<f64> {
    target.rows.iter().step_by(stride).map(|row| values[*row]).collect()
}

/// The columns of the shared coefficients on a target's samples; zeros where the run lacks one.
pub(super) fn columns_of(target: &Target, design: &TargetDesign, labels: &[Label], stride: usize) -> Vec<Vec<f64>> {
    let column = |label: &Label| {
        let own = design.columns.iter().find(|c| c.label == *label);
        own.map_or_else(|| vec![0.0; target.rows.len().div_ceil(stride)], |c| on_samples(target, &c.values, stride))
    };
    labels.iter().map(column).collect()
}

pub(super) fn samples_less_fixed(target: &Target, design: &TargetDesign, stride: usize) -> Vec<f64> {
    let mut y: Vec<f64> = target.y.iter().step_by(stride).copied().collect();
    if !design.fixed.is_empty() {
        y.iter_mut().zip(on_samples(target, &design.fixed, stride)).for_each(|(y, f)| *y -= f);
    }
    y
}

/// The equations of one target of one run, its own columns eliminated: of the shared coefficients in the order of `labels`. Each `stride`-th
/// sample takes part, and stands for those that do not.
pub(super) fn of_run(member: &Member<'_>, k: usize, rig: &[Placed], labels: &[Label], stride: usize) -> Option<Normal> {
    let target = &member.context.targets[k];
    let placed: Vec<Placed> = rig.iter().chain(&member.own).cloned().collect();
    let design = design(member.context, Declared::default(), &placed, target);
    let y = samples_less_fixed(target, &design, stride);
    let weights: Vec<f64> = member.weights[k].iter().step_by(stride).map(|w| w * stride as f64).collect();
    let shared = columns_of(target, &design, labels, stride);
    let constant = design.columns.iter().find(|c| c.label == Label::Base(0)).map(|c| on_samples(target, &c.values, stride));
    let (_, mut columns) = own_columns(target, &design, rig.len(), stride);
    let powers: Vec<&Vec<f64>> =
        constant.iter().chain(labels.iter().zip(&shared).filter(|(l, _)| matches!(l, Label::Base(_))).map(|(_, c)| c)).collect();
    centring(&mut columns, &powers, &weights);
    columns.extend(constant);
    let local = columns.len();
    columns.extend(shared);
    Normal::of_columns(&columns, &y, &weights).without_first(local)
}

/// The columns of a run's own effects, which stand behind the first `shared` of a hypothesis.
pub(super) fn own_columns(target: &Target, design: &TargetDesign, shared: usize, stride: usize) -> (Vec<Label>, Vec<Vec<f64>>) {
    let own = design.columns.iter().filter(|c| matches!(c.label, Label::Effect { effect, .. } if effect >= shared));
    own.map(|c| (c.label, on_samples(target, &c.values, stride))).unzip()
}

/// Takes from columns what the declared polynomial makes of them, and gives its coefficients: a run's own drift is not to bend what all
/// runs share.
pub(super) fn centring(own: &mut [Vec<f64>], powers: &[&Vec<f64>], weights: &[f64]) -> Vec<Vec<f64>> {
    let of_column = |column: &mut Vec<f64>| {
        let Some(mean) = Normal::of_columns(powers, column, weights).solve() else { return vec![0.0; powers.len()] };
        for (power, c) in powers.iter().zip(&mean.coefficients) {
            column.iter_mut().zip(power.iter()).for_each(|(v, p)| *v -= c * p);
        }
        mean.coefficients
    };
    own.iter_mut().map(of_column).collect()
}

/// What a run leaves over of a channel on every sample, one constant apart, which the rows that are claimed tell.
pub(super) fn residual_on(
    member: &Member<'_>,
    k: usize,
    rig: &[Placed],
    labels: &[Label],
    coefficients: &[f64],
) -> Option<Vec<f64>> {
    let target = &member.context.targets[k];
    let design = design(member.context, Declared::default(), rig, target);
    let mut residual = samples_less_fixed(target, &design, 1);
    for (column, c) in columns_of(target, &design, labels, 1).iter().zip(coefficients) {
        residual.iter_mut().zip(column).for_each(|(r, v)| *r -= c * v);
    }
    let (sum, count) = claimed(target, &residual).fold((0.0, 0.0), |(sum, count), r| (sum + r, count + 1.0));
    let mean: f64 = sum / count;
    residual.iter_mut().for_each(|r| *r -= mean);
    mean.is_finite().then_some(residual)
}

/// The same of the rows that are claimed alone.
pub(super) fn left_on(member: &Member<'_>, k: usize, rig: &[Placed], labels: &[Label], coefficients: &[f64]) -> Option<Vec<f64>> {
    let residual = residual_on(member, k, rig, labels, coefficients)?;
    Some(claimed(&member.context.targets[k], &residual).collect())
}

fn claimed<'t>(target: &'t Target, residual: &'t [f64]) -> impl Iterator<Item = f64> + 't {
    residual.iter().zip(&target.rows).filter(|(_, row)| target.claims(**row)).map(|(r, _)| *r)
}

/// Root mean square.
pub(super) fn rms(residual: &[f64]) -> f64 {
    (residual.iter().map(|r| r * r).sum::<f64>() / residual.len().max(1) as f64).sqrt()
}

/// Coefficients and their covariance from equations that were added up.
pub(super) fn solved(normal: &Normal) -> Option<(Vec<f64>, DMatrix<f64>)> {
    normal.solve().map(|s| (s.coefficients, s.inverse))
}
