//! The samples that a fit learns from, and what a design makes of them.
//!
//! What it is: a target's samples, their variances and weights, gathered once; any number of designs are then solved on them. A search
//! asks thousands of designs of the same samples.
//! What can go wrong: fewer samples than columns and three give no fit.
//! Units: log-likelihood in nats; samples in the unit of their channel.
//! Reference: separable least squares, Golub & Pereyra 1973.

use crate::channel::powers::Values;
use crate::channel::{Context, Relation, Target};
use crate::effects::design::TargetDesign;
use crate::effects::placed::Placed;
use crate::effects::steps::Steps;
use crate::fit::agreed::{Agreed, contrast_of};
use crate::fit::sizes::Sizes;
use crate::fit::{Designs, Likelihood, Rows};
use crate::model::Declared;
use crate::numeric::solve::{Normal, Solution, dot};
use std::borrow::Cow;
use std::cell::{OnceCell, RefCell};
use std::sync::Arc;

/// How much worse the variance after jumps must be for those samples to weigh less.
const WORSE: f64 = 1.5;

/// What is known of the amplitudes of effects beside the samples.
#[derive(Clone, Copy, Default)]
pub(crate) struct Known<'k> {
    /// What another reading of the same effects has said.
    pub(crate) agreed: Option<&'k Agreed>,
    /// How large they are on the whole run.
    pub(crate) sizes: Option<&'k Sizes>,
}

impl Known<'_> {
    fn tell(self, design: &TargetDesign, normal: &mut Normal) {
        if let Some(agreed) = self.agreed {
            agreed.tell(design, normal);
        }
        if let Some(sizes) = self.sizes {
            sizes.tell(design, normal);
        }
    }
}

/// The samples of one target that teach.
pub(crate) struct Samples<'c> {
    target: &'c Target,
    /// Samples that each of these stands for.
    stride: usize,
    /// Their positions among the target's samples.
    chosen: Vec<usize>,
    /// Whether every row of the log holds a sample and may teach, so that a column of the log is one of samples.
    whole: bool,
    y: Cow<'c, [f64]>,
    levelled: Cow<'c, [f64]>,
    /// One over `levelled`.
    weights: Vec<f64>,
    /// Half the sum of the logarithms of `levelled`.
    half_logs: f64,
    /// Sum of the weighted squares of `y`.
    squares: f64,
    /// Which of them follow a jump of the load; empty where the target does not tell.
    unsettled: Vec<bool>,
    /// The same as positions.
    late: Vec<usize>,
    /// The columns of the last design: most of the next one's are the same.
    products: RefCell<Vec<Product>>,
}

/// A column on the samples, and its weighted products.
struct Product {
    /// The column on all rows of the log.
    column: Values,
    values: Values,
    weighted: Vec<f64>,
    with_y: f64,
    /// With itself and with those before it in the last design: over all samples, and over the unsettled ones.
    with_others: Vec<(Values, [f64; 2])>,
    /// Values, weighted values and product with `y` over the unsettled samples.
    late: (Vec<f64>, Vec<f64>, f64),
}

