//! What a hypothesis is worth.
//!
//! What it is: the likelihood that it gains over another one, where the colour of what is left says how many samples count, less the price of
//! its parameters.
//! What can go wrong: a residual whose colour changes along the run counts as if it did not.
//! Units: evidence in nats.
//! Reference: Schwarz 1978 (penalty); Davies 1987 (shape parameters that do not exist under the null).

use crate::channel::{Context, Relation};
use crate::effects::placed::{Placed, is_named};
use crate::fit::{Fit, TargetFit, scatters};
use crate::signal::colour::Colour;

/// A candidate hypothesis with its evidence.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Its fit.
    pub fit: Fit,
    /// Net evidence over the declared model, nats.
    pub evidence: f64,
}

impl Candidate {
    /// Identifiers of its effects.
    #[must_use]
    pub fn ids(&self) -> Vec<String> {
        self.fit.placed.iter().map(|p| p.effect.id().to_owned()).collect()
    }

    /// Identifiers of those that have a name.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        self.fit.placed.iter().filter(|p| is_named(p)).map(|p| p.effect.id().to_owned()).collect()
    }
}

/// For each target the share of independent samples that the colour of the best fit's residual leaves: the same for every
/// candidate of a round, so that none wins by leaving a larger but whiter residual.
pub(crate) fn shares<'f>(context: &Context, fits: impl Iterator<Item = &'f Fit>) -> Vec<f64> {
    plain(&quietest(context, fits))
}

/// The share that the colour of each target's residual leaves.
fn plain(quietest: &[Option<&TargetFit>]) -> Vec<f64> {
    quietest.iter().map(|best| best.map_or(1.0, |t| t.share)).collect()
}

/// For each target the fit that leaves the least.
fn quietest<'f>(context: &Context, fits: impl Iterator<Item = &'f Fit>) -> Vec<Option<&'f TargetFit>> {
    let mut best: Vec<Option<&TargetFit>> = vec![None; context.targets.len()];
    for f in fits {
        for (b, t) in best.iter_mut().zip(&f.targets) {
            if b.is_none_or(|b| t.loglik.mean > b.loglik.mean) {
                *b = Some(t);
            }
        }
    }
    best
}

/// For each candidate and target the share of independent samples along what the candidate changes: noise that wanders slowly hides what is as slow,
/// and little of what steps. No candidate has more than the one that leaves the least, or it would win by changing something quick.
/// Between sensors of one speed it is that of the noise: what they differ by are single readings that are lost.
fn along(context: &Context, candidates: &[Candidate], old: &Fit, quietest: &[Option<&TargetFit>]) -> Vec<Vec<f64>> {
    let mut out = vec![vec![1.0; context.targets.len()]; candidates.len()];
    for (k, quietest) in quietest.iter().enumerate() {
        let Some(quietest) = quietest else { continue };
        let (before, plain) = (&old.targets[k].left, context.targets[k].relation.is_evidence());
        let colour = Colour::of(&quietest.left);
        let share = |left: &[f64]| {
            if plain || left.len() != before.len() {
                return quietest.share;
            }
            let change: Vec<f64> = left.iter().zip(&**before).map(|(n, o)| n - o).collect();
            colour.share_along(&change).max(quietest.share)
        };
        let most = share(&quietest.left);
        for (shares, c) in out.iter_mut().zip(candidates) {
            shares[k] = share(&c.fit.targets[k].left).min(most);
        }
    }
    out
}

/// Evidence of each candidate beyond what it was added to. In the order in which they are asked: by the evidence that they have where the noise
/// alone says how many samples count, so that a quick change is asked no earlier than a slow one that takes as much away.
pub(crate) fn weigh(context: &Context, best: &Candidate, candidates: &mut Vec<Candidate>) {
    let quietest = quietest(context, candidates.iter().map(|c| &c.fit));
    let plain = plain(&quietest);
    let shares = along(context, candidates, &best.fit, &quietest);
    let mut weighed: Vec<(f64, Candidate)> = std::mem::take(candidates)
        .into_iter()
        .zip(&shares)
        .map(|(c, shares)| {
            let gain = |shares: &[f64]| net_gain(context, &c.fit, &best.fit, shares);
            (gain(&plain), Candidate { evidence: best.evidence + gain(shares), fit: c.fit })
        })
        .collect();
    weighed.sort_by(|a, b| b.0.total_cmp(&a.0));
    candidates.extend(weighed.into_iter().map(|w| w.1));
}

/// Evidence, in nats, that the newest effect adds over a fit without it, its price paid.
pub(crate) fn net_gain(context: &Context, new: &Fit, old: &Fit, shares: &[f64]) -> f64 {
    let parts = context.targets.iter().zip(&new.targets).zip(&old.targets).zip(shares);
    let gain: f64 = parts
        .map(|(((target, n), o), share)| {
            let scattering = target.relation == Relation::Thrust && scatters(&new.placed, target.name);
            share * (n.loglik.of(scattering) - o.loglik.of(scattering))
        })
        .sum();
    gain + new.placed.last().map_or(0.0, |p| p.effect.seen(context, &p.instance) - penalty(context, p, shares))
}

/// Evidence, in nats, that all effects of a fit together add over the declared model, their price paid.
pub(crate) fn evidence_over(context: &Context, new: &Fit, start: &Fit) -> f64 {
    evidence_counted(context, new, start, &shares(context, std::iter::once(new)))
}

/// The same where each target counts so many of its samples as independent.
pub(crate) fn evidence_counted(context: &Context, new: &Fit, start: &Fit, shares: &[f64]) -> f64 {
    let earlier = &new.placed[..new.placed.len().saturating_sub(1)];
    let price = |p: &Placed| penalty(context, p, shares) - p.effect.seen(context, &p.instance);
    net_gain(context, new, start, shares) - earlier.iter().map(price).sum::<f64>()
}

/// Price of an effect: half a log of the effective sample for each parameter that the run has to tell, and half a log of the grid that was searched.
pub(crate) fn penalty(context: &Context, placed: &Placed, shares: &[f64]) -> f64 {
    let touched = context.targets.iter().zip(shares).filter(|(t, _)| placed.instance.touches(t.name));
    let n: f64 = touched.map(|(t, share)| t.rows.len() as f64 * t.weight * share).sum();
    let priced = placed.effect.priced(context, &placed.instance);
    let shapes = placed.effect.shapes(context, &placed.instance);
    let grid: usize = if priced > 0 { shapes.iter().map(|s| s.starts.len()).product() } else { 1 };
    let amplitudes = placed.effect.amplitudes(&placed.instance).len().min(placed.instance.channels.len().max(1));
    0.5 * (priced + amplitudes) as f64 * n.max(2.0).ln() + (grid as f64).ln().max(0.0) * 0.5
}
