//! A cause at a size: what it would add to every channel of a log.
//!
//! What it is: a line in the parameters of an effect from where it does nothing to where it does most. A linear amplitude grows from nought
//! (where an effect has several, the first one of each channel, all by as many noise floors); a shape grows from the end of its range at which
//! the effect vanishes; instants and onsets stand in the middle of the library's grid.
//! What can go wrong: an effect whose range ends before it vanishes has no smaller size than that.
//! Units: sizes in noise floors of the channel that shows most of the cause beside the declared model; changes in the channel's unit.
//! Reference: separable least squares, Golub & Pereyra 1973.

use super::Quantity;
use crate::attribution::choose::span;
use crate::channel::Context;
use crate::effects::design::{Label, TargetDesign};
use crate::effects::placed::Placed;
use crate::effects::{Effect, Instance};
use crate::fit::{Fit, design, plain};
use crate::model::Declared;
use crate::numeric::solve::Normal;

/// What a cause makes of one channel.
#[derive(Debug, Clone)]
pub(crate) struct Part {
    /// Which target.
    pub(crate) target: usize,
    /// Change of each sample.
    pub(crate) change: Vec<f64>,
    /// Variance that each sample gains; empty for none.
    pub(crate) scatter: Vec<f64>,
    /// Root mean square of the change, in noise floors.
    pub(crate) whole: f64,
    /// The same of what the declared columns cannot take up, the gained scatter included.
    pub(crate) beside: f64,
}

/// The line along which a cause grows.
#[derive(Clone)]
pub(crate) struct Line {
    effect: &'static dyn Effect,
    instance: Instance,
    /// Shapes at no effect and at the middle of the grid.
    from: Vec<f64>,
    to: Vec<f64>,
    /// Whether amplitudes grow (else shapes do).
    linear: bool,
    /// Amplitudes at a place of one.
    unit: Vec<f64>,
    /// Largest place that ranges and readings allow, and the least one.
    ends: (f64, f64),
}

/// Change, as a share of that at the middle of the grid, that counts as none.
const NONE: f64 = 1e-6;

impl Line {
    /// Of an instance of an effect; `None` where the log would not change at all.
    pub(crate) fn new(context: &Context, healthy: &Fit, effect: &'static dyn Effect, instance: Instance) -> Option<Self> {
        let shapes = effect.shapes(context, &instance);
        let to: Vec<f64> = shapes.iter().map(|s| s.starts[s.starts.len() / 2]).collect();
        let amplitudes = effect.amplitudes(&instance).len();
        let mut line =
            Self { effect, instance, from: to.clone(), to, linear: false, unit: vec![0.0; amplitudes], ends: (0.0, 1.0) };
        let most = line.loudness(context, healthy, 1.0);
        if most > 0.0 {
            line.from = line.vanishing(context, healthy, most);
            line.ends = line.ends_of_shapes(context);
        } else {
            line.linear = true;
            line.unit = line.units(context);
            line.ends = (0.0, f64::INFINITY);
        }
        let seen = line.loudness(context, healthy, 1.0);
        if !(seen > 0.0 && seen.is_finite()) {
            return None;
        }
        line.ends.1 = line.largest(context, healthy);
        Some(line)
    }

    /// The same with every pattern of signs of its amplitudes, as it is first; shapes keep theirs.
    pub(crate) fn turned(&self) -> Vec<Self> {
        let moved: Vec<usize> = (0..self.unit.len()).filter(|k| self.unit[*k] != 0.0).collect();
        let pattern = |bits: u32| {
            let sign = |k: usize| moved.iter().position(|m| *m == k).map_or(1.0, |b| if bits >> b & 1 == 1 { -1.0 } else { 1.0 });
            Self { unit: self.unit.iter().enumerate().map(|(k, u)| sign(k) * u).collect(), ..self.clone() }
        };
        (0..1_u32 << moved.len()).map(pattern).collect()
    }

    /// The amplitude of the first column of each channel: one noise floor of it, root mean square.
    fn units(&self, context: &Context) -> Vec<f64> {
        let mut unit = vec![0.0; self.unit.len()];
        for target in context.targets.iter().filter(|t| self.instance.touches(t.name)) {
            let with = design(context, Declared::default(), &[self.placed(1.0)], target);
            let own = with.columns.iter().filter_map(|c| match c.label {
                Label::Effect { amplitude, .. } => Some((amplitude, c)),
                Label::Base(_) => None,
            });
            let Some((k, column)) = own.min_by_key(|(k, _)| *k) else { continue };
            let size = rms(target.rows.iter().map(|row| column.values[*row]));
            if unit[k] == 0.0 && size > 0.0 {
                unit[k] = target.noise.rms / size;
            }
        }
        unit
    }

