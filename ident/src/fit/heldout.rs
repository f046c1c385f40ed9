//! Errors on rows that the fit did not see.
//!
//! What it is: five contiguous time blocks, and every second interior plateau level, each left out in turn. Of the whole run a fold knows how
//! large each effect is, and nothing else: what its rows do not show of an effect is then no more than was found, in place of anything.
//! What can go wrong: a fold that leaves too little to fit is skipped; its rows then do not count.
//! Units: the channel's.
//! Reference: specification `formats.md` (`heldout_rms`); blocked cross-validation, Roberts et al. 2017, Ecography 40:913.

use crate::channel::{Context, Target};
use crate::effects::placed::Placed;
use crate::fit::search::{refine, refine_group, unfelt_stay};
use crate::fit::{Designs, Fit, Rows};
use crate::model::Declared;

/// For each fold the rows that are left out.
#[must_use]
pub fn folds(context: &Context) -> Vec<Vec<bool>> {
    let n = context.len();
    let (t0, span) = (context.t.first().copied().unwrap_or(0.0), context.duration().max(1e-9));
    let mut out: Vec<Vec<bool>> =
        (0..5).map(|k| context.t.iter().map(|t| (((t - t0) / span * 5.0) as usize).min(4) == k).collect()).collect();
    let levels = levels(context);
    let last = levels.iter().copied().flatten().max().unwrap_or(0);
    let odd: Vec<bool> = (0..n).map(|i| levels[i].is_some_and(|l| l > 0 && l < last && l % 2 == 1)).collect();
    if odd.iter().any(|o| *o) {
        out.push(odd);
    }
    out
}

/// Index of the load level that each row belongs to, from low to high; `None` in between.
fn levels(context: &Context) -> Vec<Option<usize>> {
    let (signal, tolerance): (&[f64], f64) = match &context.pulse {
        Some(p) => (p, 3.0),
        None => (&context.rpm, 0.015 * context.rpm.iter().copied().fold(0.0, f64::max)),
    };
    let mut out = vec![None; context.len()];
    if signal.is_empty() {
        return out;
    }
    let mut stretches: Vec<(f64, usize, usize)> =
        context.steady.iter().map(|(a, b)| (signal[*a..*b].iter().sum::<f64>() / (b - a) as f64, *a, *b)).collect();
    stretches.sort_by(|x, y| x.0.total_cmp(&y.0));
    let (mut level, mut anchor) = (0, f64::NEG_INFINITY);
    for (k, (value, a, b)) in stretches.iter().enumerate() {
        if k > 0 && value - anchor > tolerance {
            level += 1;
            anchor = *value;
        } else if k == 0 {
            anchor = *value;
        }
        out[*a..*b].fill(Some(level));
    }
    out
}

/// Error of one target on rows that the fit did not see.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Held {
    /// Root mean square, of what is news (see [`Target::news`]).
    pub rms: f64,
    /// An error that a few grossly wrong rows cannot decide: the noise floor times sqrt(exp(mean ln(1 + (r / floor)^2)) - 1).
    pub typical: f64,
    /// Root mean square over the rows about which a claim is made: the figure of a verdict.
    pub claimed: f64,
}

impl Held {
    /// What is not known.
    pub(crate) const UNKNOWN: Self = Self { rms: f64::NAN, typical: f64::NAN, claimed: f64::NAN };

    /// Share of `before` that is gone, in the measure in which more is gone: rows right after a step, whose instant is known
    /// only to a sample, may rule the one, and a resonance or a saturation that few rows show rules the other.
    #[must_use]
    pub fn share_gone(&self, before: &Self) -> f64 {
        (1.0 - self.rms / before.rms).max(1.0 - self.typical / before.typical)
    }
}

/// Held-out error of each target of the context under a hypothesis.
#[must_use]
pub fn errors(context: &Context, declared: Declared<'_>, fit: &Fit, folds: &[Vec<bool>]) -> Vec<Held> {
    let all = vec![true; context.targets.len()];
    pooled(context, declared, folds, &all, fit, &|keep| refine(context, declared, &fit.placed, Rows::Where(keep), EVALUATIONS))
        .into_iter()
        .map(|e| e.unwrap_or(Held::UNKNOWN))
        .collect()
}

