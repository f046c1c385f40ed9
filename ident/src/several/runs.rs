//! Several runs of one rig judge the hypotheses together.
//!
//! What it is: every hypothesis that stood on any of the runs is fitted to each of them, and each fit predicts the other runs as
//! it stands; what predicts best is probably true.
//! What can go wrong: with one run there is nothing to predict, and the run's own probabilities stand. A run has its own tare: a
//! constant a channel is left to it.
//! Units: scores in nats.
//! Reference: cross-validation over runs; discrimination by a second experiment, Atkinson & Fedorov 1975, Biometrika 62:57.

use crate::attribution::diagnose::Diagnosis;
use crate::attribution::evidence::Candidate;
use crate::attribution::rivals::{Rival, TEMPERATURE};
use crate::channel::Context;
use crate::close::Closed;
use crate::effects::placed::Placed;
use crate::effects::placed::is_named;
use crate::experiment;
use crate::fit::search::refine;
use crate::fit::{Fit, Rows, fit};
use crate::log::Log;
use crate::model::Declared;
use crate::model::Model;
use crate::verdict::NextExperiment;

/// Rivals of one run that take part.
const RIVALS: usize = 4;
/// Evaluations that a hypothesis may spend on its shapes on a run that it does not come from.
const EVALUATIONS: usize = 80;
/// Share of the leader's probability at which another hypothesis keeps the question open.
const OPEN: f64 = 0.5;
/// Share of the noise floor below which a smaller residual counts no further.
const FINEST: f64 = 0.3;

/// A run with what was found on it.
#[derive(Debug, Clone)]
pub struct Run {
    /// The log.
    pub log: Log,
    /// The loop closed on it alone.
    pub closed: Closed,
}

/// A hypothesis and how it stands on all runs.
#[derive(Debug, Clone)]
pub struct Standing {
    /// Identifiers of its effects.
    pub ids: Vec<String>,
    /// Its fit on each run.
    pub fits: Vec<Fit>,
    /// Log of how well its fits predict the other runs; 0 with one run.
    pub score: f64,
    /// Its probability among those that stood.
    pub probability: f64,
}

impl Standing {
    /// Whether this one only adds effects to the other or leaves some out.
    fn nests(&self, other: &Self) -> bool {
        self.ids.iter().all(|i| other.ids.contains(i)) || other.ids.iter().all(|i| self.ids.contains(i))
    }
}

/// How the hypotheses stand, most probable first; empty where no run named anything.
#[must_use]
pub fn standings(runs: &[Run]) -> Vec<Standing> {
    let mut out: Vec<Standing> = hypotheses(runs)
        .into_iter()
        .filter_map(|(placed, probability)| {
            let fits: Vec<Fit> = runs.iter().map(|r| fitted(&r.closed.context, &placed)).collect::<Option<_>>()?;
            let ids = placed.iter().map(|p| p.effect.id().to_owned()).collect();
            Some(Standing { ids, fits, score: 0.0, probability })
        })
        .collect();
    if runs.len() > 1 {
        for s in &mut out {
            s.score = score(runs, &s.fits);
        }
        let top = out.iter().map(|s| s.score).fold(f64::NEG_INFINITY, f64::max);
        for s in &mut out {
            s.probability = ((s.score - top) / TEMPERATURE).exp();
        }
    }
    let total: f64 = out.iter().map(|s| s.probability).sum::<f64>().max(f64::MIN_POSITIVE);
    out.iter_mut().for_each(|s| s.probability /= total);
    out.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    out
}

/// The hypothesis that still stands against the leader, if any: about as probable, and another explanation rather than one
/// effect more or less.
#[must_use]
pub fn rival(standings: &[Standing]) -> Option<&Standing> {
    let (leader, rest) = standings.split_first()?;
    rest.iter().find(|s| s.probability >= OPEN * leader.probability && !s.nests(leader))
}

/// The model that a standing's fit on one of the runs amounts to.
#[must_use]
pub fn model(runs: &[Run], standing: &Standing, run: usize) -> Model {
    Model::from_fit(&runs[run].closed.context, &runs[run].log, Declared::default(), &standing.fits[run])
}