    /// The shapes at which the effect vanishes: the first one that can take it away alone, or all that have an end.
    fn vanishing(&self, context: &Context, healthy: &Fit, most: f64) -> Vec<f64> {
        let shapes = self.effect.shapes(context, &self.instance);
        let loud = |at: &[f64]| Self { from: at.to_vec(), ..self.clone() }.loudness(context, healthy, 0.0);
        let mut all = self.to.clone();
        for (k, shape) in shapes.iter().enumerate().filter(|(_, s)| s.range.1 > s.range.0 && !is_place(s.name)) {
            let zero = (shape.range.0 <= 0.0 && shape.range.1 >= 0.0).then_some(0.0);
            let ends = [Some(shape.range.0), zero, Some(shape.range.1)];
            let tried = ends.into_iter().flatten().map(|end| {
                let mut at = self.to.clone();
                at[k] = end;
                (loud(&at), at)
            });
            let Some((left, at)) = tried.min_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
            if left <= NONE * most {
                return at;
            }
            all[k] = at[k];
        }
        if loud(&all) < most { all } else { self.to.clone() }
    }

    fn ends_of_shapes(&self, context: &Context) -> (f64, f64) {
        let shapes = self.effect.shapes(context, &self.instance);
        let room = shapes.iter().zip(self.from.iter().zip(&self.to)).filter(|(_, (f, t))| f != t).map(|(s, (from, to))| {
            let end = if to > from { s.range.1 } else { s.range.0 };
            (end - from) / (to - from)
        });
        (0.0, room.fold(f64::INFINITY, f64::min).min(if self.from == self.to { 1.0 } else { f64::INFINITY }))
    }

    /// The place at which a channel is off by as much as it reads at most, or at which a range ends (just before it).
    fn largest(&self, context: &Context, healthy: &Fit) -> f64 {
        let ruined = |place: f64| {
            let parts = self.parts(context, healthy, place);
            parts.iter().any(|p| p.whole * context.targets[p.target].noise.rms > span(&context.targets[p.target]))
        };
        let end = self.ends.1;
        if end.is_finite() && !ruined(0.99 * end) {
            return 0.99 * end;
        }
        let mut high = if end.is_finite() { 0.99 * end } else { 1.0 };
        while !ruined(high) && high < 1e12 {
            high *= 2.0;
        }
        bisect(0.0, high, &ruined)
    }

    /// The effect at a place.
    pub(crate) fn placed(&self, place: f64) -> Placed {
        let shape = if self.linear {
            self.to.clone()
        } else {
            self.from.iter().zip(&self.to).map(|(from, to)| from + place * (to - from)).collect()
        };
        Placed { effect: self.effect, instance: self.instance.clone(), shape }
    }

    /// What it does to the channels at a place.
    pub(crate) fn parts(&self, context: &Context, healthy: &Fit, place: f64) -> Vec<Part> {
        let placed = [self.placed(place)];
        let touched = context.targets.iter().enumerate().filter(|(_, t)| self.instance.touches(t.name));
        touched.map(|(i, _)| self.part(context, healthy, &placed, (i, place))).collect()
    }

    fn part(&self, context: &Context, healthy: &Fit, placed: &[Placed], (i, place): (usize, f64)) -> Part {
        let target = &context.targets[i];
        let (without, with) = (plain(context, Declared::default(), target), design(context, Declared::default(), placed, target));
        let (before, after) =
            (predicted(context, healthy, i, &without, &[]), predicted(context, healthy, i, &with, &self.at(place)));
        let change: Vec<f64> = target.rows.iter().map(|row| after[*row] - before[*row]).collect();
        let scatter: Vec<f64> = if with.extra_variance.is_empty() {
            Vec::new()
        } else {
            target.rows.iter().map(|r| with.extra_variance[*r]).collect()
        };
        let gained = scatter.iter().sum::<f64>() / scatter.len().max(1) as f64;
        let floor = target.noise.rms;
        let left = left_beside(&without, &target.rows, &change, &target.levelled);
        let whole = (rms(change.iter().copied()).powi(2) + gained).sqrt() / floor;
        Part { target: i, whole, beside: (rms(left.into_iter()).powi(2) + gained).sqrt() / floor, change, scatter }
    }

    fn at(&self, place: f64) -> Vec<f64> {
        if self.linear { self.unit.iter().map(|u| place * u).collect() } else { self.unit.clone() }
    }

