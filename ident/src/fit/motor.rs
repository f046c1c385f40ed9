//! Motor constants KV, R and I0 from a run with torque, current and voltage.
//!
//! What it is: the power balance V I = w (Q + f) + (R/Kt^2) (Q + f)^2 + P0 gives friction f, R/Kt^2 and the controller's own draw P0
//! at any throttle; at full throttle the bridge passes the supply, V = Kt w + R I, and gives Kt.
//! What can go wrong: without a full-throttle plateau KV cannot be told from R and nothing is claimed.
//! Units: SI; KV in rev/min per volt.
//! Reference: Beharie 2013, Eq. 5.11 corrected (rpm = KV (V - I R)); errors by the delta method over the plateaus' means.

use super::{Estimate, Law, square_law};
use crate::log::Log;
use crate::noise::median;
use crate::plateau::Plateau;
use crate::solve::Normal;
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::f64::consts::TAU;

/// Shortest pulse that counts as full throttle, us.
const FULL_US: f64 = 1990.0;

/// Constants of a motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motor {
    /// Speed constant, rev/min per volt.
    pub kv: Estimate,
    /// Resistance of winding and controller, ohm.
    pub resistance: Estimate,
    /// No-load current, A.
    pub no_load: Estimate,
    /// How well the power balance describes the levels.
    pub law: Law,
}

/// Speed rad/s, torque N.m, current A, voltage V, and whether the throttle is full.
#[derive(Debug, Clone, Copy)]
struct Level {
    values: [f64; 4],
    errors: [f64; 4],
    full: bool,
}

/// Motor constants from plateaus; `None` where a channel or a full-throttle level is missing.
#[must_use]
pub fn motor(log: &Log, plateaus: &[Plateau], speed: &[Option<(f64, f64)>]) -> Option<Motor> {
    // a torque arm that is not tared would pose as friction: what the square law leaves at rest is its zero
    let zero = square_law(log, plateaus, speed, "torque_nm").map(|(_, curve, _)| curve.coefficient(0))?;
    let levels: Vec<Level> = plateaus
        .iter()
        .zip(speed)
        .filter_map(|(p, s)| {
            let rpm = s.filter(|s| s.0 > 1.0)?;
            let of = [
                (rpm.0 * TAU / 60.0, rpm.1 * TAU / 60.0),
                p.of(log, "torque_nm")?,
                p.of(log, "current_a")?,
                p.of(log, "voltage_v")?,
            ];
            let mut values = of.map(|v| v.0);
            values[1] -= zero.value;
            let full = p.of(log, "pulse_us").is_some_and(|(v, _)| v >= FULL_US);
            Some(Level { values, errors: of.map(|v| v.1), full })
        })
        .collect();
    let levels = belonging(levels);
    if levels.len() < 6 || !levels.iter().any(|l| l.full) {
        return None;
    }
    let centre = constants(&levels)?;
    let mut variance = [0.0; 3];
    for k in 0..levels.len() {
        for c in 0..4 {
            let mut moved = levels.clone();
            moved[k].values[c] += moved[k].errors[c];
            let there = constants(&moved)?;
            for (v, (a, b)) in variance.iter_mut().zip(there.iter().zip(&centre)) {
                *v += (a - b).powi(2);
            }
        }
    }
    // the zero moves every level together
    let mut moved = levels.clone();
    moved.iter_mut().for_each(|l| l.values[1] -= zero.se);
    let there = constants(&moved)?;
    for (v, (a, b)) in variance.iter_mut().zip(there.iter().zip(&centre)) {
        *v += (a - b).powi(2);
    }
    let law = balance_law(&levels)?;
    if !law.holds {
        // what the levels scatter beyond their errors they scatter for the constants too
        variance.iter_mut().for_each(|v| *v *= law.chi2);
    }
    // three constants from so many levels, each with an estimated error
    let quantile = StudentsT::new(0.0, 1.0, (levels.len() - 3) as f64).map_or(1.96, |t| t.inverse_cdf(0.975));
    let estimate = |i: usize| {
        let se = variance[i].sqrt();
        Estimate { value: centre[i], se, half: quantile * se }
    };
    let physical = centre.iter().all(|v| v.is_finite()) && centre[0] > 0.0 && centre[1] > 0.0;
    physical.then(|| Motor { kv: estimate(0), resistance: estimate(1), no_load: estimate(2), law })
}

/// How well the balance describes the levels.
fn balance_law(levels: &[Level]) -> Option<Law> {
    let (friction, ratio, own) = balance(levels)?;
    let off = |l: &Level| {
        let [w, q, i, v] = l.values;
        (v * i - w * q - friction * w - ratio * (q + friction).powi(2) - own) / balance_error(l, friction, ratio)
    };
    let freedom = levels.len().checked_sub(3).filter(|f| *f > 0)?;
    Some(Law::of(levels.iter().map(|l| off(l).powi(2)).sum::<f64>() / freedom as f64, freedom))
}

/// Standard error of a level's electric power less its mechanical power.
fn balance_error(l: &Level, friction: f64, ratio: f64) -> f64 {
    let [w, q, i, v] = l.values;
    (v * l.errors[2]).hypot(i * l.errors[3]).hypot((w + 2.0 * ratio * (q + friction)) * l.errors[1]).max(1e-4)
}

/// Leaves out levels whose balance stands six robust deviations from that of the others, the farthest first, at most a fifth.
fn belonging(mut levels: Vec<Level>) -> Vec<Level> {
    for _ in 0..levels.len() / 5 {
        let Some((friction, ratio, own)) = balance(&levels) else { break };
        let off: Vec<f64> = levels
            .iter()
            .map(|l| {
                let [w, q, i, v] = l.values;
                (v * i - w * q - friction * w - ratio * (q + friction).powi(2) - own).abs() / balance_error(l, friction, ratio)
            })
            .collect();
        let scale = 1.4826 * median(&mut off.clone());
        let farthest = (0..off.len()).max_by(|a, b| off[*a].total_cmp(&off[*b]));
        match farthest {
            Some(k) if off[k] > 6.0 * scale.max(1.0) => drop(levels.remove(k)),
            _ => break,
        }
    }
    levels
}

/// KV, R, I0.
fn constants(levels: &[Level]) -> Option<[f64; 3]> {
    let (friction, ratio, _) = balance(levels)?;
    // V = Kt w + ratio Kt^2 I at full throttle, each such level alike
    let full: Vec<f64> = levels
        .iter()
        .filter(|l| l.full)
        .map(|l| {
            let [w, _, i, v] = l.values;
            let a = ratio * i;
            if a.abs() < 1e-12 { v / w } else { (-w + (w * w + 4.0 * a * v).max(0.0).sqrt()) / (2.0 * a) }
        })
        .collect();
    let kt = full.iter().sum::<f64>() / full.len() as f64;
    Some([60.0 / (TAU * kt), ratio * kt * kt, friction / kt])
}

/// Friction torque, R/Kt^2 and the controller's own draw.
fn balance(levels: &[Level]) -> Option<(f64, f64, f64)> {
    // the friction stands in the square too: a few rounds settle it
    let (mut friction, mut ratio, mut own) = (0.0, 0.0, 0.0);
    for _ in 0..12 {
        let mut normal = Normal::new(3);
        for l in levels {
            let [w, q, i, v] = l.values;
            normal.add(&[w, (q + friction).powi(2), 1.0], v * i - w * q, balance_error(l, friction, ratio).powi(-2));
        }
        let s = normal.solve()?;
        (friction, ratio, own) = (s.coefficients[0], s.coefficients[1], s.coefficients[2]);
    }
    Some((friction, ratio, own))
}
