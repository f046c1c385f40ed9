//! What several runs of one rig amount to: model, verdict, and the figures of each run.
//!
//! What it is: the runs made ready, the names chosen and tried, the model written down, and what a page shows of them.
//! What can go wrong: with fewer than two runs there is nothing to predict.
//! Units: as the channels.
//! Reference: specification `formats.md`, "Model file", `[run]`.

use super::entries::loudest;
use super::equations::left_on;
use super::folds::{self, Tenable};
use super::joint::{Across, Joint, Shared, compared};
use super::words::{self, Told};
use super::{Member, Run, choose, differing, own, scatter};
use crate::channel::{Context, is_contrast};
use crate::close::Closed;
use crate::close::supply_limit;
use crate::effects::Estimate;
use crate::effects::placed::Placed;
use crate::experiment::between;
use crate::log::Log;
use crate::log::sparse;
use crate::model::{AddedEffect, FittedTo, Model, Polynomial, Reach, RunLevel, shape_errors, stood};
use crate::numeric::order::median;
use crate::numeric::parallel::in_parallel;
use crate::signal::{bad, start};
use crate::verdict::words::parameter_of;
use crate::verdict::words::{DISAGREE, OTHERWISE, digits, scaled};
use crate::verdict::{Kind, NextExperiment, Verdict};

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
    /// Of each channel the run on which the names took most, the channel on which they took most first.
    pub shown: Vec<Shown>,
    /// For each effect of the rig where it took most: before without it, after with it.
    pub each: Vec<Option<Shown>>,
    /// For each channel that the verdict leaves unexplained the run on which it is loudest.
    pub left: Vec<Option<Shown>>,
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
    /// Time, s; rows where the log has no time.
    pub t: Vec<f64>,
    /// Of a log without a time.
    pub timeless: bool,
    /// Measured less predicted by the declared model, one constant apart.
    pub before: Vec<f64>,
    /// The same by the corrected model.
    pub after: Vec<f64>,
}

/// Of each channel the run on which the names took most, with what is left of it; the channel on which they took most first.
fn shown(tenable: &Tenable<'_>) -> Vec<Shown> {
    let mut each: Vec<_> = tenable.compared.iter().filter(|c| !is_contrast(c.before.channel)).collect();
    each.sort_by(|a, b| b.times().total_cmp(&a.times()));
    let mut seen: Vec<&str> = Vec::new();
    each.retain(|c| {
        let new = !seen.contains(&c.before.channel);
        seen.push(c.before.channel);
        new
    });
    each.iter().filter_map(|c| shown_on(tenable, (c.before.run, c.before.channel), &[])).collect()
}

/// What is left of a channel of a run, predicted by a fit to the others: before with fewer effects, after with all.
fn shown_on(tenable: &Tenable<'_>, (run, channel): (usize, &'static str), fewer: &[Placed]) -> Option<Shown> {
    let Tenable { members, folds, .. } = tenable;
    let member = &members[run];
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
        timeless: member.context.time_is_row,
        before: left(fewer, &Joint::of(members).without(run).shared(fewer))?,
        after: left(&fold.rig, &fold.shared)?,
    })
}

/// The run on which an effect of the rig took most of the channel that it is quoted for.
fn shown_without(tenable: &Tenable<'_>, k: usize, without: &[Across], quoted: &str) -> Option<Shown> {
    let after: Vec<Across> = tenable.compared.iter().map(|c| c.after).filter(|a| a.channel == quoted).collect();
    let most = compared(without, &after).into_iter().max_by(|a, b| a.times().total_cmp(&b.times()))?;
    let fewer: Vec<Placed> = choose::without(&tenable.named, k);
    shown_on(tenable, (most.before.run, most.before.channel), &fewer)
}

