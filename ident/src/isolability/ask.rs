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
use crate::attribution::beside::ask;
use crate::attribution::choose::choose;
use crate::attribution::evidence::Candidate;
use crate::attribution::round::{REFINED, Scanned, offers, round_of};
use crate::attribution::together::Ground;
use crate::channel::{Context, Facts};
use crate::effects::NEEDED_EVIDENCE;
use crate::effects::placed::Placed;
use crate::fit::heldout;
use crate::fit::{Fit, Rows, fit, is_plausible, part_of};
use crate::model::Declared;

/// A log's schedule, sensors and noise.
pub(crate) struct Rig {
    pub(crate) context: Context,
    /// The best hypothesis of the log as it is: what it holds stays in the log.
    pub(crate) best: Fit,
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
    /// Every cause: its name, and one way in which it may be there.
    pub(crate) names: &'q [(String, Placed)],
    pub(crate) own: &'q str,
}

/// Name of the cause that an effect belongs to: one for each effect, kind of channel, and scope.
pub(crate) fn name_of<'n>(placed: &Placed, names: &'n [(String, Placed)]) -> Option<&'n str> {
    names.iter().find(|(_, p)| is_one_cause(p, placed)).map(|(name, _)| name.as_str())
}

/// Whether two effects are one cause.
pub(crate) fn is_one_cause(a: &Placed, b: &Placed) -> bool {
    let scope = |p: &Placed| p.effect.scope(&p.instance);
    let kind = |p: &Placed| p.instance.channels.first().map(|c| if c.starts_with("rpm") { "rpm".to_owned() } else { c.clone() });
    a.effect.id() == b.effect.id() && kind(a) == kind(b) && scope(a) == scope(b)
}

impl Rig {
    /// What stays in the log beside a cause: all that was found but the cause itself.
    fn beside(&self, id: &str) -> Vec<Placed> {
        self.best.placed.iter().filter(|p| p.effect.id() != id).cloned().collect()
    }

    /// The log as it would have been with a cause of some size in it; `sign` turns the noise.
    fn with(&self, line: &Line, place: f64, sign: f64) -> Context {
        let mut context = self.context.clone();
        context.facts = Facts::default();
        let id = line.placed(place).effect.id();
        for (i, target) in context.targets.iter_mut().enumerate() {
            let noise = &self.noise[i];
            target.y.iter_mut().zip(noise).for_each(|(y, e)| *y += (sign - 1.0) * e);
            for k in (0..self.best.placed.len()).filter(|k| self.best.placed[*k].effect.id() == id) {
                let part = part_of(&self.context, Declared::default(), &self.best, k, i);
                target.y.iter_mut().zip(part).for_each(|(y, part)| *y -= part);
            }
        }
        for part in line.parts(&self.context, &self.best, place) {
            let target = &mut context.targets[part.target];
            target.y.iter_mut().zip(&part.change).for_each(|(y, change)| *y += change);
            let (levelled, noise) = (&target.levelled, &self.noise[part.target]);
            let louder = part.scatter.iter().zip(levelled).map(|(extra, v)| (1.0 + extra / v).sqrt() - 1.0);
            target.y.iter_mut().zip(louder.zip(noise)).for_each(|(y, (k, e))| *y += sign * k * e);
        }
        context
    }

    /// Whether an effect of this size makes sense to the search where it is there.
    pub(crate) fn makes_sense(&self, line: &Line, place: f64) -> bool {
        let context = self.with(line, place, 1.0);
        let there = line.placed(place);
        let mut placed = self.beside(there.effect.id());
        placed.push(there);
        let last = placed.len() - 1;
        fit(&context, Declared::default(), &placed, None, Rows::All)
            .is_some_and(|f| is_plausible(&context, Declared::default(), &f, last))
    }

    /// The two answers; whether the cause would be named is looked at where `naming` asks for it.
    pub(crate) fn ask(&self, question: &Question<'_>, place: f64, naming: bool) -> Option<[Answer; 2]> {
        Some([self.answer(question, place, 1.0, naming)?, self.answer(question, place, -1.0, naming)?])
    }

    fn answer(&self, question: &Question<'_>, place: f64, sign: f64, naming: bool) -> Option<Answer> {
        let Question { line, names, own } = *question;
        let context = self.with(line, place, sign);
        let declared = Declared::default();
        let there = line.placed(place);
        let base = fit(&context, declared, &self.beside(there.effect.id()), None, Rows::All)?;
        let known = Candidate { fit: base, evidence: 0.0 };
        let shares = |s: &Scanned| s.instance.channels.iter().any(|c| there.instance.touches(c));
        let mut all: Vec<Scanned> = offers(&context).into_iter().filter(shares).collect();
        let mut offered: Vec<&mut Scanned> = all.iter_mut().collect();
        let ranked = round_of(&context, declared, &known, (&mut offered, REFINED), &mut |_| {});
        let mut answer = Answer { named: false, own: None, others: Vec::new() };
        for candidate in &ranked {
            let Some(name) = candidate.fit.placed.last().and_then(|p| name_of(p, names)) else { continue };
            if name == own {
                answer.own = answer.own.or_else(|| Some(candidate.clone()));
            } else if !answer.others.iter().any(|o| o.0 == name) {
                answer.others.push((name.to_owned(), candidate.clone()));
            }
        }
        let enough = answer.own.as_ref().is_some_and(|c| c.evidence > NEEDED_EVIDENCE);
        answer.named = naming && enough && self.is_named(&context, &known, &ranked, &there);
        Some(answer)
    }

    /// Whether the search would name this cause beside what was known, were it the only one that is offered.
    fn is_named(&self, context: &Context, known: &Candidate, ranked: &[Candidate], there: &Placed) -> bool {
        let (declared, folds) = (Declared::default(), self.folds.as_slice());
        let Some(start) = fit(context, declared, &[], None, Rows::All) else { return false };
        let own = |c: &&Candidate| c.fit.placed.last().is_some_and(|p| is_one_cause(p, there));
        let own: Vec<Candidate> = ranked.iter().filter(own).cloned().collect();
        let errors = heldout::errors(context, declared, &known.fit, folds);
        let Some(chosen) = choose(context, declared, &own, known, &errors, folds) else { return false };
        let before = if known.fit.placed.is_empty() { errors } else { heldout::errors(context, declared, &start, folds) };
        let ground = Ground { context, declared, start: &start, folds };
        let newest = chosen.winner.fit.placed.len() - 1;
        !ask(ground, &before, &chosen.winner, &chosen.held).taken_back.contains(&newest)
    }
}
