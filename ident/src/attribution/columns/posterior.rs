//! Second stage: which hypothesis, and how sure each of its names is.
//!
//! What it is: terms join one at a time, those with a name first; when no more do, every one is asked again, and may go or be exchanged.
//! Then what has no name joins, and a name goes that is not sure beside it. All hypotheses that were looked at share the probability.
//! What can go wrong: a hypothesis that no step leads to is not looked at; probabilities are over those that were.
//! Units: nats, probabilities 0 to 1.
//! Reference: Madigan & Raftery 1994, JASA 89:1535 (Occam's window); Hoeting et al. 1999, Statistical Science 14:382 (inclusion).

use super::candidates::{Asked, ask, prior_odds};
use super::fit::{Fit, Problem, fit};
use super::library::{Candidate, Placed};

/// Candidates of one round that are fitted in full.
const TRIED: usize = 4;
/// A candidate this far below nothing at first sight is not fitted, nats: a refit of the noise seldom brings more.
const FAR: f64 = 6.0;
/// A candidate with less than this share of the first one's evidence at first sight is not fitted beside it.
const CLOSE: f64 = 0.3;
/// Probability from which on a name is told: that of the intervals beside it.
const SURE: f64 = 0.95;
/// Most terms.
const MOST: usize = 12;

/// A hypothesis that was looked at.
#[derive(Debug, Clone)]
pub struct Seen {
    /// Its candidates, in order of the library.
    pub terms: Vec<usize>,
    /// Evidence with prior odds, nats.
    pub score: f64,
}

/// What came of the search.
#[derive(Debug, Clone)]
pub struct Posterior {
    /// The declared model alone.
    pub declared: Fit,
    /// What could join the declared model, before anything was chosen.
    pub asked: Vec<Asked>,
    /// The best hypothesis.
    pub best: Fit,
    /// Everything that was looked at.
    pub seen: Vec<Seen>,
}

impl Posterior {
    /// Probability that a candidate is there: of all hypotheses together that hold it.
    #[must_use]
    pub fn inclusion(&self, candidate: usize) -> f64 {
        share(&self.seen, |s| s.terms.contains(&candidate))
    }

    /// Evidence by which the best hypothesis is ahead of the one without a term.
    #[must_use]
    pub fn lead(&self, candidate: usize) -> f64 {
        let best = |with: bool| {
            self.seen.iter().filter(|s| s.terms.contains(&candidate) == with).map(|s| s.score).fold(f64::NEG_INFINITY, f64::max)
        };
        best(true) - best(false)
    }
}

/// Share of the probability of those hypotheses that satisfy a condition.
pub(crate) fn share(seen: &[Seen], holds: impl Fn(&Seen) -> bool) -> f64 {
    let top = seen.iter().map(|s| s.score).fold(f64::NEG_INFINITY, f64::max);
    let sum = |counts: &dyn Fn(&Seen) -> bool| seen.iter().filter(|s| counts(s)).map(|s| (s.score - top).exp()).sum::<f64>();
    sum(&holds) / sum(&|_| true).max(f64::MIN_POSITIVE)
}

/// Evidence of a fit with the prior odds of its terms.
#[must_use]
pub fn score(all: &[Candidate], fit: &Fit) -> f64 {
    fit.evidence + fit.placed.iter().map(|p| prior_odds(all, p.candidate)).sum::<f64>()
}

fn terms(placed: &[Placed]) -> Vec<usize> {
    let mut out: Vec<usize> = placed.iter().map(|p| p.candidate).collect();
    out.sort_unstable();
    out
}

/// A search under way: what was looked at, each hypothesis once.
struct Walk<'p> {
    problem: Problem<'p>,
    seen: Vec<Seen>,
}