/// Closes the loop on several runs of one rig.
#[must_use]
pub fn close_together(runs: &[Run], progress: &mut (dyn FnMut(f64) + Send)) -> Outcome {
    let start = start_pulse(runs.iter().map(|r| &r.closed.context));
    let share = median(&mut runs.iter().map(|r| r.closed.context.consensus.sensor_share).collect::<Vec<f64>>());
    let contexts: Vec<Context> = runs.iter().map(|run| prepared(&run.log, (start, share))).collect();
    let mut members: Vec<Member<'_>> = runs.iter().zip(&contexts).map(|(run, c)| Member::of(&run.closed, c, &contexts)).collect();
    let closed: Vec<&Closed> = runs.iter().map(|r| &r.closed).collect();
    let differing = differing::found(&closed);
    members.iter_mut().zip(differing).for_each(|(m, differing)| m.own.extend(differing));
    let named = choose::choose(&closed, &members, &mut |share| progress(0.6 * share));
    let tenable = folds::tenable(&members, named);
    progress(0.9);
    let rig: Vec<Placed> = tenable.named.iter().map(|n| n.placed.clone()).collect();
    let joint = Joint::of(&tenable.members);
    let shared = joint.shared(&rig);
    let mut estimates: Vec<Vec<Estimate>> = (0..rig.len()).map(|k| tenable.folds.estimates(&joint, &rig, k, &shared)).collect();
    let alone = alone(&joint, &rig, &closed);
    let disagreements: Vec<_> = (0..rig.len()).map(|k| disagreement(&contexts[0], &rig[k], &estimates[k], &alone[k])).collect();
    estimates.iter_mut().zip(&alone).for_each(|(shared, alone)| scatter::widened(shared, alone));
    let own = joint.members.iter().map(|m| own::of(m, &rig, &shared)).collect();
    let model = model(runs, &contexts, &shared, &rig, &estimates, own);
    let declared = declared(runs, &contexts, &members);
    let without: Vec<Vec<Across>> = (0..rig.len()).map(|k| joint.across(&choose::without(&tenable.named, k), None)).collect();
    let told = Told {
        runs,
        contexts: &contexts,
        tenable: &tenable,
        models: [&declared, &model],
        estimates: &estimates,
        without: &without,
        disagreements: &disagreements,
    };
    let mut verdict = words::verdict(&told);
    if verdict.verdict == Kind::Ambiguous {
        verdict.next_experiment = next(&told, &joint, &rig, &verdict);
    }
    let shown = shown(&tenable);
    let quoted =
        |k: usize| verdict.effects.iter().find(|e| e.run.is_none() && rig[k].is_told_by(e)).and_then(|e| e.channels.first());
    let each = (0..rig.len()).map(|k| shown_without(&tenable, k, &without[k], quoted(k)?)).collect();
    let after: Vec<Across> = tenable.compared.iter().map(|c| c.after).collect();
    let loudest = |channel: &str| loudest(&after, channel).and_then(|a| shown_on(&tenable, (a.run, a.channel), &[]));
    let left = verdict.unexplained.iter().map(|u| loudest(&u.channel)).collect();
    progress(1.0);
    Outcome { contexts, declared, model, verdict, alone, shown, each, left }
}

/// The run that would settle what these leave open: as the model has it, and as it would be with the likeliest rival in the place of the name that
/// the verdict's first alternative replaces.
fn next(told: &Told<'_, '_>, joint: &Joint<'_, '_>, rig: &[Placed], verdict: &Verdict) -> Option<NextExperiment> {
    let disputed = verdict.alternatives.iter().find_map(|a| verdict.effects.get(a.change.as_ref()?.place))?;
    let k = rig.iter().position(|p| p.is_told_by(disputed))?;
    let mut other = rig.to_vec();
    other[k] = told.tenable.named.get(k)?.rival.clone()?;
    let shared = joint.shared(&other);
    let own = joint.members.iter().map(|m| own::of(m, &other, &shared)).collect();
    let ids = [&rig[k], &other[k]].map(|p| p.effect.id().to_owned());
    let rival = model(told.runs, told.contexts, &shared, &other, &[], own);
    let next = between(told.contexts.first()?, told.models[1], &rival, &ids)?;
    Some(NextExperiment { why: next.why.replacen("this run", "these runs", 1), ..next })
}

