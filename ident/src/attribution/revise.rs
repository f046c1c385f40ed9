//! A second look at every name, given all the others.
//!
//! What it is: effects join one at a time, so that the first one may have been named for what two did together. Here each
//! is taken out in turn and every effect of the library may apply for its place beside the others; one that no longer
//! brings evidence goes.
//! What can go wrong: two wrong names that hold each other up survive it; the look costs a round of the search for each name.
//! Units: evidence in nats.
//! Reference: stepwise regression with exchange, Miller 2002, Subset Selection in Regression, section 3.6.

use crate::attribution::evidence::{Candidate, evidence_over};
use crate::attribution::places::may_join;
use crate::attribution::rivals::probabilities;
use crate::attribution::round::{REFINED, Scanned, is_part_of, newest, offers, round_of};
use crate::attribution::split::split;
use crate::channel::Context;
use crate::effects::NEEDED_EVIDENCE;
use crate::effects::placed::Placed;
use crate::fit::heldout::{self, Held};
use crate::fit::search::{connected, refine};
use crate::fit::{Fit, Rows, fit};
use crate::model::Declared;

/// Looks at most so many times at all names.
const PASSES: usize = 2;
/// Evidence by which a newcomer must be better than the one in place.
pub(crate) const CLEARLY_BETTER: f64 = 3.0;

/// Share by which a newcomer may spoil the held-out error of a channel.
const SPOILT: f64 = 0.02;

/// The chosen effect's probability in its place, and those that came close to it.
pub(crate) type Round = (f64, Vec<(Candidate, f64)>);

/// Exchanges or drops names until none changes. `rounds` then holds, for each name, how it stands given the others.
pub(crate) fn revise(
    context: &Context,
    declared: Declared<'_>,
    start: &Fit,
    folds: &[Vec<bool>],
    best: &mut Candidate,
    rounds: &mut Vec<Round>,
) {
    let mut all = offers(context);
    split((context, declared, start), folds, best, rounds, &all);
    let mut settled = vec![false; best.fit.placed.len()];
    // the last one was chosen beside all the others
    if let Some(last) = settled.last_mut() {
        *last = true;
    }
    let mut looks = PASSES * settled.len();
    while let Some(k) = settled.iter().position(|s| !s) {
        settled[k] = true;
        // what shares no channel with another name was chosen beside nothing
        if looks == 0 || best.fit.placed[k].is_read_off() || connected(&best.fit.placed, k).len() < 2 {
            continue;
        }
        looks -= 1;
        let Some((base, ranked)) = apply_for(context, declared, start, &best.fit, k, &mut all) else { continue };
        let in_place_now = &best.fit.placed[k];
        let own =
            ranked.iter().position(|c| is_as(c, in_place_now)).or_else(|| ranked.iter().position(|c| newest_is(c, in_place_now)));
        let standing = own.map_or(f64::NEG_INFINITY, |o| ranked[o].evidence);
        // a name claims no channel that does not show it
        let needed = |c: &Candidate| match (is_part_of(newest(c), Some(in_place_now)), is_part_of(Some(in_place_now), newest(c)))
        {
            (true, _) => -NEEDED_EVIDENCE,
            (_, true) => NEEDED_EVIDENCE,
            _ => CLEARLY_BETTER,
        };
        let clearly = |c: &Candidate| c.evidence > standing + needed(c) && c.evidence > NEEDED_EVIDENCE;
        // the ranking asks first what the noise's own colour speaks for: more evidence may stand behind
        let better = ranked.iter().position(|c| clearly(c) && predicts_as_well(context, declared, folds, &c.fit, &best.fit));
        let Some(winner) = better.or(own).filter(|w| ranked[*w].evidence > NEEDED_EVIDENCE) else {
            let without = Candidate { evidence: evidence_over(context, &base, start), fit: base };
            // where it no longer applies for its own place, the others must do without it
            let is_needed = || best.evidence > without.evidence + NEEDED_EVIDENCE;
            if own.is_some() || !is_needed() && predicts_as_well(context, declared, folds, &without.fit, &best.fit) {
                *best = without;
                rounds.remove(k);
                settled.remove(k);
                settled.fill(false);
            }
            continue;
        };
        let others = standing_beside(&ranked, winner, standing);
        if better == Some(winner) {
            let Some(moved) = in_place(context, declared, start, &ranked[winner].fit, k) else { continue };
            *best = moved;
            settled.fill(false);
            settled[k] = true;
        }
        rounds[k] = probabilities(&ranked[winner], &others, 0.0);
    }
}

/// All that applied for a place but its winner, and what has clearly more evidence than the effect in place and was refused all
/// the same: it predicts worse, and is no rival. Where the effect in place stays, all such were.
fn standing_beside(ranked: &[Candidate], winner: usize, standing: f64) -> Vec<Candidate> {
    let stays = ranked[winner].evidence <= standing;
    let refused = |i: usize| (i < winner || stays) && ranked[i].evidence > standing + CLEARLY_BETTER;
    ranked.iter().enumerate().filter(|(i, _)| *i != winner && !refused(*i)).map(|(_, c)| c.clone()).collect()
}

