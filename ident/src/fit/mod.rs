//! A hypothesis: the declared model and a set of effects, fitted jointly.
//!
//! What it is: separable least squares. For given shape parameters each target is a linear problem; the shapes are searched
//! by the profile likelihood over all targets that the effects touch.
//! What can go wrong: a shape that ends on its bound, or an implausible amplitude, disqualifies the hypothesis.
//! Units: log-likelihood in nats; parameters in the units that the effects state.
//! Reference: Golub & Pereyra 1973; Nelder & Mead 1965; profile likelihood, Barndorff-Nielsen & Cox 1994, section 3.4.

mod agreed;
pub mod heldout;
pub(crate) mod remembered;
pub(crate) mod samples;
pub mod search;
mod sizes;
mod written;

use crate::channel::{Context, Relation, Target};
use crate::effects::Estimate;
use crate::effects::design::{Label, TargetDesign, covariance};
use crate::effects::placed::Placed;
use crate::effects::steps::Steps;
use crate::fit::agreed::{Agreed, contrast_of};
use crate::fit::samples::{Known, Samples, Taught};
use crate::fit::sizes::Sizes;
use crate::model::Declared;
use crate::numeric::solve::Solution;
use crate::signal::colour::effective_share;
use nalgebra::DMatrix;
use std::sync::Arc;

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
    /// What is left over of each sample, scaled by its noise.
    pub left: Arc<[f64]>,
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
    Steps::default().apply(context, placed, plain(context, declared, target))
}

/// The design of one target without effects.
pub(crate) fn plain(context: &Context, declared: Declared<'_>, target: &Target) -> TargetDesign {
    match declared.model {
        None => TargetDesign::baseline(context, target.name, target.relation),
        Some(model) => model.pinned(context, target),
    }
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
        self.after(target, &mut Steps::default())
    }

    /// The same, made from what the target's last design went through.
    pub(crate) fn after(&mut self, target: &Target, steps: &mut Steps) -> &TargetDesign {
        let touching: Vec<bool> = self.placed.iter().map(|p| p.instance.touches(target.name)).collect();
        let alike = |last: &(Vec<bool>, TargetDesign)| {
            last.1.relation == Relation::SpeedFromPulse
                && target.relation == Relation::SpeedFromPulse
                && self.declared.model.is_none()
                && last.0 == touching
        };
        let kept = self.last.take().filter(alike).map(|(_, design)| TargetDesign { name: target.name, ..design });
        let made = kept.unwrap_or_else(|| {
            let design = steps.plain(|| plain(self.context, self.declared, target));
            steps.apply(self.context, self.placed, design)
        });
        &self.last.insert((touching, made)).1
    }

    /// Fits the target at a position, with what its contrast says of the amplitudes that they share.
    pub(crate) fn fit(&mut self, k: usize, rows: Rows<'_>) -> Option<TargetFit> {
        self.fit_part(k, rows, None)
    }

    /// The same on a part of the rows, with what the `whole` of them says of how large the effects are.
    pub(crate) fn fit_part(&mut self, k: usize, rows: Rows<'_>, whole: Option<&Fit>) -> Option<TargetFit> {
        let agreed = self.agreed(k, rows);
        let target = &self.context.targets[k];
        let design = self.of(target);
        let sizes = whole.map(|whole| Sizes::of(target, design, &whole.targets[k]));
        fit_with(target, design, rows, Known { agreed: agreed.as_ref(), sizes: sizes.as_ref() })
    }

    fn agreed(&mut self, k: usize, rows: Rows<'_>) -> Option<Agreed> {
        let contrast = &self.context.targets[contrast_of(self.context, self.placed, &self.context.targets[k])?];
        Samples::new(contrast, rows, self.context.len()).say(self.of(contrast))
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
    fit_with(target, design, rows, Known::default())
}

