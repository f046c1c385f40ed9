//! `throttle_quantisation`: the speed controller acts on the pulse in coarse steps.
//!
//! What it is: rpm follows 1000 us + step * round((pulse - 1000 us) / step - offset): a saw-tooth of the pulse.
//! What can go wrong: a run on few levels fits several steps; levels on a grid of their own hide multiples of it.
//! Units: us; offset in steps.
//! Reference: Widrow & Kollar 2008, *Quantization Noise*; timer resolution of speed controllers.

use super::speed_channel::expected_at as curve;
use super::{About, Amplitude, Effect, Estimate, Instance, Shape, Stage, speeds};
use crate::context::Context;
use crate::design::TargetDesign;

/// See the module.
pub(crate) struct ThrottleQuantisation;

impl Effect for ThrottleQuantisation {
    fn id(&self) -> &'static str {
        "throttle_quantisation"
    }

    fn about(&self) -> About {
        About {
            title: "Pulse acts in coarse steps",
            equation: "rpm = rpm_static(1000 + step (round((pulse - 1000) / step - offset) + offset))",
            source: "Widrow & Kollar 2008, Quantization Noise",
            depends_on: &["pulse_us"],
            signature: "rpm(pulse) is a staircase: the residual is a saw-tooth of the pulse; thrust(rpm) holds",
            look_alikes: &["current_limit"],
        }
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let channels = speeds(context);
        if channels.is_empty() || levels(context).len() < 8 { Vec::new() } else { vec![Instance::new(&channels, "")] }
    }

    fn shapes(&self, context: &Context, _: &Instance) -> Vec<Shape> {
        // the saw-tooth has a likelihood with many narrow peaks: the search starts on the highest
        let (step, offset, anchored) = best_tooth(&levels(context));
        let free = if anchored { 0.0 } else { 0.3 };
        vec![
            Shape { name: "step", unit: "us", range: (0.985 * step, 1.015 * step), starts: vec![step] },
            Shape { name: "offset", unit: "1", range: (offset - free, offset + free), starts: vec![offset] },
        ]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "depth", unit: "1" }]
    }

    fn apply(&self, context: &Context, _: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let ([step, offset], Some(pulse)) = (shape, &context.pulse) else { return };
        design.add(
            position,
            0,
            pulse.iter().zip(slope(context)).map(|(p, slope)| slope * step * tooth(*p, *step, *offset)).collect(),
        );
    }

    fn report(&self, context: &Context, _: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        // an edge lies anywhere between two levels that the run visited
        let levels = levels(context);
        if let [first, .., last] = levels.as_slice() {
            let gap = (last.0 - first.0) / (levels.len() as f64 - 1.0);
            for e in fitted.iter_mut().filter(|e| e.name == "step") {
                e.se = e.se.max(gap * e.value / (last.0 - first.0) / 12.0_f64.sqrt());
            }
        }
        fitted
    }

    fn plausible(&self, _: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        fitted.iter().any(|e| e.name == "depth" && (0.5..1.5).contains(&e.value))
    }
}

/// Slope of the static speed curve at each row's pulse, rev/min per us; zero while the motor is off.
fn slope(context: &Context) -> Vec<f64> {
    let (expected, later) = (curve(context, 0.0), curve(context, 1.0));
    expected.iter().zip(later).map(|(a, b)| if *a > 0.0 { b - a } else { 0.0 }).collect()
}

/// Pulse, slope of the static curve, and mean departure from it, for each microsecond of pulse that the run visits.
fn levels(context: &Context) -> Vec<(f64, f64, f64)> {
    let Some(pulse) = &context.pulse else { return Vec::new() };
    let (expected, slope) = (curve(context, 0.0), slope(context));
    let mut bins: std::collections::BTreeMap<i64, (f64, f64, f64, f64)> = std::collections::BTreeMap::new();
    for (i, p) in pulse.iter().enumerate() {
        let settled = i >= 8 && (pulse[i] - pulse[i - 8]).abs() < 5.0;
        if settled && *p > context.start_pulse_us && context.rpm.get(i).is_some_and(|r| *r > 0.0) {
            let bin = bins.entry((2.0 * p).round() as i64).or_default();
            bin.0 += p;
            bin.1 += slope[i];
            bin.2 += context.rpm[i] - expected[i];
            bin.3 += 1.0;
        }
    }
    // a pulse on the edge of a step must not fall off it by rounding
    let exact = |p: f64| (p * 1e6).round() * 1e-6;
    bins.into_values().map(|(p, e, d, n)| (exact(p / n), e / n, d / n)).collect()
}

