//! `throttle_quantisation`: the speed controller acts on the pulse in coarse steps.
//!
//! What it is: rpm follows 1000 us + step * round((pulse - 1000 us) / step - offset): a saw-tooth of the pulse.
//! What can go wrong: a run on few levels fits several steps; levels on a grid of their own hide multiples of it.
//! Units: us; offset in steps.
//! Reference: Widrow & Kollar 2008, *Quantization Noise*; timer resolution of speed controllers.

use crate::channel::Context;
use crate::channel::SawTooth;
use crate::effects::design::TargetDesign;
use crate::effects::tachometer::speed_channel::expected_at as curve;
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, speeds};
use crate::numeric::order::median;
use crate::signal::stretches::STILL_US;
use std::borrow::Cow;

/// See the module.
pub(crate) struct ThrottleQuantisation;

impl Effect for ThrottleQuantisation {
    fn id(&self) -> &'static str {
        "throttle_quantisation"
    }

    fn about(&self) -> About {
        About {
            title: "Pulse acts in coarse steps",
            equation: "rpm = rpm_static(1000 + step (round((pulse - 1000) / step - offset) + offset)), half a step less where a declared model tells that the pulse is cut off",
            source: "Widrow & Kollar 2008, Quantization Noise",
            depends_on: &["pulse_us"],
            signature: "rpm(pulse) is a staircase: the residual is a saw-tooth of the pulse; thrust(rpm) holds",
            look_alikes: &["current_limit"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new("the pulse", found.tell("step", |v| format!("acts in steps of {v}"), "acts in coarse steps"))
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let channels = speeds(context);
        if channels.is_empty() || levels(context).len() < 8 {
            return Vec::new();
        }
        let form = if context.against_model && best_of(context).short > 0.0 { CUT_OFF } else { "" };
        vec![Instance::new(&channels, form)]
    }

    fn shapes(&self, context: &Context, _: &Instance) -> Vec<Shape> {
        // the saw-tooth has a likelihood with many narrow peaks: the search starts on the highest
        let SawTooth { step, offset, anchored, .. } = *best_of(context);
        let free = if anchored { 0.0 } else { 0.3 };
        vec![
            Shape { name: "step", unit: "us", range: (0.985 * step, 1.015 * step), starts: vec![step] },
            Shape { name: "offset", unit: "1", range: (offset - free, offset + free), starts: vec![offset] },
        ]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "depth", unit: "1" }]
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let ([step, offset], Some(pulse)) = (shape, &context.pulse) else { return };
        let short = if instance.form == CUT_OFF { CUT } else { 0.0 };
        let slope = context.facts.slope.get_or_init(|| slope(context));
        let departure = |(p, slope): (&f64, &f64)| slope * step * (tooth(*p, *step, *offset) - short);
        design.add(position, 0, pulse.iter().zip(slope).map(departure).collect());
    }

    fn report(&self, context: &Context, _: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        // an edge lies anywhere between two levels that the run visited
        let levels = levels(context);
        if let [first, .., last] = levels.as_slice() {
            let gap = (last.0 - first.0) / (levels.len() as f64 - 1.0);
            let others = best_of(context).others;
            for e in fitted.iter_mut().filter(|e| e.name == "step") {
                let between = gap * e.value / (last.0 - first.0) / 12.0_f64.sqrt();
                e.se = e.se.max(between).max((others.1 - e.value).max(e.value - others.0) / 1.96);
            }
        }
        fitted
    }

    fn plausible(&self, _: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        fitted.iter().any(|e| e.name == "depth" && (0.5..1.5).contains(&e.value) && e.se < KNOWN * e.value)
    }
}

/// Form against a declared model, whose curve does not hold the half step by which a command that is cut off is too short.
const CUT_OFF: &str = "cut off";
/// See [`CUT_OFF`], in steps.
const CUT: f64 = 0.5;

/// Share to which the depth must be known: on few levels a tooth of some step fits any misfit of the static curve.
const KNOWN: f64 = 0.08;

/// Slope of the static speed curve at each row's pulse, rev/min per us; zero while the motor is off.
fn slope(context: &Context) -> Vec<f64> {
    let (expected, later) = (curve(context, 0.0), curve(context, 1.0));
    expected.iter().zip(later).map(|(a, b)| if *a > 0.0 { b - a } else { 0.0 }).collect()
}

