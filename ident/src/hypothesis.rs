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
pub fn fit_target(context: &Context, target: &Target, design: &TargetDesign, rows: Rows<'_>) -> Option<TargetFit> {
    let mut kept = Vec::with_capacity(target.rows.len());
    let (solution, loglik) = solve_target(context, target, design, rows, Some(&mut kept))?;
    let Solution { coefficients, inverse, rss } = solution;
    let share = effective_share(design, &coefficients, &kept);
    let covariance = inverse * ((rss / kept.len() as f64).max(0.01) / share);
    Some(TargetFit { coefficients, labels: design.columns.iter().map(|c| c.label).collect(), covariance, loglik, share })
}

/// Row, sample and variance of what went into a fit.
type Kept = (usize, f64, f64);

/// Solves for the coefficients with levelled weights (see [`crate::noise::Noise::weight_variance`]) and counts both likelihoods.
fn solve_target(
    context: &Context,
    target: &Target,
    design: &TargetDesign,
    rows: Rows<'_>,
    kept: Option<&mut Vec<Kept>>,
) -> Option<(Solution, Likelihood)> {
    let k = design.columns.len();
    let mut normal = Normal::new(k);
    let mut row = vec![0.0; k];
    let stride = if let Rows::Every(n) = rows { n.max(1) } else { 1 };
    let mut log_levelled = 0.0;
    let mut samples: Vec<Kept> = Vec::with_capacity(target.rows.len() / stride + 1);
    for (j, i) in target.rows.iter().enumerate().step_by(stride) {
        if let Rows::Where(mask) = rows
            && !mask[*i]
        {
            continue;
        }
        let speed = if context.rpm.is_empty() { 0.0 } else { context.rpm[*i] };
        let extra = design.extra_variance.get(*i).copied().unwrap_or(0.0);
        for (r, column) in row.iter_mut().zip(&design.columns) {
            *r = column.values[*i];
        }
        let y = target.y[j] - design.fixed.get(*i).copied().unwrap_or(0.0);
        let levelled = target.noise.weight_variance(speed, LEVELLED) + extra;
        normal.add(&row, y, 1.0 / levelled);
        log_levelled += 0.5 * levelled.ln();
        samples.push((*i, y, target.noise.weight_variance(speed, FLOORED) + extra));
    }
    if normal.count < k + 3 {
        return None;
    }
    let solution = normal.solve()?;
    let n = normal.count as f64;
    let (mut rss, mut log_sigma) = (0.0, 0.0);
    if kept.is_some() || !design.extra_variance.is_empty() {
        for (i, y, variance) in &samples {
            let fitted: f64 = design.columns.iter().zip(&solution.coefficients).map(|(c, b)| c.values[*i] * b).sum();
            rss += (y - fitted).powi(2) / variance;
            log_sigma += 0.5 * variance.ln();
        }
    }
    // the scale of the noise is profiled, but never below a tenth of the floor's standard deviation
    let profile = |rss: f64, log_sigma: f64| {
        let scale = (rss / n).max(0.01);
        target.weight * stride as f64 * (-0.5 * n * scale.ln() - 0.5 * rss / scale - log_sigma)
    };
    let loglik = Likelihood { mean: profile(solution.rss, log_levelled), scatter: profile(rss, log_sigma) };
    if let Some(kept) = kept {
        *kept = samples;
    }
    Some((solution, loglik))
}

/// Share of the mean variance in the weights of the least squares: a stretch with little noise must not outvote the others
/// where a polynomial misfits.
const LEVELLED: f64 = 0.5;
/// Share of the mean variance in the likelihood: enough to keep a standing rotor's silence from counting without bound.
const FLOORED: f64 = 0.05;

/// One over the integrated autocorrelation time of the scaled residual, in samples: 1 when white.
///
/// The autocorrelation is taken at lags 1, 2, 4, 8, ... and integrated in between until it falls below 0.05.
fn effective_share(design: &TargetDesign, coefficients: &[f64], kept: &[Kept]) -> f64 {
    let residual: Vec<f64> = kept
        .iter()
        .map(|(i, y, variance)| {
            let fitted: f64 = design.columns.iter().zip(coefficients).map(|(c, b)| c.values[*i] * b).sum();
            (y - fitted) / variance.sqrt()
        })
        .collect();
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
    for (i, target) in context.targets.iter().enumerate() {
        let touched = placed.iter().any(|p| p.instance.touches(target.name));
        match rest {
            Some(rest) if !touched => targets.push(rest.targets[i].clone()),
            _ => targets.push(fit_target(context, target, &design(context, declared, placed, target), rows)?),
        }
    }
    Some(Fit { placed: placed.to_vec(), targets })
}

