//! The search for shape parameters: a scan of each candidate's grid, and a joint refinement.
//!
//! What it is: the profile likelihood over the shapes, maximised from the best point of a grid by Nelder-Mead.
//! What can go wrong: a shape on its bound stays there; the diagnosis then disqualifies it.
//! Units: log-likelihood in nats.
//! Reference: Nelder & Mead 1965, Computer Journal 7:308.

use crate::channel::Context;
use crate::channel::Question;
use crate::effects::placed::Placed;
use crate::effects::{Effect, Instance, Shape};
use crate::fit::Rows;
use crate::fit::samples::{Base, Taught};
use crate::model::Declared;
use crate::numeric::simplex::nelder_mead;

/// The stride over rows that keeps the longest target near `most` samples.
pub(crate) fn stride(context: &Context, most: usize) -> usize {
    context.targets.iter().map(|t| t.rows.len()).max().unwrap_or(1).div_ceil(most).max(1)
}

/// What scans add candidates to: each second, third, ... row of a long log will do.
pub(crate) fn base<'c>(context: &'c Context, declared: Declared<'c>, placed: &'c [Placed]) -> Base<'c> {
    Base::new(Taught::new(context, declared, Rows::Every(stride(context, SCANNED))), placed)
}

/// Samples of a channel that a scan looks at.
const SCANNED: usize = 4000;

/// Grid points from which on a scan looks at channels that have something left only.
const LARGE_GRID: usize = 6;

/// Best start of one candidate added to a fixed set: a scan of its grid. On the targets that are not `loud` nothing is left to
/// gain; a large grid is not scanned on them, and nothing is found where all are quiet, unless the effect speaks of scatter.
#[must_use]
pub(crate) fn scan(
    context: &Context,
    base: &Base<'_>,
    effect: &'static dyn Effect,
    instance: &Instance,
    loud: &[bool],
) -> Option<(Vec<f64>, f64)> {
    let shapes = effect.shapes(context, instance);
    let total: usize = shapes.iter().map(|s| s.starts.len()).product();
    let mut moving: Vec<&str> = instance.channels.iter().map(String::as_str).collect();
    if total >= LARGE_GRID && !effect.scatters() {
        moving.retain(|c| context.target(c).is_some_and(|k| loud[k]));
        if moving.is_empty() {
            return None;
        }
    }
    let scattering = effect.scatters() || base.placed.iter().any(|p| p.effect.scatters());
    let before = base.loglik(&moving, scattering);
    let mut best: Option<(Vec<f64>, f64)> = None;
    for index in 0..total {
        let mut rest = index;
        let shape: Vec<f64> = shapes
            .iter()
            .map(|s| {
                let v = s.starts[rest % s.starts.len()];
                rest /= s.starts.len();
                v
            })
            .collect();
        let mut placed = base.placed.to_vec();
        placed.push(Placed { effect, instance: instance.clone(), shape: shape.clone() });
        let known = placed.last().map_or(0.0, |p| p.prior(context));
        let gain = base.taught.loglik(&placed, &moving, scattering) + known - before;
        if gain.is_finite() && best.as_ref().is_none_or(|b| gain > b.1) {
            best = Some((shape, gain));
        }
    }
    best
}

/// Times that the distance to the next point of a grid is halved.
const HALVED: i32 = 3;

/// The newest effect's shapes between the points of its grid: each in turn goes half of the way to its neighbours, then a quarter, then an eighth,
/// wherever the likelihood is larger. What sets in at an instant has a likelihood with an edge at each sample, on which a simplex hangs.
#[must_use]
pub(crate) fn between_starts(context: &Context, declared: Declared<'_>, placed: &[Placed], rows: Rows<'_>) -> Vec<Placed> {
    let mut out = placed.to_vec();
    let Some(newest) = placed.last().filter(|p| !p.shape.is_empty()) else { return out };
    let moving: Vec<&str> = newest.instance.channels.iter().map(String::as_str).collect();
    let scattering = placed.iter().any(|p| p.effect.scatters());
    let taught = Taught::new(context, declared, rows);
    let likelihood =
        |placed: &[Placed]| taught.loglik(placed, &moving, scattering) + placed.last().map_or(0.0, |p| p.prior(context));
    let (shapes, grid) = (newest.effect.shapes(context, &newest.instance), &newest.shape);
    let mut most = likelihood(&out);
    for half in 1..=HALVED {
        for (i, (shape, at)) in shapes.iter().zip(grid).enumerate() {
            for gap in gaps(shape, *at) {
                let mut moved = out.clone();
                let Some(v) = moved.last_mut().and_then(|p| p.shape.get_mut(i)) else { continue };
                *v = (*v + gap * 0.5_f64.powi(half)).clamp(shape.range.0, shape.range.1);
                let found = likelihood(&moved);
                if found > most {
                    (most, out) = (found, moved);
                }
            }
        }
    }
    out
}