/// Whether a hypothesis predicts held-out rows of every channel about as well as the one in place.
pub(crate) fn predicts_as_well(context: &Context, declared: Declared<'_>, folds: &[Vec<bool>], new: &Fit, old: &Fit) -> bool {
    let (new, old) = (heldout::errors(context, declared, new, folds), heldout::errors(context, declared, old, folds));
    let judged = context.targets.iter().zip(new.iter().zip(&old)).filter(|(t, _)| !t.relation.is_evidence());
    judged.into_iter().all(|(_, (n, o))| as_well(n, o))
}

/// The same of one channel. Where no fold could predict it, all its samples lying in one block, it says nothing.
fn as_well(new: &Held, old: &Held) -> bool {
    old.rms.is_nan() || new.share_gone(old) > -SPOILT
}

/// Whether a candidate's newest effect is this one, on the same channels and in the same form.
fn is_as(candidate: &Candidate, placed: &Placed) -> bool {
    newest_is(candidate, placed) && newest(candidate).is_some_and(|p| p.instance == placed.instance)
}

/// Whether a candidate's newest effect is this one, in whatever form.
fn newest_is(candidate: &Candidate, placed: &Placed) -> bool {
    newest(candidate).is_some_and(|p| p.effect.id() == placed.effect.id())
}

/// The hypothesis without its `k`-th effect, and everything that applies for the place, best first.
fn apply_for(
    context: &Context,
    declared: Declared<'_>,
    start: &Fit,
    whole: &Fit,
    k: usize,
    all: &mut [Scanned],
) -> Option<(Fit, Vec<Candidate>)> {
    let mut placed = whole.placed.clone();
    placed.remove(k);
    let placed = refine(context, declared, &placed, Rows::All, 60);
    let base = fit(context, declared, &placed, Some(start), Rows::All)?;
    for offer in all.iter_mut() {
        offer.found = None;
    }
    let group: Vec<&str> = connected(&whole.placed, k)
        .into_iter()
        .flat_map(|g| whole.placed[g].instance.channels.iter().map(String::as_str))
        .collect();
    let (mut near, _): (Vec<&mut Scanned>, Vec<&mut Scanned>) = all.iter_mut().partition(|o| {
        may_join(context, &placed, o.effect, &o.instance) && o.instance.channels.iter().any(|c| group.contains(&c.as_str()))
    });
    let ranked = round_of(context, declared, &Candidate { fit: base.clone(), evidence: 0.0 }, (&mut near, REFINED), &mut |_| {});
    Some((base, ranked))
}

/// The hypothesis with its newest effect moved to position `k`.
fn in_place(context: &Context, declared: Declared<'_>, start: &Fit, whole: &Fit, k: usize) -> Option<Candidate> {
    let mut placed = whole.placed.clone();
    let newest = placed.pop()?;
    placed.insert(k, newest);
    let fit = fit(context, declared, &placed, Some(start), Rows::All)?;
    Some(Candidate { evidence: evidence_over(context, &fit, start), fit })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{Instance, library};

    fn on_the_thrust(id: &str, evidence: f64) -> Candidate {
        let effect = *library().iter().find(|e| e.id() == id).expect("in the library");
        let placed = vec![Placed { effect, instance: Instance::new(&["thrust_n"], ""), shape: Vec::new() }];
        Candidate { fit: Fit { placed, targets: Vec::new() }, evidence }
    }

    #[test]
    fn what_was_refused_takes_no_probability_from_the_name_in_place() {
        let ranked = [("stall", 90.0), ("zero_drift", 50.0), ("tare_shift", 30.0)].map(|(id, e)| on_the_thrust(id, e));
        let (winner, standing) = (1, 50.0);
        let (probability, rivals) = probabilities(&ranked[winner], &standing_beside(&ranked, winner, standing), 0.0);
        assert!(probability > 0.9, "{probability}");
        assert_eq!(rivals.len(), 1);
        // what came as close as the newcomer may is a rival still
        let close = [("stall", 51.0), ("zero_drift", 50.0)].map(|(id, e)| on_the_thrust(id, e));
        assert!(probabilities(&close[winner], &standing_beside(&close, winner, standing), 0.0).0 < 0.5);
    }

    #[test]
    fn a_channel_that_no_fold_predicts_forbids_no_exchange() {
        let held = |rms: f64| Held { rms, typical: rms, claimed: rms };
        assert!(as_well(&held(f64::NAN), &held(f64::NAN)));
        assert!(as_well(&held(1.01), &held(1.0)) && !as_well(&held(1.1), &held(1.0)));
        assert!(!as_well(&held(f64::NAN), &held(1.0)), "one that the newcomer alone cannot predict is spoilt");
    }
}
