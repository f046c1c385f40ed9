//! `sample_hold`: a channel repeats old values between its updates.
//!
//! What it is: the reading stands still until its next update, `period` seconds later; the updates are seen in the channel itself, as new
//! values; on a coarse display that not every update changes, as changes that are whole periods apart ([`clock`]); or, where noise comes after the
//! hold, as changes that are late by anything up to a period ([`beneath_noise`]).
//! What can go wrong: a coarse resolution repeats values too, but not at even intervals.
//! Units: s.
//! Reference: zero-order hold; asynchronous telemetry of speed controllers.

use crate::channel::{Context, DIFFERENCES, Target};
use crate::effects::design::TargetDesign;
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, through_meter};
use crate::numeric::order::median;

mod beneath_noise;
mod clock;

use clock::Clock;

/// See the module.
pub(crate) struct SampleHold;

impl Effect for SampleHold {
    fn id(&self) -> &'static str {
        "sample_hold"
    }

    fn about(&self) -> About {
        About {
            title: "A channel repeats old values",
            equation: "reading(t) = truth(last update), an update every `period` seconds",
            source: "zero-order hold",
            depends_on: &["t_s", "time_since_step"],
            signature: "exact repeats at even intervals, and steps of the load arrive late by up to one period",
            look_alikes: &["channel_delay", "quantisation"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(found.meter(), found.tell("period", |v| format!("gives a new value only every {v}"), "repeats old values"))
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Hold
    }

    fn runs_on(&self, _: &Instance) -> [bool; 2] {
        [false, false]
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        if context.time_is_row {
            return Vec::new();
        }
        let held = |t: &&Target| !t.relation.is_evidence();
        let difference =
            |channel: &str| DIFFERENCES.iter().find(|d| d.0 == channel && context.target(d.1).is_some()).map(|d| d.1);
        let of_form =
            |t: &Target, form| Instance::new(&std::iter::once(t.name).chain(difference(t.name)).collect::<Vec<_>>(), form);
        let seen = |t: &Target| {
            let beneath = || beneath_noise::clock(context, t).is_some();
            let forms: [(&str, &dyn Fn() -> bool); 3] = [
                ("", &|| period(context, t).is_some()),
                (SKIPPING, &|| Clock::of_updates(context, t).is_some()),
                (BENEATH, &beneath),
            ];
            forms.into_iter().find(|(_, is_seen)| is_seen()).map(|(form, _)| of_form(t, form))
        };
        context.targets.iter().filter(held).filter_map(seen).collect()
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        // measured from the repeats, not fitted
        let found = target(context, instance).and_then(|t| found(context, instance, t)).map_or(0.0, |p| p.0);
        vec![Shape { name: "period", unit: "s", range: (found, found), starts: vec![found] }]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        Vec::new()
    }

    fn apply(&self, context: &Context, instance: &Instance, _: &[f64], _: usize, design: &mut TargetDesign) {
        let Some(target) = target(context, instance) else { return };
        let clock = match instance.form.as_str() {
            BENEATH => beneath_noise::clock(context, target),
            SKIPPING => Clock::of_updates(context, target),
            _ => None,
        };
        let mut fresh = vec![None; context.len()];
        match clock {
            Some(clock) => fresh = clock.before(&context.t),
            None if instance.form.is_empty() => updates(target).into_iter().for_each(|i| fresh[i] = Some(0.0)),
            None => return,
        }
        let held = |column: &&[f64]| held(column, &fresh);
        through_meter(context, design, |columns| columns.iter().map(held).collect());
    }

    fn report(&self, context: &Context, instance: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        if let Some((value, se)) = target(context, instance).and_then(|t| found(context, instance, t)) {
            for e in fitted.iter_mut().filter(|e| e.name == "period") {
                (e.value, e.se) = (value, se);
            }
        }
        fitted
    }
}

/// A column between its updates, of each of which is known how long before its row it was, as a share of the interval that ends there.
fn held(column: &[f64], fresh: &[Option<f64>]) -> Vec<f64> {
    let mut last = column.first().copied().unwrap_or(0.0);
    let mut value = last;
    let hold = |(v, fresh): (&f64, &Option<f64>)| {
        if let Some(share) = fresh {
            value = v + share * (last - v);
        }
        last = *v;
        value
    };
    column.iter().zip(fresh).map(hold).collect()
}

/// Form of a coarse display: not every update changes the reading.
const SKIPPING: &str = "skipping";
/// Form in which the noise comes after the hold, so that no value repeats.
pub(crate) const BENEATH: &str = "beneath the noise";

/// Interval of the updates and its standard error, s, as the form of an instance reads it off.
fn found(context: &Context, instance: &Instance, target: &Target) -> Option<(f64, f64)> {
    let clock = match instance.form.as_str() {
        BENEATH => beneath_noise::clock(context, target),
        SKIPPING => Clock::of_updates(context, target),
        _ => return period(context, target),
    };
    clock.map(|c| (c.period, c.error))
}

fn target<'c>(context: &'c Context, instance: &Instance) -> Option<&'c Target> {
    context.targets.iter().find(|t| instance.touches(t.name))
}