/// What went into a fit: columns, samples less the known part, and their variances in the two views, each one value a sample.
pub(crate) struct Kept<'d> {
    columns: Vec<Values>,
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
        let (y, weights) = (pick(&target.y), levelled.iter().map(|v| 1.0 / v).collect::<Vec<f64>>());
        let unsettled =
            if target.unsettled.is_empty() { Vec::new() } else { chosen.iter().map(|j| target.unsettled[*j]).collect() };
        Self {
            target,
            stride,
            squares: y.iter().zip(&weights).map(|(v, w)| w * v * v).sum(),
            y,
            weights,
            half_logs: 0.5 * log_product(&levelled),
            levelled,
            late: (0..unsettled.len()).filter(|i| unsettled[*i]).collect(),
            unsettled,
            products: RefCell::default(),
            whole: target.rows.len() == log_rows && !matches!(rows, Rows::Where(_)),
            chosen,
        }
    }

    /// What they say of the amplitudes of a contrast's effects.
    pub(crate) fn say(&self, contrast: &TargetDesign) -> Option<Agreed> {
        let (solution, ..) = self.solve(contrast, false, Known::default())?;
        Some(Agreed::of(contrast, &solution, self.chosen.len(), self.target.least_scale()))
    }

    /// What a row weighs of which every so many are taken: what is known before any run must not count for more beside fewer of them.
    pub(crate) fn unit(&self) -> f64 {
        1.0 / self.stride as f64
    }

    /// Of one value a row of the log those of the samples.
    fn gather<'d>(&self, values: &'d [f64]) -> Cow<'d, [f64]> {
        match self.stride {
            1 if self.whole => Cow::Borrowed(values),
            n if self.whole => values.chunks(n).map(|chunk| chunk[0]).collect(),
            _ => self.chosen.iter().map(|j| values[self.target.rows[*j]]).collect(),
        }
    }

    /// Of one value a sample those of the unsettled ones.
    fn of_late(&self, values: &[f64]) -> Vec<f64> {
        self.late.iter().map(|i| values[*i]).collect()
    }

    /// The columns of a design on the samples and the normal equations with `y` of all of them and of the unsettled ones. Columns that
    /// stood in the last design bring their products along.
    fn equations(&self, design: &TargetDesign) -> (Vec<Values>, [Normal; 2]) {
        let y = self.of_late(&self.y);
        let mut products = self.products.borrow_mut();
        let mut last = std::mem::take(&mut *products);
        for column in &design.columns {
            let old = last.iter().position(|k| Arc::ptr_eq(&k.column, &column.values)).map(|k| last.swap_remove(k));
            let mut own = old.unwrap_or_else(|| {
                let values = self.of_samples(&column.values);
                let weighted: Vec<f64> = values.iter().zip(&self.weights).map(|(a, w)| a * w).collect();
                let with_y = dot(&weighted, &self.y);
                let (late, late_weighted) = (self.of_late(&values), self.of_late(&weighted));
                let late_with_y = dot(&late_weighted, &y);
                let late = (late, late_weighted, late_with_y);
                Product { column: column.values.clone(), values, weighted, with_y, with_others: Vec::new(), late }
            });
            let product = |other: &Product| {
                let old = own.with_others.iter().find(|(of, _)| Arc::ptr_eq(of, &other.column));
                let new = || [dot(&own.weighted, &other.values), dot(&own.late.1, &other.late.0)];
                (other.column.clone(), old.map_or_else(new, |o| o.1))
            };
            own.with_others = products.iter().chain([&own]).map(product).collect();
            products.push(own);
        }
        let of_all = products.iter().map(|k| (k.with_others.iter().map(|o| o.1[0]), k.with_y));
        let whole = Normal::of_products(of_all, self.squares, self.y.len());
        let of_late = products.iter().map(|k| (k.with_others.iter().map(|o| o.1[1]), k.late.2));
        let squares = self.late.iter().map(|i| self.weights[*i] * self.y[*i] * self.y[*i]).sum();
        let late = Normal::of_products(of_late, squares, self.late.len());
        (products.iter().map(|k| k.values.clone()).collect(), [whole, late])
    }

    /// A column on the samples.
    fn of_samples(&self, column: &Values) -> Values {
        match self.gather(column) {
            Cow::Borrowed(_) => column.clone(),
            Cow::Owned(values) => Arc::new(values),
        }
    }

    /// Solves for the coefficients with levelled weights (see [`crate::signal::noise::Noise::weight_variance`]) and counts the likelihood
    /// of the mean, and that of the scatter too where `scattering` asks for it or an effect adds scatter.
    /// What else is known of the amplitudes is `known`.
    pub(crate) fn solve<'d>(
        &'d self,
        design: &'d TargetDesign,
        scattering: bool,
        known: Known<'_>,
    ) -> Option<(Solution, Likelihood, Kept<'d>)> {
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
        let (columns, [mut normal, late]) = if design.fixed.is_empty() && design.extra_variance.is_empty() {
            self.equations(design)
        } else {
            let columns: Vec<_> = design.columns.iter().map(|c| self.of_samples(&c.values)).collect();
            let of_late: Vec<_> = columns.iter().map(|c| self.of_late(c)).collect();
            let late = Normal::of_columns(&of_late, &self.of_late(&y), &self.of_late(&weights));
            let whole = Normal::of_columns(&columns, &y, &weights);
            (columns, [whole, late])
        };
        design.expect(&mut normal, self.unit());
        known.tell(design, &mut normal);
        let mut kept = Kept { columns, y, floored, jumps: None };
        let mut solution = normal.solve()?;
        let n = self.chosen.len() as f64;
        let weight = self.target.weight * self.stride as f64;
        // the scale of the noise is profiled, but never below a tenth of the floor's standard deviation
        let least = self.target.least_scale();
        let part = |rss: f64, n: f64| {
            let scale = (rss / n).max(least);
            weight * (-0.5 * n * scale.ln() - 0.5 * rss / scale)
        };
        let profile = |rss: f64, log_sigma: f64| part(rss, n) - weight * log_sigma;
        // after a jump of the load a static relation is off by more than the noise: those samples have a scale of their own, so that
        // they neither rule the coefficients nor drown what the others say
        let mut mean = profile(solution.rss, half_logs);
        if !self.late.is_empty() {
            let count = self.late.len() as f64;
            let calm = normal.less(&late, 1.0);
            let sums = |s: &Solution| (calm.left_by(&s.coefficients), late.left_by(&s.coefficients));
            let scales = |(calm, after): (f64, f64)| (after / count).max(0.01) / (calm / (n - count).max(1.0)).max(0.01);
            let mut found = sums(&solution);
            if count >= 3.0 && n - count > kept.columns.len() as f64 + 3.0 {
                let mut excess = scales(found).max(1.0);
                if excess > WORSE {
                    for _ in 0..ROUNDS {
                        let before = excess;
                        solution = normal.less(&late, 1.0 - 1.0 / excess).solve()?;
                        found = sums(&solution);
                        excess = scales(found).max(1.0);
                        if (excess / before).ln().abs() < 0.1 {
                            break;
                        }
                    }
                }
                kept.jumps = Some((&self.unsettled, excess));
                mean = part(found.0, n - count) + part(found.1, count) - weight * half_logs;
            }
        }
        if !self.target.trust.is_empty() {
            let of = self.tamed(&kept, &solution.coefficients, &weights);
            let count = self.late.len() as f64;
            let sums = if kept.jumps.is_some() { part(of.0, n - count) + part(of.1, count) } else { part(of.0 + of.1, n) };
            mean = sums - weight * half_logs;
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

/// Squared deviations, in variances, from which on a sample against a declared model counts by their logarithm.
const TAME: f64 = 25.0;

impl Samples<'_> {
    /// Weighted squares of what is left, of the calm samples and of those after jumps, each tamed: against a declared model a few rows of which a
    /// form says nothing (a rotor that stops) must not outvote the run. Cauchy's loss, Huber & Ronchetti 2009, section 4.8.
    fn tamed(&self, kept: &Kept<'_>, coefficients: &[f64], weights: &[f64]) -> (f64, f64) {
        let residual = kept.residual(coefficients);
        let loss = |i: usize| TAME * (residual[i] * residual[i] * weights[i] / TAME).ln_1p();
        let all: f64 = (0..residual.len()).map(loss).sum();
        let late: f64 = self.late.iter().map(|i| loss(*i)).sum();
        (all - late, late)
    }
}

/// The samples of every target, gathered when first asked for: one for all hypotheses of a search.
pub(crate) struct Taught<'c> {
    context: &'c Context,
    declared: Declared<'c>,
    rows: Rows<'c>,
    samples: Vec<OnceCell<Samples<'c>>>,
    /// For each target how its last design came about.
    steps: RefCell<Vec<Steps>>,
}

