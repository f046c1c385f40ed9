//! Long logs: the search on fewer rows, the figures on all of them.
//!
//! What it is: a log of more than [`SEARCHED`] rows is thinned for the search. The shapes of what was found, of each fold and their
//! intervals are refined on means over the rows between the kept ones, which hold nearly all that the rows know of them; every
//! coefficient, error and whiteness is then that of all rows. Effects that live from row to row are asked again on every row.
//! What can go wrong: an effect that shows for less than the stride between two steps of the command, at no even interval, can fall
//! between the rows that the search sees. The search has the power of its rows, not of all.
//! Units: rows, s.
//! Reference: notes on method, "for long logs scan on a part, refine on all rows"; rule of the rows in [`kept`].

use crate::attribution::choose::worth_a_name;
use crate::attribution::conclude::{Errors, harmful};
use crate::attribution::diagnose::{Diagnosis, diagnose};
use crate::attribution::evidence::{Candidate, net_gain, shares};
use crate::attribution::places::may_join;
use crate::attribution::round::offers;
use crate::attribution::together::without;
use crate::channel::{Context, Target};
use crate::effects::Estimate;
use crate::effects::NEEDED_EVIDENCE;
use crate::effects::placed::Placed;
use crate::fit::heldout::{self, Around, Held};
use crate::fit::search::refine;
use crate::fit::{Fit, Rows, allow_for_the_form, fit, plausible};
use crate::log::sparse::TOO_FEW;
use crate::log::{Column, Log};
use crate::model::Declared;

/// Rows above which the search is given fewer.
pub const SEARCHED: usize = 12_000;
/// Effects that speak of single rows: a thinned log may hide them.
const OF_ROWS: [&str; 3] = ["sample_hold", "quantisation", "glitch_rows"];
/// Change of the command from row to row, us, that is a step: its rows are kept whole.
const STEP_US: f64 = 5.0;
/// Evaluations for the shapes on the means, which start from those of the search.
const EVALUATIONS: usize = 120;

/// Rows that the search sees, of a log with more than [`SEARCHED`]: the rows around each step of the command, as many as half of
/// the allowance gives each (a tenth of them before it), and of the rest every n-th. A command that moves all the time has no
/// steps. First and last row are kept. `None` for a log that is short enough.
#[must_use]
pub fn kept(log: &Log) -> Option<Vec<usize>> {
    let n = log.len();
    if n <= SEARCHED {
        return None;
    }
    let steps = steps(log);
    let mut keep = vec![false; n];
    if steps.len() * 100 < SEARCHED {
        let around = (SEARCHED / 2).checked_div(steps.len()).unwrap_or(0).min(n);
        for step in steps {
            keep[step.saturating_sub(around / 10)..(step + around - around / 10).min(n)].fill(true);
        }
    }
    let whole = keep.iter().filter(|k| **k).count();
    let stride = (n - whole).div_ceil(SEARCHED - whole).max(1);
    for (rest, k) in keep.iter_mut().filter(|k| !**k).enumerate() {
        *k = rest % stride == 0;
    }
    keep[n - 1] = true;
    Some((0..n).filter(|i| keep[*i]).collect())
}

/// Rows on which the command has just jumped.
fn steps(log: &Log) -> Vec<usize> {
    let Some(pulse) = log.column("pulse_us") else { return Vec::new() };
    let known: Vec<usize> = (0..pulse.len()).filter(|i| pulse[*i].is_finite()).collect();
    known.windows(2).filter(|w| (pulse[w[1]] - pulse[w[0]]).abs() > STEP_US).map(|w| w[1]).collect()
}

/// The log with these rows only.
#[must_use]
pub fn thinned(log: &Log, rows: &[usize]) -> Log {
    map_columns(log, &|values| rows.iter().map(|i| values[*i]).collect())
}

/// The log with the mean over the rows from each kept one to the next.
fn averaged(log: &Log, rows: &[usize]) -> Log {
    let ends = rows[1..].iter().copied().chain([log.len()]);
    let spans: Vec<(usize, usize)> = rows.iter().copied().zip(ends).collect();
    let mean = |values: &[f64], (from, to): (usize, usize)| {
        let (sum, n) = values[from..to].iter().filter(|v| v.is_finite()).fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
        sum / n // no sample: 0/0 is a missing one
    };
    map_columns(log, &|values| spans.iter().map(|s| mean(values, *s)).collect())
}

fn map_columns(log: &Log, change: &dyn Fn(&[f64]) -> Vec<f64>) -> Log {
    Log {
        name: log.name.clone(),
        meta: log.meta.clone(),
        events: log.events.clone(),
        t: change(&log.t),
        columns: log.columns.iter().map(|c| Column { name: c.name.clone(), values: change(&c.values) }).collect(),
        sha256: None,
    }
}

