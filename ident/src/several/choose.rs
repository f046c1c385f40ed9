//! Which effects the rig has: those without which its runs predict each other worse.
//!
//! What it is: effects of the rig that stood, or came close, on any of the runs join one at a time, the one first by which the runs predict
//! each other best. Then each is asked again beside the others.
//! What can go wrong: what no single run had among its candidates is not asked.
//! Units: scores in nats.
//! Reference: forward selection by cross-validation over groups, Hastie et al. 2009, section 7.10.

use super::joint::{Across, Compared, Joint, Shared, compared};
use super::{FEWEST, Member};
use crate::attribution::choose::NEEDED_REDUCTION;
use crate::attribution::unexplained::LOUD;
use crate::channel::Context;
use crate::close::Closed;
use crate::effects::placed::Placed;
use crate::effects::{self, Amplitude, Estimate, NEEDED_EVIDENCE};
use crate::verdict::Scope;

/// Samples of a channel of one run that the shapes are sought on.
pub(super) const SOUGHT: usize = 1500;
/// Evaluations for the shapes of a newcomer.
pub(super) const EVALUATIONS: usize = 30;
/// Share by which the error of no channel of a run may grow (specification `closing-the-loop.md`, "Real measurements").
const TOLERANCE: f64 = 0.05;
/// Candidates of a round whose shapes are sought on all runs together.
const REFINED: usize = 7;
/// Candidates of a round of a run that take part.
const OF_A_ROUND: usize = 4;

