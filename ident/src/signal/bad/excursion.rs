//! Departures that leave at once, that no witness bears out, and that come back.
//!
//! What it is: each sample is held against what its channel was off by before; what stands farther out than a bad reading is improbable to
//! opens an excursion, which ends where the channel is back within its noise. After a step of the load a channel may be off by what
//! it is off by after the other steps too.
//! What can go wrong: a departure that does not come back is an effect, and so is one that comes slowly.
//! Units: rows, s, the channel's own.
//! Reference: contaminated normal distribution, Tukey 1960; [`super::scale`].

use super::scale::{BEFORE, Scale, before};
use super::witness::{Case, Witnesses};
use crate::numeric::order::median;
use std::collections::BTreeSet;
use std::ops::Range;

/// A departure.
#[derive(Debug, Clone)]
pub(super) struct Event {
    /// Rows of the log.
    pub(super) rows: Range<usize>,
    /// The one that is farthest off.
    pub(super) worst: usize,
    /// What was expected there.
    pub(super) expected: f64,
    /// Whether the load has just stepped.
    pub(super) at_step: bool,
    /// Whether they are the zeros of a tachometer before its second mark.
    pub(super) silent: bool,
}

/// Most samples of an excursion, its recovery included: 40 samples and five time constants of as many.
pub(super) const LONGEST: usize = 240;
/// Ages after a step, s, that part the classes of what a channel is off by then.
const AGES: [f64; 6] = [0.1, 0.25, 0.5, 1.0, 2.0, 4.0];
/// What is allowed after a step over what the other steps show.
const SLACK: f64 = 1.5;
/// Scales within which a channel is back, and those within which it has settled.
const BACK: f64 = 5.0;
const SETTLED: f64 = 3.0;
/// Share of the depth within which it is on its way back, so that the rest is recovery.
const RECOVERS: f64 = 0.1;
/// The same in least departures that matter: a spike of any height is over when its channel is back.
const MATTERS: f64 = 2.5;
/// Samples in a row that must be back, and those that a recovery is followed along.
const AGAIN: usize = 3;
const ALONG: usize = 15;
/// Share of the depth that the reading itself must jump by, and that every witness must miss: half of it tells one from the other.
const HALF: f64 = 0.5;
/// Class of age from which on a rotor is hardly on its way any more: a second.
const ON_ITS_WAY: usize = 4;
/// Share of the largest expected speed below which a probe may see nothing of a rotor that turns.
const SLOW: f64 = 0.1;

/// The excursions of a channel.
pub(super) fn found(witnesses: &Witnesses<'_>, name: &'static str) -> Vec<Event> {
    let Some(case) = witnesses.case(name, false) else { return Vec::new() };
    let search = Search::new(&case, &witnesses.t, name.starts_with("rpm"));
    let found = search.run();
    if found.is_empty() {
        return Vec::new();
    }
    let found = search.not_at_every_step(found);
    let (others, commanded) = witnesses.case(name, true).map_or_else(Default::default, |c| (c.others, c.commanded));
    // right after a step what the command says is where the channel goes, before the rotor is there
    let obeys = |e: &Excursion| search.after_step(e) && !commanded.is_empty() && case.borne_out(e, &commanded);
    let alone = |e: &Excursion| !obeys(e) && others.iter().all(|said| !case.borne_out(e, said));
    found.into_iter().filter(alone).map(|e| search.event(&e)).collect()
}

/// An excursion in samples.
#[derive(Debug, Clone)]
struct Excursion {
    from: usize,
    to: usize,
    /// What the channel was off by before.
    usual: f64,
    /// Largest departure from that, and where.
    depth: f64,
    worst: usize,
}

impl Case {
    /// What was expected of a sample of a channel that is off by so much as a rule.
    fn expected(&self, k: usize, usual: f64) -> f64 {
        self.y[k] - self.r[k] + usual
    }

    /// Whether another witness has moved along: what it leaves over has not changed by half as much.
    fn borne_out(&self, e: &Excursion, said: &[f64]) -> bool {
        let left = |k: usize| self.y[k] - said[self.rows[k]];
        let mut before: Vec<f64> = (e.from.saturating_sub(BEFORE)..e.from).map(left).collect();
        let mut after: Vec<f64> = (e.to..(e.to + BEFORE).min(self.y.len())).map(left).collect();
        let usual = if before.is_empty() { median(&mut after) } else { median(&mut before) };
        (left(e.worst) - usual).abs() < HALF * e.depth
    }
}