/// What the search found on a log, and what it looked at: the log's own context, or that of the thinned log, to which the rivals'
/// fits then belong.
pub(crate) struct Found {
    pub(crate) diagnosis: Diagnosis,
    pub(crate) searched: Option<Context>,
    /// For each effect of the winner its parameters with their errors, where they were found on means.
    pub(crate) estimates: Option<Vec<Vec<Estimate>>>,
}

/// [`diagnose`] for a log of any length.
pub(crate) fn diagnose_any(log: &Log, context: &Context, declared: Declared<'_>, progress: &mut dyn FnMut(f64)) -> Option<Found> {
    let Some(rows) = kept(log) else {
        return Some(Found { diagnosis: diagnose(context, declared, progress)?, searched: None, estimates: None });
    };
    let mut few = Context::of_clean(&thinned(log, &rows), Some(context.start_pulse_us));
    few.steady_speed(context.consensus.sensor_share);
    if let Some(us) = context.limited_from {
        few.leave_out_from(&thinned(log, &rows), us);
    }
    few.against(declared);
    let means = means(log, context, declared, &rows);
    // targets of all contexts stand in the same order; where thinning lost a channel, nothing is saved
    let whole = |c: &Context| c.targets.len() == context.targets.len() && c.targets.iter().all(|t| t.rows.len() > TOO_FEW);
    if !whole(&few) || !whole(&means) {
        return Some(Found { diagnosis: diagnose(context, declared, progress)?, searched: None, estimates: None });
    }
    let mut diagnosis = diagnose(&few, declared, &mut |p| progress(0.5 * p))?;
    let folds = heldout::folds(context);
    let all = AllRows { means: &means, context, declared, rows: &rows, folds: &folds };
    let mut estimates = all.carry_over(&mut diagnosis, true, &mut |p| progress(0.5 + 0.4 * p))?;
    // what helped on some of the rows may harm on all of them
    while let Some(harmful) = all.harmful(&diagnosis) {
        diagnosis.best.fit.placed.remove(harmful);
        diagnosis.inclusion.remove(harmful);
        estimates = all.carry_over(&mut diagnosis, false, &mut |p| progress(0.9 + 0.1 * p))?;
    }
    diagnosis.folds = folds;
    progress(1.0);
    Some(Found { diagnosis, searched: Some(few), estimates: Some(estimates) })
}

/// The context of the means, each weighted by what the noise of all rows makes of its number of rows.
fn means(log: &Log, context: &Context, declared: Declared<'_>, rows: &[usize]) -> Context {
    let (all, log) = (log.len(), &averaged(log, rows));
    let mut means = Context::of_clean(log, Some(context.start_pulse_us));
    means.steady_speed(context.consensus.sensor_share);
    if let Some(us) = context.limited_from {
        means.leave_out_from(log, us);
    }
    let sizes: Vec<f64> = rows.iter().zip(rows[1..].iter().copied().chain([all])).map(|(a, b)| (b - a) as f64).collect();
    let speeds = means.rpm.clone();
    for target in &mut means.targets {
        if let Some(whole) = context.targets.iter().find(|t| t.name == target.name) {
            target.weigh(whole.noise, &speeds, &sizes);
        }
    }
    means.against(declared);
    means
}

/// The effects with what they read off a log read off this one: a shape without a range is measured, not fitted.
fn read_off(context: &Context, placed: &[Placed]) -> Vec<Placed> {
    let measured = |p: &Placed| {
        let shapes = p.effect.shapes(context, &p.instance);
        let pick = |(s, v): (&crate::effects::Shape, &f64)| if s.range.1 <= s.range.0 { s.range.0 } else { *v };
        Placed { shape: shapes.iter().zip(&p.shape).map(pick).collect(), ..p.clone() }
    };
    placed.iter().map(measured).collect()
}

/// What carrying a diagnosis over to all rows needs.
struct AllRows<'a> {
    /// The means.
    means: &'a Context,
    /// All rows.
    context: &'a Context,
    declared: Declared<'a>,
    /// The kept rows: those of the search, and the first of each mean.
    rows: &'a [usize],
    /// Folds of all rows.
    folds: &'a [Vec<bool>],
}

