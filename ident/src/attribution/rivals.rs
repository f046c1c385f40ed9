//! Hypotheses that came close.
//!
//! What it is: the probability of the winner of a round against what could stand in its place, the other hypotheses of a verdict,
//! and for an unknown cause the effects that come nearest to it.
//! What can go wrong: effects that nobody has written are not among them; that is what `unknown` is for.
//! Units: evidence in nats, probabilities 0 to 1.
//! Reference: Kass & Raftery 1995, Bayes Factors, JASA 90:773.

use crate::attribution::evidence::Candidate;
use crate::effects::NEEDED_EVIDENCE;
use crate::fit::Fit;

/// Share of the winner's probability at which a second hypothesis makes the verdict ambiguous.
pub(crate) const RIVAL: f64 = 0.5;

/// Softmax temperature from evidence to probability.
pub(crate) const TEMPERATURE: f64 = 4.0;

/// Another hypothesis: one effect of the winner replaced.
#[derive(Debug, Clone)]
pub struct Rival {
    /// Its effects.
    pub ids: Vec<String>,
    /// Its probability.
    pub probability: f64,
    /// Its fit in the round in which it lost.
    pub fit: Fit,
}

/// Softmax over the effects that could stand in the winner's place: those that share a channel with it, and nothing at all.
pub(crate) fn probabilities(winner: &Candidate, followers: &[Candidate], nothing: f64) -> (f64, Vec<(Candidate, f64)>) {
    let Some(newest) = winner.fit.placed.last() else { return (1.0, Vec::new()) };
    let mut seen = vec![newest.effect.id()];
    let mut kept: Vec<&Candidate> = Vec::new();
    for c in followers {
        let Some(other) = c.fit.placed.last() else { continue };
        if !seen.contains(&other.effect.id()) && other.instance.channels.iter().any(|ch| newest.instance.touches(ch)) {
            seen.push(other.effect.id());
            kept.push(c);
        }
    }
    let weight = |e: f64| ((e - winner.evidence) / TEMPERATURE).exp();
    let total: f64 = 1.0 + kept.iter().map(|c| weight(c.evidence)).sum::<f64>() + weight(nothing + NEEDED_EVIDENCE);
    (1.0 / total, kept.into_iter().map(|c| (c.clone(), weight(c.evidence) / total)).collect())
}

/// The winner with one of its effects replaced by what came close to it in its round.
pub(crate) fn rivals_of(best: &Candidate, rounds: Vec<(f64, Vec<(Candidate, f64)>)>) -> Vec<Rival> {
    let product: f64 = rounds.iter().map(|r| r.0).product();
    let ids = best.ids();
    let mut out: Vec<Rival> = Vec::new();
    for (k, (own, rivals)) in rounds.into_iter().enumerate() {
        for (candidate, p) in rivals {
            let mut other = ids.clone();
            if let (Some(slot), Some(placed)) = (other.get_mut(k), candidate.fit.placed.last()) {
                *slot = placed.effect.id().to_owned();
            }
            out.push(Rival { ids: other, probability: product / own * p, fit: candidate.fit });
        }
    }
    out.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    out.truncate(LISTED);
    out.retain(|r| r.probability > 1e-4);
    out
}

/// Most other hypotheses that are listed.
const LISTED: usize = 6;
/// Probability that the library lacks the cause where nothing in it explains the residual: of 102 verdicts `unattributed` on the
/// tuning half of the blind campaign 90 were right.
pub(crate) const UNEXPLAINED: f64 = 0.9;

/// Puts the effects that come nearest alone (see [`crate::attribution::suspects::nearest`]) behind what was turned down, and shares what `unknown` leaves among all of them:
/// who must look for an unknown cause starts there.
pub(crate) fn list_nearest(rivals: &mut Vec<Rival>, singles: &[Candidate], unknown: f64) {
    for single in singles {
        let ids = single.ids();
        if rivals.len() < LISTED && !rivals.iter().any(|r| r.ids == ids) {
            rivals.push(Rival { ids, probability: 0.0, fit: single.fit.clone() });
        }
    }
    // evidence ranks what was turned down and says no more: each next one is half as probable
    let shares: f64 = (0..rivals.len()).map(|k| 0.5_f64.powi(k as i32)).sum();
    for (k, rival) in rivals.iter_mut().enumerate() {
        rival.probability = (1.0 - unknown) * 0.5_f64.powi(k as i32) / shares;
    }
}

/// Takes the name at a position out of a rival's, where it stands there: the rival may have another effect in that place, and the same
/// name may stand twice, for two channels. `names` counts those of the winner.
pub(crate) fn drop_name(ids: &mut Vec<String>, names: usize, (position, name): (usize, &str)) {
    let at = if ids.len() == names { Some(position) } else { ids.iter().position(|id| id == name) };
    if let Some(at) = at.filter(|at| ids.get(*at).is_some_and(|id| id == name)) {
        ids.remove(at);
    }
}

/// Names in an order that does not depend on who came first.
pub(crate) fn sorted(mut ids: Vec<String>) -> Vec<String> {
    ids.sort_unstable();
    ids
}

/// Names of a hypothesis that another one lacks, each as often as it is lacking; what has no name is none.
pub(crate) fn beyond(ids: &[String], other: &[String]) -> Vec<String> {
    let mut other: Vec<&String> = other.iter().collect();
    let mut left = ids.to_vec();
    left.retain(|id| match other.iter().position(|o| *o == id) {
        Some(at) => {
            other.swap_remove(at);
            false
        }
        None => id != "unknown",
    });
    left
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_stands_for_two_channels_is_dropped_once() {
        let names = |list: &[&str]| list.iter().map(|id| (*id).to_owned()).collect::<Vec<String>>();
        let dropped = |list: &[&str], of: usize, at: usize| {
            let mut ids = names(list);
            drop_name(&mut ids, of, (at, "glitch_rows"));
            ids
        };
        assert_eq!(dropped(&["glitch_rows", "stall", "glitch_rows"], 3, 2), names(&["glitch_rows", "stall"]));
        assert_eq!(dropped(&["glitch_rows", "stall", "creep"], 3, 2), names(&["glitch_rows", "stall", "creep"]));
        assert_eq!(dropped(&["creep", "glitch_rows"], 3, 0), names(&["creep"]));
        assert_ne!(sorted(names(&["glitch_rows", "stall"])), sorted(names(&["glitch_rows", "glitch_rows"])));
    }
}