impl Walk<'_> {
    fn look(&mut self, placed: &[Placed], from: Option<&Fit>, fresh: usize) -> Option<Fit> {
        let fit = fit(&self.problem, placed, from, fresh)?;
        let (terms, score) = (terms(placed), score(self.problem.library.candidates(), &fit));
        match self.seen.iter_mut().find(|s| s.terms == terms) {
            Some(old) => old.score = old.score.max(score),
            None => self.seen.push(Seen { terms, score }),
        }
        Some(fit)
    }

    fn better(&self, a: &Fit, b: &Fit) -> bool {
        let all = self.problem.library.candidates();
        score(all, a) > score(all, b)
    }

    /// The best of what could join at first sight, fitted in full; those far behind the first at first sight are not.
    fn best_joined(&mut self, from: &Fit, asked: &[Asked]) -> Option<Fit> {
        let top = asked.iter().filter(|a| a.can_be_shown()).map(Asked::score).fold(f64::NEG_INFINITY, f64::max);
        let close = |a: &&Asked| a.can_be_shown() && a.score() > -FAR && a.score() > CLOSE * top - FAR;
        let mut best: Option<Fit> = None;
        for a in asked.iter().filter(close).take(TRIED) {
            let joined = self.look(&[from.placed.as_slice(), &a.joins].concat(), Some(from), a.joins.len());
            if let Some(next) = joined.filter(|n| best.as_ref().is_none_or(|b| self.better(n, b))) {
                best = Some(next);
            }
        }
        best
    }

    /// Without what the others of its kind (with a name, or without) have made superfluous, the latest first, and with each of them exchanged
    /// for one of those that were close when it joined, where that is better.
    fn revised(&mut self, mut from: Fit, rivals: &[usize], named: bool) -> Fit {
        let all = self.problem.library.candidates();
        let mut left = from.placed.len();
        while left > 0 {
            let place = left - 1;
            left = place;
            if all[from.placed[place].candidate].is_named() != named {
                continue;
            }
            let rest: Vec<Placed> = without(all, &from.placed, place);
            let Some(less) = self.look(&rest, Some(&from), 0) else { continue };
            let own = from.placed[place].candidate;
            if self.better(&less, &from) {
                from = less;
            } else {
                let asked = ask(&self.problem, &less, &|k, _| k != own && rivals.contains(&k));
                match self.best_joined(&less, &asked[..asked.len().min(TRIED / 2)]) {
                    Some(other) if self.better(&other, &from) => from = other,
                    _ => continue,
                }
            }
            left = from.placed.len();
        }
        from
    }

    /// With everything of one kind that brings evidence.
    fn joined(&mut self, from: &Fit, named: bool, progress: &mut dyn FnMut(f64)) -> Fit {
        let (mut best, mut rivals) = (from.clone(), Vec::new());
        while best.placed.len() < MOST {
            let asked = ask(&self.problem, &best, &|_, c| c.is_named() == named);
            let close = asked.iter().filter(|a| a.can_be_shown() && a.score() > 0.0).take(2 * TRIED);
            rivals.extend(close.flat_map(|a| a.joins.iter().map(|j| j.candidate)));
            match self.best_joined(&best, &asked) {
                Some(next) if self.better(&next, &best) => best = next,
                _ => break,
            }
            progress((best.placed.len() as f64 / MOST as f64).min(0.9));
        }
        self.revised(best, &rivals, named)
    }

    /// What has no name joins the names, and a name stays that is sure beside it: a function without a name bends to everything, and what it
    /// takes up as well as a name does is no evidence of the name.
    fn beside(&mut self, mut names: Fit, progress: &mut dyn FnMut(f64)) -> Fit {
        loop {
            let with = self.joined(&names, false, progress);
            let Some(weak) = self.unsure(&with) else { return with };
            let all = self.problem.library.candidates();
            let place = names.placed.iter().position(|p| p.candidate == with.placed[weak].candidate);
            let rest = place.map(|k| without(all, &names.placed, k));
            match rest.and_then(|rest| self.look(&rest, Some(&names), 0)) {
                Some(fewer) => names = fewer,
                None => return with,
            }
        }
    }

    /// The name that brings least beside everything else, where it is not [`SURE`].
    fn unsure(&mut self, with: &Fit) -> Option<usize> {
        let all = self.problem.library.candidates();
        let named: Vec<usize> = (0..with.placed.len()).filter(|k| all[with.placed[*k].candidate].is_named()).collect();
        let brings = |k: usize| {
            let less = self.look(&without(all, &with.placed, k), Some(with), 0)?;
            Some((k, score(all, with) - score(all, &less)))
        };
        let weakest = named.into_iter().filter_map(brings).min_by(|a, b| a.1.total_cmp(&b.1))?;
        (weakest.1 < (SURE / (1.0 - SURE)).ln()).then_some(weakest.0)
    }
}

/// A hypothesis without the term at `place`, and without what cannot stand alone then.
fn without(all: &[Candidate], placed: &[Placed], place: usize) -> Vec<Placed> {
    let mut rest: Vec<Placed> = placed.iter().enumerate().filter(|(i, _)| *i != place).map(|(_, p)| p.clone()).collect();
    let ids: Vec<&str> = rest.iter().map(|p| all[p.candidate].id).collect();
    rest.retain(|p| all[p.candidate].needs.is_empty() || all[p.candidate].needs.iter().any(|n| ids.contains(n)));
    rest
}

/// Searches; `None` where even the declared model has no fit.
#[must_use]
pub fn posterior(problem: &Problem<'_>, progress: &mut dyn FnMut(f64)) -> Option<Posterior> {
    let mut walk = Walk { problem: *problem, seen: Vec::new() };
    let declared = walk.look(&[], None, 0)?;
    let first = ask(problem, &declared, &|_, c| c.is_named());
    let names = walk.joined(&declared, true, progress);
    let best = walk.beside(names, progress);
    // what could stand beside the best, for the probabilities
    let all = problem.library.candidates();
    for a in ask(problem, &best, &|_, c| c.is_named()).iter().filter(|a| a.can_be_shown()) {
        let terms = terms(&[best.placed.as_slice(), &a.joins].concat());
        if !walk.seen.iter().any(|s| s.terms == terms) {
            walk.seen.push(Seen { terms, score: score(all, &best) + a.score() });
        }
    }
    Some(Posterior { declared, asked: first, best, seen: walk.seen })
}

/// The hypothesis of somebody who knows the names: each of `ids` in the form that explains most, nothing else.
#[must_use]
pub fn told(problem: &Problem<'_>, ids: &[&str]) -> Option<Posterior> {
    let mut walk = Walk { problem: *problem, seen: Vec::new() };
    let declared = walk.look(&[], None, 0)?;
    let mut best = declared.clone();
    for id in ids {
        let asked = ask(problem, &best, &|_, c| c.id == *id);
        let forms = asked
            .iter()
            .take(TRIED)
            .filter_map(|a| walk.look(&[best.placed.as_slice(), &a.joins].concat(), Some(&best), a.joins.len()));
        let next = forms.max_by(|a, b| a.evidence.total_cmp(&b.evidence));
        best = next.unwrap_or(best);
    }
    Some(Posterior { declared, asked: Vec::new(), best, seen: walk.seen })
}