impl AllRows<'_> {
    /// The position of an effect of a diagnosis of every row that makes a channel worse, if there is one.
    fn harmful(&self, d: &Diagnosis) -> Option<usize> {
        let errors = Errors { before: &d.heldout_before, after: &d.heldout_after, without: &d.heldout_without };
        harmful(self.context, &d.best.fit, &errors)
    }

    /// Carries a diagnosis of the thinned log over to every row, where effects of single rows may be `asked` for again; gives the parameters
    /// of its effects.
    fn carry_over(&self, d: &mut Diagnosis, asked: bool, progress: &mut dyn FnMut(f64)) -> Option<Vec<Vec<Estimate>>> {
        let (context, declared) = (self.context, self.declared);
        let start = fit(context, declared, &[], None, Rows::All)?;
        let spoken: Vec<bool> = context.targets.iter().map(|t| !t.relation.is_evidence()).collect();
        d.heldout_before = self.errors(&start, &spoken, &[]);
        progress(0.2);
        let placed = self.refined(&read_off(context, &d.best.fit.placed));
        let mut best = Candidate { evidence: d.best.evidence, fit: fit(context, declared, &placed, Some(&start), Rows::All)? };
        d.heldout_after = self.errors(&best.fit, &self.touched(&placed), &d.heldout_before);
        progress(0.4);
        if asked && !d.unknown {
            self.of_rows(&mut best, &mut d.heldout_after);
            d.inclusion.resize(best.fit.placed.len(), d.probability);
        }
        progress(0.6);
        let placed = best.fit.placed.clone();
        let plain = fit(self.means, declared, &[], None, Rows::All)?;
        let found = fit(self.means, declared, &placed, Some(&plain), Rows::All)?;
        d.heldout_without = (0..placed.len())
            .map(|k| match without(self.means, declared, &found, k, &plain) {
                Some(others) => self.errors(&others, &self.touched(&placed[k..=k]), &d.heldout_after),
                None => d.heldout_before.clone(),
            })
            .collect();
        progress(0.9);
        let estimates = (0..placed.len())
            .map(|k| {
                let mut estimates = best.fit.estimates_given(context, k, found.shape_errors(self.means, declared, k, true));
                allow_for_the_form(context, &mut estimates);
                estimates
            })
            .collect();
        (d.declared, d.best) = (start, best);
        Some(estimates)
    }

    /// Shapes on the means.
    fn refined(&self, placed: &[Placed]) -> Vec<Placed> {
        refine(self.means, self.declared, placed, Rows::All, EVALUATIONS)
    }

    /// Targets that effects touch and that a verdict speaks of.
    fn touched(&self, placed: &[Placed]) -> Vec<bool> {
        let touched = |t: &Target| !t.relation.is_evidence() && placed.iter().any(|p| p.instance.touches(t.name));
        self.context.targets.iter().map(touched).collect()
    }

    /// Held-out errors on all rows of the wanted targets, the others as they were; the shapes of each fold on the means.
    fn errors(&self, fit: &Fit, wanted: &[bool], previous: &[Held]) -> Vec<Held> {
        let shapes = |keep: &[bool]| {
            let seen: Vec<bool> = self.rows.iter().map(|i| keep[*i]).collect();
            refine(self.means, self.declared, &fit.placed, Rows::Where(&seen), heldout::EVALUATIONS)
        };
        let nothing = Held::UNKNOWN;
        let pooled = heldout::pooled(self.context, self.declared, self.folds, wanted, fit, &shapes).into_iter().enumerate();
        pooled.map(|(i, e)| e.or(previous.get(i).copied()).unwrap_or(nothing)).collect()
    }

    /// Adds the effects of single rows that every row together shows, by the same rules as the search's own.
    fn of_rows(&self, best: &mut Candidate, errors: &mut Vec<Held>) {
        let (context, declared) = (self.context, self.declared);
        for offer in offers(context).into_iter().filter(|o| OF_ROWS.contains(&o.effect.id())) {
            if !may_join(context, &best.fit.placed, offer.effect, &offer.instance) {
                continue;
            }
            let shape = offer.effect.shapes(context, &offer.instance).iter().map(|s| s.range.0).collect();
            let added = Placed { effect: offer.effect, instance: offer.instance, shape };
            let placed: Vec<Placed> = best.fit.placed.iter().cloned().chain([added]).collect();
            let Some(new) = fit(context, declared, &placed, Some(&best.fit), Rows::All) else { continue };
            let gain = net_gain(context, &new, &best.fit, &shares(context, [&new, &best.fit].into_iter()));
            if gain < NEEDED_EVIDENCE || !plausible(context, declared, &new) {
                continue;
            }
            let candidate = Candidate { evidence: best.evidence + gain, fit: new };
            let held = self.errors(&candidate.fit, &self.touched(&placed[placed.len() - 1..]), errors);
            if worth_a_name(context, &candidate, gain, &Around::of(errors, &held)) {
                (*best, *errors) = (candidate, held);
            }
        }
    }
}
