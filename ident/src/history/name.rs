//! What a change is called.
//!
//! What it is: the loop closed on runs after the gap against models of usual runs before it, by the same library that names causes in one run.
//! A model of a day of its own would find that day in all others: there are two, and each is asked about the other as well. What the loop names
//! there too, and as large, is how days differ, and is taken off. What came to stay has the same size on all runs after the gap. And a cause moves
//! the channels that it is on: each adds or takes what the measures of all runs say of it. So a day's dense air beside a new gain of the load cell
//! is no damaged blade, that would move torque and speed as well.
//! What can go wrong: an effect that the runs before the gap hide is not seen after it; a drift is told by its measure, not by the library.
//! Units: scores are logarithms of odds, nats.
//! Reference: specification `closing-the-loop.md`; difference in differences.

use super::History;
use super::find::{Change, Kind, one_speed};
use crate::attribution::rivals::RIVAL;
use crate::channel::is_contrast;
use crate::close::{Closed, close};
use crate::effects::{self, Effect, Shape};
use crate::log::Log;
use crate::model::Model;
use crate::numeric::order::median;
use crate::numeric::parallel::in_parallel;
use crate::verdict::words::lower;
use crate::verdict::{EffectEntry, Parameter};
use serde::Serialize;
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Runs after a gap that are asked, and runs before it that they are asked against.
const AFTER: usize = 3;
const BEFORE: usize = 2;
/// Odds that one run or one channel gives or takes at the most, nats.
const MOST: f64 = 4.0;
/// Most names that are kept.
const KEPT: usize = 4;

/// A name of a change.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Name {
    /// Effect of the library.
    pub id: String,
    /// Its title.
    pub title: String,
    /// What it does here, with its size.
    pub words: String,
    /// Odds that a run after the gap gives it, less those of a run before it, and what its channels say, nats.
    pub score: f64,
    /// Probability that it is this one: of all names of the change and of none of them one is right.
    pub probability: f64,
}

/// Names each change of a history; `logs` in the order of its runs. `progress` hears the share that is done. A run that the loop cannot be
/// closed on takes no part.
pub fn named(history: &mut History, logs: &[&Log], progress: &(dyn Fn(f64) + Sync)) {
    let all = history.changes.len().max(1) as f64;
    for k in 0..history.changes.len() {
        let names = names(history, &history.changes[k], logs, &|share| progress((k as f64 + share) / all));
        history.changes[k].names = names;
    }
}

/// Runs that are asked about a change: the most usual before it, and some after it.
fn chosen(history: &History, change: &Change) -> (Vec<usize>, Vec<usize>) {
    let [from, to] = change.among;
    match change.kind {
        Kind::Drift => (vec![from], (from + 1..to).rev().take(AFTER).collect()),
        Kind::Step => (most_usual(history, from..change.first), spread(change.first, to)),
    }
}

/// The runs among some whose measures are nearest to their medians, each in the spread of those runs; the latest of those that are as near.
fn most_usual(history: &History, runs: Range<usize>) -> Vec<usize> {
    let mut off = vec![0.0; runs.len()];
    for (m, measure) in history.measures.iter().enumerate().filter(|(_, measure)| measure.asked) {
        let of = |k: usize| history.runs[k].values[m].map(|v| v.compared(measure.scale).value);
        let mut all: Vec<f64> = runs.clone().filter_map(of).collect();
        if all.len() < 3 {
            continue;
        }
        let middle = median(&mut all);
        let spread = median(&mut all.iter().map(|v| (v - middle).abs()).collect::<Vec<f64>>()).max(f64::MIN_POSITIVE);
        for (off, value) in off.iter_mut().zip(runs.clone().map(of)) {
            // one measure far off is as odd as it gets
            *off += value.map_or(3.0, |v| ((v - middle).abs() / spread).min(3.0));
        }
    }
    let mut order: Vec<usize> = runs.clone().collect();
    order.sort_by(|a, b| off[a - runs.start].total_cmp(&off[b - runs.start]).then(b.cmp(a)));
    order.truncate(BEFORE);
    order
}

/// First, middle and last of some runs.
fn spread(from: usize, to: usize) -> Vec<usize> {
    let mut out = vec![from, (from + to) / 2, to - 1];
    out.dedup();
    out
}