/// Held-out error of each target by the fit without the effect at a position of a whole one. What a fold does not know of the others, an instant in it or
/// an end of the range that it alone shows, it guesses as it does in the whole: a guess that differs must not decide about that effect.
#[must_use]
pub(crate) fn errors_without(
    context: &Context,
    declared: Declared<'_>,
    (whole, position): (&Fit, usize),
    without: &Fit,
    folds: &[Vec<bool>],
) -> Vec<Held> {
    let others = |placed: &[Placed]| {
        let kept = placed.iter().enumerate().filter(|(k, _)| *k != position);
        kept.map(|(_, p)| p.shape.clone()).collect::<Vec<_>>()
    };
    let known = others(&whole.placed);
    let all: Vec<usize> = (0..without.placed.len()).collect();
    let guess = |keep: &[bool]| {
        let guessed = others(&refine(context, declared, &whole.placed, Rows::Where(keep), EVALUATIONS));
        let mut start = without.placed.clone();
        for (p, (guessed, known)) in start.iter_mut().zip(guessed.iter().zip(&known)) {
            let shapes = p.effect.shapes(context, &p.instance);
            for ((v, shape), (guessed, known)) in p.shape.iter_mut().zip(shapes).zip(guessed.iter().zip(known)) {
                *v = (*v + guessed - known).clamp(shape.range.0, shape.range.1);
            }
        }
        let found = refine(context, declared, &start, Rows::Where(keep), EVALUATIONS);
        unfelt_stay(context, declared, &start, (found, &all), keep)
    };
    let wanted = vec![true; context.targets.len()];
    let pooled = pooled(context, declared, folds, &wanted, without, &guess);
    pooled.into_iter().map(|e| e.unwrap_or(Held::UNKNOWN)).collect()
}

/// What the newest effect does to the held-out errors, by target.
#[derive(Debug, Clone)]
pub struct Around {
    /// Without it.
    pub without: Vec<Held>,
    /// With it.
    pub with: Vec<Held>,
    /// Without it, on the rows that the others say something about.
    pub known_without: Vec<Held>,
    /// With it, on the same rows.
    pub known_with: Vec<Held>,
}

impl Around {
    /// Where every row that was left out is known.
    pub(crate) fn of(without: &[Held], with: &[Held]) -> Self {
        let (without, with) = (without.to_vec(), with.to_vec());
        Self { known_without: without.clone(), known_with: with.clone(), without, with }
    }
}

/// What the newest effect does to the held-out errors: without it, and with it. The shapes of the other effects stay as all rows
/// gave them, in both: an instant that lies in a fold is unknown to the rest, and what is guessed for it must not decide about
/// the newcomer. Targets that the newcomer does not reach keep their `previous` error.
///
/// A row is known where the fold's prediction of it with the newcomer is itself surer than one reading is: a level that the rest of
/// the run does not surround may speak for a newcomer, but not against it.
#[must_use]
pub fn errors_around_newest(
    context: &Context,
    declared: Declared<'_>,
    fit: &Fit,
    folds: &[Vec<bool>],
    previous: &[Held],
) -> Around {
    let Some((newest, others)) = fit.placed.split_last() else { return Around::of(previous, previous) };
    let mut sums = vec![[Sum::default(); 4]; context.targets.len()];
    for out in folds {
        let keep: Vec<bool> = out.iter().map(|o| !o).collect();
        let placed = refine_group(context, declared, &fit.placed, &[others.len()], Rows::Where(&keep), EVALUATIONS);
        let placed = unfelt_stay(context, declared, &fit.placed, (placed, &[others.len()]), &keep);
        let (mut with, mut without) = (Designs::new(context, declared, &placed), Designs::new(context, declared, others));
        let targets = context.targets.iter().zip(&mut sums).enumerate();
        for (k, (target, sums)) in targets.filter(|(_, (t, _))| newest.instance.touches(t.name)) {
            let fits = (with.fit(k, Rows::Where(&keep)), without.fit(k, Rows::Where(&keep)));
            let (Some(fitted), Some(plain)) = fits else { continue };
            let (with, without) = (with.of(target), without.of(target));
            let new = with.predict(&fitted.coefficients, context.len());
            let old = without.predict(&plain.coefficients, context.len());
            let left = left_over(target, &new, &keep);
            for (row, y) in target.rows.iter().zip(&target.y).filter(|(row, _)| out[**row]) {
                let known = with.variance(&fitted.covariance, *row) < left;
                let of_row = [y - old[*row], y - new[*row]];
                for (sum, residual) in sums.iter_mut().zip(of_row.into_iter().cycle().take(if known { 4 } else { 2 })) {
                    sum.add(target, *row, residual);
                }
            }
        }
    }
    let [without, with, known_without, known_with] = [0, 1, 2, 3].map(|k| {
        let parts = sums.iter().zip(&context.targets).zip(previous);
        parts.map(|((s, target), previous)| s[k].held(target).unwrap_or(*previous)).collect()
    });
    Around { without, with, known_without, known_with }
}

/// Mean square of what a prediction leaves on the rows that taught it.
fn left_over(target: &Target, prediction: &[f64], keep: &[bool]) -> f64 {
    let taught = target.rows.iter().zip(&target.y).filter(|(row, _)| keep[**row]);
    let (sum, n) = taught.fold((0.0, 0.0), |s, (row, y)| (s.0 + (y - prediction[*row]).powi(2), s.1 + 1.0));
    sum / f64::max(n, 1.0)
}

/// Evaluations that each fold may spend on its shapes, starting from those of all rows.
pub(crate) const EVALUATIONS: usize = 40;

