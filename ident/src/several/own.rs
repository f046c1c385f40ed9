//! What belongs to one run alone: the constant of each channel, its own drifts and events.
//!
//! What it is: with the shared coefficients known, the rest of a run's samples gives its own; drifts and events are centred on the declared
//! polynomial, so that what the rig has does not hang on them.
//! What can go wrong: an effect of the run that the rig's effects have made needless goes.
//! Units: as the channels.
//! Reference: specification `formats.md`, "Scope".

use super::Member;
use super::equations::{centring, columns_of, of_run, own_columns, samples_less_fixed, shared};
use super::joint::{Joint, Shared};
use crate::channel::Target;
use crate::effects::design::Label;
use crate::effects::placed::Placed;
use crate::effects::{NEEDED_EVIDENCE, library};
use crate::fit::search::{base, refine_newest, scan};
use crate::fit::{Rows, design, fit, is_plausible};
use crate::model::Declared;
use crate::model::{AddedEffect, RunLevel};
use crate::numeric::parallel::in_parallel;
use crate::numeric::solve::Normal;
use crate::verdict::Scope;

/// Most drifts and events of one run.
const MOST: usize = 3;
/// Others that are weighed against one: the next ones explain less on their grids.
const RIVALS: usize = 4;
/// Evaluations for the shapes of one.
const EVALUATIONS: usize = 60;

