//! Which candidate of a round gets a name.
//!
//! What it is: the first in the ranking that pays for itself, predicts held-out rows better, and is clearly itself or large.
//! What can go wrong: a small further effect that could as well be another one stays without a name.
//! Units: shares of squared held-out errors; evidence in nats.
//! Reference: specification `closing-the-loop.md`, steps 5 to 7.

use crate::attribution::evidence::Candidate;
use crate::attribution::moment::lasts;
use crate::attribution::places::of_this_rig;
use crate::attribution::rivals::{RIVAL, probabilities};
use crate::channel::{Context, Target};
use crate::effects::NEEDED_EVIDENCE;
use crate::effects::placed::Placed;
use crate::fit::heldout::{self, Around, Held};
use crate::fit::search::connected;
use crate::model::Declared;

/// Share of the held-out error on its first channel that an effect must remove to be worth a name.
pub(crate) const NEEDED_REDUCTION: f64 = 0.05;

/// Effects that are named with small errors removed; a further one must remove much, because small misfits of the declared
/// polynomials look like anything.
const EASILY_NAMED: usize = 3;

/// Share of the held-out error below which a further effect is named only if nothing else explains it as well.
const CLEAR_REDUCTION: f64 = 0.15;

/// What one round chose.
pub(crate) struct Chosen {
    /// The hypothesis with its newest effect.
    pub(crate) winner: Candidate,
    /// Its held-out errors, by target.
    pub(crate) held: Vec<Held>,
    /// Its probability in its round.
    pub(crate) probability: f64,
    /// What came close to it.
    pub(crate) rivals: Vec<(Candidate, f64)>,
}

/// The first candidate in the ranking that brings enough evidence, predicts held-out rows better, and is either clearly itself
/// or large: a small further effect that could as well be another one is left unnamed.
pub(crate) fn choose(
    context: &Context,
    declared: Declared<'_>,
    ranked: &[Candidate],
    best: &Candidate,
    errors: &[Held],
    folds: &[Vec<bool>],
) -> Option<Chosen> {
    for (k, winner) in ranked.iter().enumerate().filter(|(_, c)| c.evidence > best.evidence + NEEDED_EVIDENCE) {
        let around = heldout::errors_around_newest(context, declared, &winner.fit, folds, errors);
        let gain = winner.evidence - best.evidence;
        if !worth_a_name(context, winner, gain, &around) || !lasts(context, declared, &best.fit, &winner.fit) {
            continue;
        }
        let (probability, rivals) = probabilities(winner, &ranked[k + 1..], best.evidence);
        let unclear = rivals.first().is_some_and(|r| r.1 >= RIVAL * probability);
        let named = of_this_rig(context, &best.fit.placed);
        let small = largest_reduction(context, winner, &around.with, &around.without) < CLEAR_REDUCTION;
        // what an earlier effect's rough form leaves of itself looks like a further small one
        let newest = winner.fit.placed.len() - 1;
        let placed = &winner.fit.placed;
        let beside = connected(placed, newest).iter().any(|k| *k != newest && of_this_rig(context, &placed[*k..=*k]) > 0);
        if small && (beside || unclear && named > 0 || named >= EASILY_NAMED) {
            continue;
        }
        return Some(Chosen { winner: winner.clone(), held: around.with, probability, rivals });
    }
    None
}

/// The newest effect must remove some of the held-out error on one of its channels, and spoil none.
pub(crate) fn worth_a_name(context: &Context, candidate: &Candidate, gain: f64, around: &Around) -> bool {
    let Some(newest) = candidate.fit.placed.last() else { return false };
    let mut helps = false;
    // a resonance that one level alone has met is not predicted by the others: when that level is left out, the height of its
    // peak is a guess; overwhelming evidence of scatter and vibration stands all the same
    let certain = newest.effect.scatters() && gain > 30.0 * NEEDED_EVIDENCE;
    for (i, target) in context.targets.iter().enumerate() {
        if !newest.instance.touches(target.name) {
            continue;
        }
        helps |= around.with[i].share_gone(&around.without[i]) > NEEDED_REDUCTION;
        let spoils = around.known_with[i].share_gone(&around.known_without[i]) < -NEEDED_REDUCTION;
        // what is off by more than all that the channel ever reads is no prediction
        let ruins = around.with[i].rms > span(target);
        if (spoils || ruins) && !target.relation.is_evidence() && !certain {
            return false;
        }
    }
    // extra scatter has no mean to predict: the evidence alone must carry it
    helps || (newest.effect.scatters() && gain > 4.0 * NEEDED_EVIDENCE)
}

/// Largest share of the held-out error that the newest effect removes from one of its channels.
fn largest_reduction(context: &Context, candidate: &Candidate, held: &[Held], before: &[Held]) -> f64 {
    let Some(newest) = candidate.fit.placed.last() else { return 0.0 };
    context
        .targets
        .iter()
        .enumerate()
        .filter(|(_, t)| newest.instance.touches(t.name))
        .map(|(i, _)| held[i].share_gone(&before[i]))
        .fold(0.0, f64::max)
}

/// Distance between a channel's lowest and highest reading.
pub(crate) fn span(target: &Target) -> f64 {
    let (low, high) = target.y.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), y| (a.min(*y), b.max(*y)));
    high - low
}

/// Whether an effect of the final set no longer removes any held-out error. Extra scatter has no mean to predict.
pub(crate) fn is_idle(context: &Context, placed: &Placed, errors: &[Held], without: &[Held]) -> bool {
    let most = context
        .targets
        .iter()
        .enumerate()
        .filter(|(_, t)| placed.instance.touches(t.name))
        .map(|(i, _)| errors[i].share_gone(&without[i]))
        .fold(0.0, f64::max);
    most < 0.5 * NEEDED_REDUCTION && !placed.effect.scatters()
}
