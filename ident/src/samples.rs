//! The samples that a fit learns from, and what a design makes of them.
//!
//! What it is: a target's samples, their variances and weights, gathered once; any number of designs are then solved on them. A search
//! asks thousands of designs of the same samples.
//! What can go wrong: fewer samples than columns and three give no fit.
//! Units: log-likelihood in nats; samples in the unit of their channel.
//! Reference: separable least squares, Golub & Pereyra 1973.

use crate::context::{Context, Relation, Target};
use crate::design::TargetDesign;
use crate::hypothesis::{Declared, Designs, Likelihood, Placed, Rows};
use crate::solve::{Normal, Solution};
use std::borrow::Cow;
use std::cell::OnceCell;

/// How much worse the variance after jumps must be for those samples to weigh less.
const WORSE: f64 = 1.5;

/// The samples of one target that teach.
pub(crate) struct Samples<'c> {
    target: &'c Target,
    /// Samples that each of these stands for.
    stride: usize,
    /// Their positions among the target's samples.
    chosen: Vec<usize>,
    /// Whether they are all rows of the log, so that columns can be used as they stand.
    whole: bool,
    y: Cow<'c, [f64]>,
    levelled: Cow<'c, [f64]>,
    /// One over `levelled`.
    weights: Vec<f64>,
    /// Half the sum of the logarithms of `levelled`.
    half_logs: f64,
    /// Which of them follow a jump of the load; empty where the target does not tell.
    unsettled: Vec<bool>,
}

/// What went into a fit: columns, samples less the known part, and their variances in the two views, each one value a sample.
pub(crate) struct Kept<'d> {
    columns: Vec<Cow<'d, [f64]>>,
    y: Cow<'d, [f64]>,
    pub(crate) floored: Vec<f64>,
    /// Which samples follow a jump of the load, and by how much worse their variance is than that of the others.
    pub(crate) jumps: Option<(&'d [bool], f64)>,
}

impl Kept<'_> {
    /// Samples less the fitted columns.
    pub(crate) fn residual(&self, coefficients: &[f64]) -> Vec<f64> {
        let mut out = self.y.to_vec();
        for (column, b) in self.columns.iter().zip(coefficients) {
            out.iter_mut().zip(column.iter()).for_each(|(r, v)| *r -= v * b);
        }
        out
    }
}

impl<'c> Samples<'c> {
    /// Those of the rows that may teach.
    pub(crate) fn new(target: &'c Target, rows: Rows<'_>, log_rows: usize) -> Self {
        let stride = if let Rows::Every(n) = rows { n.max(1) } else { 1 };
        let chosen: Vec<usize> = match rows {
            Rows::Where(mask) => (0..target.rows.len()).filter(|j| mask[target.rows[*j]]).collect(),
            _ => (0..target.rows.len()).step_by(stride).collect(),
        };
        let all = chosen.len() == target.rows.len();
        let pick = |values: &'c [f64]| -> Cow<'c, [f64]> {
            if all { Cow::Borrowed(values) } else { chosen.iter().map(|j| values[*j]).collect() }
        };
        let levelled = pick(&target.levelled);
        let unsettled =
            if target.unsettled.is_empty() { Vec::new() } else { chosen.iter().map(|j| target.unsettled[*j]).collect() };
        Self {
            target,
            stride,
            y: pick(&target.y),
            weights: levelled.iter().map(|v| 1.0 / v).collect(),
            half_logs: 0.5 * log_product(&levelled),
            levelled,
            unsettled,
            whole: all && chosen.len() == log_rows,
            chosen,
        }
    }

