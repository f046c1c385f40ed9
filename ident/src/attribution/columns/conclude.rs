//! Last stage: what is said.
//!
//! What it is: the names that stay once each has been asked for itself: none may make a channel worse on readings that no fit saw, none may
//! rest on the edge of what is plausible; then how sure each is, what could stand in its place, and what is left beside them.
//! What can go wrong: nothing; where no name stays there is none.
//! Units: the channels' own; probabilities 0 to 1.
//! Reference: specification `formats.md`, "Verdict"; `closing-the-loop.md`, steps 6 and 7.

use super::channel::rms;
use super::evidence::White;
use super::fit::{Fit, Problem, fit};
use super::library::Placed;
use super::noise::Noise;
use super::posterior::{Posterior, Seen, share};
use super::validate::{fairest, fairest_of};

/// Share by which names may make a channel's error larger (specification, "Verdict"), and by which each has to make one smaller: what changes
/// less counts as no change, one way as the other.
pub(crate) const WORSE: f64 = 0.02;
/// Error on left-out readings, in noise floors, from which on a channel is told in any case (specification, "Verdict").
pub const LOUD: f64 = 3.0;
/// Evidence of a wander from which on it is told, nats: on a dozen channels of white noise one in a hundred logs reaches it.
const WANDERS: f64 = 10.0;
/// A hypothesis is told beside the best from this probability on, relative to it.
const BESIDE: f64 = 1.0 / 3.0;
/// Alternatives below this are not listed.
const LISTED: f64 = 0.01;

/// Errors of one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errors {
    /// Over all readings with the fit to all of them.
    pub rms: f64,
    /// Over readings that the fit did not see.
    pub held_out: f64,
}

/// A term of the final hypothesis.
#[derive(Debug, Clone, PartialEq)]
pub struct Kept {
    /// Its place in the hypothesis.
    pub place: usize,
    /// Probability that it is there.
    pub probability: f64,
    /// Evidence by which it is ahead of everything without it, nats.
    pub lead: f64,
    /// Channels that it changes, the one that it improves most first, each with 1 - (held-out error with all)/(without it).
    pub channels: Vec<(usize, f64)>,
    /// What could stand in its place: candidates, and their probability.
    pub rivals: Vec<(Vec<usize>, f64)>,
}

/// Something that is left on a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Left {
    /// The channel.
    pub channel: usize,
    /// Held-out error in noise floors.
    pub over_floor: f64,
    /// Memory of what wanders there, s; 0 where nothing does.
    pub memory_s: f64,
}

/// What is left of every reading when its block of time took no part in the fit, by channel.
#[derive(Debug, Clone, Default)]
pub struct HeldOut {
    /// Of the declared model.
    pub before: Vec<Vec<f64>>,
    /// Of the final hypothesis.
    pub after: Vec<Vec<f64>>,
    /// Of the final hypothesis without one of its terms, the rest fitted again; by place.
    pub without: Vec<Vec<Vec<f64>>>,
}

/// The conclusion.
#[derive(Debug, Clone)]
pub struct Conclusion {
    /// The declared model alone.
    pub declared: Fit,
    /// The final hypothesis.
    pub fit: Fit,
    /// Its terms, the surest first, those without a name last.
    pub kept: Vec<Kept>,
    /// Errors of the declared model, by channel.
    pub before: Vec<Errors>,
    /// Errors of the final hypothesis, by channel.
    pub after: Vec<Errors>,
    /// What those held-out errors are the means of.
    pub held_out: HeldOut,
    /// For each place the weighting with which the hypothesis without that term predicts best.
    pub weighting_without: Vec<Vec<Noise>>,
    /// What is left.
    pub left: Vec<Left>,
    /// Whole hypotheses beside the final one, with their probability.
    pub alternatives: Vec<(Vec<usize>, f64)>,
    /// Whether something else explains the first cause equally well.
    pub ambiguous: bool,
}