fn names(history: &History, change: &Change, logs: &[&Log], progress: &(dyn Fn(f64) + Sync)) -> Vec<Name> {
    let (before, after) = chosen(history, change);
    let done = AtomicUsize::new(0);
    let all = (2 * before.len() + after.len()) as f64;
    let closed_on = |k: usize, model: Option<&Model>| {
        let closed = close(logs[k], model, &[], &mut |_| {}).ok();
        progress((done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / all);
        closed
    };
    let own = in_parallel(before.len(), &|k| closed_on(before[k], None).map(|c| c.model));
    let models: Vec<(usize, Model)> = before.iter().zip(own).filter_map(|(k, m)| Some((*k, m?))).collect();
    if models.is_empty() {
        return Vec::new();
    }
    let others = models.iter().enumerate().flat_map(|(m, of)| before.iter().filter(|k| **k != of.0).map(move |k| (*k, m)));
    let before: Vec<(usize, usize)> = others.collect();
    let after = after.iter().enumerate().map(|(k, run)| (*run, k % models.len()));
    let pairs: Vec<(usize, usize)> = before.iter().copied().chain(after).collect();
    let closed = in_parallel(pairs.len(), &|k| closed_on(pairs[k].0, Some(&models[pairs[k].1].1)));
    let (usual, news) = closed.split_at(before.len());
    let found: Vec<Found<'_>> = effects::library().iter().filter_map(|e| found(*e, usual, news)).collect();
    let mut out: Vec<Name> = Vec::new();
    for name in found.iter().flat_map(|f| std::iter::once(f.name(change, history)).chain(f.look_alikes(change, history))) {
        match out.iter_mut().find(|known| known.id == name.id) {
            Some(known) if known.score < name.score => *known = name,
            Some(_) => {}
            None => out.push(name),
        }
    }
    out.retain(|name| name.score > 0.0);
    out.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.id.cmp(&b.id)));
    weigh(&mut out);
    out.truncate(KEPT);
    out
}

/// Gives each name its probability: its odds over those of all names and of none of them, whose odds are one.
fn weigh(names: &mut [Name]) {
    // the largest is taken off so that no power overflows
    let top = names.iter().map(|name| name.score).fold(0.0, f64::max);
    let all = names.iter().map(|name| (name.score - top).exp()).sum::<f64>() + (-top).exp();
    names.iter_mut().for_each(|name| name.probability = (name.score - top).exp() / all);
}

/// An effect that the loop names after the gap more than before it.
struct Found<'c> {
    effect: &'static dyn Effect,
    /// By how much more, nats.
    odds: f64,
    /// A run after the gap that has it, and as what.
    on: &'c Closed,
    entry: &'c EffectEntry,
}

impl Found<'_> {
    fn name(&self, change: &Change, history: &History) -> Name {
        Name {
            id: self.effect.id().to_owned(),
            title: lower(self.effect.about().title),
            words: lower(&self.effect.said(self.entry).sentence()),
            score: self.odds + spoken(change, history, &of_speeds(&self.entry.channels)),
            probability: 0.0,
        }
    }

    /// Effects that it is easily taken for, on some of its channels. The loop held each for less likely than a rival, and cannot tell them where a
    /// day of its own stands beside them.
    fn look_alikes(&self, change: &Change, history: &History) -> Vec<Name> {
        let own = of_speeds(&self.entry.channels);
        let look_alikes = self.effect.about().look_alikes.iter().filter_map(|id| effects::by_id(id));
        let told = |effect: &'static dyn Effect| {
            let instances = effect.instances(&self.on.context);
            let channels = instances.iter().map(|i| of_speeds(&i.channels)).filter(|c| c.is_subset(&own));
            let spoken = channels.map(|c| spoken(change, history, &c)).max_by(f64::total_cmp)?;
            let title = lower(effect.about().title);
            let score = self.odds + RIVAL.ln() + spoken;
            Some(Name { id: effect.id().to_owned(), words: title.clone(), title, score, probability: 0.0 })
        };
        look_alikes.filter_map(told).collect()
    }
}

/// Channels, those that are measured, the sensors of one speed as one.
fn of_speeds(channels: &[String]) -> BTreeSet<&str> {
    channels.iter().filter(|c| !is_contrast(c)).map(|c| one_speed(c)).collect()
}

/// What the measures say of a cause on these channels; one that is not on what moved most leaves that without a cause.
fn spoken(change: &Change, history: &History, channels: &BTreeSet<&str>) -> f64 {
    let own = change.channels.iter().filter(|(channel, _)| channels.contains(channel.as_str()));
    let most = change.moved.iter().map(|m| &history.measures[m.measure]).find(|m| !m.of_two).map(|m| one_speed(&m.channel));
    let left = if most.is_none_or(|most| channels.contains(most)) { 0.0 } else { MOST };
    own.map(|(_, evidence)| evidence.clamp(-MOST, MOST)).sum::<f64>() - left
}

