//! A hypothesis: the declared model and a set of effects, fitted jointly.
//!
//! What it is: separable least squares. For given shape parameters each target is a linear problem; the shapes are searched
//! by the profile likelihood over all targets that the effects touch.
//! What can go wrong: a shape that ends on its bound, or an implausible amplitude, disqualifies the hypothesis.
//! Units: log-likelihood in nats; parameters in the units that the effects state.
//! Reference: Golub & Pereyra 1973; Nelder & Mead 1965; profile likelihood, Barndorff-Nielsen & Cox 1994, section 3.4.

use crate::context::{Context, Relation, Target};
use crate::design::{Label, TargetDesign};
use crate::effects::{Effect, Estimate, Instance};
use crate::model::Model;
use crate::solve::{Normal, Solution};
use nalgebra::DMatrix;

/// An effect placed in a hypothesis.
#[derive(Clone)]
pub struct Placed {
    /// The effect.
    pub effect: &'static dyn Effect,
    /// Which channels, which form.
    pub instance: Instance,
    /// Values of its shape parameters.
    pub shape: Vec<f64>,
}

impl std::fmt::Debug for Placed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {:?} {} {:?}", self.effect.id(), self.instance.channels, self.instance.form, self.shape)
    }
}

/// What the effects are added to.
#[derive(Debug, Clone, Copy, Default)]
pub struct Declared<'a> {
    /// A model that stands as it is; `None` is the thesis baseline, refitted.
    pub model: Option<&'a Model>,
}

/// Fit of one target.
#[derive(Debug, Clone)]
pub struct TargetFit {
    /// Coefficients in the order of the design's columns.
    pub coefficients: Vec<f64>,
    /// Their meaning.
    pub labels: Vec<Label>,
    /// Covariance of the coefficients.
    pub covariance: DMatrix<f64>,
    /// Log-likelihood, weighted for shared rotors.
    pub loglik: Likelihood,
    /// Share of independent samples that the colour of this fit's residual leaves, 1 when white.
    pub share: f64,
}

/// A fitted hypothesis.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The effects with their shapes.
    pub placed: Vec<Placed>,
    /// One fit for each target of the context.
    pub targets: Vec<TargetFit>,
}

/// Log-likelihood under the two views of the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Likelihood {
    /// With levelled variances: asks how well the mean is predicted, and does not let a nearly noiseless stretch decide that.
    pub mean: f64,
    /// With the variances as they are: asks about the scatter too.
    pub scatter: f64,
}

impl Likelihood {
    /// The view that answers for a hypothesis that does or does not speak of scatter.
    #[must_use]
    pub fn of(self, scatters: bool) -> f64 {
        if scatters { self.scatter } else { self.mean }
    }
}

/// Whether any of the effects says something of the scatter of a channel.
#[must_use]
pub fn scatters(placed: &[Placed], channel: &str) -> bool {
    placed.iter().any(|p| p.effect.scatters() && p.instance.touches(channel))
}

/// Builds the design of one target under a hypothesis.
#[must_use]
pub fn design(context: &Context, declared: Declared<'_>, placed: &[Placed], target: &Target) -> TargetDesign {
    let mut design = match declared.model {
        None => TargetDesign::baseline(context, target.name, target.relation),
        Some(model) => model.pinned(context, target),
    };
    let mut order: Vec<usize> = (0..placed.len()).collect();
    order.sort_by_key(|i| placed[*i].effect.stage());
    for i in order {
        let p = &placed[i];
        if p.instance.touches(target.name) {
            p.effect.apply(context, &p.instance, &p.shape, i, &mut design);
        }
    }
    design
}

/// Designs of one hypothesis, target after target: the speed channels see one rotor, and where the same effects touch them their
/// design is made once.
pub(crate) struct Designs<'a> {
    context: &'a Context,
    declared: Declared<'a>,
    placed: &'a [Placed],
    last: Option<(Vec<bool>, TargetDesign)>,
}

impl<'a> Designs<'a> {
    pub(crate) fn new(context: &'a Context, declared: Declared<'a>, placed: &'a [Placed]) -> Self {
        Self { context, declared, placed, last: None }
    }