/// Rows on which a channel shows a new value.
fn updates(target: &Target) -> Vec<usize> {
    let changed = target.y.windows(2).zip(&target.rows[1..]).filter(|(w, _)| w[0] != w[1]).map(|(_, row)| *row);
    target.rows.first().copied().into_iter().chain(changed).collect()
}

/// Interval of the updates and its standard error, s, where they come at even intervals of at least one and a half rows.
fn period(context: &Context, target: &Target) -> Option<(f64, f64)> {
    // a standing rotor reads zero again and again
    let live = |row: usize| context.rpm.get(row).is_none_or(|r| *r > crate::effects::rotor::blade_damage::STANDSTILL);
    let rows = updates(target);
    let gaps: Vec<f64> =
        rows.windows(2).filter(|w| live(w[0]) && live(w[1])).map(|w| context.t[w[1]] - context.t[w[0]]).collect();
    if gaps.len() < 20 {
        return None;
    }
    let dt = spacing(context, target);
    let middle = median(&mut gaps.clone());
    // two updates that happen to read the same make one double gap
    let near: Vec<f64> = gaps.iter().copied().filter(|g| (g - middle).abs() < 1.5 * dt).collect();
    let mean = near.iter().sum::<f64>() / near.len() as f64;
    let even = near.len() as f64 > 0.85 * gaps.len() as f64;
    // intervals between 1 and 2 rows show as ones and twos: nearly no interval may then be of another length
    (even && mean > 1.4 * dt).then(|| slope(context, &rows, &live, mean))
}

/// Usual time between two readings of a channel, s: a sparse one has blank rows between.
fn spacing(context: &Context, target: &Target) -> f64 {
    let mut gaps: Vec<f64> = target.rows.windows(2).map(|w| context.t[w[1]] - context.t[w[0]]).collect();
    if gaps.is_empty() { context.step() } else { median(&mut gaps) }
}

/// Fewest readings of a value for which a channel is said to repeat it, by its readings alone.
const REPEATS: f64 = 1.9;

/// What a channel's own readings show, whatever its model says: that it repeats its values at even intervals, as an instance and its estimates.
pub(crate) fn by_readings(context: &Context, target: &Target) -> Option<(Instance, Vec<Estimate>)> {
    let exact = || period(context, target).map(|found| ("", found));
    let skipping = || Clock::of_updates(context, target).map(|c| (SKIPPING, (c.period, c.error)));
    let (form, (value, se)) = exact().or_else(skipping)?;
    let estimate = Estimate { name: "period".to_owned(), unit: "s".to_owned(), value, se };
    (value > REPEATS * spacing(context, target)).then(|| (Instance::new(&[target.name], form), vec![estimate]))
}

/// Updates whose times are first asked for their rate.
const FIRST_LOOK: f64 = 100.0;

/// Share by which the mean of the single intervals may be wrong: rows that are missing make some of them longer.
const ROUGH: f64 = 0.03;

