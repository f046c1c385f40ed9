//! What several runs of one rig amount to: model, verdict, and the figures of each run.
//!
//! What it is: the joint fit put into the contract's words. Every error that counts is that of a run predicted whole by a fit to the others.
//! What can go wrong: with fewer than two runs there is nothing to predict.
//! Units: as the channels.
//! Reference: specification `formats.md`, "Verdict", `across_runs_rms`.

use super::choose::{self, Named};
use super::entries::{entry, own_entries, unexplained, unnamed};
use super::equations::left_on;
use super::joint::{Across, Joint, Shared};
use super::{Member, own};
use crate::bad;
use crate::close::{Closed, validation};
use crate::context::{Context, DIFFERENCES, Relation, unit_of};
use crate::effects::Estimate;
use crate::hypothesis::{Placed, allow_for_the_form};
use crate::log::Log;
use crate::model::{AddedEffect, FittedTo, Model, Polynomial, RunLevel};
use crate::noise::median;
use crate::residual::whiteness;
use crate::sparse;
use crate::verdict::{BeforeAfter, Channel, Channels, FORMAT, Figures, Kind, Validation, Verdict};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Fewest runs that can predict each other.
pub const FEWEST: usize = 2;

/// A run of the rig, on which the loop was closed alone first.
#[derive(Debug, Clone)]
pub struct Run {
    /// The log.
    pub log: Log,
    /// The loop closed on it alone.
    pub closed: Closed,
}

/// What several runs amount to.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The runs made ready, with the starting pulse of all.
    pub contexts: Vec<Context>,
    /// Declared model, fitted to all runs.
    pub declared: Model,
    /// Corrected model.
    pub model: Model,
    /// The contract's words.
    pub verdict: Verdict,
    /// For each effect of the rig its parameters on each run alone; empty where the run cannot tell.
    pub alone: Vec<Vec<Vec<Estimate>>>,
    /// Where the names took most.
    pub shown: Option<Shown>,
}

/// What is left of a channel of one run, predicted by a fit to the others.
#[derive(Debug, Clone)]
pub struct Shown {
    /// Run, by position.
    pub run: usize,
    /// Its name.
    pub name: String,
    /// Channel.
    pub channel: &'static str,
    /// Noise floor.
    pub floor: f64,
    /// Time, s.
    pub t: Vec<f64>,
    /// Measured less predicted by the declared model, one constant apart.
    pub before: Vec<f64>,
    /// The same by the corrected model.
    pub after: Vec<f64>,
}

/// The channel and run on which the names took most, with what is left of it.
fn shown(joint: &Joint<'_, '_>, folds: &Folds, before: &[Across], after: &[Across]) -> Option<Shown> {
    let gone = |(b, a): &(&Across, &Across)| b.rms.max(b.floor) / a.rms.max(a.floor);
    let (most, _) =
        before.iter().zip(after).filter(|(b, _)| !is_contrast(b.channel)).max_by(|x, y| gone(x).total_cmp(&gone(y)))?;
    let (run, channel) = (most.run, most.channel);
    let member = &joint.members[run];
    let k = member.context.target(channel)?;
    let left = |rig: &[Placed], shared: &[Shared]| {
        let s = shared.iter().find(|s| s.channel == channel)?;
        left_on(member, k, rig, &s.labels, &s.coefficients)
    };
    let target = &member.context.targets[k];
    let fold = &folds.0[run];
    Some(Shown {
        run,
        name: member.context.name.clone(),
        channel,
        floor: target.noise.rms,
        t: target.rows.iter().filter(|row| target.claims(**row)).map(|row| member.context.t[*row]).collect(),
        before: left(&[], &joint.without(run).shared(&[]))?,
        after: left(&fold.rig, &fold.shared)?,
    })
}

