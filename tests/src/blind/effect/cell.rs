//! Effects of the load cell and its amplifier.
//!
//! What it is: the true thrust over time in, the strain reading over time out.
//! What can go wrong: the resonance's shaft phase must run on the fine grid, or its alias depends on the sampling of the generator.
//! Units: N, s, Hz.
//! Reference: creep as a first-order after-effect; hysteresis as a sum of play elements (Prandtl and Ishlinskii) or as a lens; a mode of one degree
//! of freedom under a rotating imbalance; amplifier that clips.

use super::Effect;
use super::drive::{Air, REFERENCE};
use crate::blind::chance::Chance;
use crate::blind::rig::{Rig, poly};

/// The reading that the amplifier clips at, N.
#[must_use]
pub fn level(e: &Effect, rig: &Rig) -> f64 {
    poly(&rig.thrust, rig.top / 1000.0) * (1.0 - e.strength)
}

/// Play elements of the hysteresis.
const PLAYS: usize = 4;

/// What the cell adds besides the reading itself.
#[derive(Debug, Clone, Default)]
pub struct Strain {
    /// Reading before noise, N.
    pub reading: Vec<f64>,
    /// Rms of the raw strain about the mean, N.
    pub rms: Vec<f64>,
}

/// What acts on the cell, on the fine grid.
#[derive(Debug)]
pub struct Loads<'a> {
    /// Grid step, s.
    pub step: f64,
    /// Averaging time of one logged sample, s.
    pub window: f64,
    /// Speed, rev/min.
    pub speed: &'a [f64],
    /// Thrust, N.
    pub thrust: &'a [f64],
    /// Torque, N.m.
    pub torque: &'a [f64],
    /// Surroundings.
    pub air: &'a [Air],
}

/// Passes the thrust through the cell.
#[must_use]
pub fn pass(rig: &Rig, effects: &[Effect], loads: &Loads<'_>, k: &mut Chance) -> Strain {
    let Loads { step: h, window, speed: n, thrust, torque, air } = *loads;
    let mut y = thrust.to_vec();
    let mut rms = vec![0.0; y.len()];
    let full = poly(&rig.thrust, rig.top / 1000.0);
    for e in effects {
        let a = e.signed();
        let time = |i: usize| i as f64 * h;
        let (mut state, mut plays) = ([0.0f64; 2], [0.0f64; PLAYS]);
        for i in 0..y.len() {
            match e.id {
                "zero_drift" => y[i] += a * time(i),
                "thermal_zero" => y[i] += a * (air[i].temperature - REFERENCE.temperature),
                "tare_shift" if time(i) >= e.t0 => y[i] += a,
                "gain_change" if e.form == 0 && time(i) >= e.t0 => y[i] *= 1.0 + a,
                "gain_change" if e.form == 1 => y[i] *= 1.0 + a * time(i) / e.b,
                "torque_crosstalk" => y[i] += a * torque[i],
                "creep" => {
                    state[0] += (y[i] - state[0]) * (1.0 - (-h / e.b).exp());
                    y[i] += a * state[0];
                }
                "hysteresis" if e.form == 0 => {
                    // play elements lag behind the load by their slack: low on the way up, high on the way down
                    let x = y[i] / full;
                    let mut lag = 0.0;
                    for (k, p) in plays.iter_mut().enumerate() {
                        let slack = e.b * (k + 1) as f64 / PLAYS as f64;
                        *p = p.clamp(x - slack, x + slack);
                        lag += *p - x;
                    }
                    let opening = e.b * (PLAYS + 1) as f64;
                    y[i] += a * lag / opening;
                }
                "hysteresis" => {
                    // a lens between rest and full load, on the side of the last move beyond the slack
                    let x = y[i] / full;
                    let before = plays[0];
                    plays[0] = before.clamp(x - 0.01, x + 0.01);
                    if plays[0] != before {
                        state[0] = (plays[0] - before).signum();
                    }
                    y[i] -= 0.5 * a * state[0] * 4.0 * (x * (1.0 - x)).max(0.0);
                }
                "beam_resonance" => {
                    let per_rev = if e.form == 1 { 2.0 } else { 1.0 };
                    let f = per_rev * n[i] / 60.0;
                    let r = f / e.b;
                    // force grows with the square of speed; its share of thrust at full speed is the strength
                    let force = e.strength * full * (n[i] / rig.top).powi(2);
                    let amp = force / ((1.0 - r * r).powi(2) + (2.0 * e.c * r).powi(2)).sqrt();
                    state[0] = (state[0] + f * h).fract();
                    let arg = std::f64::consts::PI * f * window;
                    let kept = if arg.abs() < 1e-6 { 1.0 } else { arg.sin() / arg };
                    rms[i] = amp * std::f64::consts::FRAC_1_SQRT_2;
                    y[i] += amp * kept * (std::f64::consts::TAU * state[0] + k.between(0.0, 0.5)).sin() + 0.04 * amp;
                }
                _ => super::super::unknown::cell(e, rig, i, time(i), h, n, &mut state, &mut y[i], k),
            }
        }
    }
    Strain { reading: y, rms }
}