/// Log-likelihood of the touched targets only: what a search compares.
fn touched_loglik(
    context: &Context,
    declared: Declared<'_>,
    placed: &[Placed],
    moving: &[&str],
    rows: Rows<'_>,
    scattering: bool,
) -> f64 {
    let mut sum = 0.0;
    for target in context.targets.iter().filter(|t| moving.contains(&t.name)) {
        let view = scattering && target.relation == Relation::Thrust;
        let mut kept = Vec::new();
        match solve_target(context, target, &design(context, declared, placed, target), rows, view.then_some(&mut kept)) {
            Some((_, loglik)) => sum += loglik.of(view),
            None => return f64::NEG_INFINITY,
        }
    }
    sum
}

/// The rows stride that keeps a scan of the longest target near `most` samples.
fn scan_stride(context: &Context, most: usize) -> usize {
    context.targets.iter().map(|t| t.rows.len()).max().unwrap_or(1).div_ceil(most).max(1)
}

/// Best start of one candidate added to a fixed set: a scan of its grid.
#[must_use]
pub fn scan(
    context: &Context,
    declared: Declared<'_>,
    base: &[Placed],
    effect: &'static dyn Effect,
    instance: &Instance,
) -> Option<(Vec<f64>, f64)> {
    let shapes = effect.shapes(context, instance);
    let moving: Vec<&str> = instance.channels.iter().map(String::as_str).collect();
    let rows = Rows::Every(scan_stride(context, 4000));
    let scattering = effect.scatters() || base.iter().any(|p| p.effect.scatters());
    let before = touched_loglik(context, declared, base, &moving, rows, scattering);
    let mut best: Option<(Vec<f64>, f64)> = None;
    let total: usize = shapes.iter().map(|s| s.starts.len()).product();
    for index in 0..total {
        let mut rest = index;
        let shape: Vec<f64> = shapes
            .iter()
            .map(|s| {
                let v = s.starts[rest % s.starts.len()];
                rest /= s.starts.len();
                v
            })
            .collect();
        let mut placed = base.to_vec();
        placed.push(Placed { effect, instance: instance.clone(), shape: shape.clone() });
        let gain = touched_loglik(context, declared, &placed, &moving, rows, scattering) - before;
        if gain.is_finite() && best.as_ref().is_none_or(|b| gain > b.1) {
            best = Some((shape, gain));
        }
    }
    best
}

/// Improves the shapes of a hypothesis together (Nelder-Mead within the plausible ranges): those of its newest effect and of
/// every effect that shares a channel with it, directly or through others. The rest is independent of them.
#[must_use]
pub fn refine_newest(
    context: &Context,
    declared: Declared<'_>,
    placed: &[Placed],
    rows: Rows<'_>,
    evaluations: usize,
) -> Vec<Placed> {
    let Some(newest) = placed.len().checked_sub(1) else { return Vec::new() };
    refine_group(context, declared, placed, &connected(placed, newest), rows, evaluations)
}

/// Improves all shapes of a hypothesis, each group of effects that share channels on its own.
#[must_use]
pub fn refine(context: &Context, declared: Declared<'_>, placed: &[Placed], rows: Rows<'_>, evaluations: usize) -> Vec<Placed> {
    let mut out = placed.to_vec();
    let mut done = vec![false; placed.len()];
    for k in 0..placed.len() {
        if !done[k] {
            let group = connected(placed, k);
            out = refine_group(context, declared, &out, &group, rows, evaluations);
            for g in group {
                done[g] = true;
            }
        }
    }
    out
}

/// Positions that share channels with position `k`, directly or through others.
pub(crate) fn connected(placed: &[Placed], k: usize) -> Vec<usize> {
    let mut group = vec![k];
    let mut at = 0;
    while at < group.len() {
        for (j, p) in placed.iter().enumerate() {
            if !group.contains(&j) && p.instance.channels.iter().any(|c| placed[group[at]].instance.touches(c)) {
                group.push(j);
            }
        }
        at += 1;
    }
    group.sort_unstable();
    group
}