    /// The design of a target.
    pub(crate) fn of(&mut self, target: &Target) -> &TargetDesign {
        let touching: Vec<bool> = self.placed.iter().map(|p| p.instance.touches(target.name)).collect();
        let alike = |last: &(Vec<bool>, TargetDesign)| {
            last.1.relation == Relation::SpeedFromPulse
                && target.relation == Relation::SpeedFromPulse
                && self.declared.model.is_none()
                && last.0 == touching
        };
        let kept = self.last.take().filter(alike).map(|(_, design)| TargetDesign { name: target.name, ..design });
        let made = kept.unwrap_or_else(|| design(self.context, self.declared, self.placed, target));
        &self.last.insert((touching, made)).1
    }
}

/// Which rows may teach: all, or those that a mask leaves in.
#[derive(Debug, Clone, Copy)]
pub enum Rows<'a> {
    /// Every row.
    All,
    /// Every n-th sample of a target, for quick scans.
    Every(usize),
    /// Rows for which the mask is true.
    Where(&'a [bool]),
}

/// Fits one target for given shapes.
///
/// The likelihood counts samples as independent; [`TargetFit::share`] says how many of them the colour of the residual leaves.
#[must_use]
pub fn fit_target(target: &Target, design: &TargetDesign, rows: Rows<'_>) -> Option<TargetFit> {
    let (Solution { coefficients, inverse, .. }, loglik, kept) = solve_target(target, design, rows, true)?;
    let mut residual = kept.residual(&coefficients);
    residual.iter_mut().zip(&kept.floored).for_each(|(r, v)| *r /= v.sqrt());
    if let Some((unsettled, excess)) = &kept.jumps {
        residual.iter_mut().zip(unsettled).filter(|(_, u)| **u).for_each(|(r, _)| *r /= excess.sqrt());
    }
    let rss: f64 = residual.iter().map(|r| r * r).sum();
    let share = effective_share(&residual);
    let covariance = inverse * ((rss / residual.len() as f64).max(0.01) / share);
    Some(TargetFit { coefficients, labels: design.columns.iter().map(|c| c.label).collect(), covariance, loglik, share })
}

/// What went into a fit: columns, samples less the known part, and their variances in the two views, each one value a sample.
struct Kept {
    columns: Vec<Vec<f64>>,
    y: Vec<f64>,
    floored: Vec<f64>,
    /// Which samples follow a jump of the load, and by how much worse their variance is than that of the others.
    jumps: Option<(Vec<bool>, f64)>,
}

impl Kept {
    /// Samples less the fitted columns.
    fn residual(&self, coefficients: &[f64]) -> Vec<f64> {
        let mut out = self.y.clone();
        for (column, b) in self.columns.iter().zip(coefficients) {
            out.iter_mut().zip(column).for_each(|(r, v)| *r -= v * b);
        }
        out
    }
}

