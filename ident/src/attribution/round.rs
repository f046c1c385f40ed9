//! One round of the search: every effect of the library applies for a place beside what was found.
//!
//! What it is: the grid of each is scanned, the best are refined, and all are ranked.
//! What can go wrong: an effect whose grid lies far from its best shape is refined late or never.
//! Units: evidence in nats.
//! Reference: forward selection, Miller 2002, Subset Selection in Regression, chapter 3.

use crate::attribution::evidence::{Candidate, net_gain, penalty, weigh};
use crate::attribution::places::may_join;
use crate::channel::Context;
use crate::effects::placed::Placed;
use crate::effects::{self, Effect, Instance, NEEDED_EVIDENCE};
use crate::fit::search::{base, between_starts, refine_newest, scan, stride};
use crate::fit::{Fit, Rows, fit, heldout, plausible};
use crate::model::Declared;
use crate::numeric::parallel::{cores, in_parallel};
use crate::signal::residual::whiteness;
use std::collections::BTreeSet;

/// Candidates whose shapes are refined after the scan of their grids.
pub(crate) const REFINED: usize = 7;

/// Of these, those whose shapes are refined on all rows in the end.
const POLISHED: usize = 3;

/// Samples of a channel that the refinement of every candidate looks at.
const SKETCH: usize = 2700;

/// What a scan of one instance gave; it stays valid until an effect is added on one of its channels.
pub(crate) struct Scanned {
    pub(crate) effect: &'static dyn Effect,
    pub(crate) instance: Instance,
    pub(crate) found: Option<(Vec<f64>, f64)>,
}

impl Scanned {
    /// An instance that has not been scanned yet.
    pub(crate) fn new(effect: &'static dyn Effect, instance: Instance) -> Self {
        Self { effect, instance, found: None }
    }
}

/// Fewest samples of a channel on which an effect with shape parameters is tried; a bare amplitude needs fewer.
pub(crate) const FEWEST_SAMPLES: (usize, usize) = (30, 7);

/// Every instance of every effect that the log could hold.
pub(crate) fn offers(context: &Context) -> Vec<Scanned> {
    let enough = |e: &dyn Effect, instance: &Instance| {
        let fewest = if e.shapes(context, instance).is_empty() { FEWEST_SAMPLES.1 } else { FEWEST_SAMPLES.0 };
        context.targets.iter().filter(|t| instance.touches(t.name)).all(|t| t.rows.len() >= fewest)
    };
    effects::library()
        .iter()
        .flat_map(|e| e.instances(context).into_iter().map(|instance| Scanned::new(*e, instance)))
        .filter(|o| enough(o.effect, &o.instance))
        .collect()
}

/// Residual over noise floor, and whiteness, below and above which a channel has nothing left to explain.
const QUIET: (f64, f64) = (1.08, 1e-3);

/// Targets that something is left on: only they are worth the scan of a grid.
pub(crate) fn loud(context: &Context, declared: Declared<'_>, fit: &Fit) -> Vec<bool> {
    heldout::residuals(context, declared, fit)
        .iter()
        .zip(&context.targets)
        .map(|(r, target)| {
            let news = target.rows.iter().zip(r).map(|(row, v)| target.news(*row, *v).powi(2));
            let rms = (news.sum::<f64>() / r.len().max(1) as f64).sqrt();
            let t: Vec<f64> = target.rows.iter().map(|row| context.t[*row]).collect();
            // what a declared model leaves over is coloured
            rms > QUIET.0 * target.noise.rms || target.trust.is_empty() && whiteness(&t, r) < QUIET.1
        })
        .collect()
}

/// Scans the grids of some offers beside what is there already, on all cores, each with what it remembers of the rows.
fn scan_all(context: &Context, declared: Declared<'_>, (placed, loud): (&[Placed], &[bool]), mut due: Vec<&mut &mut Scanned>) {
    let shares = cores().min(due.len());
    let of_share = |share: usize| {
        let base = base(context, declared, placed);
        let own = due.iter().skip(share).step_by(shares);
        own.map(|o| scan(context, &base, o.effect, &o.instance, loud)).collect::<Vec<_>>()
    };
    let found = in_parallel(shares, &of_share);
    for (share, found) in found.into_iter().enumerate() {
        due.iter_mut().skip(share).step_by(shares).zip(found).for_each(|(offer, found)| offer.found = found);
    }
}

