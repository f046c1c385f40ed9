//! Names and what has no name, side by side.
//!
//! What it is: a name goes where something without a name predicts its channels better, or where it explains too little of them; names on
//! other channels have no part in that. What is left on a channel then gets a correction without a name of its own, beside the names.
//! What can go wrong: a name that touches many channels stays as long as the others need it, although one of them is predicted better
//! without it; the correction then adds to it.
//! Units: evidence in nats; errors in noise floors.
//! Reference: specification `closing-the-loop.md`, step 7.

use crate::attribution::correction::{correct, without_correction};
use crate::attribution::evidence::Candidate;
use crate::attribution::opponent::{Contested, contested, correction, explains, groups, left_over, news_left, noisier};
use crate::attribution::together::Ground;
use crate::attribution::unexplained::LOUD;
use crate::effects::NEEDED_EVIDENCE;
use crate::effects::placed::Placed;
use crate::fit::heldout::{self, Held};
use crate::fit::search::{connected, refine};
use crate::fit::{Fit, Rows, fit};

/// What is asked of the names, channel by channel.
pub(crate) struct Asked {
    /// Positions of the names that go.
    pub(crate) taken_back: Vec<usize>,
    /// Channels that something without a name predicts better.
    pub(crate) contested: Vec<Vec<usize>>,
}

/// Asks every name on its own channels.
pub(crate) fn ask(ground: Ground<'_>, before: &[Held], best: &Candidate, named: &[Held]) -> Asked {
    let Ground { context, declared, start, folds } = ground;
    let contested = contested(context, declared, start, folds, before, best, named);
    let mut taken_back: Vec<usize> = Vec::new();
    for Contested { group, variable } in &contested {
        let touches = |k: &usize| group.iter().any(|i| best.fit.placed[*k].instance.touches(context.targets[*i].name));
        let there: Vec<usize> = (0..best.fit.placed.len()).filter(touches).collect();
        let corrected = if there.is_empty() { None } else { correction(context, declared, &best.fit, group, variable) };
        taken_back.extend(there.into_iter().filter(|k| corrected.as_ref().is_none_or(|f| !is_needed(ground, f, *k))));
    }
    for k in 0..best.fit.placed.len() {
        let together = connected(&best.fit.placed, k);
        if together[0] == k && !explains(context, declared, start, &best.fit, &together) {
            taken_back.extend(together.into_iter().filter(|k| context.against_model || !is_needed(ground, &best.fit, *k)));
        }
    }
    // zeros that are older than the run are set anew every day
    taken_back.retain(|k| !best.fit.placed[*k].is_tare());
    taken_back.sort_unstable();
    taken_back.dedup();
    Asked { taken_back, contested: contested.into_iter().map(|c| c.group).collect() }
}

/// Share of the held-out error of one of its channels that a name must take away, beside all the rest, to stand although the rest of that
/// channel has no name.
pub(crate) const NEEDED: f64 = 0.2;

/// Whether an effect of a fit is needed beside all others, or the readings themselves show it.
fn is_needed(ground: Ground<'_>, fit: &Fit, k: usize) -> bool {
    let Ground { context, declared, folds, .. } = ground;
    let placed = &fit.placed[k];
    if placed.effect.seen(context, &placed.instance) > NEEDED_EVIDENCE {
        return true;
    }
    let Some(others) = left_of(ground, fit, &[k]) else { return false };
    let [with, without] = [fit, &others].map(|f| heldout::errors(context, declared, f, folds));
    let touched = context.targets.iter().enumerate().filter(|(_, t)| placed.instance.touches(t.name));
    touched.map(|(i, _)| with[i].share_gone(&without[i])).fold(0.0, f64::max) > NEEDED
}

/// A hypothesis without the effects at some positions, its shapes refined again.
pub(crate) fn left_of(ground: Ground<'_>, best: &Fit, gone: &[usize]) -> Option<Fit> {
    let Ground { context, declared, start, .. } = ground;
    let placed: Vec<Placed> = best.placed.iter().enumerate().filter(|(k, _)| !gone.contains(k)).map(|(_, p)| p.clone()).collect();
    fit(context, declared, &refine(context, declared, &placed, Rows::All, 60), Some(start), Rows::All)
}

/// The hypothesis with a correction on every group of channels on which something without a name is left; the same where nothing is.
pub(crate) fn with_rests(ground: Ground<'_>, best: &Fit, errors: &[Held], contested: &[Vec<usize>]) -> Fit {
    let Ground { context, declared, folds, .. } = ground;
    let mut out = best.clone();
    let rests = rests(ground, best, errors, contested);
    for group in &rests {
        let (corrected, helps) = correct(context, declared, &out, folds, group);
        if helps {
            out = corrected;
        }
    }
    // what cannot be corrected is told all the same; the loudest where nothing else is
    let nothing_but_zeros = best.placed.iter().all(Placed::is_tare);
    if nothing_but_zeros && out.placed.len() == best.placed.len() {
        let loudest = rests.first().cloned().or_else(|| noisier(context));
        if let Some(group) = loudest {
            let (corrected, helps) = correct(context, declared, best, folds, &group);
            return if helps { corrected } else { without_correction(context, best, &group) };
        }
    }
    out
}

/// Groups of channels on which something without a name is left, the loudest first.
fn rests(ground: Ground<'_>, best: &Fit, errors: &[Held], contested: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let Ground { context, declared, start, .. } = ground;
    let residuals = heldout::residuals(context, declared, best);
    let news = if context.against_model { news_left(context, declared, start, best) } else { Vec::new() };
    let named = best.placed.iter().any(|p| !p.is_tare());
    let touched = |k: usize| best.placed.iter().any(|p| !p.is_tare() && p.instance.touches(context.targets[k].name));
    let is_loud = |k: usize| errors[k].claimed > LOUD * context.targets[k].noise.rms;
    let is_left = |k: &usize| {
        if context.against_model && named {
            return news.contains(k);
        }
        left_over(context, &context.targets[*k], &residuals[*k]) && (!touched(*k) || is_loud(*k))
    };
    let over = |g: &Vec<usize>| g.iter().map(|k| errors[*k].rms / context.targets[*k].noise.rms).fold(0.0, f64::max);
    let mut out: Vec<Vec<usize>> =
        groups(context).into_iter().filter(|g| contested.contains(g) || g.iter().any(is_left)).collect();
    out.sort_by(|a, b| over(b).total_cmp(&over(a)));
    out
}