    /// Of one value a row of the log those of the samples.
    fn gather<'d>(&self, values: &'d [f64]) -> Cow<'d, [f64]> {
        if self.whole { Cow::Borrowed(values) } else { self.chosen.iter().map(|j| values[self.target.rows[*j]]).collect() }
    }

    /// Solves for the coefficients with levelled weights (see [`crate::noise::Noise::weight_variance`]) and counts the likelihood
    /// of the mean, and that of the scatter too where `scattering` asks for it or an effect adds scatter.
    pub(crate) fn solve<'d>(&'d self, design: &'d TargetDesign, scattering: bool) -> Option<(Solution, Likelihood, Kept<'d>)> {
        if self.chosen.len() < design.columns.len() + 3 {
            return None;
        }
        let mut y = Cow::Borrowed(&*self.y);
        if !design.fixed.is_empty() {
            y.to_mut().iter_mut().zip(self.gather(&design.fixed).iter()).for_each(|(y, f)| *y -= f);
        }
        let looks_at_scatter = scattering || !design.extra_variance.is_empty();
        let mut floored: Vec<f64> =
            if looks_at_scatter { self.chosen.iter().map(|j| self.target.floored[*j]).collect() } else { Vec::new() };
        let (mut levelled, mut weights) = (Cow::Borrowed(&*self.levelled), Cow::Borrowed(self.weights.as_slice()));
        let mut half_logs = self.half_logs;
        if !design.extra_variance.is_empty() {
            let extra = self.gather(&design.extra_variance);
            levelled.to_mut().iter_mut().zip(extra.iter()).for_each(|(v, e)| *v += e);
            floored.iter_mut().zip(extra.iter()).for_each(|(v, e)| *v += e);
            weights = levelled.iter().map(|v| 1.0 / v).collect();
            half_logs = 0.5 * log_product(&levelled);
        }
        let columns: Vec<Cow<'d, [f64]>> = design.columns.iter().map(|c| self.gather(&c.values)).collect();
        let mut kept = Kept { columns, y, floored, jumps: None };
        let mut solution = Normal::of_columns(&kept.columns, &kept.y, &weights).solve()?;
        let n = self.chosen.len() as f64;
        let weight = self.target.weight * self.stride as f64;
        // the scale of the noise is profiled, but never below a tenth of the floor's standard deviation
        let part = |rss: f64, n: f64| {
            let scale = (rss / n).max(0.01);
            weight * (-0.5 * n * scale.ln() - 0.5 * rss / scale)
        };
        let profile = |rss: f64, log_sigma: f64| part(rss, n) - weight * log_sigma;
        // after a jump of the load a static relation is off by more than the noise: those samples have a scale of their own, so that
        // they neither rule the coefficients nor drown what the others say
        let mut mean = profile(solution.rss, half_logs);
        if !self.unsettled.is_empty() {
            let unsettled = &self.unsettled;
            let late = unsettled.iter().filter(|u| **u).count() as f64;
            let sums = |solution: &Solution| {
                let mut sums = (0.0, 0.0);
                for ((r, v), u) in kept.residual(&solution.coefficients).iter().zip(levelled.iter()).zip(unsettled) {
                    *(if *u { &mut sums.1 } else { &mut sums.0 }) += r * r / v;
                }
                sums
            };
            let scales = |(calm, after): (f64, f64)| (after / late.max(1.0)).max(0.01) / (calm / (n - late).max(1.0)).max(0.01);
            let mut found = sums(&solution);
            if late >= 3.0 && n - late > kept.columns.len() as f64 + 3.0 {
                let mut excess = scales(found).max(1.0);
                if excess > WORSE {
                    for _ in 0..2 {
                        weights
                            .to_mut()
                            .iter_mut()
                            .zip(levelled.iter())
                            .zip(unsettled)
                            .for_each(|((w, v), u)| *w = 1.0 / (v * if *u { excess } else { 1.0 }));
                        solution = Normal::of_columns(&kept.columns, &kept.y, &weights).solve()?;
                        found = sums(&solution);
                        excess = scales(found).max(1.0);
                    }
                }
                mean = part(found.0, n - late) + part(found.1, late) - weight * half_logs;
                kept.jumps = Some((unsettled, excess));
            }
        }
        let scatter = if looks_at_scatter {
            let rss = kept.residual(&solution.coefficients).iter().zip(&kept.floored).map(|(r, v)| r * r / v).sum();
            profile(rss, 0.5 * log_product(&kept.floored))
        } else {
            mean
        };
        Some((solution, Likelihood { mean, scatter }, kept))
    }
}

/// The samples of every target, gathered when first asked for: one for all hypotheses of a search.
pub(crate) struct Taught<'c> {
    context: &'c Context,
    declared: Declared<'c>,
    rows: Rows<'c>,
    samples: Vec<OnceCell<Samples<'c>>>,
}

impl<'c> Taught<'c> {
    /// Those of the rows that may teach.
    pub(crate) fn new(context: &'c Context, declared: Declared<'c>, rows: Rows<'c>) -> Self {
        Self { context, declared, rows, samples: context.targets.iter().map(|_| OnceCell::new()).collect() }
    }

    /// Log-likelihood of the `moving` targets only: what a search compares.
    pub(crate) fn loglik(&self, placed: &[Placed], moving: &[&str], scattering: bool) -> f64 {
        let mut sum = 0.0;
        let mut designs = Designs::new(self.context, self.declared, placed);
        let moving = (0..self.samples.len()).filter(|k| moving.contains(&self.context.targets[*k].name));
        for k in moving {
            match self.of_target(k, &mut designs, scattering) {
                Some(loglik) => sum += loglik,
                None => return f64::NEG_INFINITY,
            }
        }
        sum
    }

    fn of_target(&self, k: usize, designs: &mut Designs<'_>, scattering: bool) -> Option<f64> {
        let target = &self.context.targets[k];
        let view = scattering && target.relation == Relation::Thrust;
        let samples = self.samples[k].get_or_init(|| Samples::new(target, self.rows, self.context.len()));
        samples.solve(designs.of(target), view).map(|(_, loglik, _)| loglik.of(view))
    }
}

/// What a scan adds candidates to: its effects, and its likelihood, which every candidate on the same channels is compared with.
pub(crate) struct Base<'c> {
    pub(crate) taught: Taught<'c>,
    pub(crate) placed: &'c [Placed],
    /// For each target its likelihood in the two views.
    known: Vec<[OnceCell<Option<f64>>; 2]>,
}

impl<'c> Base<'c> {
    /// These effects on the rows that may teach.
    pub(crate) fn new(taught: Taught<'c>, placed: &'c [Placed]) -> Self {
        let known = taught.samples.iter().map(|_| Default::default()).collect();
        Self { taught, placed, known }
    }

    /// See [`Taught::loglik`].
    pub(crate) fn loglik(&self, moving: &[&str], scattering: bool) -> f64 {
        let (context, declared) = (self.taught.context, self.taught.declared);
        let mut designs = Designs::new(context, declared, self.placed);
        let moving = (0..self.known.len()).filter(|k| moving.contains(&context.targets[*k].name));
        moving
            .map(|k| {
                let known = &self.known[k][usize::from(scattering)];
                known.get_or_init(|| self.taught.of_target(k, &mut designs, scattering)).unwrap_or(f64::NEG_INFINITY)
            })
            .fold(0.0, |sum, part| sum + part)
    }
}

/// Sum of the logarithms of positive numbers, one logarithm for every eight of them.
fn log_product(values: &[f64]) -> f64 {
    values
        .chunks(8)
        .map(|chunk| {
            let scale = chunk[0];
            scale.ln() * chunk.len() as f64 + chunk.iter().map(|v| v / scale).product::<f64>().ln()
        })
        .sum()
}