/// Concludes; candidates that are `barred` are no part of it.
#[must_use]
pub fn conclude(problem: &Problem<'_>, posterior: &Posterior, barred: &[usize]) -> Option<Conclusion> {
    let (declared_noise, before) = fairest(problem, &posterior.declared)?;
    let declared = fit_as(problem, &posterior.declared, &declared_noise)?;
    let all = problem.library.candidates();
    let is_named = |p: &Placed| all[p.candidate].is_named();
    // names are judged without what has no name beside them: it would hold part of what they explain
    let open = posterior.best.placed.iter().filter(|p| !barred.contains(&p.candidate)).cloned();
    let (names, nameless): (Vec<Placed>, Vec<Placed>) = open.partition(is_named);
    let whole = names.len() == posterior.best.placed.len();
    let mut chosen = if whole { posterior.best.clone() } else { fit(problem, &names, Some(&posterior.best), 0)? };
    let declared_errors = errors(&before);
    let mut judged = sifted(problem, &declared_errors, &mut chosen, &is_named)?;
    if !nameless.is_empty() {
        chosen = fit(problem, &[chosen.placed.as_slice(), &nameless].concat(), Some(&chosen), 0)?;
        judged = sifted(problem, &declared_errors, &mut chosen, &|p| !is_named(p))?;
    }
    let last = fit_as(problem, &chosen, &judged.noise)?;
    Some(account(problem, posterior, (declared, before), (last, judged)))
}

/// Concludes without asking any term to go: for a hypothesis that was told.
#[must_use]
pub fn conclude_told(problem: &Problem<'_>, posterior: &Posterior) -> Option<Conclusion> {
    let (declared_noise, before) = fairest(problem, &posterior.declared)?;
    let declared = fit_as(problem, &posterior.declared, &declared_noise)?;
    let mut chosen = posterior.best.clone();
    let judged = sifted(problem, &errors(&before), &mut chosen, &|_| false)?;
    let last = fit_as(problem, &chosen, &judged.noise)?;
    Some(account(problem, posterior, (declared, before), (last, judged)))
}

/// What left-out readings say of a hypothesis.
struct Judged {
    /// Weighting that predicts them best.
    noise: Vec<Noise>,
    /// What is left by channel.
    left: Vec<Vec<f64>>,
    /// The same without each term.
    left_without: Vec<Vec<Vec<f64>>>,
    /// Weighting that predicts best without each term.
    weighting_without: Vec<Vec<Noise>>,
    /// Channels that each term changes.
    touched: Vec<Vec<usize>>,
}

/// Error of each channel.
fn errors(left: &[Vec<f64>]) -> Vec<f64> {
    left.iter().map(|r| rms(r)).collect()
}

impl Judged {
    fn errors(&self) -> Vec<f64> {
        errors(&self.left)
    }

    fn errors_without(&self) -> Vec<Vec<f64>> {
        self.left_without.iter().map(|left| errors(left)).collect()
    }
}

/// Takes those of the terms that are asked about out of a hypothesis that have to go, one after the other.
fn sifted(problem: &Problem<'_>, before: &[f64], chosen: &mut Fit, asked: &dyn Fn(&Placed) -> bool) -> Option<Judged> {
    loop {
        let (noise, left) = fairest(problem, chosen)?;
        let terms = 0..chosen.placed.len();
        let without = terms.clone().map(|k| without(problem, chosen, k)).collect::<Option<Vec<_>>>()?;
        let (weighting_without, left_without) = without.into_iter().unzip();
        let touched = terms.map(|k| channels_of(problem, chosen, k)).collect();
        let judged = Judged { noise, left, left_without, weighting_without, touched };
        let Some(falls) = falls(problem, chosen, before, &judged, asked) else { return Some(judged) };
        let rest: Vec<Placed> = chosen.placed.iter().enumerate().filter(|(k, _)| *k != falls).map(|(_, p)| p.clone()).collect();
        *chosen = fit(problem, &rest, Some(chosen), 0)?;
    }
}