/// Solves for the coefficients with levelled weights (see [`crate::noise::Noise::weight_variance`]) and counts the likelihood
/// of the mean, and that of the scatter too where `scattering` asks for it or an effect adds scatter.
fn solve_target(
    target: &Target,
    design: &TargetDesign,
    rows: Rows<'_>,
    scattering: bool,
) -> Option<(Solution, Likelihood, Kept)> {
    let stride = if let Rows::Every(n) = rows { n.max(1) } else { 1 };
    let chosen: Vec<usize> = match rows {
        Rows::Where(mask) => (0..target.rows.len()).filter(|j| mask[target.rows[*j]]).collect(),
        _ => (0..target.rows.len()).step_by(stride).collect(),
    };
    if chosen.len() < design.columns.len() + 3 {
        return None;
    }
    let gather = |values: &[f64]| -> Vec<f64> {
        if values.len() == chosen.len() {
            return values.to_vec(); // no row of the log is missing
        }
        chosen.iter().map(|j| values[target.rows[*j]]).collect()
    };
    let pick = |values: &[f64]| -> Vec<f64> { chosen.iter().map(|j| values[*j]).collect() };
    let (mut y, mut levelled, mut floored) = (pick(&target.y), pick(&target.levelled), Vec::new());
    if !design.fixed.is_empty() {
        y.iter_mut().zip(gather(&design.fixed)).for_each(|(y, f)| *y -= f);
    }
    let looks_at_scatter = scattering || !design.extra_variance.is_empty();
    if looks_at_scatter {
        floored = pick(&target.floored);
    }
    if !design.extra_variance.is_empty() {
        let extra = gather(&design.extra_variance);
        levelled.iter_mut().zip(&extra).for_each(|(v, e)| *v += e);
        floored.iter_mut().zip(&extra).for_each(|(v, e)| *v += e);
    }
    let columns: Vec<Vec<f64>> = design.columns.iter().map(|c| gather(&c.values)).collect();
    let mut kept = Kept { columns, y, floored, jumps: None };
    let mut weights: Vec<f64> = levelled.iter().map(|v| 1.0 / v).collect();
    let mut solution = Normal::of_columns(&kept.columns, &kept.y, &weights).solve()?;
    let n = chosen.len() as f64;
    let weight = target.weight * stride as f64;
    // the scale of the noise is profiled, but never below a tenth of the floor's standard deviation
    let part = |rss: f64, n: f64| {
        let scale = (rss / n).max(0.01);
        weight * (-0.5 * n * scale.ln() - 0.5 * rss / scale)
    };
    let profile = |rss: f64, log_sigma: f64| part(rss, n) - weight * log_sigma;
    let half_logs = |variances: &[f64]| 0.5 * log_product(variances);
    // after a jump of the load a static relation is off by more than the noise: those samples have a scale of their own, so that
    // they neither rule the coefficients nor drown what the others say
    let mut mean = profile(solution.rss, half_logs(&levelled));
    if !target.unsettled.is_empty() {
        let unsettled: Vec<bool> = chosen.iter().map(|j| target.unsettled[*j]).collect();
        let late = unsettled.iter().filter(|u| **u).count() as f64;
        let sums = |solution: &Solution| {
            let mut sums = (0.0, 0.0);
            for ((r, v), u) in kept.residual(&solution.coefficients).iter().zip(&levelled).zip(&unsettled) {
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
                        .iter_mut()
                        .zip(&levelled)
                        .zip(&unsettled)
                        .for_each(|((w, v), u)| *w = 1.0 / (v * if *u { excess } else { 1.0 }));
                    solution = Normal::of_columns(&kept.columns, &kept.y, &weights).solve()?;
                    found = sums(&solution);
                    excess = scales(found).max(1.0);
                }
            }
            mean = part(found.0, n - late) + part(found.1, late) - weight * half_logs(&levelled);
            kept.jumps = Some((unsettled, excess));
        }
    }
    let scatter = if looks_at_scatter {
        let rss = kept.residual(&solution.coefficients).iter().zip(&kept.floored).map(|(r, v)| r * r / v).sum();
        profile(rss, half_logs(&kept.floored))
    } else {
        mean
    };
    Some((solution, Likelihood { mean, scatter }, kept))
}

/// How much worse the variance after jumps must be for those samples to weigh less.
const WORSE: f64 = 1.5;

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

/// One over the integrated autocorrelation time of the scaled residual, in samples: 1 when white.
///
/// The autocorrelation is taken at lags 1, 2, 4, 8, ... and integrated in between until it falls below 0.05.
pub(crate) fn effective_share(residual: &[f64]) -> f64 {
    let c0: f64 = residual.iter().map(|r| r * r).sum();
    let (mut time, mut last, mut lag) = (1.0, 1.0, 1usize);
    while c0 > 0.0 && lag < residual.len() / 4 {
        let rho = residual.iter().zip(&residual[lag..]).map(|(a, b)| a * b).sum::<f64>() / c0;
        if rho < 0.05 {
            break;
        }
        let width = if lag == 1 { 1.0 } else { (lag / 2) as f64 };
        time += 2.0 * width * if lag == 1 { rho } else { 0.5 * (rho + last) };
        last = rho;
        lag *= 2;
    }
    1.0 / time
}

/// Fits every target that the effects touch; the others come from `rest`.
#[must_use]
pub fn fit(context: &Context, declared: Declared<'_>, placed: &[Placed], rest: Option<&Fit>, rows: Rows<'_>) -> Option<Fit> {
    let mut targets = Vec::with_capacity(context.targets.len());
    let mut designs = Designs::new(context, declared, placed);
    for (i, target) in context.targets.iter().enumerate() {
        let touched = placed.iter().any(|p| p.instance.touches(target.name));
        match rest {
            Some(rest) if !touched => targets.push(rest.targets[i].clone()),
            _ => targets.push(fit_target(target, designs.of(target), rows)?),
        }
    }
    Some(Fit { placed: placed.to_vec(), targets })
}