/// The saw-tooth of a run.
fn best_of(context: &Context) -> &SawTooth {
    context.facts.tooth.get_or_init(|| {
        let levels = levels(context);
        let beside_a_curve = || best_tooth(&levels, Departures::new(&levels));
        if context.expected_speed.is_empty() {
            return beside_a_curve();
        }
        // a declared model has the curve, but not what else has changed the speed
        let whole = Departures::whole(&levels);
        let all = levels.iter().map(|l| l.2 * l.2).sum::<f64>();
        let best = best_tooth(&levels, whole);
        if best.score > WHOLE * all {
            return best;
        }
        let beside = beside_a_curve();
        SawTooth { short: Departures::whole(&levels).best(beside.step, beside.offset).0, ..beside }
    })
}

/// Pulse, slope of the static curve, and median departure from it, for each half microsecond of pulse that the run visits: where the
/// command is held and the rotor has arrived, if that is [`ENOUGH`] levels, for on a ramp the rotor lags; else also where the command
/// moves evenly.
fn levels(context: &Context) -> Vec<(f64, f64, f64)> {
    let held = levels_where(context, STILL_US);
    if held.len() < ENOUGH { levels_where(context, EVEN_US) } else { held }
}

/// The same where the command changes by less than `most` from row to row.
fn levels_where(context: &Context, most: f64) -> Vec<(f64, f64, f64)> {
    let Some(pulse) = &context.pulse else { return Vec::new() };
    // what a declared model's curve misses on a healthy day is no tooth
    let declared = !context.expected_speed.is_empty();
    let expected = if declared { Cow::Borrowed(&context.expected_speed) } else { Cow::Owned(curve(context, 0.0)) };
    let slope = context.facts.slope.get_or_init(|| slope(context));
    let mut bins: std::collections::BTreeMap<i64, (f64, f64, Vec<f64>)> = std::collections::BTreeMap::new();
    for (i, p) in pulse.iter().enumerate() {
        // the command has been held, or has moved evenly, for a while
        let arrived =
            i >= 8 && (i - 7..=i).all(|k| (pulse[k] - pulse[k - 1]).abs() < most) && !context.settling.get(i).is_some_and(|s| *s);
        if arrived && *p > context.start_pulse_us && context.rpm.get(i).is_some_and(|r| *r > 0.0) {
            let bin = bins.entry((2.0 * p).round() as i64).or_default();
            bin.0 += p;
            bin.1 += slope[i];
            bin.2.push(context.rpm[i] - expected[i]);
        }
    }
    // a pulse on the edge of a step must not fall off it by rounding
    let exact = |p: f64| (p * 1e6).round() * 1e-6;
    bins.into_values().map(|(p, e, mut d)| (exact(p / d.len() as f64), e / d.len() as f64, median(&mut d))).collect()
}

/// Held levels from which on ramps are not needed: a saw-tooth has three unknowns beside the five of the curve, and a few must be left.
const ENOUGH: usize = 12;

/// Change of the command from row to row below which the rotor keeps up with it, us.
const EVEN_US: f64 = 5.0;

/// Largest departure of a pulse from the next step's, in steps: -0.5 to 0.5.
fn tooth(pulse: f64, step: f64, offset: f64) -> f64 {
    let at = (pulse - 1000.0) / step - offset;
    at.round() - at
}

/// Share of the best score from which on another step could as well be the true one.
const ALIAS: f64 = 0.8;

/// The best saw-tooth: every step on a grid that is even in frequency, then a fine scan about the best ones.
fn best_tooth(levels: &[(f64, f64, f64)], departures: Departures) -> SawTooth {
    let span = levels.last().map_or(1.0, |l| l.0) - levels.first().map_or(0.0, |l| l.0);
    let df = 0.15 / span.max(10.0);
    let (low, high) = (1.0 / LONGEST, 1.0 / SHORTEST);
    let mut coarse: Vec<(f64, f64)> = (0..((high - low) / df) as usize)
        .map(|k| low + df * k as f64)
        .map(|f| {
            let at = |offset: f64| departures.explained(1.0 / f, offset);
            let free = (0..8).map(|m| at(f64::from(m) / 8.0 - 0.5));
            (f, free.chain(anchors(1.0 / f).map(at)).fold(0.0, f64::max))
        })
        .collect();
    coarse.sort_by(|a, b| b.1.total_cmp(&a.1));
    coarse.truncate(16);
    let none = Tooth { score: f64::NEG_INFINITY, step: 10.0, offset: 0.0 };
    let (mut best, mut anchored) = (none, none);
    let mut peaks = Vec::new();
    for (f, _) in coarse {
        let mut peak = none;
        for k in -6..=6 {
            let step = 1.0 / (f + df * f64::from(k) / 6.0);
            // by round steps, or a round number of them over 1000 us
            for step in [step, step.round(), 0.5 * (2.0 * step).round(), 1000.0 / (1000.0 / step).round()] {
                for offset in anchors(step) {
                    anchored.improve(&departures, step, offset);
                }
            }
            for m in 0..16 {
                peak.improve(&departures, step, f64::from(m) / 16.0 - 0.5);
            }
        }
        peaks.push(peak);
        if peak.score > best.score {
            best = peak;
        }
    }
    // a counter of the controller starts somewhere sensible unless the data say otherwise
    let is_anchored = anchored.score > ANCHORED * best.score;
    let Tooth { step, offset, .. } = if is_anchored { anchored } else { best };
    let alike = peaks.iter().filter(|p| p.score > ALIAS * best.score).map(|p| p.step);
    let others = alike.fold((step, step), |(low, high), s| (low.min(s), high.max(s)));
    let (short, score) = departures.best(step, offset);
    SawTooth { step, offset, anchored: is_anchored, short, score, others }
}