/// Standard deviation, in rows, of what is left of the updates' times about even intervals beyond which their clock has stopped
/// in between. Updates that show on the next row leave 0.29.
const EVEN: f64 = 0.6;

/// Interval of updates that come at a rate of their own and show on the next row, and its standard error, s: slope of their times
/// over their count. The count needs the rate to a part in the number of updates: the frequency at which their times have most of
/// one phase, over a span that doubles.
fn slope(context: &Context, rows: &[usize], live: &dyn Fn(usize) -> bool, first: f64) -> (f64, f64) {
    let dt = context.step();
    let times: Vec<f64> = rows.iter().filter(|r| live(**r)).map(|r| context.t[*r]).collect();
    let guess = (first, first / (times.len().max(1) as f64).sqrt());
    let (Some(&from), Some(&to)) = (times.first(), times.last()) else { return guess };
    let (mut rate, mut reach, mut span) = (1.0 / first, ROUGH / first, FIRST_LOOK * first);
    loop {
        let known = &times[..times.partition_point(|t| *t - from <= span)];
        let step = 0.2 / span.min(to - from);
        rate = most_of_one_phase(known, rate, reach, step);
        reach = 2.0 * step;
        if span >= to - from {
            break;
        }
        span *= 2.0;
    }
    let (late, _) = phase(&times, rate);
    let count = |t: f64| (t * rate - late).round();
    match Line::through(times.iter().map(|t| (count(*t), *t))) {
        // the next row is up to one row late, at both ends
        Some(line) if line.scatter < EVEN * dt => (line.slope, dt * (0.5 / line.longest).max(1.0 / (12.0 * line.squares).sqrt())),
        _ => guess,
    }
}

/// Phase of times at a rate, in turns, and the length of their mean on the circle.
fn phase(times: &[f64], rate: f64) -> (f64, f64) {
    let turn = |t: &f64| (std::f64::consts::TAU * (t * rate).fract()).sin_cos();
    let (s, c) = times.iter().map(turn).fold((0.0, 0.0), |sum, v| (sum.0 + v.0, sum.1 + v.1));
    (s.atan2(c) / std::f64::consts::TAU, s.hypot(c) / times.len().max(1) as f64)
}

/// The rate within `reach` at which times have most of one phase. Rows at even intervals mirror a rate about half of their own:
/// of the two the nearer one counts.
fn most_of_one_phase(times: &[f64], rate: f64, reach: f64, step: f64) -> f64 {
    let steps = (reach / step).ceil() as i32;
    let of = |k: i32| rate + f64::from(k) * step;
    let score = |k: i32| phase(times, of(k)).1 * (1.0 - 0.05 * f64::from(k.abs()) / f64::from(steps.max(1)));
    (-steps..=steps).max_by(|a, b| score(*a).total_cmp(&score(*b))).map_or(rate, of)
}

/// A straight line through times over their counts.
struct Line {
    slope: f64,
    /// Sum of the squared counts about their mean.
    squares: f64,
    /// Largest difference of two counts.
    longest: f64,
    /// Standard deviation of the times about the line, s.
    scatter: f64,
}

impl Line {
    fn through(points: impl Iterator<Item = (f64, f64)> + Clone) -> Option<Self> {
        let n = points.clone().count() as f64;
        let (k, t) = points.clone().fold((0.0, 0.0), |sum, p| (sum.0 + p.0 / n, sum.1 + p.1 / n));
        let squares: f64 = points.clone().map(|p| (p.0 - k).powi(2)).sum();
        if squares <= 0.0 {
            return None;
        }
        let slope = points.clone().map(|p| (p.0 - k) * (p.1 - t)).sum::<f64>() / squares;
        let start = t - slope * k;
        let left: f64 = points.clone().map(|p| (p.1 - start - slope * p.0).powi(2)).sum();
        let counts = points.map(|p| p.0);
        let (least, most) = counts.fold((f64::INFINITY, f64::NEG_INFINITY), |m, k| (m.0.min(k), m.1.max(k)));
        Some(Self { slope, squares, longest: most - least, scatter: (left / n).sqrt() })
    }
}