/// Closes the loop on several runs of one rig.
#[must_use]
pub fn close_together(runs: &[Run], progress: &mut (dyn FnMut(f64) + Send)) -> Outcome {
    let start = start_pulse(runs);
    let contexts: Vec<Context> = runs.iter().map(|run| prepared(&run.log, start)).collect();
    let mut members: Vec<Member<'_>> =
        runs.iter().zip(&contexts).filter_map(|(run, c)| Member::of(&run.closed, c, &contexts)).collect();
    let closed: Vec<&Closed> = runs.iter().map(|r| &r.closed).collect();
    let mut named = choose::choose(&closed, &members, &mut |share| progress(0.6 * share));
    let (folds, after) = tenable(&members, &mut named);
    progress(0.9);
    let rig: Vec<Placed> = named.iter().map(|n| n.placed.clone()).collect();
    let worths = own::settle(&mut members, &rig);
    let joint = Joint::of(&members);
    let before = joint.across(&[], None);
    let shared = joint.shared(&rig);
    let estimates: Vec<Vec<Estimate>> = (0..rig.len()).map(|k| folds.estimates(&joint, &rig, k, &shared)).collect();
    let bare: Vec<Member<'_>> = members.iter().map(|m| Member { own: Vec::new(), ..m.clone() }).collect();
    let level = |m: &Member<'_>| own::of(m, &[], &Joint::of(&bare).shared(&[]));
    let declared = model(runs, &contexts, &Joint::of(&bare).shared(&[]), &[], &[], bare.iter().map(level).collect());
    let own = members.iter().map(|m| own::of(m, &rig, &shared)).collect();
    let model = model(runs, &contexts, &shared, &rig, &estimates, own);
    let across = [before.as_slice(), &after];
    let alone = alone(&joint, &rig);
    let verdict = verdict(runs, &contexts, &joint, &named, &model, &declared, across, &estimates, &worths);
    progress(1.0);
    let shown = shown(&joint, &folds, &before, &after);
    Outcome { contexts, declared, model, verdict, alone, shown }
}

fn start_pulse(runs: &[Run]) -> f64 {
    median(&mut runs.iter().map(|r| r.closed.context.start_pulse_us).collect::<Vec<f64>>())
}

fn prepared(log: &Log, start: f64) -> Context {
    let log = &*sparse::without(log, &sparse::left_out(log));
    let aside = bad::found(log);
    let mut context = Context::of_clean(&bad::without(log, &aside), Some(start));
    context.leave_aside(aside);
    context
}

/// The fit without one run.
struct Fold {
    /// Which effects of the rig it holds.
    known: Vec<usize>,
    rig: Vec<Placed>,
    shared: Vec<Shared>,
}

/// The fits without one run each.
struct Folds(Vec<Fold>);