/// Offsets of a plain counter: cut off or rounded, counted from 1000 us or from 0.
fn anchors(step: f64) -> [f64; 4] {
    let from_zero = -(1000.0 / step).fract();
    [-0.5, 0.0, from_zero, from_zero + 0.5]
}

/// Share of the best score at which a saw-tooth that is counted from 1000 us or from 0 is taken.
const ANCHORED: f64 = 0.98;

/// Depth of the tooth beside that of a pure rounding.
const DEPTH: (f64, f64) = (0.7, 1.3);
/// The same where the curve is known.
const DEPTH_OF_WHOLE: (f64, f64) = (0.9, 1.1);

/// Most nuisances: four powers of the pulse, and the slope of the curve.
const NUISANCES: usize = 5;

/// Share of all that the levels depart from a known curve that a saw-tooth must explain to be sought in the departures as they are.
const WHOLE: f64 = 0.9;

/// Departures of the levels from a curve: from the run's own static one less all that a cubic or a shift of the pulse explains. Thousands of saw-teeth are
/// held against them, so what each level has to say stands together.
struct Departures {
    levels: Vec<Level>,
    /// By how many steps a rounded command is too short: nothing that can be told beside a free shift.
    short: &'static [f64],
    /// How deep a tooth may be.
    depth: (f64, f64),
}

struct Level {
    pulse: f64,
    slope: f64,
    /// Orthonormal columns, zero beyond their number.
    nuisances: [f64; NUISANCES],
    rest: f64,
}

impl Departures {
    fn new(levels: &[(f64, f64, f64)]) -> Self {
        let middle = levels.get(levels.len() / 2).map_or(1500.0, |l| l.0);
        let power = |k: i32| levels.iter().map(|l| ((l.0 - middle) / 500.0).powi(k)).collect::<Vec<f64>>();
        let mut nuisances: Vec<Vec<f64>> = Vec::new();
        for mut column in (0..=3).map(power).chain([levels.iter().map(|l| l.1).collect()]) {
            let whole = norm(&column);
            nuisances.iter().for_each(|q| remove(&mut column, q));
            let left = norm(&column);
            if left > 1e-6 * whole {
                column.iter_mut().for_each(|v| *v /= left);
                nuisances.push(column);
            }
        }
        let mut rest: Vec<f64> = levels.iter().map(|l| l.2).collect();
        nuisances.iter().for_each(|q| remove(&mut rest, q));
        let at = |i: usize| std::array::from_fn(|k| nuisances.get(k).map_or(0.0, |q| q[i]));
        let level = |(i, (pulse, slope, _)): (usize, &(f64, f64, f64))| Level {
            pulse: *pulse,
            slope: *slope,
            nuisances: at(i),
            rest: rest[i],
        };
        Self { levels: levels.iter().enumerate().map(level).collect(), short: &[0.0], depth: DEPTH }
    }

    /// Of a curve that is known: a command that is cut off is half a step too short, one that is rounded is not.
    fn whole(levels: &[(f64, f64, f64)]) -> Self {
        let level = |(pulse, slope, rest): &(f64, f64, f64)| Level {
            pulse: *pulse,
            slope: *slope,
            nuisances: [0.0; NUISANCES],
            rest: *rest,
        };
        Self { levels: levels.iter().map(level).collect(), short: &[0.0, CUT], depth: DEPTH_OF_WHOLE }
    }

    /// Squared departure that a saw-tooth of about the depth of a rounding takes away.
    fn explained(&self, step: f64, offset: f64) -> f64 {
        self.best(step, offset).1
    }

    /// By how many steps the command is too short, and what that explains.
    fn best(&self, step: f64, offset: f64) -> (f64, f64) {
        let each = self.short.iter().map(|short| (*short, self.explained_by(step, offset, *short)));
        each.fold((0.0, f64::NEG_INFINITY), |best, other| if other.1 > best.1 { other } else { best })
    }