/// Every instance added to `best`, so many of them refined, and more where promising, best first.
pub(crate) fn round_of(
    context: &Context,
    declared: Declared<'_>,
    best: &Candidate,
    (offers, refined): (&mut [&mut Scanned], usize),
    progress: &mut dyn FnMut(f64),
) -> Vec<Candidate> {
    let count = offers.len().max(1) as f64;
    let newest = best.fit.placed.last();
    let whole = vec![1.0; context.targets.len()];
    let loud = loud(context, declared, &best.fit);
    let mut ranked: Vec<(f64, Vec<Placed>)> = Vec::new();
    let joining = |o: &Scanned| may_join(context, &best.fit.placed, o.effect, &o.instance);
    let stale = |o: &Scanned| newest.is_some_and(|n| o.instance.channels.iter().any(|c| n.instance.touches(c)));
    offers.iter_mut().filter(|o| stale(o)).for_each(|o| o.found = None);
    scan_all(
        context,
        declared,
        (&best.fit.placed, &loud),
        offers.iter_mut().filter(|o| joining(o) && o.found.is_none()).collect(),
    );
    progress(0.7);
    for offer in offers.iter().filter(|o| joining(o)) {
        if let Some((shape, gain)) = &offer.found {
            let added = Placed { effect: offer.effect, instance: offer.instance.clone(), shape: shape.clone() };
            let net = gain + added.effect.seen(context, &added.instance) - penalty(context, &added, &whole);
            ranked.push((net, best.fit.placed.iter().cloned().chain([added]).collect()));
        }
    }
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    let sketch = Rows::Every(stride(context, SKETCH));
    // against a model many a name fits a moment on its grid, and stands before the one that fits the run once it is refined
    let refined = if context.against_model { 2 * refined } else { refined };
    let mut out: Vec<Candidate> = Vec::new();
    ranked.retain(|r| r.0 >= -20.0);
    let stands = |placed: &[Placed]| {
        fit(context, declared, placed, Some(&best.fit), Rows::All).filter(|f| plausible(context, declared, f))
    };
    let wide = |placed: &[Placed]| {
        let found = refine_newest(context, declared, &between_starts(context, declared, placed, sketch), sketch, 120);
        better_on_all_rows(context, [stands(&found), stands(&newest_alone(placed, &found))], &best.fit)
    };
    // the best on their grids, and of each of the best effects its best form: forms of one effect must not crowd out the others
    let mut heard = BTreeSet::new();
    let is_sure = |(k, (_, placed)): (usize, &(f64, Vec<Placed>))| {
        let of = placed.last().map(|p| (p.effect.id(), p.instance.channels.first().cloned()));
        let first = heard.len() < refined && heard.insert(of);
        first || k < refined
    };
    let sure: Vec<bool> = ranked.iter().enumerate().map(is_sure).collect();
    let queue: Vec<&Vec<Placed>> = ranked.iter().zip(&sure).filter(|(_, sure)| **sure).map(|(r, _)| &r.1).collect();
    let mut found = in_parallel(queue.len(), &|k| wide(queue[k])).into_iter();
    let mut most = f64::NEG_INFINITY;
    for (k, ((gain, placed), sure)) in ranked.iter().zip(sure).enumerate() {
        progress(0.7 + 0.3 * (k as f64 / count));
        // what explains on its grid alone twice as much as all that came out so far is worth a refinement, whatever stands before it
        let promising = k < 3 * refined && *gain > 0.0 && *gain > 2.0 * most;
        let fitted = match sure {
            true => found.next().flatten(),
            false if promising => wide(placed),
            false => stands(placed),
        };
        if let Some(fitted) = fitted {
            most = most.max(net_gain(context, &fitted, &best.fit, &whole));
            out.push(Candidate { fit: fitted, evidence: 0.0 });
        }
    }
    weigh(context, best, &mut out);
    let polished = if matches!(sketch, Rows::Every(1)) { 0 } else { out.len().min(POLISHED) };
    let polish = |k: usize| stands(&refine_newest(context, declared, &out[k].fit.placed, Rows::All, 50));
    let polished = in_parallel(polished, &polish);
    for (c, fitted) in out.iter_mut().zip(polished) {
        c.fit = fitted.unwrap_or_else(|| c.fit.clone());
    }
    weigh(context, best, &mut out);
    on_fewer_channels(&mut out);
    out
}