/// An effect that the rig has.
#[derive(Debug, Clone)]
pub(super) struct Named {
    /// The effect, with the shapes that all runs share.
    pub(super) placed: Placed,
    /// By how much worse the runs predict each other without it, nats.
    pub(super) score: f64,
    /// The same of what could stand in its place, were it not there.
    pub(super) rivals: Vec<(&'static str, f64)>,
    /// The best of these.
    pub(super) rival: Option<Placed>,
}

/// The effects of the rig but one.
pub(super) fn without(named: &[Named], k: usize) -> Vec<Placed> {
    named.iter().enumerate().filter(|(j, _)| *j != k).map(|(_, n)| n.placed.clone()).collect()
}

/// Candidates: every effect of the rig that stood on a run or came close, with the shapes that it had there.
fn pool(joint: &Joint<'_, '_>, runs: &[&Closed]) -> Vec<Vec<Placed>> {
    let mut out: Vec<Vec<Placed>> = Vec::new();
    let mut add = |p: &Placed| {
        // what one run alone can tell stays with that run
        let of_rig = p.effect.id() != "unknown" && p.effect.scope(&p.instance) == Scope::Rig && joint.tellers(p) >= FEWEST;
        if !of_rig || p.effect.is_of_one_run(&p.instance) {
            return;
        }
        // and what has a size of its own on each run with those
        if joint.members.iter().any(|m| m.own.iter().any(|own| own.is_like(p))) {
            return;
        }
        match out.iter_mut().find(|o| o[0].is_like(p)) {
            Some(known) => known.push(p.clone()),
            None => out.push(vec![p.clone()]),
        }
    };
    let contexts: Vec<&Context> = runs.iter().map(|r| &r.context).collect();
    for effect in effects::library().iter().copied() {
        effect.among(&contexts).into_iter().for_each(|(instance, shape)| add(&Placed { effect, instance, shape }));
    }
    for run in runs {
        let d = &run.diagnosis;
        d.best.fit.placed.iter().for_each(&mut add);
        d.rivals.iter().filter_map(|r| r.fit.placed.last()).for_each(&mut add);
        d.candidates
            .iter()
            .flat_map(|round| round.iter().take(OF_A_ROUND))
            .filter_map(|c| c.fit.placed.last())
            .for_each(&mut add);
    }
    out
}

/// The effects that the runs share.
pub(super) fn choose(runs: &[&Closed], members: &[Member<'_>], progress: &mut dyn FnMut(f64)) -> Vec<Named> {
    let joint = Joint::of(members);
    let mut pool = pool(&joint, runs);
    let mut rig: Vec<Placed> = Vec::new();
    let mut now = joint.across(&rig, None);
    for round in 0.. {
        progress(1.0 - 0.6_f64.powi(round));
        let Some((at, placed, then)) = best(&joint, &rig, &now, &pool) else { break };
        rig.push(placed);
        pool.swap_remove(at);
        now = then;
        drop_useless(&joint, &mut rig, &mut now);
    }
    exchange(&joint, &mut rig, &mut now, &mut pool);
    let named = |k: usize| {
        let (score, without) = gain_of(&joint, &rig, &now, k);
        let others = rivals(&joint, &rig, k, &without, &pool);
        let rival = others.iter().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(p, _)| p.clone());
        let rivals = others.into_iter().map(|(p, gain)| (p.effect.id(), gain)).collect();
        Named { placed: rig[k].clone(), score, rivals, rival }
    };
    (0..rig.len()).map(named).collect()
}

/// What predicts the runs better in the place of a name takes it: a name may have joined for what a later one explains. No more exchanges than
/// there are candidates.
fn exchange(joint: &Joint<'_, '_>, rig: &mut Vec<Placed>, now: &mut Vec<Across>, pool: &mut Vec<Vec<Placed>>) {
    let score = |errors: &[Across]| errors.iter().map(Across::score).sum::<f64>();
    let better = |rig: &[Placed], now: &[Across], pool: &[Vec<Placed>], k: usize| {
        let (worth, without) = gain_of(joint, rig, now, k);
        let (newcomer, gain) = rivals(joint, rig, k, &without, pool).into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        if gain <= worth {
            return None;
        }
        let mut with = rig.to_vec();
        with[k] = newcomer;
        let taken = |with: Vec<Placed>| {
            let then = joint.across(&with, None);
            (score(&then) > score(now) && stands(joint, &with, &without, &then)).then_some((k, with, then))
        };
        // with the shapes of all runs, or with those of the run that it is from
        taken(joint.refined(&with, &[k], SOUGHT, EVALUATIONS)).or_else(|| taken(with))
    };
    for _ in 0..pool.len() {
        let Some((k, with, then)) = (0..rig.len()).find_map(|k| better(rig, now, pool, k)) else { return };
        pool.retain(|starts| !starts[0].is_like(&with[k]));
        pool.push(vec![rig[k].clone()]);
        (*rig, *now) = (with, then);
        drop_useless(joint, rig, now);
    }
}

/// By how much better the runs predict each other with each candidate in the place of one of the rig's effects on its channels.
fn rivals(joint: &Joint<'_, '_>, rig: &[Placed], k: usize, without: &[Across], pool: &[Vec<Placed>]) -> Vec<(Placed, f64)> {
    let mut others = rig.to_vec();
    let left = others.remove(k);
    let close = |starts: &&Vec<Placed>| {
        let first = &starts[0];
        first.effect.id() != left.effect.id()
            && first.instance.channels.iter().any(|c| left.instance.touches(c))
            && may_stand_beside(&others, first)
    };
    // what could not join could not stand there either
    let stands = |p: &Placed, then: &[Across]| {
        let with: Vec<Placed> = others.iter().chain([p]).cloned().collect();
        self::stands(joint, &with, without, then)
    };
    let gain = |starts: &Vec<Placed>| {
        let tried = starts.iter().map(|p| (p, tried(joint, &others, without, p)));
        let standing = tried.filter(|(p, (_, then))| stands(p, then)).map(|(p, (gain, _))| (p, gain));
        let (best, gain) = standing.max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some((best.clone(), gain))
    };
    pool.iter().filter(close).filter_map(gain).collect()
}

type Joined = (usize, Placed, Vec<Across>);

/// The candidate by which the runs predict each other best, its shapes sought on all of them; `None` where none helps enough.
fn best(joint: &Joint<'_, '_>, rig: &[Placed], now: &[Across], pool: &[Vec<Placed>]) -> Option<Joined> {
    let sketch = |(at, starts): (usize, &Vec<Placed>)| {
        let gains = starts.iter().map(|p| (at, p.clone(), tried(joint, rig, now, p).0));
        gains.max_by(|a, b| a.2.total_cmp(&b.2))
    };
    let free = pool.iter().enumerate().filter(|(_, starts)| may_stand_beside(rig, &starts[0]));
    let mut sketched: Vec<(usize, Placed, f64)> = free.filter_map(sketch).collect();
    sketched.sort_by(|a, b| b.2.total_cmp(&a.2));
    for (at, start, _) in sketched.into_iter().take(REFINED) {
        let mut with = rig.to_vec();
        with.push(start);
        let with = joint.refined(&with, &[rig.len()], SOUGHT, EVALUATIONS);
        let newest = &with[rig.len()];
        let (gain, then) = tried(joint, rig, now, newest);
        if gain > NEEDED_EVIDENCE && stands(joint, &with, now, &then) {
            return Some((at, newest.clone(), then));
        }
    }
    None
}

/// Whether no other form of the effect stands on one of its channels.
fn may_stand_beside(rig: &[Placed], newcomer: &Placed) -> bool {
    let same =
        |p: &&Placed| p.effect.id() == newcomer.effect.id() && p.instance.channels.iter().any(|c| newcomer.instance.touches(c));
    !rig.iter().any(|p| same(&p))
}

/// Geometric mean.
fn typical(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(s, n), v| (s + v.max(f64::MIN_POSITIVE).ln(), n + 1.0));
    f64::exp(sum / n)
}

/// Whether it takes enough off the error of one of its channels, on average over the runs, to be worth a name.
pub(super) fn is_worth(compared: &[Compared]) -> bool {
    let gone = |channel: &str| 1.0 - 1.0 / typical(compared.iter().filter(|c| c.before.channel == channel).map(Compared::times));
    compared.iter().any(|c| gone(c.before.channel) > NEEDED_REDUCTION)
}