/// The same hypothesis with its amplitudes under another weighting.
fn fit_as(problem: &Problem<'_>, of: &Fit, noise: &[Noise]) -> Option<Fit> {
    let solved = White::new(problem.channels, noise, &of.design).solve()?;
    let (amplitudes, covariance) = (solved.amplitudes.clone(), solved.covariance());
    Some(Fit { amplitudes, covariance, solved, noise: noise.to_vec(), ..of.clone() })
}

/// What is left of held-out readings without the term at `place`, the rest fitted again, and the weighting that is fair to it: the noise that was
/// found beside the term is the wrong one without it.
fn without(problem: &Problem<'_>, fit: &Fit, place: usize) -> Option<(Vec<Noise>, Vec<Vec<f64>>)> {
    let rest: Vec<Placed> = fit.placed.iter().enumerate().filter(|(k, _)| *k != place).map(|(_, p)| p.clone()).collect();
    fairest_of(problem, &rest, &fit.noise, false)
}

/// Channels whose prediction changes when the term at `place` goes and everything else stays.
fn channels_of(problem: &Problem<'_>, fit: &Fit, place: usize) -> Vec<usize> {
    let mut touched: Vec<usize> = fit.columns_of(place).flat_map(|i| fit.design.columns[i].parts.iter().map(|p| p.0)).collect();
    let rest: Vec<Placed> = fit.placed.iter().enumerate().filter(|(k, _)| *k != place).map(|(_, p)| p.clone()).collect();
    let design = problem.library.design(&rest);
    let own: Vec<usize> = fit.columns_of(place).collect();
    let others: Vec<usize> = (0..fit.design.columns.len()).filter(|i| !own.contains(i)).collect();
    for (column, i) in design.columns.iter().zip(others) {
        for (channel, values) in &column.parts {
            let same = fit.design.columns[i].parts.iter().any(|(c, v)| c == channel && v == values);
            if !same {
                touched.push(*channel);
            }
        }
    }
    touched.sort_unstable();
    touched.dedup();
    touched
}

/// The term that has to go, if one of those that are asked about has.
fn falls(problem: &Problem<'_>, fit: &Fit, before: &[f64], judged: &Judged, asked: &dyn Fn(&Placed) -> bool) -> Option<usize> {
    let (after, without, touched) = (judged.errors(), judged.errors_without(), &judged.touched);
    let gain = |k: usize, c: usize| 1.0 - after[c] / without[k][c];
    let best = |k: usize| touched[k].iter().map(|c| gain(k, *c)).fold(f64::NEG_INFINITY, f64::max);
    let open = || (0..touched.len()).filter(|k| asked(&fit.placed[*k]));
    // a channel that all of them together make worse: the one goes whose leaving helps it most
    for c in (0..after.len()).filter(|c| after[*c] > (1.0 + WORSE) * before[*c]) {
        let worst = open().filter(|k| touched[*k].contains(&c)).min_by(|a, b| gain(*a, c).total_cmp(&gain(*b, c)));
        if worst.is_some_and(|k| gain(k, c) < 0.0) {
            return worst;
        }
    }
    let edge = |k: usize| {
        let p = &fit.placed[k];
        let shapes = &problem.library.candidates()[p.candidate].shapes;
        p.shape.iter().zip(shapes).any(|(v, s)| !s.inside(*v))
    };
    // what has no name stands for what is left over, and beneath the noise floor nothing is
    let named = |k: usize| problem.library.candidates()[fit.placed[k].candidate].is_named();
    let beneath = |k: usize| !named(k) && touched[k].iter().all(|c| without[k][*c] <= problem.channels[*c].floor);
    let weak = |k: &usize| best(*k) < WORSE || edge(*k) || spans_zero(fit, *k) || beneath(*k);
    open().filter(weak).min_by(|a, b| best(*a).total_cmp(&best(*b)))
}

/// Whether every amplitude of a term could be nothing (a term of shapes alone is judged by its evidence).
fn spans_zero(fit: &Fit, place: usize) -> bool {
    let mut own = fit.columns_of(place).peekable();
    own.peek().is_some()
        && fit.placed[place].shape.is_empty()
        && own.all(|i| fit.amplitudes[i].abs() < 1.96 * fit.covariance[(i, i)].sqrt())
}