/// Held-out errors of the wanted targets, the effects of each fold as `refined` gives them for the rows that it may see, about as large as in the
/// `whole` fit.
pub(crate) fn pooled(
    context: &Context,
    declared: Declared<'_>,
    folds: &[Vec<bool>],
    wanted: &[bool],
    whole: &Fit,
    refined: &dyn Fn(&[bool]) -> Vec<Placed>,
) -> Vec<Option<Held>> {
    let by_fold: Vec<Vec<Sum>> = folds.iter().map(|out| left_out(context, declared, out, wanted, Some(whole), refined)).collect();
    together(context, &by_fold)
}

/// The errors that the sums of all folds amount to, by target.
pub(crate) fn together(context: &Context, by_fold: &[Vec<Sum>]) -> Vec<Option<Held>> {
    let whole = |k: usize| by_fold.iter().fold(Sum::default(), |whole, fold| whole.and(fold[k]));
    context.targets.iter().enumerate().map(|(k, target)| whole(k).held(target)).collect()
}

/// Sums over the rows of one fold, by target, the effects as `refined` gives them for the rows that it may see, about as large as in the `whole`
/// fit; of any size without one.
pub(crate) fn left_out(
    context: &Context,
    declared: Declared<'_>,
    out: &[bool],
    wanted: &[bool],
    whole: Option<&Fit>,
    refined: &dyn Fn(&[bool]) -> Vec<Placed>,
) -> Vec<Sum> {
    let mut sums = vec![Sum::default(); context.targets.len()];
    let keep: Vec<bool> = out.iter().map(|o| !o).collect();
    let taught = |p: Placed| {
        let known = Placed { shape: p.effect.taught(context, &p.instance, &p.shape, &keep), ..p };
        in_the_middle(context, known, &keep)
    };
    let placed: Vec<Placed> = refined(&keep).into_iter().map(taught).collect();
    let mut designs = Designs::new(context, declared, &placed);
    for (k, (target, sum)) in context.targets.iter().zip(&mut sums).enumerate().filter(|(k, _)| wanted[*k]) {
        let Some(fitted) = designs.fit_part(k, Rows::Where(&keep), whole) else { continue };
        let prediction = designs.of(target).predict(&fitted.coefficients, context.len());
        for (row, y) in target.rows.iter().zip(&target.y).filter(|(row, _)| out[**row]) {
            sum.add(target, *row, y - prediction[*row]);
        }
    }
    sums
}

/// An effect whose instants within rows that are left out are in the middle of these: the kept rows do not tell them, and the middle is the guess that is
/// wrong by least.
fn in_the_middle(context: &Context, mut placed: Placed, keep: &[bool]) -> Placed {
    let shapes = placed.effect.shapes(context, &placed.instance);
    for (v, _) in placed.shape.iter_mut().zip(shapes).filter(|(_, s)| s.is_instant()) {
        let row = context.t.partition_point(|t| t < v).min(keep.len().saturating_sub(1));
        if keep.get(row).copied().unwrap_or(true) {
            continue;
        }
        let from = keep[..row].iter().rposition(|k| *k).map_or(0, |k| k + 1);
        let to = keep[row..].iter().position(|k| *k).map_or(keep.len(), |k| row + k) - 1;
        *v = 0.5 * (context.t[from] + context.t[to]);
    }
    placed
}

/// Sums over rows that were left out.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sum {
    squares: f64,
    logs: f64,
    rows: usize,
    /// Square sum over the rows about which a claim is made.
    pub(crate) claimed_squares: f64,
    /// Number of these rows.
    pub(crate) claimed: usize,
}

impl Sum {
    fn add(&mut self, target: &Target, row: usize, residual: f64) {
        let square = target.news(row, residual).powi(2);
        self.squares += square;
        self.logs += (square / target.noise.rms.powi(2)).ln_1p();
        self.rows += 1;
        if target.claims(row) {
            self.claimed_squares += target.as_it_stands(row, residual).powi(2);
            self.claimed += 1;
        }
    }

    fn and(self, other: Self) -> Self {
        Self {
            squares: self.squares + other.squares,
            logs: self.logs + other.logs,
            rows: self.rows + other.rows,
            claimed_squares: self.claimed_squares + other.claimed_squares,
            claimed: self.claimed + other.claimed,
        }
    }

    fn held(self, target: &Target) -> Option<Held> {
        let mean = |sum: f64| sum / self.rows as f64;
        (self.rows > 0).then(|| Held {
            rms: mean(self.squares).sqrt(),
            typical: target.noise.rms * mean(self.logs).exp_m1().sqrt(),
            claimed: (self.claimed_squares / self.claimed as f64).sqrt(),
        })
    }
}

/// Residual of each target on its own rows.
#[must_use]
pub fn residuals(context: &Context, declared: Declared<'_>, fit: &Fit) -> Vec<Vec<f64>> {
    let mut designs = Designs::new(context, declared, &fit.placed);
    context
        .targets
        .iter()
        .zip(&fit.targets)
        .map(|(target, f)| {
            let prediction = designs.of(target).predict(&f.coefficients, context.len());
            target.rows.iter().zip(&target.y).map(|(i, y)| y - prediction[*i]).collect()
        })
        .collect()
}