/// Whether a rig with a newcomer may stand: it is worth a name, spoils no channel and makes sense.
fn stands(joint: &Joint<'_, '_>, with: &[Placed], before: &[Across], then: &[Across]) -> bool {
    let compared = compared(before, then);
    is_worth(&compared) && harms(&compared).is_none() && is_plausible(joint, with)
}

/// What a newcomer adds to how well the runs predict each other, and their errors then.
fn tried(joint: &Joint<'_, '_>, rig: &[Placed], now: &[Across], newest: &Placed) -> (f64, Vec<Across>) {
    let touched: Vec<&'static str> = now.iter().map(|a| a.channel).filter(|c| newest.instance.touches(c)).collect();
    let mut channels = touched;
    channels.dedup();
    let with: Vec<Placed> = rig.iter().chain([newest]).cloned().collect();
    let changed = joint.across(&with, Some(&channels));
    merged(now, &changed)
}

/// The errors with those of some channels made anew, and the gain in score.
fn merged(now: &[Across], changed: &[Across]) -> (f64, Vec<Across>) {
    let of = |a: &Across| changed.iter().find(|c| c.run == a.run && c.channel == a.channel).copied().unwrap_or(*a);
    let then: Vec<Across> = now.iter().map(of).collect();
    let gain = then.iter().map(Across::score).sum::<f64>() - now.iter().map(Across::score).sum::<f64>();
    (gain, then)
}

/// A channel whose error on a run grows: by more than days differ where it is loud, or until it is.
pub(super) fn harms(compared: &[Compared]) -> Option<&'static str> {
    let worse = |c: &&Compared| c.after.rms > ((1.0 + TOLERANCE) * c.before.rms).max(LOUD * c.after.floor);
    compared.iter().find(worse).map(|c| c.before.channel)
}

/// Whether no shape lies on its bound, and each effect makes sense on one of the runs at least.
fn is_plausible(joint: &Joint<'_, '_>, rig: &[Placed]) -> bool {
    let shared = joint.shared(rig);
    let makes_sense = |(k, p): (usize, &Placed)| {
        let ranges = joint.ranges(p);
        let inside = ranges.iter().zip(&p.shape).all(|(range, v)| {
            let margin = 1e-3 * (range.1 - range.0);
            range.1 <= range.0 || (*v > range.0 + margin && *v < range.1 - margin)
        });
        let estimates = estimates(joint, rig, k, &shared);
        inside && joint.members.iter().any(|m| p.effect.plausible(m.context, &p.instance, &estimates))
    };
    rig.iter().enumerate().all(makes_sense)
}

/// Parameters of one of the rig's effects, errors as all runs together leave them; those of shapes are not a number.
pub(super) fn estimates(joint: &Joint<'_, '_>, rig: &[Placed], k: usize, shared: &[Shared]) -> Vec<Estimate> {
    let p = &rig[k];
    let Some(member) = joint.members.first() else { return Vec::new() };
    let shapes = p.effect.shapes(member.context, &p.instance);
    let shapes = shapes.iter().zip(&p.shape);
    let mut out: Vec<Estimate> =
        shapes.map(|(s, v)| Estimate { name: s.name.into(), unit: s.unit.into(), value: *v, se: f64::NAN }).collect();
    for (i, Amplitude { name, unit }) in p.effect.amplitudes(&p.instance).into_iter().enumerate() {
        let label = crate::effects::design::Label::Effect { effect: k, amplitude: i };
        let of = |s: &Shared| {
            // a channel that the amplitude does not reach has nothing of it
            let j = s.labels.iter().position(|l| *l == label).filter(|j| s.coefficients[*j] != 0.0)?;
            Some(Estimate {
                name: name.into(),
                unit: unit.into(),
                value: s.coefficients[j],
                se: s.covariance[(j, j)].max(0.0).sqrt(),
            })
        };
        out.extend(shared.iter().find_map(of));
    }
    out
}

/// What an effect is worth beside the others, and the errors without it.
fn gain_of(joint: &Joint<'_, '_>, rig: &[Placed], now: &[Across], k: usize) -> (f64, Vec<Across>) {
    let mut others = rig.to_vec();
    let left = others.remove(k);
    let mut channels: Vec<&'static str> = now.iter().map(|a| a.channel).filter(|c| left.instance.touches(c)).collect();
    channels.dedup();
    let (gain, then) = merged(now, &joint.across(&others, Some(&channels)));
    (-gain, then)
}

/// Effects that the later ones have made needless go: what they had to bring to join, each still has to bring beside the others.
fn drop_useless(joint: &Joint<'_, '_>, rig: &mut Vec<Placed>, now: &mut Vec<Across>) {
    loop {
        let worth = |k: usize| (k, gain_of(joint, rig, now, k));
        let needless =
            |(_, (gain, then)): &(usize, (f64, Vec<Across>))| *gain < NEEDED_EVIDENCE || !is_worth(&compared(then, now));
        let least = (0..rig.len()).map(worth).filter(needless).min_by(|a, b| a.1.0.total_cmp(&b.1.0));
        match least {
            Some((k, (_, then))) if rig.len() > 1 => {
                rig.remove(k);
                *now = then;
            }
            _ => return,
        }
    }
}