/// Log-likelihood of the touched targets only: what a search compares.
pub(crate) fn touched_loglik(
    context: &Context,
    declared: Declared<'_>,
    placed: &[Placed],
    moving: &[&str],
    rows: Rows<'_>,
    scattering: bool,
) -> f64 {
    let mut sum = 0.0;
    let mut designs = Designs::new(context, declared, placed);
    for target in context.targets.iter().filter(|t| moving.contains(&t.name)) {
        let view = scattering && target.relation == Relation::Thrust;
        match solve_target(target, designs.of(target), rows, view) {
            Some((_, loglik, _)) => sum += loglik.of(view),
            None => return f64::NEG_INFINITY,
        }
    }
    sum
}

impl Fit {
    /// Fitted parameters of the effect at `position`: shapes with standard errors from the curvature of the profile
    /// likelihood, then amplitudes with theirs. Quick enough for every candidate of a search.
    #[must_use]
    pub fn estimates(&self, context: &Context, declared: Declared<'_>, position: usize) -> Vec<Estimate> {
        self.estimates_given(context, position, self.shape_errors(context, declared, position, false))
    }

    /// The same for a report. Where the likelihood of a shape is not a parabola (an instant between two visits, an onset between
    /// two levels), its error is at least half the width over which it falls by 1.92, over 1.96. The error of an amplitude
    /// holds what the errors of the shapes make of it, and every parameter an allowance for its form.
    #[must_use]
    pub fn profiled_estimates(&self, context: &Context, declared: Declared<'_>, position: usize) -> Vec<Estimate> {
        let errors = self.shape_errors(context, declared, position, true);
        let mut out = self.estimates_given(context, position, errors.clone());
        for (i, error) in errors.iter().enumerate() {
            for (e, moved) in out[errors.len()..].iter_mut().zip(self.amplitudes_moved(context, declared, position, i, *error)) {
                e.se = e.se.hypot(moved);
            }
        }
        allow_for_the_form(context, &mut out);
        out
    }

    /// By how much the amplitudes of an effect move, in the order of [`Self::estimates`], when one of its shapes moves by its standard error.
    fn amplitudes_moved(&self, context: &Context, declared: Declared<'_>, position: usize, shape: usize, error: f64) -> Vec<f64> {
        let placed = &self.placed[position];
        let Some(range) = placed.effect.shapes(context, &placed.instance).get(shape).map(|s| s.range) else { return Vec::new() };
        let amplitudes = |sign: f64| -> Option<Vec<f64>> {
            let mut moved = self.placed.clone();
            let to = &mut moved[position].shape[shape];
            *to = (*to + sign * error).clamp(range.0, range.1);
            let fit = fit(context, declared, &moved, Some(self), Rows::All)?;
            let all = fit.estimates_given(context, position, vec![0.0; placed.shape.len()]);
            Some(all[placed.shape.len()..].iter().map(|e| e.value).collect())
        };
        match (amplitudes(1.0), amplitudes(-1.0)) {
            (Some(up), Some(down)) => up.iter().zip(&down).map(|(u, d)| 0.5 * (u - d).abs()).collect(),
            _ => Vec::new(),
        }
    }

    /// The same with the standard errors of the shapes known.
    pub(crate) fn estimates_given(&self, context: &Context, position: usize, errors: Vec<f64>) -> Vec<Estimate> {
        let p = &self.placed[position];
        let mut out = Vec::new();
        for ((shape, value), se) in p.effect.shapes(context, &p.instance).iter().zip(&p.shape).zip(errors) {
            out.push(Estimate { name: shape.name.into(), unit: shape.unit.into(), value: *value, se });
        }
        for (k, a) in p.effect.amplitudes(&p.instance).iter().enumerate() {
            for t in &self.targets {
                if let Some(j) = t.labels.iter().position(|l| *l == (Label::Effect { effect: position, amplitude: k })) {
                    let estimate = Estimate {
                        name: a.name.into(),
                        unit: a.unit.into(),
                        value: t.coefficients[j],
                        se: t.covariance[(j, j)].max(0.0).sqrt(),
                    };
                    if !out.iter().any(|e| e.name == estimate.name) {
                        out.push(estimate);
                    }
                }
            }
        }
        out
    }