/// The last step of the load before a sample.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Since {
    /// Class by age; [`AGES`] long where the load has settled.
    pub(super) class: usize,
    /// Number of the step.
    pub(super) number: usize,
    /// Its first row.
    first: usize,
    /// Its size in the channel.
    size: f64,
}

/// What a channel is off by in a class of age.
#[derive(Debug, Clone, Copy, Default)]
struct Usual {
    /// Over the step.
    share: f64,
    /// Whether there were other steps to compare with.
    compared: bool,
}

struct Search<'c> {
    case: &'c Case,
    speed: bool,
    scale: Scale,
    since: Vec<Since>,
    /// Per class what the channel is off by after a step, over the step.
    usual: [Usual; AGES.len()],
    top: f64,
}

impl<'c> Search<'c> {
    fn new(case: &'c Case, t: &[f64], speed: bool) -> Self {
        let scale = Scale::of(&case.r, &case.y);
        let since = since(case, t);
        let usual = usual(case, &since, &scale);
        let top = case.said.iter().copied().fold(0.0, f64::max);
        Self { case, speed, scale, since, usual, top }
    }

    /// What a channel may be off by at a sample because of the last step.
    fn allowed(&self, k: usize) -> f64 {
        let since = self.since[k];
        self.usual.get(since.class).map_or(0.0, |q| SLACK * q.share * since.size)
    }

    fn run(&self) -> Vec<Excursion> {
        let r = &self.case.r;
        let mut out = Vec::new();
        let mut last: Vec<usize> = Vec::new();
        // what the channel was off by before the last step, and that step
        let mut held: Option<(usize, f64)> = None;
        let mut k = 0;
        while k < r.len() {
            let since = self.since[k];
            let running = if last.len() >= AGAIN { self.of(&last) } else { before(r, k) };
            let usual = match held {
                _ if since.class >= AGES.len() => running,
                Some((step, usual)) if step == since.number => usual,
                _ => {
                    held = Some((since.number, running));
                    running
                }
            };
            let off = (r[k] - usual).abs();
            if off > (self.scale.times * self.scale.at(k) + self.allowed(k)).max(self.scale.least) {
                if let Some(e) = self
                    .follow(self.begins(k, usual, &last), usual)
                    .filter(|e| e.to > k && self.leaves_at_once(e) && self.sees(e) && self.is_gross(e) && !self.is_late(e))
                {
                    k = e.to;
                    out.push(e);
                    continue;
                }
                // it lasts: from now on this is what the channel is off by
                if last.len() >= AGAIN {
                    last.clear();
                    held = held.map(|h| (h.0, r[k]));
                }
            }
            last.push(k);
            if last.len() > BEFORE {
                last.remove(0);
            }
            k += 1;
        }
        out
    }

    /// Where an excursion that stood out at a sample began: what the last step would have allowed belongs to it.
    fn begins(&self, k: usize, usual: f64, last: &[usize]) -> usize {
        let r = &self.case.r;
        let of_it = |j: &usize| self.since[*j].number == self.since[k].number && self.since[*j].class < AGES.len();
        let far = |j: &usize| (r[*j] - usual) * (r[k] - usual).signum() > HALF * (r[k] - usual).abs();
        if self.since[k].class >= AGES.len() || last.is_empty() {
            k
        } else {
            k - (0..k).rev().take_while(|j| of_it(j) && far(j)).count()
        }
    }

    fn of(&self, samples: &[usize]) -> f64 {
        median(&mut samples.iter().map(|k| self.case.r[*k]).collect::<Vec<_>>())
    }

    /// Follows an excursion until the channel is back.
    fn follow(&self, from: usize, usual: f64) -> Option<Excursion> {
        let r = &self.case.r;
        let end = (from + LONGEST).min(r.len());
        let (mut depth, mut worst, mut back) = (0.0, from, 0);
        for k in from..end {
            let off = (r[k] - usual).abs();
            if off > depth {
                (depth, worst) = (off, k);
            }
            let near = (BACK * self.scale.at(k)).max((RECOVERS * depth).min(MATTERS * self.scale.least));
            back = if off < near + self.allowed(k) && off < HALF * depth { back + 1 } else { 0 };
            let (to, ended) = (k + 1 - back, k + 1 == r.len());
            if back == AGAIN || ended && to - from <= AGAIN {
                // what ends with a step of the load has come before it, or is what the level is off by
                let (first, other) = (self.since[from], self.since[to.min(r.len() - 1)]);
                let ends_at_step = other.number != first.number && other.class < ON_ITS_WAY;
                if ends_at_step && to - from > AGAIN && depth <= HALF * self.case.expected(worst, usual).abs() {
                    return None;
                }
                return Some(Excursion { from, to: self.settled(to, end), usual, depth, worst });
            }
        }
        None
    }