fn fit_with(target: &Target, design: &TargetDesign, rows: Rows<'_>, known: Known<'_>) -> Option<TargetFit> {
    let log_rows = design.columns.first().map_or(design.fixed.len(), |c| c.values.len());
    let samples = Samples::new(target, rows, log_rows);
    let (Solution { coefficients, inverse, .. }, loglik, kept) = samples.solve(design, true, known)?;
    let mut residual = kept.residual(&coefficients);
    residual.iter_mut().zip(&kept.floored).for_each(|(r, v)| *r /= v.sqrt());
    if let Some((unsettled, excess)) = &kept.jumps {
        residual.iter_mut().zip(unsettled.iter()).filter(|(_, u)| **u).for_each(|(r, _)| *r /= excess.sqrt());
    }
    let rss: f64 = residual.iter().map(|r| r * r).sum();
    let share = effective_share(&residual);
    let times = (rss / residual.len() as f64).max(0.01) / share;
    let labels = || design.columns.iter().map(|c| c.label);
    let covariance = covariance(target.relation, labels(), inverse, (samples.unit(), times));
    Some(TargetFit { coefficients, labels: labels().collect(), covariance, loglik, share, left: residual.into() })
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
            _ => targets.push(designs.fit(i, rows)?),
        }
    }
    Some(Fit { placed: placed.to_vec(), targets })
}

/// An amplitude with a shape a standard error higher, and lower.
struct Moved {
    up: f64,
    down: f64,
}

/// Standard errors from nothing at which an amplitude has its sign for sure: a hundredth more than an interval of 95 % holds.
const SIGNED: f64 = 2.0;

impl Moved {
    /// The standard error of an amplitude that this shape widens.
    fn widen(&self, e: &Estimate) -> f64 {
        let all = e.se.hypot(0.5 * (self.up - self.down));
        let signed = e.value.abs() >= SIGNED * e.se && [self.up, self.down].iter().all(|moved| moved * e.value > 0.0);
        if signed { all.min(e.value.abs() / SIGNED) } else { all }
    }
}

/// Whether every shape lies within its range, and every effect makes physical sense.
pub(crate) fn plausible(context: &Context, declared: Declared<'_>, fit: &Fit) -> bool {
    (0..fit.placed.len()).all(|k| is_plausible(context, declared, fit, k))
}