    /// Standard errors of the shape parameters of one effect.
    pub(crate) fn shape_errors(&self, context: &Context, declared: Declared<'_>, position: usize, profiled: bool) -> Vec<f64> {
        let p = &self.placed[position];
        let shapes = p.effect.shapes(context, &p.instance);
        let n = p.shape.len();
        if n == 0 {
            return Vec::new();
        }
        let moving: Vec<&str> = p.instance.channels.iter().map(String::as_str).collect();
        let scattering = self.placed.iter().any(|p| p.effect.scatters());
        let value = |x: &[f64]| {
            let mut placed = self.placed.clone();
            placed[position].shape = x.to_vec();
            touched_loglik(context, declared, &placed, &moving, Rows::All, scattering)
        };
        let h: Vec<f64> =
            shapes.iter().zip(&p.shape).map(|(s, v)| (0.02 * v.abs()).max(1e-4 * (s.range.1 - s.range.0)).max(1e-9)).collect();
        let at = |moves: &[(usize, f64)]| {
            let mut x = p.shape.clone();
            for (i, d) in moves {
                x[*i] += d * h[*i];
            }
            value(&x)
        };
        let centre = at(&[]);
        let mut hessian = DMatrix::zeros(n, n);
        for i in 0..n {
            hessian[(i, i)] = -(at(&[(i, 1.0)]) - 2.0 * centre + at(&[(i, -1.0)])) / (h[i] * h[i]);
            for j in 0..i {
                let mixed = (at(&[(i, 1.0), (j, 1.0)]) - at(&[(i, 1.0), (j, -1.0)]) - at(&[(i, -1.0), (j, 1.0)])
                    + at(&[(i, -1.0), (j, -1.0)]))
                    / (4.0 * h[i] * h[j]);
                hessian[(i, j)] = -mixed;
                hessian[(j, i)] = -mixed;
            }
        }
        let share = context
            .targets
            .iter()
            .zip(&self.targets)
            .filter(|(t, _)| p.instance.touches(t.name))
            .map(|(_, f)| f.share)
            .fold(1.0, f64::min);
        hessian *= share;
        let inverse = hessian.clone().try_inverse();
        let curvature = |i: usize| match &inverse {
            Some(v) if v[(i, i)] > 0.0 => v[(i, i)].sqrt(),
            _ if hessian[(i, i)] > 0.0 => 1.0 / hessian[(i, i)].sqrt(),
            _ => shapes[i].range.1 - shapes[i].range.0,
        };
        (0..n)
            .map(|i| {
                let quick = curvature(i);
                if !profiled || shapes[i].is_nuisance() || shapes[i].range.1 <= shapes[i].range.0 {
                    return quick;
                }
                let fall = |to: f64| {
                    let mut x = p.shape.clone();
                    x[i] = to;
                    share * (centre - value(&x))
                };
                let reach = |sign: f64| {
                    let bound = if sign > 0.0 { shapes[i].range.1 - p.shape[i] } else { p.shape[i] - shapes[i].range.0 };
                    half_width(&|d| fall(p.shape[i] + sign * d), h[i], bound.max(0.0))
                };
                // a symmetric interval must hold the longer side
                quick.max(reach(1.0).max(reach(-1.0)) / 1.96)
            })
            .collect()
    }
}

/// Standard error, as a share of a parameter, that stands for the forms themselves: a quadratic load curve, a lag of first order, a
/// moving average that starts with a row are true to some half a per cent, and no number of samples makes them truer.
const FORM: f64 = 0.005;

/// Share of a row by which every delay, window and time constant is uncertain: what a signal does between two rows is a guess.
const BETWEEN_ROWS: f64 = 0.1;

/// Adds what the forms leave open to the standard errors of parameters. An instant has no form, and lies anywhere between two rows.
pub(crate) fn allow_for_the_form(context: &Context, estimates: &mut [Estimate]) {
    let row = context.duration() / context.len().max(2) as f64;
    for e in estimates {
        let form = match (e.name.as_str(), e.unit.as_str()) {
            ("t0", _) => row / 12.0_f64.sqrt(),
            (_, "s") => (FORM * e.value).hypot(BETWEEN_ROWS * row),
            _ => FORM * e.value,
        };
        e.se = e.se.hypot(form);
    }
}

/// Distance at which a log-likelihood has fallen by 1.92, at most `bound`: doubled from a small step, then halved between.
fn half_width(fall: &dyn Fn(f64) -> f64, step: f64, bound: f64) -> f64 {
    const FALL: f64 = 1.92;
    let mut outer = 0.05 * step;
    while outer < bound && fall(outer) < FALL {
        outer *= 2.0;
    }
    let mut inner = if outer <= 0.05 * step { 0.0 } else { 0.5 * outer };
    outer = outer.min(bound);
    for _ in 0..5 {
        let mid = 0.5 * (inner + outer);
        if fall(mid) < FALL { inner = mid } else { outer = mid }
    }
    outer
}
