//! A joint fit in the contract's words.
//!
//! What it is: the verdict on several runs. Every error that counts is that of a run predicted whole by a fit to the others.
//! What can go wrong: a channel that only one run has cannot be predicted by another; it is said.
//! Units: as the channels.
//! Reference: specification `formats.md`, "Verdict", `across_runs_rms`.

use super::Run;
use super::entries::{alternatives, entry, own_entries, unexplained, unnamed};
use super::folds::Tenable;
use super::joint::{Across, Compared, Joint};
use crate::attribution::depends::goes_with;
use crate::attribution::rivals::RIVAL;
use crate::attribution::unexplained::looks_like;
use crate::channel::{Context, Relation, is_contrast, unit_of};
use crate::close::{NO_COMMAND, validation};
use crate::effects::Estimate;
use crate::effects::placed::Placed;
use crate::model::Model;
use crate::signal::residual::whiteness;
use crate::verdict::{Alternative, BeforeAfter, Channel, Channels, EffectEntry, FORMAT, Figures, Kind, Validation, Verdict};
use std::collections::BTreeMap;

/// A joint fit, to be put into words.
pub(super) struct Told<'f, 'a> {
    /// The runs.
    pub(super) runs: &'f [Run],
    /// The runs made ready.
    pub(super) contexts: &'f [Context],
    /// The names, the runs' own effects, and how each run is predicted.
    pub(super) tenable: &'f Tenable<'a>,
    /// Declared model, and the corrected one.
    pub(super) models: [&'f Model; 2],
    /// For each name its parameters.
    pub(super) estimates: &'f [Vec<Estimate>],
    /// For each name the errors of the runs without it.
    pub(super) without: &'f [Vec<Across>],
    /// For each name on what the runs disagree, in words.
    pub(super) disagreements: &'f [Option<String>],
}

/// The contract's words.
pub(super) fn verdict(told: &Told<'_, '_>) -> Verdict {
    let Told { runs, contexts, tenable, models, estimates, without, disagreements } = *told;
    let Tenable { named, members, worths, compared, .. } = tenable;
    let joint = Joint::of(members);
    let after: Vec<Across> = compared.iter().map(|c| c.after).collect();
    let channels = channels(told);
    let of = |k: usize| {
        let (mut entry, others) = entry(&joint, &named[k], [&without[k], &after], &estimates[k]);
        disagreements.get(k).iter().copied().flatten().for_each(|said| entry.evidence += &format!("; {said}"));
        (entry, others)
    };
    let mut names: Vec<_> = (0..named.len()).map(of).collect();
    names.sort_by(|a, b| b.0.heldout_error_reduction.total_cmp(&a.0.heldout_error_reduction));
    let own = models[1].own.iter().zip(worths).enumerate();
    names.extend(own.flat_map(|(run, (own, worths))| own_entries(&contexts[run], own, worths)));
    let alternatives = alternatives(&names);
    let mut effects: Vec<_> = names.into_iter().map(|(entry, _)| entry).collect();
    // what it looks like is told of what is left, which a fit to that run alone does not show
    let rig: Vec<Placed> = named.iter().map(|n| n.placed.clone()).collect();
    let looks = |a: &Across| {
        let (context, left) = (&contexts[a.run], joint.left(a.run, &rig, a.channel)?);
        let target = context.target(a.channel)?;
        Some((looks_like(context, &context.targets[target], &left), goes_with(context, target, &left)))
    };
    let mut unexplained = unexplained(runs, &looks, &after, &channels);
    // what nothing predicts has nothing left over
    unexplained.retain(|u| !channels.not_predicted.contains_key(&u.channel));
    let kind = match (effects.is_empty(), unexplained.is_empty()) {
        (false, _) if alternatives.iter().any(|a| is_as_likely(a, &effects)) => Kind::Ambiguous,
        (false, _) => Kind::Attributed,
        (true, false) => Kind::Unattributed,
        (true, true) => Kind::None,
    };
    if kind == Kind::Unattributed {
        effects.extend(unexplained.first().map(unnamed));
    }
    let silent: Vec<String> = channels.not_predicted.keys().cloned().collect();
    Verdict {
        format: FORMAT,
        run: runs[0].log.name.clone(),
        verdict: kind,
        channels,
        effects,
        unexplained,
        alternatives,
        next_experiment: None,
        left_out: Vec::new(),
        set_aside: Vec::new(),
        held: runs.iter().all(|r| r.closed.verdict.held),
        at_rest: runs.iter().all(|r| r.closed.verdict.at_rest),
        sensor_share: Some(models[1].sensor_share).filter(|share| *share > 0.0),
        // of all of them or of none: a run of single rows beside others says so on its own page
        guessed_floors: runs.iter().map(|r| r.closed.verdict.guessed_floors).min().flatten(),
        validation: Vec::new(),
        runs: runs.iter().enumerate().map(|(k, run)| of_run(run, k, compared, &silent)).collect(),
    }
}

/// Whether something else explains as much as the name in whose place it would stand, about, as on one run alone.
fn is_as_likely(other: &Alternative, effects: &[EffectEntry]) -> bool {
    let own = |place: usize| effects.get(place).map_or(1.0, |e| e.probability);
    other.change.as_ref().is_some_and(|change| change.probability >= RIVAL * own(change.place))
}

fn of_run(run: &Run, k: usize, compared: &[Compared], silent: &[String]) -> Validation {
    let told = |c: &&Compared| !is_contrast(c.before.channel) && !silent.iter().any(|s| s == c.before.channel);
    let own = compared.iter().filter(|c| c.before.run == k).filter(told);
    let channels: BTreeMap<String, BeforeAfter> =
        own.map(|c| (c.before.channel.to_owned(), BeforeAfter { before: c.before.rms, after: c.after.rms })).collect();
    Validation { run: run.log.name.clone(), channels }
}

/// Each channel over all runs, as the root of the mean square over the runs: what is left across runs, the noise floor, what the written model
/// leaves. A channel that no second run has is not predicted.
fn channels(told: &Told<'_, '_>) -> Channels {
    let Told { runs, contexts, tenable, models, .. } = *told;
    let mut out = Channels::default();
    let own: Vec<Validation> = runs.iter().map(|r| validation(&r.log, models[0], models[1])).collect();
    for target in contexts.iter().flat_map(|c| &c.targets).filter(|t| !t.relation.is_evidence()) {
        let name = target.name;
        if out.predicted.contains_key(name) || out.not_predicted.contains_key(name) {
            continue;
        }
        let compared: Vec<&Compared> = tenable.compared.iter().filter(|c| c.before.channel == name).collect();
        let without = contexts.iter().filter(|c| c.pulse.is_none()).count();
        let speed = matches!(target.relation, Relation::SpeedAlone | Relation::SpeedFromPulse);
        if compared.is_empty() && speed && without > 0 {
            let reason = if without == contexts.len() {
                NO_COMMAND.to_owned()
            } else {
                format!("{NO_COMMAND} on {without} of {} runs", contexts.len())
            };
            out.not_predicted.insert(name.to_owned(), reason);
            continue;
        }
        if compared.is_empty() {
            out.not_predicted.insert(name.to_owned(), "no second run measured it".to_owned());
            continue;
        }
        let pooled = |of: &dyn Fn(&Compared) -> f64| root_mean(compared.iter().map(|c| of(c)));
        let figures = |side: usize, across: f64, of: &dyn Fn(&BeforeAfter) -> f64| Figures {
            rms: root_mean(own.iter().filter_map(|v| v.channels.get(name)).map(of)),
            heldout_rms: across,
            across_runs_rms: Some(across),
            whiteness_p: least_white(runs, contexts, models[side], name),
        };
        let channel = Channel {
            unit: unit_of(name).to_owned(),
            noise_floor_rms: pooled(&|c| c.before.floor),
            before: figures(0, pooled(&|c| c.before.rms), &|b| b.before),
            after: figures(1, pooled(&|c| c.after.rms), &|b| b.after),
        };
        out.predicted.insert(name.to_owned(), channel);
    }
    for (name, reason) in runs.iter().flat_map(|r| &r.closed.verdict.channels.not_predicted) {
        if !out.predicted.contains_key(name) {
            out.not_predicted.entry(name.clone()).or_insert_with(|| reason.clone());
        }
    }
    out
}

/// Root of the mean square.
pub(super) fn root_mean(values: impl Iterator<Item = f64>) -> f64 {
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
