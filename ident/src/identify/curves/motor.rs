//! Motor constants KV, R and I0 from a run with torque, current and voltage.
//!
//! What it is: the power balance V I = w (Q + f) + (R/Kt^2) (Q + f)^2 + P0 gives friction f, R/Kt^2 and the controller's own draw P0
//! at any throttle; at full throttle the bridge passes the supply, V = Kt w + R I, and gives Kt.
//! What can go wrong: without a full-throttle plateau KV cannot be told from R and nothing is claimed.
//! Units: SI; KV in rev/min per volt.
//! Reference: Beharie 2013, Eq. 5.11 corrected (rpm = KV (V - I R)); errors by the delta method over the plateaus' means.

use super::{Estimate, Law, Zero};
use crate::log::Log;
use crate::numeric::order::median;
use crate::numeric::solve::Normal;
use crate::plateau::Plateau;
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

/// Motor constants from plateaus, the torque on its zero; `None` where a channel or a full-throttle level is missing.
#[must_use]
pub fn motor(log: &Log, plateaus: &[Plateau], speed: &[Option<(f64, f64)>], zero: Option<&Zero>) -> Option<Motor> {
    // a torque arm that is not tared would pose as friction
    let zero_at = |p: &Plateau| zero.map_or((0.0, 0.0), |zero| zero.at(p.middle_s()));
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
            values[1] -= zero_at(p).0;
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
    let off = median(&mut plateaus.iter().map(|p| zero_at(p).1).collect::<Vec<_>>());
    moved.iter_mut().for_each(|l| l.values[1] -= off);
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

/// What of a log keeps [`motor`] from its constants, in words.
#[must_use]
pub fn lacks(log: &Log, plateaus: &[Plateau], speed: &[Option<(f64, f64)>]) -> String {
    const NEEDED: [&str; 4] = ["torque_nm", "current_a", "voltage_v", "pulse_us"];
    let absent: Vec<&str> = NEEDED.into_iter().filter(|name| log.column(name).is_none()).collect();
    if speed.iter().all(Option::is_none) {
        return "the log has no speed".to_owned();
    }
    if !absent.is_empty() {
        return format!("the log has no {}", absent.join(", no "));
    }
    let turning = |(p, s): (&Plateau, &Option<(f64, f64)>)| {
        s.filter(|s| s.0 > 1.0)?;
        NEEDED.into_iter().map(|name| p.of(log, name)).collect::<Option<Vec<_>>>().map(|of| of[3].0)
    };
    let pulses: Vec<f64> = plateaus.iter().zip(speed).filter_map(turning).collect();
    let highest = pulses.iter().copied().fold(0.0, f64::max);
    match pulses.len() {
        0..6 => format!("{} turning levels with torque, current and voltage, of 6 that it takes", pulses.len()),
        _ if highest < FULL_US => {
            format!("no level at full throttle ({FULL_US:.0} us and more): the highest is at {highest:.0} us")
        }
        _ => "the power balance of the levels gives no resistance above 0".to_owned(),
    }
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
