//! What stands at the end of the search.
//!
//! What it is: names that what has no name predicts better are taken back; of the rest each must still remove something, make sense, and be
//! more than nothing by its interval. What is left on a channel gets a term without a name.
//! What can go wrong: one name goes at a time, the first that has no ground; another order might leave another set.
//! Units: evidence in nats; shares of squared held-out errors.
//! Reference: specification `closing-the-loop.md`, step 7.

use crate::attribution::beside::{NEEDED, ask, left_of, with_rests};
use crate::attribution::choose::is_idle;
use crate::attribution::conclude::{Errors, drowned, is_nothing, quoted, untenable};
use crate::attribution::evidence::{Candidate, evidence_over};
use crate::attribution::revise::Round;
use crate::attribution::rivals::{Rival, UNEXPLAINED, drop_name, rivals_of};
use crate::attribution::together::{Ground, without};
use crate::effects::Estimate;
use crate::effects::placed::{Placed, is_named};
use crate::fit::heldout::{self, Held};

/// A hypothesis, and what is known of each of its names.
pub(crate) struct Standing {
    /// The hypothesis.
    pub(crate) best: Candidate,
    /// Its held-out errors, by target.
    pub(crate) errors: Vec<Held>,
    /// For each of its effects the probability of its being there.
    pub(crate) inclusion: Vec<f64>,
    /// Other hypotheses, most probable first.
    pub(crate) rivals: Vec<Rival>,
}

/// What is known of each effect of the set that stays.
pub(crate) struct Settled {
    /// The held-out errors without it, by target.
    pub(crate) without: Vec<Vec<Held>>,
    /// Its parameters, as they are reported.
    pub(crate) estimates: Vec<Vec<Estimate>>,
}

impl Standing {
    /// What the rounds of the search have left.
    pub(crate) fn of(best: Candidate, errors: Vec<Held>, rounds: Vec<Round>) -> Self {
        let inclusion = rounds.iter().map(|r| r.0).collect();
        let rivals = rivals_of(&best, rounds);
        Self { best, errors, inclusion, rivals }
    }

    /// Takes back the names that something without a name predicts better, and says on which channels that is so.
    pub(crate) fn take_back(&mut self, ground: Ground<'_>, before: &[Held]) -> Option<Vec<Vec<usize>>> {
        let Ground { context, declared, start, folds } = ground;
        let asked = ask(ground, before, &self.best, &self.errors);
        if asked.taken_back.is_empty() {
            return Some(asked.contested);
        }
        let probability: f64 = self.inclusion.iter().product();
        let ids = self.best.ids();
        let probability = (1.0 - UNEXPLAINED) * probability;
        let turned_down = Rival { ids: ids.clone(), probability, fit: self.best.fit.clone() };
        for k in asked.taken_back.iter().rev() {
            self.forget(&ids, *k);
        }
        self.best.fit = left_of(ground, &self.best.fit, &asked.taken_back)?;
        self.best.evidence = evidence_over(context, &self.best.fit, start);
        self.errors = heldout::errors(context, declared, &self.best.fit, folds);
        if self.best.fit.placed.is_empty() {
            self.rivals.clear();
        }
        self.rivals.insert(0, turned_down);
        Some(asked.contested)
    }

    /// Lets go what has no ground beside the others, one after the other, and adds what is left without a name.
    pub(crate) fn settle(&mut self, ground: Ground<'_>, before: &[Held], contested: &[Vec<usize>]) -> Option<Settled> {
        let Ground { context, declared, folds, .. } = ground;
        let mut rests_told = false;
        loop {
            let without = self.without_each(ground, before);
            let mut goes = self.groundless(ground, before, &without);
            if goes.is_none() && !rests_told {
                rests_told = true;
                let with = with_rests(ground, &self.best.fit, &self.errors, contested);
                if with.placed.len() > self.best.fit.placed.len() {
                    self.inclusion.resize(with.placed.len(), UNEXPLAINED);
                    self.best.fit = with;
                    self.errors = heldout::errors(context, declared, &self.best.fit, folds);
                    continue;
                }
            }
            let placed = &self.best.fit.placed;
            let mut estimates = Vec::new();
            if goes.is_none() {
                estimates = (0..placed.len()).map(|k| self.best.fit.profiled_estimates(context, declared, k)).collect();
                // an interval that is wide because size and shape trade places says nothing against a name that the rows need
                let hardly_needed = |k: usize| quoted(context, &placed[k], &self.errors, &without[k]).of_news < NEEDED;
                goes = (0..estimates.len()).find(|k| is_nothing(context, &placed[*k], &estimates[*k]) && hardly_needed(*k));
            }
            let Some(mut goes) = goes else { return Some(Settled { without, estimates }) };
            // a correction beside which a name makes no sense is no correction
            if is_named(&placed[goes]) {
                let shares = |p: &Placed| p.instance.channels.iter().any(|c| placed[goes].instance.touches(c));
                goes = placed.iter().position(|p| !is_named(p) && shares(p)).unwrap_or(goes);
            }
            self.forget(&self.best.ids(), goes);
            self.best.fit = left_of(ground, &self.best.fit, &[goes])?;
            self.errors = heldout::errors(context, declared, &self.best.fit, folds);
        }
    }

    /// For each effect the held-out errors without it, by target.
    fn without_each(&self, ground: Ground<'_>, before: &[Held]) -> Vec<Vec<Held>> {
        let Ground { context, declared, start, folds } = ground;
        let errors = |k: usize| match without(context, declared, &self.best.fit, k, start) {
            Some(fit) => heldout::errors_without(context, declared, (&self.best.fit, k), &fit, folds),
            None => before.to_vec(),
        };
        (0..self.best.fit.placed.len()).map(errors).collect()
    }

    /// The first effect for which nothing speaks beside the others: what it was named for a later one has taken over, it is not tenable, or it
    /// drowns in what is left.
    fn groundless(&self, ground: Ground<'_>, before: &[Held], without: &[Vec<Held>]) -> Option<usize> {
        let Ground { context, declared, .. } = ground;
        let fit = &self.best.fit;
        let names = fit.placed.iter().filter(|p| is_named(p)).count();
        let idle =
            |k: &usize| names > 1 && is_named(&fit.placed[*k]) && is_idle(context, &fit.placed[*k], &self.errors, &without[*k]);
        let figures = Errors { before, after: &self.errors, without };
        (0..without.len())
            .find(idle)
            .or_else(|| untenable(context, declared, fit, &figures))
            .or_else(|| drowned(context, declared, fit, &figures))
    }

    /// Takes the name at a position out of the rivals that hold it, and forgets how sure it was. What would have stood in its place has lost it too.
    fn forget(&mut self, names: &[String], k: usize) {
        self.rivals.retain(|r| r.ids.len() != names.len() || r.ids.get(k) == names.get(k));
        self.rivals.iter_mut().for_each(|r| drop_name(&mut r.ids, names.len(), (k, &names[k])));
        self.inclusion.remove(k);
    }
}