impl<'c> Taught<'c> {
    /// Those of the rows that may teach.
    pub(crate) fn new(context: &'c Context, declared: Declared<'c>, rows: Rows<'c>) -> Self {
        let samples: Vec<_> = context.targets.iter().map(|_| OnceCell::new()).collect();
        let steps = RefCell::new(samples.iter().map(|_| Steps::default()).collect());
        Self { context, declared, rows, samples, steps }
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
        let agreed = contrast_of(self.context, designs.placed, target).and_then(|k| self.agreed(k, designs));
        let design = designs.after(target, &mut self.steps.borrow_mut()[k]);
        let known = Known { agreed: agreed.as_ref(), sizes: None };
        self.of(k).solve(design, view, known).map(|(_, loglik, _)| loglik.of(view))
    }

    fn agreed(&self, contrast: usize, designs: &mut Designs<'_>) -> Option<Agreed> {
        let design = designs.after(&self.context.targets[contrast], &mut self.steps.borrow_mut()[contrast]);
        self.of(contrast).say(design)
    }

    fn of(&self, k: usize) -> &Samples<'c> {
        self.samples[k].get_or_init(|| Samples::new(&self.context.targets[k], self.rows, self.context.len()))
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

/// Most rounds of weighting the samples after jumps by how badly they are predicted; a rotor that runs down bends the curves of
/// the first ones.
const ROUNDS: usize = 12;

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

#[cfg(test)]
mod tests {
    use crate::channel::Context;
    use crate::close::close;
    use crate::fit::{Rows, fit};
    use crate::log::{Column, Log};
    use crate::model::Declared;