/// Ways from a start to the next ones below and above, or to the ends of the range.
fn gaps(shape: &Shape, at: f64) -> [f64; 2] {
    let below = shape.starts.iter().copied().filter(|s| *s < at).fold(shape.range.0, f64::max);
    let above = shape.starts.iter().copied().filter(|s| *s > at).fold(shape.range.1, f64::min);
    [below - at, above - at]
}

/// Improves the shapes of a hypothesis together (Nelder-Mead within the plausible ranges): those of its newest effect and of
/// every effect that shares a channel with it, directly or through others. The rest is independent of them.
#[must_use]
pub fn refine_newest(
    context: &Context,
    declared: Declared<'_>,
    placed: &[Placed],
    rows: Rows<'_>,
    evaluations: usize,
) -> Vec<Placed> {
    let Some(newest) = placed.len().checked_sub(1) else { return Vec::new() };
    refine_group(context, declared, placed, &connected(placed, newest), rows, evaluations)
}

/// Improves all shapes of a hypothesis, each group of effects that share channels on its own.
#[must_use]
pub fn refine(context: &Context, declared: Declared<'_>, placed: &[Placed], rows: Rows<'_>, evaluations: usize) -> Vec<Placed> {
    let mut out = placed.to_vec();
    let mut done = vec![false; placed.len()];
    for k in 0..placed.len() {
        if !done[k] {
            let group = connected(placed, k);
            out = refine_group(context, declared, &out, &group, rows, evaluations);
            for g in group {
                done[g] = true;
            }
        }
    }
    out
}

/// Positions that share channels with position `k`, directly or through others.
pub(crate) fn connected(placed: &[Placed], k: usize) -> Vec<usize> {
    let mut group = vec![k];
    let mut at = 0;
    while at < group.len() {
        for (j, p) in placed.iter().enumerate() {
            if !group.contains(&j) && p.instance.channels.iter().any(|c| placed[group[at]].instance.touches(c)) {
                group.push(j);
            }
        }
        at += 1;
    }
    group.sort_unstable();
    group
}

/// First steps from the optimum of all rows to that of a part of them, as a share of those from a grid's point: what a fold leaves out moves it by a
/// fraction of its standard error. Larger ones cost a search of few evaluations all of them, and it ends far along any ridge.
const NEAR: f64 = 0.1;

/// Improves the shapes of the effects at the positions of `group` together, the others as they are.
pub(crate) fn refine_group(
    context: &Context,
    declared: Declared<'_>,
    placed: &[Placed],
    group: &[usize],
    rows: Rows<'_>,
    evaluations: usize,
) -> Vec<Placed> {
    let ranges: Vec<(f64, f64)> = placed.iter().flat_map(|p| p.effect.shapes(context, &p.instance)).map(|s| s.range).collect();
    let start: Vec<f64> = placed.iter().flat_map(|p| p.shape.iter().copied()).collect();
    let owner: Vec<usize> = placed.iter().enumerate().flat_map(|(k, p)| std::iter::repeat_n(k, p.shape.len())).collect();
    let free: Vec<usize> = (0..start.len()).filter(|i| ranges[*i].1 > ranges[*i].0 && group.contains(&owner[*i])).collect();
    if free.is_empty() {
        return placed.to_vec();
    }
    let moving = touched_by_shapes(placed, group);
    let question = Question::new((context, declared), placed, group, &moving, rows, evaluations);
    let shapes = context.facts.refined.or_found(question, || {
        let taught = Taught::new(context, declared, rows);
        let scattering = placed.iter().any(|p| p.effect.scatters());
        let inside = |x: &[f64]| -> Vec<f64> {
            let mut full = start.clone();
            for (i, v) in free.iter().zip(x) {
                full[*i] = v.clamp(ranges[*i].0, ranges[*i].1);
            }
            full
        };
        let cost = |x: &[f64]| -> f64 {
            let full = inside(x);
            // a soft wall keeps the simplex inside the plausible box
            let wall: f64 = free.iter().zip(x).map(|(i, v)| ((v - full[*i]) / (ranges[*i].1 - ranges[*i].0)).abs()).sum();
            let placed = with_shapes(placed, &full);
            let known: f64 = group.iter().map(|k| placed[*k].prior(context)).sum();
            -taught.loglik(&placed, &moving, scattering) - known + 1e3 * wall
        };
        let x0: Vec<f64> = free.iter().map(|i| start[*i]).collect();
        let widths = free.iter().map(|i| (start[*i].abs(), ranges[*i].1 - ranges[*i].0));
        let near = if matches!(rows, Rows::Where(_)) { NEAR } else { 1.0 };
        let steps: Vec<f64> = widths.map(|(at, width)| near * (0.15 * at).max(0.01 * width).min(0.2 * width)).collect();
        let best = with_shapes(placed, &inside(&nelder_mead(&cost, &x0, &steps, evaluations)));
        group.iter().map(|k| best[*k].shape.clone()).collect()
    });
    let mut out = placed.to_vec();
    group.iter().zip(shapes).for_each(|(k, shape)| out[*k].shape = shape);
    out
}

