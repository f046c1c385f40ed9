//! One question to the search: the log with a cause in it.
//!
//! What it is: what the best hypothesis leaves over on a log is its noise, with its colour and its moments. A cause is added to a healthy
//! rig's predictions and to that noise, and the search is asked what it would name: the round, the choice and the look at the nameless that
//! decide a verdict, and nothing beside them. It is asked twice, with the noise as it was and turned upside down: what the noise happens to say for
//! or against a cause is then gone from the mean.
//! What can go wrong: predictors (speed, current, temperature) stay as they were measured.
//! Units: nats.
//! Reference: structural isolability, Krysander & Frisk 2008, IEEE Trans. SMC-A 38:1183; distinguishability with noise, Eriksson, Frisk &
//! Krysander 2013, Automatica 49:1591.

use super::size::Line;
use crate::beside::ask;
use crate::context::{Context, Facts};
use crate::diagnose::{Candidate, NEEDED_EVIDENCE, Scanned, choose, offers, round_of};
use crate::heldout;
use crate::hypothesis::{Declared, Fit, Placed, Rows, fit, plausible};
use crate::together::Ground;

/// A log's schedule, sensors and noise.
pub(crate) struct Rig {
    pub(crate) context: Context,
    /// Declared part of the best hypothesis.
    pub(crate) healthy: Fit,
    /// What that hypothesis leaves of each sample of each target.
    pub(crate) noise: Vec<Vec<f64>>,
    pub(crate) folds: Vec<Vec<bool>>,
    /// What that hypothesis names.
    pub(crate) found: Vec<String>,
}

/// What the search says of a log with a cause in it.
#[derive(Clone)]
pub(crate) struct Answer {
    /// Whether it names the cause, and nothing takes the name back; false where nobody asked.
    pub(crate) named: bool,
    /// Evidence of the cause; `None` where its fit makes no sense.
    pub(crate) own: Option<Candidate>,
    /// The best of the other causes, each under its name.
    pub(crate) others: Vec<(String, Candidate)>,
}

/// Which cause is asked for among which.
#[derive(Clone, Copy)]
pub(crate) struct Question<'q> {
    pub(crate) line: &'q Line,
    /// Every cause with its name.
    pub(crate) names: &'q [(String, Placed)],
    pub(crate) own: &'q str,
}

/// Name of a cause: the effect, its form, and its channels where it comes on several sets of them.
pub(crate) fn name_of(placed: &Placed, names: &[(String, Placed)]) -> Option<String> {
    let same = |p: &Placed| p.effect.id() == placed.effect.id() && p.instance == placed.instance;
    names.iter().find(|(_, p)| same(p)).map(|(name, _)| name.clone())
}

impl Rig {
    /// The log as it would have been with a cause of some size in it; `sign` turns the noise.
    fn with(&self, line: &Line, place: f64, sign: f64) -> Context {
        let mut context = self.context.clone();
        context.facts = Facts::default();
        let healthy = heldout::residuals(&self.context, Declared::default(), &self.healthy);
        for (target, (left, noise)) in context.targets.iter_mut().zip(healthy.iter().zip(&self.noise)) {
            target.y.iter_mut().zip(left.iter().zip(noise)).for_each(|(y, (l, e))| *y += sign * e - l);
        }
        for part in line.parts(&self.context, &self.healthy, place) {
            let target = &mut context.targets[part.target];
            target.y.iter_mut().zip(&part.change).for_each(|(y, change)| *y += change);
            let (levelled, noise) = (&target.levelled, &self.noise[part.target]);
            let louder = part.scatter.iter().zip(levelled).map(|(extra, v)| (1.0 + extra / v).sqrt() - 1.0);
            target.y.iter_mut().zip(louder.zip(noise)).for_each(|(y, (k, e))| *y += sign * k * e);
        }
        context
    }

    /// Whether an effect makes sense to the search where it is all that is there.
    pub(crate) fn makes_sense(&self, line: &Line, place: f64) -> bool {
        let context = self.with(line, place, 1.0);
        let placed = [line.placed(place)];
        fit(&context, Declared::default(), &placed, None, Rows::All)
            .is_some_and(|f| plausible(&context, Declared::default(), &f))
    }

    /// The two answers; whether the cause would be named is looked at where `naming` asks for it.
    pub(crate) fn ask(&self, question: &Question<'_>, place: f64, naming: bool) -> Option<[Answer; 2]> {
        Some([self.answer(question, place, 1.0, naming)?, self.answer(question, place, -1.0, naming)?])
    }

    fn answer(&self, question: &Question<'_>, place: f64, sign: f64, naming: bool) -> Option<Answer> {
        let Question { line, names, own } = *question;
        let context = self.with(line, place, sign);
        let declared = Declared::default();
        let start = fit(&context, declared, &[], None, Rows::All)?;
        let there = line.placed(place);
        let shares = |s: &Scanned| s.instance.channels.iter().any(|c| there.instance.touches(c));
        let mut all: Vec<Scanned> = offers(&context).into_iter().filter(shares).collect();
        let mut offered: Vec<&mut Scanned> = all.iter_mut().collect();
        let nothing = Candidate { fit: start.clone(), evidence: 0.0 };
        let ranked = round_of(&context, declared, &nothing, &mut offered, &mut |_| {});
        let mut answer = Answer { named: false, own: None, others: Vec::new() };
        for candidate in &ranked {
            let Some(name) = candidate.fit.placed.last().and_then(|p| name_of(p, names)) else { continue };
            if name == own {
                answer.own = answer.own.or_else(|| Some(candidate.clone()));
            } else if !answer.others.iter().any(|o| o.0 == name) {
                answer.others.push((name, candidate.clone()));
            }
        }
        let enough = answer.own.as_ref().is_some_and(|c| c.evidence > NEEDED_EVIDENCE);
        answer.named = naming && enough && self.is_named(&context, &start, &ranked, &there);
        Some(answer)
    }

    /// Whether the search would name this effect, whatever form of it comes first.
    fn is_named(&self, context: &Context, start: &Fit, ranked: &[Candidate], there: &Placed) -> bool {
        let (declared, folds) = (Declared::default(), self.folds.as_slice());
        let before = heldout::errors(context, declared, start, folds);
        let nothing = Candidate { fit: start.clone(), evidence: 0.0 };
        let own: Vec<Candidate> =
            ranked.iter().filter(|c| c.fit.placed.last().is_some_and(|p| p.effect.id() == there.effect.id())).cloned().collect();
        let Some(chosen) = choose(context, declared, &own, &nothing, &before, folds) else { return false };
        let ground = Ground { context, declared, start, folds };
        ask(ground, &before, &chosen.winner, &chosen.held).taken_back.is_empty()
    }
}