fn account(
    problem: &Problem<'_>,
    posterior: &Posterior,
    (declared, before): (Fit, Vec<Vec<f64>>),
    (fit, judged): (Fit, Judged),
) -> Conclusion {
    let (before_held, after_held, without) = (errors(&before), judged.errors(), judged.errors_without());
    let Judged { touched, left: after, left_without, weighting_without, .. } = judged;
    let all = problem.library.candidates();
    let mut kept: Vec<Kept> = (0..fit.placed.len())
        .map(|place| {
            let mut channels: Vec<(usize, f64)> =
                touched[place].iter().map(|c| (*c, 1.0 - after_held[*c] / without[place][*c])).collect();
            channels.sort_by(|a, b| b.1.total_cmp(&a.1));
            let own = fit.placed[place].candidate;
            let rivals = rivals(&posterior.seen, &fit, own);
            Kept { place, probability: posterior.inclusion(own), lead: posterior.lead(own), channels, rivals }
        })
        .collect();
    let named = |k: &Kept| all[fit.placed[k.place].candidate].is_named();
    kept.sort_by(|a, b| named(b).cmp(&named(a)).then(b.lead.total_cmp(&a.lead)));
    let figures = |of: &Fit, held: Vec<f64>| -> Vec<Errors> {
        held.into_iter()
            .enumerate()
            .map(|(c, held_out)| Errors { rms: rms(&of.residual(problem.channels, c)), held_out })
            .collect()
    };
    let ambiguous = kept.first().is_some_and(|k| named(k) && k.rivals.first().is_some_and(|r| r.1 > BESIDE * k.probability));
    Conclusion {
        left: left(problem, &fit, &after_held),
        before: figures(&declared, before_held),
        declared,
        after: figures(&fit, after_held),
        held_out: HeldOut { before, after, without: left_without },
        weighting_without,
        alternatives: alternatives(&posterior.seen, &fit),
        ambiguous,
        kept,
        fit,
    }
}

fn own_terms(fit: &Fit) -> Vec<usize> {
    let mut out: Vec<usize> = fit.placed.iter().map(|p| p.candidate).collect();
    out.sort_unstable();
    out
}

/// The hypotheses without the terms of the best one that fell afterwards: what made those fall does not hang on the hypothesis.
fn standing(seen: &[Seen], best: &[usize]) -> Vec<Seen> {
    let top = seen.iter().max_by(|a, b| a.score.total_cmp(&b.score));
    let fell = |t: &usize| top.is_some_and(|s| s.terms.contains(t)) && !best.contains(t);
    let without = |s: &Seen| Seen { terms: s.terms.iter().copied().filter(|t| !fell(t)).collect(), score: s.score };
    seen.iter().map(without).collect()
}

/// What could stand in the place of a candidate: the hypotheses that hold something else instead.
fn rivals(seen: &[Seen], fit: &Fit, own: usize) -> Vec<(Vec<usize>, f64)> {
    let best = own_terms(fit);
    let instead = |s: &Seen| s.terms.iter().copied().filter(|t| !best.contains(t)).collect::<Vec<_>>();
    let mut out = together(&standing(seen, &best), |s| !s.terms.contains(&own), instead);
    out.retain(|o| !o.0.is_empty());
    out
}

fn alternatives(seen: &[Seen], fit: &Fit) -> Vec<(Vec<usize>, f64)> {
    let best = own_terms(fit);
    together(&standing(seen, &best), |s| s.terms != best, |s| s.terms.clone())
}

/// Some of the hypotheses under what each is told as, those alike together, the most probable first.
fn together(seen: &[Seen], some: impl Fn(&Seen) -> bool, told: impl Fn(&Seen) -> Vec<usize>) -> Vec<(Vec<usize>, f64)> {
    let mut out: Vec<(Vec<usize>, f64)> = Vec::new();
    for s in seen.iter().filter(|s| some(s)) {
        let (terms, probability) = (told(s), share(seen, |h| std::ptr::eq(h, s)));
        match out.iter_mut().find(|o| o.0 == terms) {
            Some(o) => o.1 += probability,
            None => out.push((terms, probability)),
        }
    }
    out.retain(|o| o.1 > LISTED);
    out.sort_by(|a, b| b.1.total_cmp(&a.1));
    out
}