    fn explained_by(&self, step: f64, offset: f64, short: f64) -> f64 {
        let (mut with_nuisances, mut along, mut square) = ([0.0; NUISANCES], 0.0, 0.0);
        for level in &self.levels {
            let x = level.slope * step * (tooth(level.pulse, step, offset) - short);
            with_nuisances.iter_mut().zip(&level.nuisances).for_each(|(sum, q)| *sum += x * q);
            along += x * level.rest;
            square += x * x;
        }
        let own = square - with_nuisances.iter().map(|s| s * s).sum::<f64>();
        if own <= 1e-12 {
            return 0.0;
        }
        let depth = (along / own).clamp(self.depth.0, self.depth.1);
        depth * (2.0 * along - depth * own)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

fn remove(from: &mut [f64], unit: &[f64]) {
    let along = dot(from, unit);
    from.iter_mut().zip(unit).for_each(|(v, u)| *v -= along * u);
}

/// A saw-tooth and how much of the squared departures it explains.
#[derive(Clone, Copy)]
struct Tooth {
    score: f64,
    step: f64,
    offset: f64,
}

impl Tooth {
    /// Takes another step and offset where they explain more.
    fn improve(&mut self, departures: &Departures, step: f64, offset: f64) {
        let score = departures.explained(step, offset);
        if score > self.score {
            *self = Self { score, step, offset };
        }
    }
}

/// Steps that are searched, us.
const SHORTEST: f64 = 2.0;
/// See [`SHORTEST`].
const LONGEST: f64 = 80.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Column, Log};

    #[test]
    fn a_cut_off_pulse_on_a_grid_gives_its_step_and_anchor() {
        // departures of a straight line of 5 rev/min per us whose pulse is cut to steps of 13 us, about their mean
        let levels: Vec<(f64, f64, f64)> = (0..150)
            .map(|k| 1100.0 + 6.0 * f64::from(k))
            .map(|p: f64| (p, 5.0, 5.0 * (13.0 * ((p - 1000.0) / 13.0).floor() - (p - 1000.0) + 6.0)))
            .collect();
        let SawTooth { step, offset, anchored, others, .. } = best_tooth(&levels, Departures::new(&levels));
        assert!(anchored && (step - 13.0).abs() < 1e-9 && offset == -0.5, "{step} {offset} {anchored}");
        assert!(others.0 > 12.8 && others.1 < 13.2, "{others:?}");
    }

    #[test]
    fn on_a_grid_of_levels_a_known_curve_tells_what_a_cubic_swallows() {
        // a straight line of 5 rev/min per us whose pulse is cut to steps of 12.56 us, on levels 50 us apart
        let cut = |p: f64| 12.56 * ((p - 1000.0) / 12.56).floor() - (p - 1000.0);
        let levels: Vec<(f64, f64, f64)> =
            (0..16).map(|k| 1100.0 + 50.0 * f64::from(k)).map(|p| (p, 5.0, 5.0 * cut(p))).collect();
        let SawTooth { step, short, score, .. } = best_tooth(&levels, Departures::whole(&levels));
        let all: f64 = levels.iter().map(|l| l.2 * l.2).sum();
        assert!((step - 12.56).abs() < 0.02 && short == CUT && score > 0.99 * all, "{step} {short} {score} of {all}");
        let swallowed = best_tooth(&levels, Departures::new(&levels));
        assert!(swallowed.score < 0.01 * all, "{}", swallowed.score);
    }

    #[test]
    fn a_rotor_that_lags_on_ramps_does_not_speak_of_held_levels() {
        // twenty levels in any order, ramps of 4 us a row between them on which the rotor is 40 rev/min behind
        let visits = (0..20).map(|k| 1150.0 + f64::from(k * 7 % 20) * 37.0);
        let mut pulse: Vec<f64> = vec![1000.0; 20];
        for level in visits {
            while (pulse[pulse.len() - 1] - level).abs() > 4.0 {
                let last = pulse[pulse.len() - 1];
                pulse.push(last + 4.0 * (level - last).signum());
            }
            pulse.extend([level; 40]);
        }
        let speed = |i: usize| {
            let behind = if i == 0 { 0.0 } else { 10.0 * (pulse[i] - pulse[i - 1]).clamp(-4.0, 4.0) };
            (6.0 * (pulse[i] - 1000.0) - behind).max(0.0)
        };
        let column = |name: &str, values: Vec<f64>| Column { name: name.into(), values };
        let log = Log {
            name: "ramps".into(),
            t: (0..pulse.len()).map(|i| 0.05 * i as f64).collect(),
            columns: vec![column("rpm_opto", (0..pulse.len()).map(speed).collect()), column("pulse_us", pulse)],
            ..Log::default()
        };
        let found = levels(&Context::new(&log, None));
        assert_eq!(found.len(), 20);
    }
}