/// Each run predicted by a fit to the others, shapes too. Names that make a run's channel worse go, the weakest first.
fn tenable(members: &[Member<'_>], named: &mut Vec<Named>) -> (Folds, Vec<Across>) {
    let joint = Joint::of(members);
    let before = joint.across(&[], None);
    loop {
        let rig: Vec<Placed> = named.iter().map(|n| n.placed.clone()).collect();
        let (folds, after) = left_out(&joint, &rig);
        let Some(worse) = choose::harms(&before, &after) else { return (folds, after) };
        let touching = (0..named.len()).filter(|k| named[*k].placed.instance.touches(worse));
        let Some(weakest) = touching.min_by(|a, b| named[*a].score.total_cmp(&named[*b].score)) else { return (folds, after) };
        named.remove(weakest);
    }
}

/// The fits without one run each, on all cores, and what they predict of it.
fn left_out(joint: &Joint<'_, '_>, rig: &[Placed]) -> (Folds, Vec<Across>) {
    let of = |run: usize| {
        let others = joint.without(run);
        // of what the others cannot tell nothing is known
        let known: Vec<usize> = (0..rig.len()).filter(|k| others.tellers(&rig[*k]) > 0).collect();
        let rig: Vec<Placed> = known.iter().map(|k| rig[*k].clone()).collect();
        let refined = others.refined_whole(&rig, choose::SOUGHT, choose::EVALUATIONS);
        let shared = others.shared(&refined);
        (others.on(run, &refined, &shared), Fold { known, rig: refined, shared })
    };
    let all = in_parallel(joint.members.len(), &of);
    let mut out = (Folds(Vec::new()), Vec::new());
    for (across, fold) in all {
        out.1.extend(across);
        out.0.0.push(fold);
    }
    // in the order in which a joint fit lists them: by channel, then by run
    let channels: Vec<&str> = joint.channels();
    out.1.sort_by_key(|a| (channels.iter().position(|c| *c == a.channel), a.run));
    out
}

/// What a function makes of 0 to `n`, in order, on all cores.
pub(super) fn in_parallel<T: Send>(n: usize, of: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(n.max(1));
    let next = AtomicUsize::new(0);
    let worker = || {
        let take = || Some(next.fetch_add(1, Ordering::Relaxed)).filter(|i| *i < n);
        std::iter::from_fn(take).map(|i| (i, of(i))).collect::<Vec<(usize, T)>>()
    };
    let mut all: Vec<(usize, T)> = std::thread::scope(|scope| {
        let handles: Vec<_> = (0..threads).map(|_| scope.spawn(worker)).collect();
        handles.into_iter().flat_map(|h| h.join().unwrap_or_default()).collect()
    });
    all.sort_by_key(|(i, _)| *i);
    all.into_iter().map(|(_, value)| value).collect()
}

impl Folds {
    /// Parameters of an effect of the rig. Its error is what all runs together leave, and what leaving out one run after the other moves it by
    /// (jackknife over runs, Efron & Stein 1981, Annals of Statistics 9:586).
    fn estimates(&self, joint: &Joint<'_, '_>, rig: &[Placed], k: usize, shared: &[Shared]) -> Vec<Estimate> {
        let mut out = choose::estimates(joint, rig, k, shared);
        let of_fold = |f: &Fold| Some(choose::estimates(joint, &f.rig, f.known.iter().position(|j| *j == k)?, &f.shared));
        let folds: Vec<Vec<Estimate>> = self.0.iter().filter_map(of_fold).collect();
        let n = folds.len().max(1) as f64;
        for (i, e) in out.iter_mut().enumerate() {
            let values: Vec<f64> = folds.iter().filter_map(|f| f.get(i)).map(|f| f.value).collect();
            let mean = values.iter().sum::<f64>() / n;
            let moved = ((n - 1.0) / n * values.iter().map(|v| (v - mean).powi(2)).sum::<f64>()).sqrt();
            e.se = if e.se.is_finite() { e.se.hypot(moved) } else { moved };
        }
        if let Some(member) = joint.members.first() {
            allow_for_the_form(member.context, &mut out);
        }
        out
    }
}

/// Parameters of each effect of the rig on each run alone.
fn alone(joint: &Joint<'_, '_>, rig: &[Placed]) -> Vec<Vec<Vec<Estimate>>> {
    let of_run = |run: usize| {
        let one = joint.only(run);
        let refined = one.refined_whole(rig, choose::SOUGHT, choose::EVALUATIONS);
        let shared = one.shared(&refined);
        (0..rig.len())
            .map(|k| if one.tells(run, &rig[k]) { choose::estimates(&one, &refined, k, &shared) } else { Vec::new() })
            .collect()
    };
    let by_run: Vec<Vec<Vec<Estimate>>> = in_parallel(joint.members.len(), &of_run);
    (0..rig.len()).map(|k| by_run.iter().map(|run| run[k].clone()).collect()).collect()
}

fn model(
    runs: &[Run],
    contexts: &[Context],
    shared: &[Shared],
    rig: &[Placed],
    estimates: &[Vec<Estimate>],
    own: Vec<RunLevel>,
) -> Model {
    let polynomial = |s: &Shared| {
        let of_run = |o: &RunLevel| o.polynomials.iter().find(|(c, _)| c == s.channel).and_then(|(_, p)| p.first().copied());
        let zeros: Vec<f64> = own.iter().filter_map(of_run).collect();
        let (mean, spread) = mean_and_spread(&zeros);
        let powers = s.base().map(|j| (s.coefficients[j], s.covariance[(j, j)].max(0.0).sqrt()));
        let (coefficients, errors) = std::iter::once((mean, spread)).chain(powers).unzip();
        Polynomial { channel: s.channel.to_owned(), coefficients, errors }
    };
    let effect = |(k, p): (usize, &Placed)| AddedEffect {
        placed: p.clone(),
        amplitudes: shared
            .iter()
            .filter(|s| p.instance.touches(s.channel))
            .map(|s| (s.channel.to_owned(), s.amplitudes(k, p)))
            .collect(),
        estimates: estimates.get(k).cloned().unwrap_or_default(),
        mean: Vec::new(),
    };
    let polynomials = shared.iter().map(polynomial).collect();
    Model {
        runs: runs.iter().map(|r| FittedTo::of(&r.log)).collect(),
        effects: rig.iter().enumerate().map(effect).collect(),
        own,
        ..Model::of(&contexts[0], &runs[0].log, polynomials)
    }
}

/// Mean of the runs' constants and its standard error.
fn mean_and_spread(zeros: &[f64]) -> (f64, f64) {
    let n = zeros.len().max(1) as f64;
    let mean = zeros.iter().sum::<f64>() / n;
    let square = zeros.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    (mean, (square / n).sqrt())
}

#[expect(clippy::too_many_arguments, reason = "the whole of a joint fit, put into words once")]
fn verdict(
    runs: &[Run],
    contexts: &[Context],
    joint: &Joint<'_, '_>,
    named: &[Named],
    model: &Model,
    declared: &Model,
    across: [&[Across]; 2],
    estimates: &[Vec<Estimate>],
    worths: &[Vec<own::Worth>],
) -> Verdict {
    let channels = channels(runs, contexts, [declared, model], across);
    let mut effects: Vec<_> = (0..named.len()).map(|k| entry(joint, named, k, across[1], &estimates[k])).collect();
    effects.sort_by(|a, b| b.heldout_error_reduction.total_cmp(&a.heldout_error_reduction));
    let own = model.own.iter().zip(worths).enumerate();
    effects.extend(own.flat_map(|(run, (own, worths))| own_entries(&contexts[run], own, worths)));
    let unexplained = unexplained(runs, across[1]);
    let kind = match (effects.is_empty(), unexplained.is_empty()) {
        (false, _) => Kind::Attributed,
        (true, false) => Kind::Unattributed,
        (true, true) => Kind::None,
    };
    if kind == Kind::Unattributed {
        effects.extend(unexplained.first().map(unnamed));
    }
    Verdict {
        format: FORMAT,
        run: runs[0].log.name.clone(),
        verdict: kind,
        channels,
        effects,
        unexplained,
        alternatives: Vec::new(),
        next_experiment: None,
        left_out: Vec::new(),
        set_aside: Vec::new(),
        validation: Vec::new(),
        runs: runs.iter().enumerate().map(|(k, run)| of_run(run, k, across)).collect(),
    }
}

/// Whether a channel is what one speed sensor reads beyond the others.
pub(super) fn is_contrast(channel: &str) -> bool {
    DIFFERENCES.iter().any(|d| d.1 == channel)
}

fn of_run(run: &Run, k: usize, [before, after]: [&[Across]; 2]) -> Validation {
    let own = before.iter().zip(after).filter(|(b, _)| b.run == k && !is_contrast(b.channel));
    let channels: BTreeMap<String, BeforeAfter> =
        own.map(|(b, a)| (b.channel.to_owned(), BeforeAfter { before: b.rms, after: a.rms })).collect();
    Validation { run: run.log.name.clone(), channels }
}

/// Each channel over all runs: what is left across runs and the noise floor as geometric means over the runs, so that a run of wild steps does
/// not stand for all; what the written model leaves as the root of the mean square.
fn channels(runs: &[Run], contexts: &[Context], models: [&Model; 2], across: [&[Across]; 2]) -> Channels {
    let mut out = Channels::default();
    let own: Vec<Validation> = runs.iter().map(|r| validation(&r.log, models[0], models[1])).collect();
    for target in contexts.iter().flat_map(|c| &c.targets).filter(|t| !t.relation.is_evidence()) {
        let name = target.name;
        if out.predicted.contains_key(name) || out.not_predicted.contains_key(name) {
            continue;
        }
        if target.relation == Relation::SpeedAlone {
            out.not_predicted.insert(name.to_owned(), "no command was logged".to_owned());
            continue;
        }
        let pooled = |list: &[Across], of: &dyn Fn(&Across) -> f64| typical(list.iter().filter(|a| a.channel == name).map(of));
        let figures = |side: usize, of: &dyn Fn(&BeforeAfter) -> f64| Figures {
            rms: root_mean(own.iter().filter_map(|v| v.channels.get(name)).map(of)),
            heldout_rms: pooled(across[side], &|a| a.rms),
            across_runs_rms: Some(pooled(across[side], &|a| a.rms)),
            whiteness_p: least_white(runs, contexts, models[side], name),
        };
        let channel = Channel {
            unit: unit_of(name).to_owned(),
            noise_floor_rms: pooled(across[0], &|a| a.floor),
            before: figures(0, &|b| b.before),
            after: figures(1, &|b| b.after),
        };
        if channel.before.heldout_rms.is_finite() && channel.after.heldout_rms.is_finite() {
            out.predicted.insert(name.to_owned(), channel);
        }
    }
    out
}

/// Geometric mean.
pub(super) fn typical(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(s, n), v| (s + v.max(f64::MIN_POSITIVE).ln(), n + 1.0));
    f64::exp(sum / n)
}

fn root_mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(s, n), v| (s + v * v, n + 1.0));
    f64::sqrt(sum / n)
}

/// The least whiteness of a channel's residual over the runs.
fn least_white(runs: &[Run], contexts: &[Context], model: &Model, name: &'static str) -> f64 {
    let of_run = |(run, context): (&Run, &Context)| {
        let target = &context.targets[context.target(name)?];
        let prediction = model.on(&run.log).predict(context, name)?;
        let claimed = target.rows.iter().zip(&target.y).filter(|(row, _)| target.claims(**row));
        let (t, r): (Vec<f64>, Vec<f64>) = claimed.map(|(row, y)| (context.t[*row], y - prediction[*row])).unzip();
        Some(whiteness(&t, &r))
    };
    runs.iter().zip(contexts).filter_map(of_run).fold(1.0, f64::min)
}