/// What is left, channel by channel.
fn left(problem: &Problem<'_>, fit: &Fit, held: &[f64]) -> Vec<Left> {
    let one = |c: usize| {
        let channel = &problem.channels[c];
        let residual = fit.residual(problem.channels, c);
        let noise = fit.noise[c].fitted(channel, &residual);
        let wanders = noise.wander_evidence(channel, &residual) > WANDERS;
        let over_floor = held[c] / channel.floor.max(f64::MIN_POSITIVE);
        (wanders || over_floor > LOUD).then_some(Left {
            channel: c,
            over_floor,
            memory_s: if wanders { noise.memory_s } else { 0.0 },
        })
    };
    (0..problem.channels.len()).filter_map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::super::channel::Channel;
    use super::super::design::{Column, Design, Owner, Prior};
    use super::super::library::{Candidate, Library, UNKNOWN};
    use super::super::posterior::posterior;
    use super::*;
    use std::sync::Arc;

    /// A constant, and beside it one wave, with a name or without.
    struct Wave {
        candidates: [Candidate; 1],
        values: Arc<Vec<f64>>,
    }

    impl Wave {
        fn column(&self, owner: Owner) -> Column {
            let (sd, values) = match owner {
                Owner::Declared => (1.0, Arc::new(vec![1.0; self.values.len()])),
                Owner::Term(_) => (0.3, self.values.clone()),
            };
            Column { owner, name: "size", prior: Prior::about_zero(sd), parts: vec![(0, values)] }
        }
    }

    impl Library for Wave {
        fn candidates(&self) -> &[Candidate] {
            &self.candidates
        }

        fn design(&self, hypothesis: &[Placed]) -> Design {
            let terms = (0..hypothesis.len()).map(|k| self.column(Owner::Term(k)));
            Design { columns: std::iter::once(self.column(Owner::Declared)).chain(terms).collect() }
        }

        fn addition(&self, hypothesis: &[Placed], _: &Placed) -> Option<Vec<Column>> {
            Some(vec![self.column(Owner::Term(hypothesis.len()))])
        }
    }

    /// Terms that are kept of a wave of 0.3 in noise of 0.05, where the noise floor is said to be `floor`.
    fn kept(id: &'static str, floor: f64) -> usize {
        let t: Vec<f64> = (0..600).map(|i| 0.05 * f64::from(i)).collect();
        let noise = |i: usize| 0.05 * (((i * 7919) % 1009) as f64 / 504.5 - 1.0);
        let values: Vec<f64> = t.iter().map(|t| (2.1 * t).sin()).collect();
        let y = values.iter().enumerate().map(|(i, v)| 0.3 * v + noise(i)).collect();
        let channels = [Channel { name: "force".into(), unit: "N", t, y, floor }];
        let (form, shapes, starts) = (String::new(), Vec::new(), vec![Vec::new()]);
        let candidate = Candidate { id, form, shapes, starts, needs: Vec::new(), excludes: Vec::new() };
        let library = Wave { candidates: [candidate], values: Arc::new(values) };
        let problem = Problem { channels: &channels, library: &library };
        let found = posterior(&problem, &mut |_| {}).unwrap();
        assert_eq!(found.best.placed.len(), 1, "the wave is seen");
        assert_eq!(conclude(&problem, &found, &[0]).unwrap().kept.len(), 0, "a candidate that is barred is no part of it");
        conclude(&problem, &found, &[]).unwrap().kept.len()
    }

    /// What has no name is not added where nothing is left over the noise floor; a name there may still be true.
    #[test]
    fn nothing_without_a_name_is_added_beneath_the_floor() {
        assert_eq!((kept(UNKNOWN, 0.04), kept(UNKNOWN, 0.25)), (1, 0));
        assert_eq!(kept("drag", 0.25), 1);
    }
}
