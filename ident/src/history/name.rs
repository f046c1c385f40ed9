//! What a change is called.
//!
//! What it is: the loop closed on runs after the gap against a model of the most usual run before it, by the same library that names causes in one
//! run. A model of a day of its own would find that day in all others. What the loop names on other runs before the gap as well, and as large, is how days differ, and is taken off. What came to stay has the
//! same size on all runs after the gap: another one is of its own day.
//! What can go wrong: an effect that the run before the gap hides is not seen after it; a drift is told by its measure, not by the library.
//! Units: scores are logarithms of odds, nats.
//! Reference: specification `closing-the-loop.md`; difference in differences.

use super::History;
use super::find::{Change, Kind};
use crate::close::{Closed, close};
use crate::effects::{self, Effect};
use crate::log::Log;
use crate::model::Model;
use crate::noise::median;
use crate::parallel::in_parallel;
use crate::verdict::EffectEntry;
use crate::words::lower;
use serde::Serialize;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Runs after a gap that are asked, and runs before it that show how days differ.
const AFTER: usize = 3;
const BEFORE: usize = 2;
/// Odds that one run gives or takes at the most, nats.
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
    /// Odds that a run after the gap gives it, less those of a run before it, nats.
    pub score: f64,
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

/// Runs that are asked about a change: the one that the model is of, others before it, some after it.
fn chosen(history: &History, change: &Change) -> (usize, Vec<usize>, Vec<usize>) {
    let [from, to] = change.among;
    let gap = if change.kind == Kind::Drift { from + 1 } else { change.first };
    let own = most_usual(history, from..gap);
    let before: Vec<usize> = (from..gap).rev().filter(|k| *k != own).take(BEFORE).collect();
    let after: Vec<usize> = if change.kind == Kind::Drift { (gap..to).rev().take(AFTER).collect() } else { spread(gap, to) };
    (own, before, after)
}

/// The run among some whose measures are nearest to their medians, each in the spread of those runs; the latest of those that are as near.
fn most_usual(history: &History, runs: Range<usize>) -> usize {
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
    let least = off.iter().copied().fold(f64::INFINITY, f64::min);
    off.iter().rposition(|o| *o <= least).map_or(runs.start, |k| runs.start + k)
}

/// First, middle and last of some runs.
fn spread(from: usize, to: usize) -> Vec<usize> {
    let mut out = vec![from, (from + to) / 2, to - 1];
    out.dedup();
    out
}

fn names(history: &History, change: &Change, logs: &[&Log], progress: &(dyn Fn(f64) + Sync)) -> Vec<Name> {
    let (usual, before, after) = chosen(history, change);
    let Ok(own) = close(logs[usual], None, &[], &mut |_| {}) else { return Vec::new() };
    let runs: Vec<usize> = before.iter().chain(&after).copied().collect();
    let done = AtomicUsize::new(1);
    let of = |k: usize| {
        let closed = against(logs[runs[k]], &own.model);
        progress((done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / (runs.len() + 1) as f64);
        closed
    };
    let closed = in_parallel(runs.len(), &of);
    let (usual, news) = closed.split_at(before.len());
    let moved: Vec<&str> = change.moved.iter().map(|m| history.measures[m.measure].channel.as_str()).collect();
    let mut out: Vec<Name> = effects::library().iter().filter_map(|e| told(*e, usual, news, &moved)).collect();
    out.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.id.cmp(&b.id)));
    out.truncate(KEPT);
    out
}

fn against(log: &Log, model: &Model) -> Option<Closed> {
    close(log, Some(model), &[], &mut |_| {}).ok()
}

/// An effect as a name, where runs after the gap speak for it more than those before.
fn told(effect: &'static dyn Effect, usual: &[Option<Closed>], news: &[Option<Closed>], moved: &[&str]) -> Option<Name> {
    let id = effect.id();
    let mean = |all: Vec<f64>| (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64);
    let mut sizes: Vec<f64> = news.iter().flatten().filter_map(|c| size(entry(c, id)?)).collect();
    let as_large = if sizes.is_empty() { None } else { Some(median(&mut sizes)) };
    // a run on which it has no size tells by its odds alone
    let like = |c: &Closed| times(entry(c, id), as_large);
    let same = |c: &Closed| if like(c).is_some_and(|times| !(0.5..2.0).contains(&times)) { -MOST } else { odds(c, id) };
    let as_before = |c: &Closed| if like(c).is_some_and(|times| times < 0.5) { -MOST } else { odds(c, id) };
    let after = mean(news.iter().flatten().map(same).collect())?;
    let score = after - mean(usual.iter().flatten().map(as_before).collect()).unwrap_or(-MOST);
    let entry = news.iter().flatten().filter_map(|c| entry(c, id)).find(|e| moved.is_empty() || touches(e, moved))?;
    // what does not touch what moved most leaves that without a cause
    let score = if moved.first().is_some_and(|most| !touches(entry, &[*most])) { score - MOST } else { score };
    let words = lower(&effect.said(entry).sentence());
    (score > 0.0).then(|| Name { id: id.to_owned(), title: lower(effect.about().title), words, score })
}

/// Whether an effect is on one of these channels; the sensors of one speed are one.
fn touches(e: &EffectEntry, channels: &[&str]) -> bool {
    let speed = |c: &str| c.starts_with("rpm");
    e.channels.iter().any(|c| channels.iter().any(|m| c == m || speed(c) && speed(m)))
}

/// How large an effect is, with its sign: the first of its parameters that is no instant and no shape.
fn size(entry: &EffectEntry) -> Option<f64> {
    const SHAPES: [&str; 8] = ["t0", "t1", "phase", "tau", "tau_up", "tau_down", "onset", "slack"];
    entry.parameters.iter().find(|p| !SHAPES.contains(&p.name.as_str())).map(|p| p.value)
}

/// How large an effect is on a run, over what it is after the gap: below a half it is nearer to nothing.
fn times(on_run: Option<&EffectEntry>, after: Option<f64>) -> Option<f64> {
    let times = on_run.and_then(size)? / after?;
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