/// The declared model, fitted to all runs: no effect, of the rig or of a run.
fn declared(runs: &[Run], contexts: &[Context], members: &[Member<'_>]) -> Model {
    let bare: Vec<Member<'_>> = members.iter().map(|m| Member { own: Vec::new(), ..m.clone() }).collect();
    let shared = Joint::of(&bare).shared(&[]);
    let own = bare.iter().map(|m| own::of(m, &[], &shared)).collect();
    Model { sensor_share: 0.0, ..model(runs, contexts, &shared, &[], &[], own) }
}

/// The pulse at which the rig's motor starts: between the highest at which it stands on any run and the lowest at which it turns. Each run by itself
/// tells it no finer than its own levels lie. As the noise floors, it is of all runs, so that a run which the others predict has its part in it.
fn start_pulse<'c>(runs: impl Iterator<Item = &'c Context>) -> f64 {
    let (mut t, mut pulse, mut rpm) = (Vec::new(), Vec::new(), Vec::new());
    for context in runs {
        let Some(own) = context.pulse.as_ref().filter(|p| p.len() == context.told.len()) else { continue };
        let shift = t.last().copied().unwrap_or(0.0) - context.t.first().copied().unwrap_or(0.0);
        t.extend(context.t.iter().map(|t| t + shift));
        pulse.extend_from_slice(own);
        rpm.extend_from_slice(&context.told);
    }
    start::start_pulse(&t, (!pulse.is_empty()).then_some(&*pulse), &rpm)
}

fn prepared(log: &Log, (start, share): (f64, f64)) -> Context {
    let log = &*sparse::without(log, &sparse::left_out(log));
    let aside = bad::found(log);
    let log = &*bad::without(log, &aside);
    let mut context = Context::of_clean(log, Some(start));
    context.leave_aside(aside);
    context.steady_speed(share);
    if let Some(limit) = supply_limit::found(log, &context) {
        context.leave_out_from(log, limit.begins_us());
    }
    context
}

/// On which of an effect's parameters the runs disagree, as it is reported, in words.
fn disagreement(context: &Context, placed: &Placed, shared: &[Estimate], alone: &[Vec<Estimate>]) -> Option<String> {
    let reported = |e: &[Estimate]| placed.effect.report(context, &placed.instance, e.to_vec());
    let runs: Vec<Vec<Estimate>> = alone.iter().map(|run| reported(run)).collect();
    let shared = reported(shared);
    let (name, [least, most]) = scatter::disagreement(&shared, &runs)?;
    let unit = shared.iter().find(|e| e.name == name).map_or("", |e| e.unit.as_str());
    // as the value itself is told
    let together = shared.iter().find(|e| e.name == name).map_or(f64::NAN, |e| e.value);
    let (factor, unit) = scaled(together, unit);
    let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
    let told = |v: f64| digits(factor * v, 0.005 * (factor * v).abs());
    let what = parameter_of(placed.effect.id(), &name);
    let how = if (least..=most).contains(&together) { DISAGREE } else { OTHERWISE };
    Some(format!("{how}: alone they have {} to {}{unit} for the {what}", told(least), told(most)))
}

