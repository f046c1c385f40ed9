//! Spin-up and spin-down time constants from the steps of a run.
//!
//! What it is: one exponential through all steps of one direction, each scaled by its own height, with a common delay between the
//! command's row and the rotor's answer.
//! What can go wrong: fewer than four steps of a direction, or sampling too slow to see the approach, leave the constant out.
//! Units: s.
//! Reference: first-order response; errors clustered by step (Liang & Zeger 1986).

use super::Estimate;
use crate::log::Log;
use crate::plateau::Plateau;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Time constants.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Spin {
    /// Towards more speed, s.
    pub up: Option<Estimate>,
    /// Towards less, s.
    pub down: Option<Estimate>,
}

/// Share of the way still to go at each row after the command, of one step.
struct Step {
    /// Seconds after the first row with the new command.
    t: Vec<f64>,
    left: Vec<f64>,
    /// Height squared: how much the step says.
    weight: f64,
}

/// Time constants from the steps between neighbouring plateaus; `speed` is the consensus on every row.
#[must_use]
pub fn spin(log: &Log, plateaus: &[Plateau], speed: &[f64]) -> Spin {
    let Some(command) = log.column("pulse_us").filter(|_| speed.len() == log.len()) else { return Spin::default() };
    let mut sides: [Vec<Step>; 2] = [Vec::new(), Vec::new()];
    for w in plateaus.windows(2) {
        let end = w[0].first + w[0].rows;
        let Some(new) = command.get(w[1].first).filter(|v| v.is_finite()) else { continue };
        // the first row of the new command; a level between the two plateaus makes it another step
        let changed = (end..=w[1].first).find(|i| (command[*i] - new).abs() < 0.5);
        let clean = changed
            .is_some_and(|c| c <= end + 1 && (c..w[1].first).all(|i| command[i].is_nan() || (command[i] - new).abs() < 0.5));
        let (Some(changed), true) = (changed, clean) else { continue };
        let level = |p: &Plateau| {
            let z = &speed[p.first..p.first + p.rows];
            z.iter().sum::<f64>() / z.len() as f64
        };
        let (before, after) = (level(&w[0]), level(&w[1]));
        let height = after - before;
        // from a standing rotor the controller starts the motor by its own programme
        if before < 1.0 || after < 1.0 || height.abs() < 1e-3 * before.max(after) {
            continue;
        }
        // three times the settling: further rows say nothing of the approach
        let to = (changed + 3 * (w[1].first - changed) + 20).min(w[1].first + w[1].rows);
        let t: Vec<f64> = (changed..to).map(|i| log.t[i] - log.t[changed]).collect();
        let left = (changed..to).map(|i| (after - speed[i]) / height).collect();
        sides[usize::from(height < 0.0)].push(Step { t, left, weight: height * height });
    }
    let interval = log.t.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
    let [up, down] = sides.map(|s| time_constant(&s, interval));
    Spin { up, down }
}

fn time_constant(steps: &[Step], interval: f64) -> Option<Estimate> {
    if steps.len() < 4 {
        return None;
    }
    let longest = steps.iter().filter_map(|s| s.t.last().copied()).fold(0.0, f64::max);
    let cost = |tau: f64, delay: f64| -> f64 {
        steps
            .iter()
            .map(|s| s.weight * s.t.iter().zip(&s.left).map(|(t, y)| (y - model(*t, tau, delay)).powi(2)).sum::<f64>())
            .sum()
    };
    let mut best = (f64::INFINITY, interval, 0.0);
    for k in 0..60 {
        let tau = 0.2 * interval * (longest / interval / 0.2).powf(f64::from(k) / 59.0);
        for d in 0..=12 {
            let delay = interval * (f64::from(d) * 0.25 - 1.0);
            let c = cost(tau, delay);
            if c < best.0 {
                best = (c, tau, delay);
            }
        }
    }
    let (_, mut tau, mut delay) = best;
    let mut information = [[0.0; 2]; 2];
    let mut scores: Vec<[f64; 2]> = Vec::new();
    for _ in 0..30 {
        information = [[0.0; 2]; 2];
        scores = vec![[0.0; 2]; steps.len()];
        for (s, score) in steps.iter().zip(&mut scores) {
            for (t, y) in s.t.iter().zip(&s.left) {
                let f = model(*t, tau, delay);
                let lag = t - delay;
                let g = if lag <= 0.0 { [0.0, 0.0] } else { [f * lag / (tau * tau), f / tau] };
                for i in 0..2 {
                    score[i] += s.weight * g[i] * (y - f);
                    for j in 0..2 {
                        information[i][j] += s.weight * g[i] * g[j];
                    }
                }
            }
        }
        let total = scores.iter().fold([0.0, 0.0], |a, s| [a[0] + s[0], a[1] + s[1]]);
        let inverse = inverse(information)?;
        let move_by = [0, 1].map(|i| inverse[i][0] * total[0] + inverse[i][1] * total[1]);
        tau = (tau + move_by[0].clamp(-0.3 * tau, 0.3 * tau)).max(1e-4);
        delay += move_by[1].clamp(-interval, interval);
    }
    let inverse = inverse(information)?;
    // clustered by step: what is alike within a step (colour, a wrong level) counts once
    let n = steps.len() as f64;
    let mut variance = 0.0;
    for s in &scores {
        variance += (inverse[0][0] * s[0] + inverse[0][1] * s[1]).powi(2);
    }
    let se = (variance * n / (n - 2.0)).sqrt();
    let quantile = StudentsT::new(0.0, 1.0, n - 2.0).map_or(1.96, |t| t.inverse_cdf(0.975));
    // an approach faster than a third of the sampling interval was not seen
    (tau.is_finite() && se.is_finite() && tau > interval / 3.0).then_some(Estimate { value: tau, se, half: quantile * se })
}

/// Share of the way still to go.
fn model(t: f64, tau: f64, delay: f64) -> f64 {
    if t <= delay { 1.0 } else { (-(t - delay) / tau).exp() }
}

fn inverse(m: [[f64; 2]; 2]) -> Option<[[f64; 2]; 2]> {
    let d = m[0][0] * m[1][1] - m[0][1] * m[1][0];
    (d.abs() > 1e-300).then(|| [[m[1][1] / d, -m[0][1] / d], [-m[1][0] / d, m[0][0] / d]])
}