/// An effect where runs after the gap speak for it more than those before.
fn found<'c>(effect: &'static dyn Effect, usual: &[Option<Closed>], news: &'c [Option<Closed>]) -> Option<Found<'c>> {
    let id = effect.id();
    let mean = |all: Vec<f64>| (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64);
    let mut sizes: Vec<f64> = news.iter().flatten().filter_map(|c| size(c, id)).collect();
    let as_large = if sizes.is_empty() { None } else { Some(median(&mut sizes)) };
    // a run on which it has no size tells by its odds alone
    let like = |c: &Closed| times(size(c, id), as_large);
    let same = |c: &Closed| if like(c).is_some_and(|times| !(0.5..2.0).contains(&times)) { -MOST } else { odds(c, id) };
    let as_before = |c: &Closed| if like(c).is_some_and(|times| times < 0.5) { -MOST } else { odds(c, id) };
    let after = mean(news.iter().flatten().map(same).collect())?;
    let odds = after - mean(usual.iter().flatten().map(as_before).collect()).unwrap_or(-MOST);
    let (on, entry) = news.iter().flatten().find_map(|c| Some((c, entry(c, id)?)))?;
    (odds > 0.0).then_some(Found { effect, odds, on, entry })
}

/// How large an effect is on a run, with its sign: the first of its parameters that is a size, or its first.
fn size(closed: &Closed, id: &str) -> Option<f64> {
    let placed = closed.diagnosis.best.fit.placed.iter().find(|p| p.effect.id() == id);
    let shapes = placed.map_or_else(Vec::new, |p| p.effect.shapes(&closed.context, &p.instance));
    let is_size = |p: &&Parameter| shapes.iter().find(|s| s.name == p.name).is_none_or(Shape::is_size);
    let all = &entry(closed, id)?.parameters;
    all.iter().find(is_size).or(all.first()).map(|p| p.value)
}

/// How large an effect is on a run, over what it is after the gap: below a half it is nearer to nothing.
fn times(on_run: Option<f64>, after: Option<f64>) -> Option<f64> {
    let times = on_run? / after?;
    times.is_finite().then_some(times)
}

fn entry<'c>(closed: &'c Closed, id: &str) -> Option<&'c EffectEntry> {
    closed.verdict.effects.iter().find(|e| e.id == id)
}

/// Odds that a run gives an effect.
fn odds(closed: &Closed, id: &str) -> f64 {
    let named = entry(closed, id).map(|e| e.probability);
    let beside: f64 = closed.verdict.alternatives.iter().filter(|a| a.ids.iter().any(|i| i == id)).map(|a| a.probability).sum();
    let p = named.unwrap_or(beside).clamp(1e-9, 1.0 - 1e-9);
    (p / (1.0 - p)).ln().clamp(-MOST, MOST)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::tests::stepped;

    /// A new gain of the load cell moves the thrust alone; a damaged blade would move torque and speed.
    #[test]
    fn a_cause_takes_what_its_channels_did_not_move_by() {
        let history = stepped(12, 7);
        let mut change = history.changes[0].clone();
        change.channels = [("rpm", -2.0), ("thrust_n", 30.0), ("torque_nm", -1.5)].map(|(c, e)| (c.to_owned(), e)).to_vec();
        let of = |channels: &[&str]| {
            let all: Vec<String> = channels.iter().map(|c| (*c).to_owned()).collect();
            spoken(&change, &history, &of_speeds(&all))
        };
        assert_eq!(of(&["thrust_n"]), MOST);
        assert_eq!(of(&["thrust_n", "torque_nm", "rpm_hall", "rpm_opto"]), MOST - 3.5);
        assert_eq!(of(&["torque_nm"]), -1.5 - MOST);
    }

    /// Three times as likely is three times as likely, and no name takes the whole: it may be none of them.
    #[test]
    fn names_share_one_probability_with_none_of_them() {
        let of = |scores: &[f64]| -> Vec<f64> {
            let name = |score: &f64| Name {
                id: String::new(),
                title: String::new(),
                words: String::new(),
                score: *score,
                probability: 0.0,
            };
            let mut names: Vec<Name> = scores.iter().map(name).collect();
            weigh(&mut names);
            names.iter().map(|n| n.probability).collect()
        };
        let two = of(&[6f64.ln(), 2f64.ln()]);
        assert!((two[0] - 6.0 / 9.0).abs() < 1e-12 && (two[1] - 2.0 / 9.0).abs() < 1e-12, "{two:?}");
        assert!((of(&[0.0])[0] - 0.5).abs() < 1e-12);
        assert!(of(&[5000.0, 1.0]).iter().all(|p| p.is_finite()) && of(&[]).is_empty());
    }

    #[test]
    fn the_models_are_of_the_most_usual_runs_before_the_gap() {
        let history = stepped(12, 7);
        let (before, after) = chosen(&history, &history.changes[0]);
        assert!(before.len() == BEFORE && before.iter().all(|k| *k < 7), "{before:?}");
        assert_eq!(after, [7, 9, 11]);
    }
}