    fn loudness(&self, context: &Context, healthy: &Fit, place: f64) -> f64 {
        self.parts(context, healthy, place).iter().map(|p| p.whole).fold(0.0, f64::max)
    }

    /// Size at a place: what stands beside the declared model on the channel that shows most.
    pub(crate) fn size(&self, context: &Context, healthy: &Fit, place: f64) -> f64 {
        self.parts(context, healthy, place).iter().map(|p| p.beside).fold(0.0, f64::max)
    }

    /// Largest size.
    pub(crate) fn most(&self, context: &Context, healthy: &Fit) -> f64 {
        self.size(context, healthy, self.ends.1)
    }

    /// The place of a size; the end of the line where it has no such size.
    pub(crate) fn place(&self, context: &Context, healthy: &Fit, size: f64) -> f64 {
        if self.linear {
            return (size / self.size(context, healthy, 1.0)).min(self.ends.1);
        }
        bisect(self.ends.0, self.ends.1, &|place| self.size(context, healthy, place) >= size)
    }

    /// The size's own parameter at a place, and the parameters that stand still.
    pub(crate) fn quantities(&self, context: &Context, place: f64) -> (Quantity, Vec<Quantity>) {
        let shapes = self.effect.shapes(context, &self.instance);
        let at = self.placed(place).shape;
        let of_shape = |k: usize| Quantity { name: shapes[k].name.to_owned(), unit: shapes[k].unit.to_owned(), value: at[k] };
        let moves = |k: &usize| !self.linear && self.from[*k] != self.to[*k];
        let fixed =
            (0..shapes.len()).filter(|k| !moves(k) && shapes[*k].range.1 > shapes[*k].range.0 && !shapes[*k].is_nuisance());
        let still: Vec<Quantity> = fixed.map(of_shape).collect();
        let amplitude = || {
            let k = self.unit.iter().position(|u| *u != 0.0)?;
            let a = self.effect.amplitudes(&self.instance)[k];
            Some(Quantity { name: a.name.to_owned(), unit: a.unit.to_owned(), value: self.at(place)[k] })
        };
        let own = (0..shapes.len()).find(moves).map(of_shape).or_else(amplitude);
        (own.or_else(|| still.first().cloned()).unwrap_or_default(), still)
    }
}

/// Shapes that say when or where something happens, and not how much of it there is.
fn is_place(name: &str) -> bool {
    matches!(
        name,
        "t0" | "phase" | "offset" | "spread" | "reference" | "onset" | "half_speed" | "natural_frequency" | "damping_ratio"
    )
}

/// The prediction with the declared coefficients of the healthy rig and amplitudes of the effect.
fn predicted(context: &Context, healthy: &Fit, target: usize, design: &TargetDesign, amplitudes: &[f64]) -> Vec<f64> {
    let fit = &healthy.targets[target];
    let coefficient = |label: Label| match label {
        Label::Effect { amplitude, .. } => amplitudes.get(amplitude).copied().unwrap_or(0.0),
        base @ Label::Base(_) => fit.labels.iter().position(|l| *l == base).map_or(0.0, |k| fit.coefficients[k]),
    };
    let coefficients: Vec<f64> = design.columns.iter().map(|c| coefficient(c.label)).collect();
    design.predict(&coefficients, context.len())
}

/// What the declared columns leave of a change.
fn left_beside(declared: &TargetDesign, rows: &[usize], change: &[f64], levelled: &[f64]) -> Vec<f64> {
    let weights: Vec<f64> = levelled.iter().map(|v| 1.0 / v).collect();
    let columns: Vec<Vec<f64>> = declared.columns.iter().map(|c| rows.iter().map(|r| c.values[*r]).collect()).collect();
    let mut left = change.to_vec();
    let mut normal = Normal::of_columns(&columns, change, &weights);
    declared.expect(&mut normal, 1.0);
    if let Some(solution) = normal.solve() {
        for (column, b) in columns.iter().zip(&solution.coefficients) {
            left.iter_mut().zip(column).for_each(|(l, v)| *l -= b * v);
        }
    }
    left
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0_usize), |(s, n), v| (s + v * v, n + 1));
    (sum / n.max(1) as f64).sqrt()
}

/// Where a condition that fails at `low` begins to hold.
fn bisect(mut low: f64, mut high: f64, holds: &dyn Fn(f64) -> bool) -> f64 {
    for _ in 0..50 {
        let mid = 0.5 * (low + high);
        if holds(mid) { high = mid } else { low = mid }
    }
    high
}