    /// The sample from which on a recovery has faded into the noise.
    fn settled(&self, from: usize, end: usize) -> usize {
        let r = &self.case.r;
        let stays = |k: usize| {
            let next = &r[k + 1..(k + 1 + ALONG).min(r.len())];
            next.len() < AGAIN
                || (r[k] - median(&mut next.to_vec())).abs()
                    <= SETTLED * self.scale.at(k) + if self.since[k].class < 3 { self.allowed(k) } else { 0.0 }
        };
        (from..end).find(|k| stays(*k)).unwrap_or(end)
    }

    /// Whether the reading itself jumps where the excursion begins or ends: what follows something else slowly does not.
    fn leaves_at_once(&self, e: &Excursion) -> bool {
        let y = &self.case.y;
        let around = |range: Range<usize>| if range.is_empty() { None } else { Some(median(&mut y[range].to_vec())) };
        let (before, after) = (around(e.from.saturating_sub(5)..e.from), around(e.to..(e.to + 5).min(y.len())));
        let jumps = |k: usize, to: Option<f64>| to.is_some_and(|to| (y[k] - to).abs() > HALF * e.depth);
        let first =
            (e.from..e.to.min(e.from + AGAIN)).any(|k| jumps(k, before) && (k == 0 || (y[k] - y[k - 1]).abs() > 0.3 * e.depth));
        let last = (e.to.saturating_sub(AGAIN).max(e.from)..e.to)
            .any(|k| jumps(k, after) && (k + 1 == y.len() || (y[k + 1] - y[k]).abs() > 0.3 * e.depth));
        first || last
    }

    /// Whether a speed that reads too low is that of a rotor which a probe sees.
    fn sees(&self, e: &Excursion) -> bool {
        let said = self.case.said.get(self.case.rows[e.worst]).copied().unwrap_or(f64::INFINITY);
        !self.speed || self.case.r[e.worst] > e.usual || said > SLOW * self.top
    }

    /// Whether an excursion is more than a way to a new level that no witness knows of: it does not follow a step, or is over at once, or half
    /// of what is expected is lost.
    fn is_gross(&self, e: &Excursion) -> bool {
        let known = if self.case.prompt { self.since[e.from].class >= ON_ITS_WAY } else { e.to - e.from <= AGAIN + 1 };
        known || e.depth > HALF * self.case.expected(e.worst, e.usual).abs()
    }

    /// Whether a reading is on its way from what it was before a step of the load to what it is after it.
    fn is_late(&self, e: &Excursion) -> bool {
        let (since, row) = (self.since[e.worst], self.case.rows[e.worst]);
        if self.usual.get(since.class).is_none_or(|u| u.compared) || self.case.said.is_empty() {
            return false;
        }
        let said = &self.case.said[since.first.saturating_sub(2)..=row];
        let (low, high) = said.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        let margin = BACK * self.scale.at(e.worst);
        (low - margin..=high + margin).contains(&(self.case.y[e.worst] - e.usual))
    }

    /// Without those that recur with the load.
    fn not_at_every_step(&self, found: Vec<Excursion>) -> Vec<Excursion> {
        without_recurring(found, &self.since, |e| e.from)
    }

    /// Whether an excursion begins while a step of the load is on its way.
    fn after_step(&self, e: &Excursion) -> bool {
        self.since[e.from].class < AGES.len()
    }

    fn event(&self, e: &Excursion) -> Event {
        let rows = self.case.rows[e.from]..self.case.rows[e.to - 1] + 1;
        let expected = self.case.expected(e.worst, e.usual);
        Event { rows, worst: self.case.rows[e.worst], expected, at_step: self.since[e.from].class < ON_ITS_WAY, silent: false }
    }
}

/// Without those departures that come at one class of age after three steps of the load and more, and after a fifth of them all: they
/// recur with the load. `at` is the sample where one begins.
pub(super) fn without_recurring<T>(found: Vec<T>, since: &[Since], at: impl Fn(&T) -> usize) -> Vec<T> {
    let mut seen: [BTreeSet<usize>; AGES.len()] = Default::default();
    for s in found.iter().map(|e| since[at(e)]) {
        if let Some(steps) = seen.get_mut(s.class) {
            steps.insert(s.number);
        }
    }
    let steps = since.last().map_or(0, |s| s.number);
    let recurs = |class: usize| seen.get(class).is_some_and(|of| of.len() >= 3 && of.len() * 5 > steps);
    found.into_iter().filter(|e| !recurs(since[at(e)].class)).collect()
}