/// What a drift or an event of a run is worth beside the rig's effects.
#[derive(Debug, Clone)]
pub(super) struct Worth {
    /// Evidence, nats.
    pub(super) gain: f64,
    /// Share of the error that it takes, by channel.
    pub(super) reduction: Vec<(&'static str, f64)>,
    /// What could stand in its place, with its evidence, nats.
    pub(super) rivals: Vec<(&'static str, f64)>,
}

/// The drifts and events of each run beside the rig's effects: those that it had alone and still needs, and those that show now.
pub(super) fn settle(members: &mut [Member<'_>], rig: &[Placed]) -> Vec<Vec<Worth>> {
    let shared = Joint::of(members).shared(rig);
    let of_run = |run: usize| {
        let mut member = members[run].clone();
        prune(&mut member, rig, &shared);
        while member.own.len() < MOST {
            let Some(newest) = best(&member, rig, &shared) else { break };
            member.own.push(newest);
        }
        exchange(&mut member, rig, &shared);
        let rivals = |k: usize| others(&member, rig, &shared, k).into_iter().map(|(p, gain)| (p.effect.id(), gain)).collect();
        let told = |k: usize| Worth { rivals: rivals(k), ..worth(&member, rig, &shared, k) };
        let all = (0..member.own.len()).map(told).collect();
        (member.own, all)
    };
    let settled: Vec<(Vec<Placed>, Vec<Worth>)> = in_parallel(members.len(), &of_run);
    let (own, worths): (Vec<_>, Vec<_>) = settled.into_iter().unzip();
    members.iter_mut().zip(own).for_each(|(m, own)| m.own = own);
    worths
}

/// Drifts and events without which the run is fitted as well go.
fn prune(member: &mut Member<'_>, rig: &[Placed], shared: &[Shared]) {
    let mut k = 0;
    while k < member.own.len() {
        if worth(member, rig, shared, k).gain > NEEDED_EVIDENCE {
            k += 1;
        } else {
            member.own.remove(k);
        }
    }
}

/// The drift or event that explains most of what is left of a run, if one explains enough.
fn best(member: &Member<'_>, rig: &[Placed], shared: &[Shared]) -> Option<Placed> {
    let start = scanned(member, rig).into_iter().next()?;
    let (newest, gain) = refined(member, rig, shared, &start)?;
    (gain > NEEDED_EVIDENCE).then_some(newest)
}

/// The drifts and events that a run may have beside what it has, by what their grids explain: the best first.
fn scanned(member: &Member<'_>, rig: &[Placed]) -> Vec<Placed> {
    let (context, declared) = (member.context, Declared::default());
    let placed: Vec<Placed> = rig.iter().chain(&member.own).cloned().collect();
    let base = base(context, declared, &placed);
    let loud = vec![true; context.targets.len()];
    let offered = library().iter().flat_map(|e| e.instances(context).into_iter().map(move |i| (*e, i)));
    let of_run =
        offered.filter(|(e, i)| e.scope(i) != Scope::Rig && !placed.iter().any(|p| p.effect.id() == e.id() && p.instance == *i));
    let scanned = of_run.filter_map(|(effect, instance)| {
        let (shape, gain) = scan(context, &base, effect, &instance, &loud)?;
        Some((Placed { effect, instance, shape }, gain))
    });
    let mut all: Vec<(Placed, f64)> = scanned.filter(|(p, _)| !p.is_tare()).collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    all.into_iter().map(|(placed, _)| placed).collect()
}

/// A newcomer with its shapes refined, and its evidence; `None` where it makes no sense.
fn refined(member: &Member<'_>, rig: &[Placed], shared: &[Shared], start: &Placed) -> Option<(Placed, f64)> {
    let (context, declared) = (member.context, Declared::default());
    let with: Vec<Placed> = rig.iter().chain(&member.own).chain([start]).cloned().collect();
    let newest = refine_newest(context, declared, &with, Rows::All, EVALUATIONS).pop()?;
    let mut tried = member.clone();
    tried.own.push(newest.clone());
    let whole: Vec<Placed> = rig.iter().chain(&tried.own).cloned().collect();
    let stands = fit(context, declared, &whole, None, Rows::All)?;
    let gain = worth(&tried, rig, shared, tried.own.len() - 1).gain;
    is_plausible(context, declared, &stands, whole.len() - 1).then_some((newest, gain))
}

/// The drifts and events that could stand in the place of one of a run's own, with their evidence: those on its channels that come closest.
fn others(member: &Member<'_>, rig: &[Placed], shared: &[Shared], k: usize) -> Vec<(Placed, f64)> {
    let mut without = member.clone();
    let taken = without.own.remove(k);
    let other = |p: &Placed| p.effect.id() != taken.effect.id() && p.instance.channels.iter().any(|c| taken.instance.touches(c));
    let close = scanned(&without, rig).into_iter().filter(other).take(RIVALS);
    close.filter_map(|start| refined(&without, rig, shared, &start)).collect()
}

/// What explains more in the place of a drift or an event takes it: one that a run had alone may have stood for what the rig has.
fn exchange(member: &mut Member<'_>, rig: &[Placed], shared: &[Shared]) {
    for k in 0..member.own.len() {
        let best = others(member, rig, shared, k).into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((other, _)) = best.filter(|(_, gain)| *gain > worth(member, rig, shared, k).gain) {
            member.own[k] = other;
        }
    }
}

/// What one of a run's own effects is worth: how much worse its samples are fitted without it, less the penalty for its parameters.
fn worth(member: &Member<'_>, rig: &[Placed], shared: &[Shared], k: usize) -> Worth {
    let mut without = member.clone();
    let taken = without.own.remove(k);
    let (mut gain, mut reduction, mut most) = (0.0, Vec::new(), 1.0_f64);
    for s in shared.iter().filter(|s| taken.instance.touches(s.channel)) {
        let Some(target) = member.context.target(s.channel) else { continue };
        let squares =
            |m: &Member<'_>| Some(of_run(m, target, rig, &s.labels, 1)?.left_by(&s.coefficients).max(f64::MIN_POSITIVE));
        let (Some(with), Some(left)) = (squares(member), squares(&without)) else { continue };
        let samples = member.independent[target];
        gain += 0.5 * member.context.targets[target].weight * samples * (left / with).ln();
        reduction.push((s.channel, 1.0 - (with / left).sqrt()));
        most = most.max(samples);
    }
    let parameters = taken.shape.len() + taken.effect.amplitudes(&taken.instance).len();
    Worth { gain: gain - 0.5 * parameters as f64 * most.ln(), reduction, rivals: Vec::new() }
}

/// The run's own values, with the shared ones known.
pub(super) fn of(member: &Member<'_>, rig: &[Placed], all: &[Shared]) -> RunLevel {
    let mut out = RunLevel::default();
    let (context, declared) = (member.context, Declared::default());
    let placed: Vec<Placed> = rig.iter().chain(&member.own).cloned().collect();
    let alone = if member.own.is_empty() { None } else { fit(context, declared, &placed, None, Rows::All) };
    // errors as the run alone leaves them; the values are those that stand beside the shared ones
    let added = |(k, p): (usize, &Placed)| {
        let estimates = alone.as_ref().map(|f| f.profiled_estimates(context, declared, rig.len() + k)).unwrap_or_default();
        AddedEffect {
            placed: p.clone(),
            amplitudes: Vec::new(),
            estimates,
            mean: Vec::new(),
            reach: Vec::new(),
            shape_errors: Vec::new(),
        }
    };
    out.effects = member.own.iter().enumerate().map(added).collect();
    for (k, target) in member.context.targets.iter().enumerate() {
        let Some(s) = all.iter().find(|s| s.channel == target.name) else { continue };
        let Some((polynomial, amplitudes)) = of_target(member, k, target, rig, s) else { continue };
        out.polynomials.push((target.name.to_owned(), polynomial));
        for ((effect, p), values) in out.effects.iter_mut().zip(&member.own).zip(amplitudes) {
            if p.instance.touches(target.name) {
                effect.amplitudes.push((target.name.to_owned(), values));
            }
        }
    }
    out.effects.iter_mut().for_each(tell_what_stands);
    out
}

/// Tells of each amplitude what the model holds of it: on the first channel that it reaches.
fn tell_what_stands(added: &mut AddedEffect) {
    for (i, a) in added.placed.effect.amplitudes(&added.placed.instance).iter().enumerate() {
        let reached = added.amplitudes.iter().map(|(_, values)| values[i]).find(|v| *v != 0.0);
        if let (Some(value), Some(e)) = (reached, added.estimates.iter_mut().find(|e| e.name == a.name)) {
            e.value = value;
        }
    }
}

/// The polynomial that stands on this run, from the constant up as far as it differs from the rig's, and the amplitudes of each own effect.
fn of_target(member: &Member<'_>, k: usize, target: &Target, rig: &[Placed], s: &Shared) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
    let placed: Vec<Placed> = rig.iter().chain(&member.own).cloned().collect();
    let design = design(member.context, Declared::default(), &placed, target);
    let weights = &member.weights[k];
    let mut y = samples_less_fixed(target, &design, 1);
    for (column, c) in columns_of(target, &design, &shared(rig, target), 1).iter().zip(&s.coefficients) {
        y.iter_mut().zip(column).for_each(|(y, v)| *y -= c * v);
    }
    let powers = columns_of(target, &design, &(0..=target.relation.degree()).map(Label::Base).collect::<Vec<_>>(), 1);
    let (labels, mut own) = own_columns(target, &design, rig.len(), 1);
    let centres = centring(&mut own, &powers.iter().collect::<Vec<_>>(), weights);
    let columns: Vec<&Vec<f64>> = std::iter::once(&powers[0]).chain(&own).collect();
    let solution = Normal::of_columns(&columns, &y, weights).solve()?;
    let (zero, values) = solution.coefficients.split_first()?;
    let mut polynomial = vec![*zero];
    if !own.is_empty() {
        polynomial.extend(s.labels.iter().zip(&s.coefficients).filter(|(l, _)| matches!(l, Label::Base(_))).map(|(_, c)| *c));
        for (centre, a) in centres.iter().zip(values) {
            polynomial.iter_mut().zip(centre).for_each(|(c, p)| *c -= a * p);
        }
    }
    let of_effect = |(j, p): (usize, &Placed)| {
        let of = |amplitude| Label::Effect { effect: rig.len() + j, amplitude };
        let count = p.effect.amplitudes(&p.instance).len();
        (0..count).map(|i| labels.iter().position(|l| *l == of(i)).map_or(0.0, |at| values[at])).collect()
    };
    Some((polynomial, member.own.iter().enumerate().map(of_effect).collect()))
}