/// Whether the effect at a position of a fit makes physical sense and none of its shapes lies on a bound.
pub(crate) fn is_plausible(context: &Context, declared: Declared<'_>, fit: &Fit, k: usize) -> bool {
    fit.placed.get(k).is_none_or(|p| {
        let inside = p.effect.shapes(context, &p.instance).iter().zip(&p.shape).all(|(s, v)| {
            let margin = 1e-3 * (s.range.1 - s.range.0);
            s.is_nuisance() || s.range.1 <= s.range.0 || (*v > s.range.0 - margin && *v < s.range.1 - margin)
        });
        let errors = || {
            if p.effect.judges_shape_errors() {
                fit.shape_errors(context, declared, k, false)
            } else {
                vec![f64::NAN; p.shape.len()]
            }
        };
        inside && p.effect.plausible(context, &p.instance, &fit.estimates_given(context, k, errors()))
    })
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
    /// holds what the errors of the shapes make of it, and every parameter an allowance for its form. One that has its sign whatever the
    /// shapes are does not lose it in its interval.
    #[must_use]
    pub fn profiled_estimates(&self, context: &Context, declared: Declared<'_>, position: usize) -> Vec<Estimate> {
        let errors = self.shape_errors(context, declared, position, true);
        let mut out = self.estimates_given(context, position, errors.clone());
        for (i, error) in errors.iter().enumerate() {
            for (e, moved) in out[errors.len()..].iter_mut().zip(self.amplitudes_moved(context, declared, position, i, *error)) {
                e.se = moved.widen(e);
            }
        }
        allow_for_the_form(context, &mut out);
        out
    }

    /// Where the amplitudes of an effect move, in the order of [`Self::estimates`], when one of its shapes moves by its standard error.
    fn amplitudes_moved(
        &self,
        context: &Context,
        declared: Declared<'_>,
        position: usize,
        shape: usize,
        error: f64,
    ) -> Vec<Moved> {
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
            (Some(up), Some(down)) => up.into_iter().zip(down).map(|(up, down)| Moved { up, down }).collect(),
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
        let taught = Taught::new(context, declared, Rows::All);
        let of_colour = |name: &str| context.target(name).map_or(1.0, |k| self.targets[k].share);
        let least = moving.iter().map(|name| of_colour(name)).fold(1.0, f64::min);
        let value = |x: &[f64]| {
            let mut placed = self.placed.clone();
            placed[position].shape = x.to_vec();
            let known = placed[position].prior(context);
            if context.against_model {
                // speeds are coloured by what the model leaves over of them, and a load cell that knows the shape is not
                return known
                    + moving.iter().map(|name| of_colour(name) * taught.loglik(&placed, &[name], scattering)).sum::<f64>();
            }
            known + least * taught.loglik(&placed, &moving, scattering)
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
                    centre - value(&x)
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

/// What an effect adds to the prediction of a target, on its rows, all other coefficients as they are.
pub(crate) fn part_of(context: &Context, declared: Declared<'_>, fit: &Fit, k: usize, target: usize) -> Vec<f64> {
    let (of, fitted) = (&context.targets[target], &fit.targets[target]);
    let whole = Designs::new(context, declared, &fit.placed).of(of).predict(&fitted.coefficients, context.len());
    let mut others = fit.placed.clone();
    others.remove(k);
    let mut designs = Designs::new(context, declared, &others);
    let design = designs.of(of);
    let as_before = |label: Label| match label {
        Label::Effect { effect, amplitude } if effect >= k => Label::Effect { effect: effect + 1, amplitude },
        other => other,
    };
    let coefficient = |label: Label| {
        let at = fitted.labels.iter().position(|l| *l == as_before(label));
        at.map_or(0.0, |at| fitted.coefficients[at])
    };
    let coefficients: Vec<f64> = design.columns.iter().map(|c| coefficient(c.label)).collect();
    let rest = design.predict(&coefficients, context.len());
    of.rows.iter().map(|row| whole[*row] - rest[*row]).collect()
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

/// Estimates as a reader has them: a reading is of any instant of its row, or of all of it, and no log says which. So no delay, window or time
/// constant is known better than that. Another run of the same logger has its readings at the same instants: predictions do not ask for this.
pub(crate) fn anywhere_in_a_row(context: &Context, mut estimates: Vec<Estimate>) -> Vec<Estimate> {
    let spread = context.duration() / context.len().max(2) as f64 / 12.0_f64.sqrt();
    estimates.iter_mut().filter(|e| e.unit == "s" && e.name != "t0").for_each(|e| e.se = e.se.hypot(spread));
    estimates
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

#[cfg(test)]
mod tests {
    use super::*;

    fn known_to(se: f64) -> Estimate {
        Estimate { name: "derate".into(), unit: "1/A2".into(), value: 6.0, se }
    }

    #[test]
    fn an_amplitude_keeps_the_sign_that_it_has_for_every_shape() {
        // twice as large with a shape that may be twice as long, and never nothing
        let moved = Moved { up: 13.0, down: 3.0 };
        let se = moved.widen(&known_to(0.5));
        assert!(se > 2.9 && 6.0 - 1.96 * se > 0.0, "{se}");
        let again = moved.widen(&known_to(se));
        assert!(6.0 - 1.96 * again > 0.0, "{again}");
        // one that a shape turns round has no sign, nor has one that is nothing anyway
        assert!(6.0 - 1.96 * Moved { up: 13.0, down: -1.0 }.widen(&known_to(0.5)) < 0.0);
        assert!(6.0 - 1.96 * moved.widen(&known_to(4.0)) < 0.0);
        // a shape that matters little widens as errors do
        assert!((Moved { up: 6.3, down: 5.7 }.widen(&known_to(0.4)) - 0.5).abs() < 1e-12);
    }
}
