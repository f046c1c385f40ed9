//! A fitted hypothesis as a model.
//!
//! What it is: declared polynomials, effects with their amplitudes, their reach, and what another run expects of each.
//! What can go wrong: of an effect that does not act on another run only its mean goes there.
//! Units: those of the channels.
//! Reference: specification `formats.md`, "Powerplant model".

use super::{Fit, part_of};
use crate::channel::{Context, Target};
use crate::effects::Estimate;
use crate::effects::design::{Label, TargetDesign};
use crate::log::Log;
use crate::model::scope::is_mean_elsewhere;
use crate::model::{AddedEffect, Declared, Model, Polynomial, Reach, shape_errors};
use crate::numeric::solve::Normal;

impl Model {
    /// The model that a fitted hypothesis amounts to.
    #[must_use]
    pub fn from_fit(context: &Context, log: &Log, declared: Declared<'_>, fit: &Fit) -> Self {
        let estimates = (0..fit.placed.len()).map(|k| fit.profiled_estimates(context, declared, k)).collect();
        Self::of_estimates(context, log, declared, fit, estimates)
    }

    /// The same with the parameters of each effect and their errors known.
    pub(crate) fn of_estimates(
        context: &Context,
        log: &Log,
        declared: Declared<'_>,
        fit: &Fit,
        estimates: Vec<Vec<Estimate>>,
    ) -> Self {
        let mut model = match declared.model {
            Some(m) => m.clone(),
            None => Self::of(context, log, Vec::new()),
        };
        if declared.model.is_none() {
            for (target, t) in context.targets.iter().zip(&fit.targets) {
                let base = |f: &dyn Fn(usize) -> f64| -> Vec<f64> {
                    t.labels.iter().enumerate().filter(|(_, l)| matches!(l, Label::Base(_))).map(|(j, _)| f(j)).collect()
                };
                model.polynomials.push(Polynomial {
                    channel: target.name.to_owned(),
                    coefficients: base(&|j| t.coefficients[j]),
                    errors: base(&|j| t.covariance[(j, j)].max(0.0).sqrt()),
                });
            }
        }
        for (position, (placed, estimates)) in fit.placed.iter().zip(estimates).enumerate() {
            let count = placed.effect.amplitudes(&placed.instance).len();
            let mut amplitudes = Vec::new();
            for (target, t) in context.targets.iter().zip(&fit.targets) {
                if placed.instance.touches(target.name) {
                    let mut values = vec![0.0; count];
                    for (l, c) in t.labels.iter().zip(&t.coefficients) {
                        if let Label::Effect { effect, amplitude } = l
                            && *effect == position
                        {
                            values[*amplitude] = *c;
                        }
                    }
                    amplitudes.push((target.name.to_owned(), values));
                }
            }
            let mean = mean(context, declared, fit, position);
            // what does not act on another run goes nowhere beyond
            let acting =
                context.targets.iter().zip(&fit.targets).filter(|(t, _)| mean.is_empty() && placed.instance.touches(t.name));
            let reach = acting.map(|(target, t)| Reach::fitted(target.name, &t.labels, &t.covariance, position, count)).collect();
            let shape_errors = shape_errors(&estimates, placed);
            model.effects.push(AddedEffect { placed: placed.clone(), amplitudes, estimates, mean, reach, shape_errors });
        }
        model.saw(context, model.effects.len() - fit.placed.len());
        model
    }
}

/// What another run expects of an effect in the place of its course: for each channel the declared polynomial that comes nearest to what the
/// effect adds on its own run. Nothing for an effect that acts on other runs.
fn mean(context: &Context, declared: Declared<'_>, fit: &Fit, position: usize) -> Vec<(String, Vec<f64>)> {
    let placed = &fit.placed[position];
    if !is_mean_elsewhere(placed) {
        return Vec::new();
    }
    let of_target = |(k, target): (usize, &Target)| {
        let part = part_of(context, declared, fit, position, k);
        let columns = TargetDesign::baseline(context, target.name, target.relation).columns;
        let mut normal = Normal::new(columns.len());
        for (row, part) in target.rows.iter().zip(&part).filter(|(row, _)| target.claims(**row)) {
            normal.add(&columns.iter().map(|c| c.values[*row]).collect::<Vec<f64>>(), *part, 1.0);
        }
        Some((target.name.to_owned(), normal.solve()?.coefficients))
    };
    context.targets.iter().enumerate().filter(|(_, t)| placed.instance.touches(t.name)).filter_map(of_target).collect()
}
