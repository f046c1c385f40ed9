//! `thermal_zero`: the load cell's zero moves with temperature.
//!
//! What it is: thrust_n += coefficient * (T - 20 degC): gauge and bridge do not compensate each other fully.
//! What can go wrong: where temperature only rises with time it looks like `zero_drift`; noise of the thermometer is averaged away first.
//! Units: N/K.
//! Reference: Beharie 2013, Table 6 (temperature coefficients of gauge and beam).

use crate::channel::Context;
use crate::effects::design::TargetDesign;
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Instance, Scope, Shape, Stage, present};

/// See the module.
pub(crate) struct ThermalZero;

/// The temperature at which the zero is counted as zero, degC.
const REFERENCE: f64 = 20.0;

impl Effect for ThermalZero {
    fn id(&self) -> &'static str {
        "thermal_zero"
    }

    fn about(&self) -> About {
        About {
            title: "Zero of the load cell moves with temperature",
            equation: "thrust_n += coefficient * (temp_c - 20)",
            source: "Beharie 2013, Table 6",
            depends_on: &["temp_c"],
            signature: "the thrust residual follows temp_c, at every level alike",
            look_alikes: &["zero_drift", "air_density"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            "the load cell's zero",
            found.tell_signed(
                "coefficient",
                (1.0, "N"),
                ["rises", "falls"],
                |word, v| format!("{word} by {v} per kelvin"),
                "moves with the temperature",
            ),
        )
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let moves = context.temperature.as_ref().is_some_and(|t| {
            let (lo, hi) = t.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
            hi - lo > 0.05
        });
        if moves && !present(context, &["thrust_n"]).is_empty() { vec![Instance::new(&["thrust_n"], "")] } else { Vec::new() }
    }

    fn shapes(&self, _: &Context, _: &Instance) -> Vec<Shape> {
        Vec::new()
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "coefficient", unit: "N/K" }]
    }

    fn apply(&self, context: &Context, _: &Instance, _: &[f64], position: usize, design: &mut TargetDesign) {
        let Some(temperature) = warmth(context) else { return };
        design.add(position, 0, temperature.iter().map(|t| t - REFERENCE).collect());
    }
}

/// The temperature of a log without its meter's noise.
pub(crate) fn warmth(context: &Context) -> Option<&[f64]> {
    context.facts.warmth.get_or_init(|| context.temperature.as_ref().map(|t| smoothed(t))).as_deref()
}

/// A slow quantity without its meter's noise: a housing is slow, a thermometer is noisy. A straight line through the rows around each
/// one, whose number doubles from 21 up while the wider line differs from the narrower by no more than the noise explains (Lepski's
/// rule); at the ends the window stays as wide and lies to one side.
pub(crate) fn smoothed(x: &[f64]) -> Vec<f64> {
    let noise = x.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).powi(2)).sum::<f64>() / (6 * x.len().max(1)) as f64;
    let mut half = NARROW;
    let mut best = through_lines(x, half);
    while 2 * half < x.len() {
        let wider = through_lines(x, 2 * half);
        let square = best.iter().zip(&wider).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / x.len() as f64;
        // the two windows share half their rows: their difference has half the variance of the narrower one
        if square > ALLOWED * noise / (2.0 * (2 * half + 1) as f64) {
            break;
        }
        (half, best) = (2 * half, wider);
    }
    best
}

/// For each row the value there of the straight line through the window of `2 half + 1` rows around it.
fn through_lines(x: &[f64], half: usize) -> Vec<f64> {
    let sums = |f: &dyn Fn(usize, f64) -> f64| -> Vec<f64> {
        std::iter::once(0.0)
            .chain(x.iter().enumerate().scan(0.0, |s, (i, v)| {
                *s += f(i, *v);
                Some(*s)
            }))
            .collect()
    };
    let (zeroth, first) = (sums(&|_, v| v), sums(&|i, v| i as f64 * v));
    let width = (2 * half + 1).min(x.len());
    let m = width as f64;
    (0..x.len())
        .map(|i| {
            let from = i.saturating_sub(half).min(x.len() - width);
            let (sum, moment) = (zeroth[from + width] - zeroth[from], first[from + width] - first[from]);
            let centre = from as f64 + 0.5 * (m - 1.0);
            let slope = if width < 3 { 0.0 } else { (moment - centre * sum) / (m * (m * m - 1.0) / 12.0) };
            sum / m + slope * (i as f64 - centre)
        })
        .collect()
}

/// Half-width of the narrowest window, rows.
const NARROW: usize = 10;
/// Excess of the variance between two widths over what noise makes of it, from which on the wider one is too wide.
const ALLOWED: f64 = 1.5;

#[cfg(test)]
mod tests {
    use super::*;

    /// A thermometer with noise of 0.1 on a course.
    fn thermometer(course: impl Fn(f64) -> f64) -> (Vec<f64>, Vec<f64>) {
        let truth: Vec<f64> = (0..4000).map(|i| course(f64::from(i) / 4000.0)).collect();
        // differences of a low-discrepancy sequence: as white as second differences can tell
        let noise = |i: usize| 0.1 * 12.0_f64.sqrt() * (((i * i) as f64 * 0.618_033_988_749_895).fract() - 0.5);
        let reading = truth.iter().enumerate().map(|(i, v)| v + noise(i)).collect();
        (truth, reading)
    }

    fn error(course: impl Fn(f64) -> f64) -> f64 {
        let (truth, reading) = thermometer(course);
        let square = smoothed(&reading).iter().zip(&truth).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        (square / truth.len() as f64).sqrt()
    }

    #[test]
    fn a_straight_warming_is_told_from_its_noise_and_a_fast_one_is_followed() {
        let (line, waves) = (error(|u| 20.0 + 5.0 * u), error(|u| 20.0 + (40.0 * u).sin()));
        assert!(line < 0.01, "the widest window leaves a tenth of the noise: {line}");
        assert!(waves < 0.05, "{waves}");
    }
}