/// The last step before each sample. Steps in rows that follow one another are one.
pub(super) fn since(case: &Case, t: &[f64]) -> Vec<Since> {
    let mut steps: Vec<(usize, usize, bool)> = Vec::new();
    for (row, gap) in &case.steps {
        match steps.last_mut() {
            Some((_, last, _)) if row - *last <= 2 && !gap => *last = *row,
            _ => steps.push((*row, *row, *gap)),
        }
    }
    let mut out = vec![Since { class: AGES.len(), ..Since::default() }; case.rows.len()];
    for (number, (first, last, gap)) in steps.iter().enumerate() {
        let next = steps.get(number + 1).map_or(t.len(), |s| s.0);
        let until = (*first..next).take_while(|i| t[*i] - t[*last] < AGES[AGES.len() - 1]).last().map_or(*first, |i| i + 1);
        let size = size(case, *first, until, *gap);
        let from = case.rows.partition_point(|r| *r < first.saturating_sub(1));
        let to = case.rows.partition_point(|r| *r < until);
        for k in from..to {
            let age = (t[case.rows[k]] - t[*last]).max(0.0);
            out[k] = Since { class: AGES.partition_point(|edge| *edge <= age), number: number + 1, first: *first, size };
        }
        out[to..].iter_mut().for_each(|s| s.number = number + 1);
    }
    out
}

/// What a step is in the channel: the change that its witness says, or that the channel itself shows where it has none. After a gap the
/// rotor may come from standing.
fn size(case: &Case, first: usize, until: usize, gap: bool) -> f64 {
    if case.said.is_empty() {
        let at = |row: usize| case.rows.partition_point(|r| *r < row);
        let (from, to) = (at(first), at(until));
        let mean = |range: Range<usize>| median(&mut case.y[range].to_vec());
        let change = mean(from.saturating_sub(BEFORE)..from) - mean(to.saturating_sub(BEFORE).max(from)..to);
        return if change.is_finite() { change.abs() } else { 0.0 };
    }
    let before = case.said[first.saturating_sub(2)];
    let said = &case.said[first.saturating_sub(1)..until];
    let change = said.iter().fold(0.0, |most, s| f64::max(most, (s - before).abs()));
    if gap { change.max(said.iter().fold(0.0, |most, s| f64::max(most, s.abs()))) } else { change }
}

/// How many of the largest departures after `n` steps are not looked at, so that a bad sample does not allow for itself: a tenth, two at
/// least.
pub(super) fn left_out(n: usize) -> usize {
    (n / 10).max(2)
}

/// Per class of age what the channel is off by after steps, over the step: the third largest of all steps, the second or the largest
/// where there are few, so that a bad sample at one of them does not allow for itself.
fn usual(case: &Case, since: &[Since], scale: &Scale) -> [Usual; AGES.len()] {
    /// Most that too few steps to compare can allow for: a rotor with a time constant of a quarter of a second that draws half as much
    /// again on its way.
    const MOST: [f64; AGES.len()] = [1.5, 1.5, 1.0, 0.5, 0.3, 0.2];
    let mut shares: [Vec<f64>; AGES.len()] = Default::default();
    let mut k = 0;
    while k < since.len() {
        let step = since[k];
        let end = k + since[k..].iter().take_while(|s| s.number == step.number).count();
        let usual = before(&case.r, k);
        let mut most: [Option<f64>; AGES.len()] = [None; AGES.len()];
        for (j, since) in since.iter().enumerate().take(end).skip(k) {
            let Some(most) = most.get_mut(since.class).filter(|_| step.size > 10.0 * scale.at(j)) else { continue };
            let off = ((case.r[j] - usual).abs() - 4.0 * scale.at(j)).max(0.0) / step.size;
            *most = Some(most.map_or(off, |m| m.max(off)));
        }
        shares.iter_mut().zip(most).for_each(|(shares, most)| shares.extend(most));
        k = end;
    }
    let mut out = [Usual::default(); AGES.len()];
    for (class, shares) in shares.iter_mut().enumerate() {
        shares.sort_unstable_by(|a, b| b.total_cmp(a));
        let skip = match shares.len() {
            0 => {
                out[class].share = MOST[class];
                continue;
            }
            1..4 => 0,
            4..10 => 1,
            n => left_out(n),
        };
        let share = if skip == 0 { shares[0].min(MOST[class]) } else { shares[skip] };
        out[class] = Usual { share, compared: skip > 0 };
    }
    out
}