/// Share of a likelihood by which the order of its sums alone may move it: a million sums, each rounded to the 16th digit.
const ROUNDED: f64 = 1e-10;

/// The hypothesis with those shapes of the effects at some positions as they were in `from` that the kept rows do not feel: an instant within a
/// stretch that is left out costs the rest nothing, wherever a simplex has carried it.
#[must_use]
pub(crate) fn unfelt_stay(
    context: &Context,
    declared: Declared<'_>,
    from: &[Placed],
    (mut refined, of): (Vec<Placed>, &[usize]),
    keep: &[bool],
) -> Vec<Placed> {
    let moving = touched_by_shapes(from, of);
    let scattering = refined.iter().any(|p| p.effect.scatters());
    let taught = Taught::new(context, declared, Rows::Where(keep));
    let known = |placed: &[Placed]| of.iter().map(|k| placed[*k].prior(context)).sum::<f64>();
    let gain = |placed: &[Placed]| taught.loglik(placed, &moving, scattering) + known(placed);
    let most = gain(&refined);
    for k in of {
        for i in 0..refined[*k].shape.len() {
            let found = std::mem::replace(&mut refined[*k].shape[i], from[*k].shape[i]);
            if found != from[*k].shape[i] && (gain(&refined) - most).abs() > ROUNDED * most.abs() {
                refined[*k].shape[i] = found;
            }
        }
    }
    refined
}

fn touched_by_shapes<'p>(placed: &'p [Placed], group: &[usize]) -> Vec<&'p str> {
    let moved = group.iter().map(|k| &placed[*k]).filter(|p| !p.shape.is_empty());
    let mut out: Vec<&str> = moved.flat_map(|p| p.instance.channels.iter().map(String::as_str)).collect();
    out.sort_unstable();
    out.dedup();
    out
}

fn with_shapes(placed: &[Placed], full: &[f64]) -> Vec<Placed> {
    let mut at = 0;
    placed
        .iter()
        .map(|p| {
            let shape = full[at..at + p.shape.len()].to_vec();
            at += p.shape.len();
            Placed { shape, ..p.clone() }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::unfelt_stay;
    use crate::channel::Context;
    use crate::effects::placed::Placed;
    use crate::effects::{Instance, by_id};
    use crate::log::{Column, Log};
    use crate::model::Declared;

    /// A zero that jumps at 50 s of 100: an instant between the rows that are left out, 40 s to 60 s, costs the others nothing.
    #[test]
    fn an_instant_that_the_kept_rows_do_not_feel_stays_where_it_was() {
        let t: Vec<f64> = (0..1000).map(|i| 0.1 * f64::from(i)).collect();
        let column = |name: &str, of: fn(f64) -> f64| Column { name: name.into(), values: t.iter().map(|t| of(*t)).collect() };
        let columns = vec![
            column("rpm", |t| 3000.0 + 1000.0 * (0.7 * t).sin()),
            column("thrust_n", |t| {
                1e-7 * (3000.0 + 1000.0 * (0.7 * t).sin()).powi(2) + if t < 50.0 { 0.0 } else { 0.3 } + 0.01 * (37.0 * t).sin()
            }),
        ];
        let context = Context::new(&Log { t: t.clone(), columns, ..Log::default() }, Some(1000.0));
        let at = |t0: f64| {
            let effect = by_id("tare_shift").expect("in the library");
            vec![Placed { effect, instance: Instance::new(&["thrust_n"], ""), shape: vec![t0] }]
        };
        let keep: Vec<bool> = t.iter().map(|t| !(40.0..60.0).contains(t)).collect();
        let stays = |found: f64| unfelt_stay(&context, Declared::default(), &at(50.0), (at(found), &[0]), &keep)[0].shape[0];
        assert_eq!([42.0, 58.0].map(stays), [50.0, 50.0]);
        // one that they feel stays where it was found
        assert_eq!([20.0, 80.0].map(stays), [20.0, 80.0]);
    }
}