fn refine_group(
    context: &Context,
    declared: Declared<'_>,
    placed: &[Placed],
    group: &[usize],
    rows: Rows<'_>,
    evaluations: usize,
) -> Vec<Placed> {
    let ranges: Vec<(f64, f64)> = placed.iter().flat_map(|p| p.effect.shapes(context, &p.instance)).map(|s| s.range).collect();
    let start: Vec<f64> = placed.iter().flat_map(|p| p.shape.iter().copied()).collect();
    let owner: Vec<usize> = placed.iter().enumerate().flat_map(|(k, p)| std::iter::repeat_n(k, p.shape.len())).collect();
    let free: Vec<usize> = (0..start.len()).filter(|i| ranges[*i].1 > ranges[*i].0 && group.contains(&owner[*i])).collect();
    if free.is_empty() {
        return placed.to_vec();
    }
    let moving = touched_by_shapes(placed, group);
    let scattering = placed.iter().any(|p| p.effect.scatters());
    let cost = |x: &[f64]| -> f64 {
        let mut full = start.clone();
        for (i, v) in free.iter().zip(x) {
            full[*i] = v.clamp(ranges[*i].0, ranges[*i].1);
        }
        // a soft wall keeps the simplex inside the plausible box
        let wall: f64 = free.iter().zip(x).map(|(i, v)| ((v - full[*i]) / (ranges[*i].1 - ranges[*i].0)).abs()).sum();
        -touched_loglik(context, declared, &with_shapes(placed, &full), &moving, rows, scattering) + 1e3 * wall
    };
    let x0: Vec<f64> = free.iter().map(|i| start[*i]).collect();
    let steps: Vec<f64> = free
        .iter()
        .map(|i| (0.15 * start[*i].abs()).max(0.01 * (ranges[*i].1 - ranges[*i].0)).min(0.2 * (ranges[*i].1 - ranges[*i].0)))
        .collect();
    let best = nelder_mead(&cost, &x0, &steps, evaluations);
    let mut full = start.clone();
    for (i, v) in free.iter().zip(&best) {
        full[*i] = v.clamp(ranges[*i].0, ranges[*i].1);
    }
    with_shapes(placed, &full)
}

fn touched_by_shapes<'p>(placed: &'p [Placed], group: &[usize]) -> Vec<&'p str> {
    let moved = group.iter().map(|k| &placed[*k]).filter(|p| !p.shape.is_empty());
    let mut out: Vec<&str> = moved.flat_map(|p| p.instance.channels.iter().map(String::as_str)).collect();
    out.sort_unstable();
    out.dedup();
    out
}

fn with_shapes(placed: &[Placed], full: &[f64]) -> Vec<Placed> {
    let mut at = 0;
    placed
        .iter()
        .map(|p| {
            let shape = full[at..at + p.shape.len()].to_vec();
            at += p.shape.len();
            Placed { shape, ..p.clone() }
        })
        .collect()
}

fn nelder_mead(cost: &dyn Fn(&[f64]) -> f64, x0: &[f64], steps: &[f64], evaluations: usize) -> Vec<f64> {
    let n = x0.len();
    let mut simplex: Vec<(Vec<f64>, f64)> = vec![(x0.to_vec(), cost(x0))];
    for i in 0..n {
        let mut x = x0.to_vec();
        x[i] += steps[i];
        let c = cost(&x);
        simplex.push((x, c));
    }
    let mut used = n + 1;
    while used < evaluations {
        simplex.sort_by(|a, b| a.1.total_cmp(&b.1));
        if simplex[n].1 - simplex[0].1 < 1e-5 {
            break;
        }
        let centre: Vec<f64> = (0..n).map(|j| simplex[..n].iter().map(|s| s.0[j]).sum::<f64>() / n as f64).collect();
        let along = |k: f64| -> Vec<f64> { (0..n).map(|j| centre[j] + k * (simplex[n].0[j] - centre[j])).collect() };
        let reflected = along(-1.0);
        let c = cost(&reflected);
        used += 1;
        if c < simplex[0].1 {
            let expanded = along(-2.0);
            let e = cost(&expanded);
            used += 1;
            simplex[n] = if e < c { (expanded, e) } else { (reflected, c) };
        } else if c < simplex[n - 1].1 {
            simplex[n] = (reflected, c);
        } else {
            let inside = along(if c < simplex[n].1 { -0.5 } else { 0.5 });
            let i = cost(&inside);
            used += 1;
            if i < simplex[n].1.min(c) {
                simplex[n] = (inside, i);
            } else {
                let best = simplex[0].0.clone();
                for s in simplex.iter_mut().skip(1) {
                    for (v, b) in s.0.iter_mut().zip(&best) {
                        *v = b + 0.5 * (*v - b);
                    }
                    s.1 = cost(&s.0);
                    used += 1;
                }
            }
        }
    }
    simplex.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).map_or_else(|| x0.to_vec(), |s| s.0)
}

impl Fit {
    /// Fitted parameters of the effect at `position`: shapes with standard errors from the curvature of the profile
    /// likelihood, then amplitudes with theirs.
    #[must_use]
    pub fn estimates(&self, context: &Context, declared: Declared<'_>, position: usize) -> Vec<Estimate> {
        let p = &self.placed[position];
        let mut out = Vec::new();
        let errors = self.shape_errors(context, declared, position);
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
    fn shape_errors(&self, context: &Context, declared: Declared<'_>, position: usize) -> Vec<f64> {
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
        (0..n)
            .map(|i| match &inverse {
                Some(v) if v[(i, i)] > 0.0 => v[(i, i)].sqrt(),
                _ if hessian[(i, i)] > 0.0 => 1.0 / hessian[(i, i)].sqrt(),
                _ => shapes[i].range.1 - shapes[i].range.0,
            })
            .collect()
    }
}