    /// A rig on levels; three rows of the thrust are off by as much as is said.
    fn log(off: f64) -> Log {
        let wave = |i: usize, k: f64| (k * (i * i) as f64).sin();
        let pulse: Vec<f64> = (0..1500).map(|i| 1150.0 + (i / 40 * 37 % 50) as f64 * 14.0).collect();
        let rpm: Vec<f64> = pulse.iter().enumerate().map(|(i, p)| 6.0 * (p - 1000.0) + 2.0 * wave(i, 0.7)).collect();
        let wrong = |i: usize| if [700, 701, 702].contains(&i) { off } else { 0.0 };
        let thrust = rpm.iter().enumerate().map(|(i, r)| 0.25e-6 * r * r + 0.01 * wave(i, 1.3) + wrong(i)).collect();
        let columns = [("pulse_us", pulse), ("rpm", rpm), ("thrust_n", thrust)];
        let columns = columns.into_iter().map(|(name, values)| Column { name: name.to_owned(), values }).collect();
        Log { name: "day.csv".to_owned(), t: (0..1500).map(|i| 0.05 * f64::from(i)).collect(), columns, ..Log::default() }
    }

    #[test]
    fn three_rows_do_not_outvote_a_run_against_its_model() {
        let model = close(&log(0.0), None, &[], &mut |_| {}).expect("a healthy day").model;
        let likelihood = |off: f64| {
            let mut context = Context::of_clean(&log(off), Some(model.start_pulse_us));
            let declared = Declared { model: Some(&model) };
            context.against(declared);
            let thrust = context.target("thrust_n").expect("a load cell");
            fit(&context, declared, &[], None, Rows::All).expect("a fit").targets[thrust].loglik.mean
        };
        let (as_ever, off, further) = (likelihood(0.0), likelihood(3.0), likelihood(300.0));
        assert!(as_ever - off > 30.0 && as_ever - off < 1500.0, "{as_ever} {off}");
        assert!(off > further && off - further < 1000.0, "{off} {further}");
    }
}