/// The run that would tell the leader and its rival apart, as they were fitted to the first run.
#[must_use]
pub fn next(runs: &[Run], leader: &Standing, rival: &Standing) -> Option<NextExperiment> {
    let first = &runs.first()?.closed;
    let question = Diagnosis {
        best: Candidate { fit: leader.fits[0].clone(), evidence: first.diagnosis.best.evidence },
        rivals: vec![Rival { ids: rival.ids.clone(), probability: rival.probability, fit: rival.fits[0].clone() }],
        ..first.diagnosis.clone()
    };
    experiment::next(&first.context, Declared::default(), &model(runs, leader, 0), &question)
}

/// Every hypothesis that stood on a run, with the probability that it had there.
fn hypotheses(runs: &[Run]) -> Vec<(Vec<Placed>, f64)> {
    let mut out: Vec<(Vec<Placed>, f64)> = Vec::new();
    let mut add = |placed: Vec<Placed>, probability: f64| {
        // what has no name is no hypothesis of another run
        let placed: Vec<Placed> = placed.into_iter().filter(is_named).collect();
        let new = !placed.is_empty() && !out.iter().any(|(other, _)| same(other, &placed));
        if new {
            out.push((placed, probability));
        }
    };
    for run in runs {
        let d = &run.closed.diagnosis;
        add(d.best.fit.placed.clone(), d.probability);
        for rival in d.rivals.iter().take(RIVALS) {
            add(complete(&d.best.fit, rival), rival.probability);
        }
    }
    out
}

/// A rival as a whole hypothesis: the winner with the effect that the rival lacks replaced by the one that the rival has.
fn complete(best: &Fit, rival: &Rival) -> Vec<Placed> {
    let Some(other) = rival.fit.placed.last() else { return Vec::new() };
    let kept =
        best.placed.iter().filter(|p| rival.ids.iter().any(|id| id == p.effect.id()) && p.effect.id() != other.effect.id());
    kept.cloned().chain([other.clone()]).collect()
}

fn same(a: &[Placed], b: &[Placed]) -> bool {
    let holds = |list: &[Placed], p: &Placed| list.iter().any(|q| q.effect.id() == p.effect.id() && q.instance == p.instance);
    a.len() == b.len() && a.iter().all(|p| holds(b, p))
}

fn fitted(context: &Context, placed: &[Placed]) -> Option<Fit> {
    let declared = Declared::default();
    let placed = refine(context, declared, placed, Rows::All, EVALUATIONS);
    fit(context, declared, &placed, None, Rows::All)
}

/// Sum over the runs of how well the fits to the other runs predict it, on average.
fn score(runs: &[Run], fits: &[Fit]) -> f64 {
    let mut sum = 0.0;
    for (j, judge) in runs.iter().enumerate() {
        let teachers: Vec<usize> = (0..runs.len()).filter(|i| *i != j).collect();
        for i in &teachers {
            let model = Model::from_fit(&runs[*i].closed.context, &runs[*i].log, Declared::default(), &fits[*i]);
            sum += predicts(&model, judge) / teachers.len() as f64;
        }
    }
    sum
}

/// Log score of a model on a run: samples as independent as the residual of the run's own best fit.
fn predicts(model: &Model, run: &Run) -> f64 {
    let context = &run.closed.context;
    let shares = run.closed.diagnosis.best.fit.targets.iter().map(|t| t.share);
    context
        .targets
        .iter()
        .zip(shares)
        .filter(|(t, _)| !t.relation.is_evidence())
        .filter_map(|(target, share)| {
            let prediction = model.predict(context, target.name)?;
            let residual: Vec<f64> = target.rows.iter().zip(&target.y).map(|(i, y)| y - prediction[*i]).collect();
            let n = residual.len() as f64;
            let mean = residual.iter().sum::<f64>() / n;
            let square = residual.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / n;
            let floor = (FINEST * target.noise.rms).powi(2).max(f64::MIN_POSITIVE);
            Some(-0.5 * n * share * target.weight * (square.max(floor) / floor).ln())
        })
        .sum()
}