/// The hypothesis with its newest effect as it was `found`, and the others as they stood.
fn newest_alone(placed: &[Placed], found: &[Placed]) -> Vec<Placed> {
    placed.split_last().into_iter().flat_map(|(_, others)| others).chain(found.last()).cloned().collect()
}

/// The one that brings more. Rows at even intervals may miss each row behind a step: what they say of a lag that stands already counts only where
/// all rows agree.
fn better_on_all_rows(context: &Context, found: [Option<Fit>; 2], best: &Fit) -> Option<Fit> {
    let whole = vec![1.0; context.targets.len()];
    let gain = |f: &Fit| net_gain(context, f, best, &whole);
    found.into_iter().flatten().max_by(|a, b| gain(a).total_cmp(&gain(b)))
}

/// The effect that a candidate adds.
pub(crate) fn newest(candidate: &Candidate) -> Option<&Placed> {
    candidate.fit.placed.last()
}

/// Whether an effect is the other one in the same form on fewer channels, none of them another.
pub(crate) fn is_part_of(part: Option<&Placed>, whole: Option<&Placed>) -> bool {
    let (Some(part), Some(whole)) = (part, whole) else { return false };
    let fewer = part.instance.channels.len() < whole.instance.channels.len();
    let same = part.effect.id() == whole.effect.id() && part.instance.form == whole.instance.form;
    same && fewer && part.instance.channels.iter().all(|c| whole.instance.touches(c))
}

/// Puts an instance before one of the same effect on more channels that brings less than a name needs beyond it: a name claims no channel that does
/// not show it.
fn on_fewer_channels(candidates: &mut [Candidate]) {
    for k in 0..candidates.len() {
        let stands_first = |c: &Candidate| {
            is_part_of(newest(c), newest(&candidates[k])) && c.evidence > candidates[k].evidence - NEEDED_EVIDENCE
        };
        if let Some(j) = (k + 1..candidates.len()).find(|j| stands_first(&candidates[*j])) {
            candidates[k..=j].rotate_right(1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::by_id;
    use crate::log::{Column, Log};

    fn placed(id: &str, channels: &[&str], shape: &[f64]) -> Placed {
        Placed { effect: by_id(id).expect("in the library"), instance: Instance::new(channels, ""), shape: shape.to_vec() }
    }

    /// A zero that slipped at 10 s, its instant as two refinements left it, and a gain whose start each of them moved or left alone.
    #[test]
    fn what_a_sketch_says_of_others_counts_where_all_rows_agree() {
        let t: Vec<f64> = (0..400).map(|i| 0.05 * f64::from(i)).collect();
        let rpm: Vec<f64> = (0..400).map(|i| 2000.0 + 1000.0 * f64::from(i / 50 % 4)).collect();
        let noise = |i: usize| 0.01 * (1.3 * (i * i) as f64).sin();
        let thrust = |i: usize| 1e-7 * rpm[i].powi(2) * if t[i] < 5.0 { 1.0 } else { 1.1 } + if t[i] < 10.0 { 0.0 } else { 0.2 };
        let thrust: Vec<f64> = (0..400).map(|i| thrust(i) + noise(i)).collect();
        let columns = [("rpm", rpm), ("thrust_n", thrust)];
        let columns = columns.into_iter().map(|(name, values)| Column { name: name.to_owned(), values }).collect();
        let context = Context::new(&Log { t, columns, ..Log::default() }, None);
        let gain = |t0: f64| {
            let instance = Instance::new(&["thrust_n"], "step");
            Placed { effect: by_id("gain_change").expect("in the library"), instance, shape: vec![0.1, t0] }
        };
        let slipped = |t0: f64| placed("tare_shift", &["thrust_n"], &[t0]);
        let begun = [gain(5.2), slipped(9.0)];
        let fitted = |placed: &[Placed]| fit(&context, Declared::default(), placed, None, Rows::All);
        let best = fitted(&begun[..1]).expect("a fit");
        let kept = |found: &[Placed]| {
            let chosen = better_on_all_rows(&context, [fitted(found), fitted(&newest_alone(&begun, found))], &best);
            chosen.expect("one of them").placed.iter().map(|p| *p.shape.last().expect("an instant")).collect::<Vec<_>>()
        };
        assert_eq!(kept(&[gain(12.0), slipped(10.0)]), [5.2, 10.0]);
        assert_eq!(kept(&[gain(5.0), slipped(10.0)]), [5.0, 10.0]);
    }
}