/// Parameters of each effect of the rig on each run alone. The error of a shape is that which the run's own verdict has for it.
fn alone(joint: &Joint<'_, '_>, rig: &[Placed], closed: &[&Closed]) -> Vec<Vec<Vec<Estimate>>> {
    let error = |run: usize, k: usize, name: &str| {
        let of = &closed.get(run)?.diagnosis;
        let at = of.best.fit.placed.iter().position(|p| p.is_like(&rig[k]))?;
        of.estimates.get(at)?.iter().find(|e| e.name == name).map(|e| e.se)
    };
    let with_errors = |run: usize, k: usize, mut told: Vec<Estimate>| {
        told.iter_mut().filter(|e| !e.se.is_finite()).for_each(|e| e.se = error(run, k, &e.name).unwrap_or(e.se));
        told
    };
    // from where the run itself found them: from what all share the search may not come away, and no run is a witness of the others' word
    let own = |run: usize, p: &Placed| closed.get(run)?.diagnosis.best.fit.placed.iter().find(|own| own.is_like(p));
    let has = |run: usize, p: &Placed| own(run, p).is_some();
    let found = |run: usize, p: &Placed| Placed {
        shape: own(run, p).map_or_else(|| p.shape.clone(), |own| own.shape.clone()),
        ..p.clone()
    };
    let of_run = |run: usize| {
        let one = joint.only(run);
        let begins: Vec<Placed> = rig.iter().map(|p| found(run, p)).collect();
        let refined = one.refined_whole(&begins, choose::SOUGHT, choose::EVALUATIONS);
        let shared = one.shared(&refined);
        (0..rig.len())
            .map(|k| {
                let is_of_others = refined[k].shape == rig[k].shape && !refined[k].shape.is_empty() && !has(run, &rig[k]);
                if one.tells(run, &rig[k]) && !is_of_others {
                    with_errors(run, k, choose::estimates(&one, &refined, k, &shared))
                } else {
                    Vec::new()
                }
            })
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
    let effect = |(k, p): (usize, &Placed)| {
        let touched = || shared.iter().filter(|s| p.instance.touches(s.channel));
        let count = p.effect.amplitudes(&p.instance).len();
        let estimates = estimates.get(k).cloned().unwrap_or_default();
        AddedEffect {
            placed: p.clone(),
            amplitudes: touched().map(|s| (s.channel.to_owned(), s.amplitudes(k, p))).collect(),
            mean: Vec::new(),
            reach: touched().map(|s| Reach::fitted(s.channel, &s.labels, &s.covariance, k, count)).collect(),
            shape_errors: shape_errors(&estimates, p),
            estimates,
        }
    };
    let polynomials = shared.iter().map(polynomial).collect();
    let mut model = Model {
        runs: runs.iter().map(|r| FittedTo::of(&r.log)).collect(),
        effects: rig.iter().enumerate().map(effect).collect(),
        own,
        ..Model::of(&contexts[0], &runs[0].log, polynomials)
    };
    let highest = runs.iter().filter_map(|run| Model::of(&contexts[0], &run.log, Vec::new()).highest_pulse_us);
    model.highest_pulse_us = highest.reduce(f64::max);
    model.stood = contexts.iter().any(stood);
    contexts.iter().for_each(|context| model.saw(context, 0));
    model
}

/// Mean of the runs' constants and its standard error.
fn mean_and_spread(zeros: &[f64]) -> (f64, f64) {
    let n = zeros.len().max(1) as f64;
    let mean = zeros.iter().sum::<f64>() / n;
    let square = zeros.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    (mean, (square / n).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Column;

    /// A rotor that stands below 1080 us, six seconds at each level.
    fn run(levels: &[f64]) -> Context {
        let pulse: Vec<f64> = levels.iter().flat_map(|p| [*p; 60]).collect();
        let rpm = pulse.iter().map(|p| if *p > 1080.0 { 8.0 * (p - 1000.0) } else { 0.0 }).collect();
        let t = (0..pulse.len()).map(|i| 0.1 * i as f64).collect();
        let columns = [("pulse_us", pulse), ("rpm", rpm)];
        let columns = columns.map(|(name, values)| Column { name: name.to_owned(), values }).to_vec();
        Context::new(&Log { t, columns, ..Log::default() }, None)
    }

    #[test]
    fn the_start_lies_between_what_stands_and_what_turns_on_any_run() {
        let [coarse, fine] = [run(&[1000.0, 1100.0, 1400.0]), run(&[1000.0, 1050.0, 1200.0, 1500.0])];
        assert_eq!((coarse.start_pulse_us, fine.start_pulse_us), (1050.0, 1125.0));
        assert_eq!(start_pulse([&coarse, &fine].into_iter()), 1075.0);
        assert_eq!(start_pulse([&fine, &coarse, &coarse].into_iter()), 1075.0);
    }
}
