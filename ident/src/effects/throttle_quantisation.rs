//! `throttle_quantisation`: the speed controller acts on the pulse in coarse steps.
//!
//! What it is: rpm follows 1000 us + step * round((pulse - 1000 us) / step - offset): a saw-tooth of the pulse.
//! What can go wrong: a run on few levels fits several steps; levels on a grid of their own hide multiples of it.
//! Units: us; offset in steps.
//! Reference: Widrow & Kollar 2008, *Quantization Noise*; timer resolution of speed controllers.

use super::speed_channel::expected;
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
        vec![
            Shape { name: "step", unit: "us", range: (1.0, 80.0), starts: periods(context, 4) },
            Shape { name: "offset", unit: "1", range: (-0.75, 0.75), starts: vec![-0.5, -0.25, 0.0, 0.25] },
        ]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "depth", unit: "1" }]
    }

    fn apply(&self, context: &Context, _: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let ([step, offset], Some(pulse)) = (shape, &context.pulse) else { return };
        // slope of the static curve, rev/min per us, from its value half a step to either side
        let curve = slope(context);
        let column = pulse
            .iter()
            .zip(curve)
            .map(|(p, slope)| {
                let at = (p - 1000.0) / step - offset;
                slope * step * (at.round() - at)
            })
            .collect();
        design.add(position, 0, column);
    }

    fn plausible(&self, _: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        fitted.iter().any(|e| e.name == "depth" && (0.5..1.5).contains(&e.value))
    }
}

/// Slope of the static speed curve at each row's pulse, rev/min per us; zero while the motor is off.
fn slope(context: &Context) -> Vec<f64> {
    let levels = levels(context);
    let n = levels.len();
    let Some(pulse) = &context.pulse else { return vec![0.0; context.len()] };
    if n < 4 {
        return vec![0.0; context.len()];
    }
    // straight line over a quarter of the levels about each one
    let half = (n / 8).max(1);
    let slopes: Vec<f64> = (0..n)
        .map(|k| {
            let (a, b) = (k.saturating_sub(half), (k + half).min(n - 1));
            (levels[b].1 - levels[a].1) / (levels[b].0 - levels[a].0).max(1e-9)
        })
        .collect();
    pulse
        .iter()
        .map(|p| {
            if *p < context.start_pulse_us {
                return 0.0;
            }
            let k = levels.partition_point(|l| l.0 < *p).min(n - 1);
            slopes[k]
        })
        .collect()
}

/// Pulse, expected speed, and mean departure from it, for each microsecond of pulse that the run visits.
fn levels(context: &Context) -> Vec<(f64, f64, f64)> {
    let Some(pulse) = &context.pulse else { return Vec::new() };
    let expected = expected(context);
    let mut bins: std::collections::BTreeMap<i64, (f64, f64, f64, f64)> = std::collections::BTreeMap::new();
    for (i, p) in pulse.iter().enumerate() {
        let settled = i >= 8 && (pulse[i] - pulse[i - 8]).abs() < 5.0;
        if settled && *p > context.start_pulse_us && context.rpm.get(i).is_some_and(|r| *r > 0.0) {
            let bin = bins.entry((2.0 * p).round() as i64).or_default();
            bin.0 += p;
            bin.1 += expected[i];
            bin.2 += context.rpm[i] - expected[i];
            bin.3 += 1.0;
        }
    }
    bins.into_values().map(|(p, e, d, n)| (p / n, e / n, d / n)).collect()
}

/// Steps whose saw-tooth fits the departures best: the strongest lines of a periodogram over pulse.
fn periods(context: &Context, count: usize) -> Vec<f64> {
    let levels = levels(context);
    let span = levels.last().map_or(1.0, |l| l.0) - levels.first().map_or(0.0, |l| l.0);
    // a saw-tooth's size grows with the slope of the curve: so do the departures
    let power = |step: f64| {
        let (mut s, mut c) = (0.0, 0.0);
        for (p, _, d) in &levels {
            let (sin, cos) = (std::f64::consts::TAU * (p - 1000.0) / step).sin_cos();
            s += d * sin;
            c += d * cos;
        }
        s * s + c * c
    };
    // even in frequency, eight points a resolved line
    let (low, high) = (1.0 / 80.0, 1.0 / 2.0);
    let df = 0.15 / span.max(10.0);
    let n = (((high - low) / df) as usize).min(4000);
    let grid: Vec<(f64, f64)> =
        (0..n).map(|k| 1.0 / (low + (high - low) * k as f64 / n as f64)).map(|step| (step, power(step))).collect();
    let mut peaks: Vec<(f64, f64)> = grid.windows(3).filter(|w| w[1].1 > w[0].1 && w[1].1 >= w[2].1).map(|w| w[1]).collect();
    peaks.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut out: Vec<f64> = peaks.into_iter().take(count).map(|p| p.0).collect();
    if out.is_empty() {
        out.push(10.0);
    }
    out
}