/// Largest departure of a pulse from the next step's, in steps: -0.5 to 0.5.
fn tooth(pulse: f64, step: f64, offset: f64) -> f64 {
    let at = (pulse - 1000.0) / step - offset;
    at.round() - at
}

/// Step and offset of the saw-tooth that fits the departures best, and whether the offset is that of a plain counter: the strongest lines of a periodogram over pulse, then a fine
/// scan about each.
fn best_tooth(levels: &[(f64, f64, f64)]) -> (f64, f64, bool) {
    let span = levels.last().map_or(1.0, |l| l.0) - levels.first().map_or(0.0, |l| l.0);
    let power = |step: f64| {
        let (mut s, mut c) = (0.0, 0.0);
        for (p, _, d) in levels {
            let (sin, cos) = (std::f64::consts::TAU * (p - 1000.0) / step).sin_cos();
            s += d * sin;
            c += d * cos;
        }
        s * s + c * c
    };
    // even in frequency, about six points a resolved line
    let (low, high) = (1.0 / LONGEST, 1.0 / SHORTEST);
    let df = (0.15 / span.max(10.0)).max((high - low) / 4000.0);
    let grid: Vec<(f64, f64)> =
        (0..((high - low) / df) as usize).map(|k| low + df * k as f64).map(|f| (f, power(1.0 / f))).collect();
    let mut peaks: Vec<(f64, f64)> = grid.windows(3).filter(|w| w[1].1 > w[0].1 && w[1].1 >= w[2].1).map(|w| w[1]).collect();
    peaks.sort_by(|a, b| b.1.total_cmp(&a.1));
    peaks.truncate(8);
    let mut best = Tooth { score: f64::NEG_INFINITY, step: 10.0, offset: 0.0 };
    let mut anchored = best;
    for (f, _) in peaks {
        for k in -6..=6 {
            let step = 1.0 / (f + df * f64::from(k) / 6.0);
            // cut off or rounded, counted from 1000 us or from 0; by round steps, or a round number of them over 1000 us
            for step in [step, step.round(), 0.5 * (2.0 * step).round(), 1000.0 / (1000.0 / step).round()] {
                let from_zero = -(1000.0 / step).fract();
                for offset in [-0.5, 0.0, from_zero, from_zero + 0.5] {
                    anchored.improve(levels, step, offset);
                }
            }
            for m in 0..16 {
                best.improve(levels, step, f64::from(m) / 16.0 - 0.5);
            }
        }
    }
    // a counter of the controller starts somewhere sensible unless the data say otherwise
    if anchored.score > ANCHORED * best.score { (anchored.step, anchored.offset, true) } else { (best.step, best.offset, false) }
}

/// Share of the best score at which a saw-tooth that is counted from 1000 us or from 0 is taken.
const ANCHORED: f64 = 0.98;

/// A saw-tooth and how much of the squared departures it explains.
#[derive(Clone, Copy)]
struct Tooth {
    score: f64,
    step: f64,
    offset: f64,
}

impl Tooth {
    /// Takes another step and offset where they explain more.
    fn improve(&mut self, levels: &[(f64, f64, f64)], step: f64, offset: f64) {
        // a shift of the whole pulse belongs to the static curve: it is projected out
        let (mut dx, mut xx, mut ds, mut xs, mut ss) = (0.0, 1e-12, 0.0, 0.0, 1e-12);
        for (p, slope, d) in levels {
            let x = slope * step * tooth(*p, step, offset);
            dx += d * x;
            xx += x * x;
            ds += d * slope;
            xs += x * slope;
            ss += slope * slope;
        }
        let (dt, tt) = (dx - ds * xs / ss, xx - xs * xs / ss);
        // a pulse that is cut to steps has the tooth the right way up
        if dt > 0.0 && dt * dt / tt > self.score {
            *self = Self { score: dt * dt / tt, step, offset };
        }
    }
}

/// Steps that are searched, us.
const SHORTEST: f64 = 3.0;
/// See [`SHORTEST`].
const LONGEST: f64 = 80.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_off_pulse_on_a_grid_gives_its_step_and_anchor() {
        // departures of a straight line of 5 rev/min per us whose pulse is cut to steps of 13 us, about their mean
        let levels: Vec<(f64, f64, f64)> = (0..150)
            .map(|k| 1100.0 + 6.0 * f64::from(k))
            .map(|p: f64| (p, 5.0, 5.0 * (13.0 * ((p - 1000.0) / 13.0).floor() - (p - 1000.0) + 6.0)))
            .collect();
        let (step, offset, anchored) = best_tooth(&levels);
        assert!(anchored && (step - 13.0).abs() < 1e-9 && offset == -0.5, "{step} {offset} {anchored}");
    }
}
