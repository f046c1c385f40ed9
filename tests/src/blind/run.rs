//! One run: rig, schedule and effects in time, sampled and logged.
//!
//! What it is: power train on a fine grid, load cell, sensors, meters, noise, missing samples; the same run without sensor noise
//! is kept beside it, because the noise that was really added is what a perfect model would leave over.
//! What can go wrong: channels that a rig lacks are computed all the same and dropped at the end.
//! Units: as the column names say.
//! Reference: module `effect`.

use super::chance::Chance;
use super::effect::drive::{Air, Output, REFERENCE, Train};
use super::effect::{Effect, cell, sense};
use super::fit;
use super::rig::{Rig, poly};
use super::schedule::Schedule;
use std::collections::BTreeMap;

/// A logged run.
#[derive(Debug, Clone, Default)]
pub struct Run {
    /// Time, s.
    pub t: Vec<f64>,
    /// Columns in the order of the log; NaN is a missing sample.
    pub columns: Vec<(&'static str, Vec<f64>)>,
    /// The same without sensor noise and missing samples.
    pub quiet: BTreeMap<&'static str, Vec<f64>>,
}

/// Steps of the fine grid in one sample interval: at least 100 a second.
fn fine(rig: &Rig) -> usize {
    (100.0 / rig.hz).ceil() as usize
}

/// Charge of a clean run, Ah.
#[must_use]
pub fn charge(rig: &Rig, schedule: &Schedule) -> f64 {
    let h = 0.1;
    schedule
        .sampled(h, (schedule.duration / h) as usize)
        .iter()
        .map(|p| rig.current_at(rig.speed_at(*p, rig.declared()), rig.declared()) * h / 3600.0)
        .sum()
}

/// Surroundings over time: a slow wander, and what the effects ask for.
fn surroundings(rig: &Rig, effects: &[Effect], duration: f64, h: f64, n: usize, k: &mut Chance) -> Vec<Air> {
    let warm = effects.iter().find(|e| e.id == "air_density").map(|e| e.strength);
    let thermal = effects.iter().any(|e| e.id == "thermal_zero");
    let reach = warm.unwrap_or(if thermal { k.between(3.0, 15.0) } else { k.log_between(0.2, 6.0) });
    let (shape, phase, turns) = (k.of(&[0u8, 1, 2]), k.between(0.0, std::f64::consts::TAU), k.between(0.6, 2.0));
    let (weather, humid) = (k.between(-3.0, 3.0), k.between(8.0, 20.0) * k.sign());
    let humid_turns = k.between(0.6, 1.8);
    (0..n)
        .map(|i| {
            let x = i as f64 * h / duration;
            let course = match shape {
                0 => x,
                1 => 1.0 - (-4.0 * x).exp(),
                _ => 0.5 - 0.5 * (std::f64::consts::TAU * turns * x + phase).cos(),
            };
            Air {
                temperature: REFERENCE.temperature + rig.day.temperature + reach * course,
                pressure: REFERENCE.pressure + rig.day.pressure + if rig.pressure { weather * x } else { 0.0 },
                humidity: REFERENCE.humidity + humid * (std::f64::consts::TAU * humid_turns * x + 2.0 * phase).sin(),
            }
        })
        .collect()
}

/// Runs the rig. `stream` keeps the randomness of one run apart from another's; `noisy` false leaves sensor noise out.
#[must_use]
pub fn run(rig: &Rig, effects: &[Effect], schedule: &Schedule, seed: u64, stream: u64, noisy: bool) -> Run {
    let per = fine(rig);
    let h = 1.0 / rig.hz / per as f64;
    let rows = (schedule.duration * rig.hz) as usize;
    let n = rows * per;
    let pulse = schedule.sampled(h, n);
    let air = surroundings(rig, effects, schedule.duration, h, n, &mut Chance::new(seed, stream));
    let mut real = Chance::new(seed, stream + 1);
    let mut train = Train::new(rig, effects);
    let mut out = Vec::with_capacity(n);
    let (mut wander, mut rough, mut turns) = (0.0, 0.0, 0.0);
    let (mut slow, mut drift) = (Chance::new(seed, stream + 6), 0.0);
    let mut revolutions = Vec::with_capacity(n);
    for i in 0..n {
        if i % per == 0 {
            wander = if noisy { rig.wander * real.normal() } else { 0.0 };
            rough = rig.turbulence * real.normal();
        }
        if noisy && rig.common.0 > 0.0 {
            let keep = (-h / rig.common.1).exp();
            drift = keep * drift + rig.common.0 * (1.0 - keep * keep).sqrt() * slow.normal();
        }
        let turning = out.last().map_or(0.0, |o: &Output| o.speed);
        let all = if turning > 100.0 { wander + drift / turning } else { wander };
        let mut o = train.step(i as f64 * h, h, pulse[i], air[i], all);
        o.torque *= 1.0 + rough;
        turns += o.speed / 60.0 * h;
        revolutions.push(turns);
        out.push(o);
    }
    let speed: Vec<f64> = out.iter().map(|o| o.speed).collect();
    let thrust: Vec<f64> = out.iter().map(|o| o.thrust).collect();
    let torque: Vec<f64> = out.iter().map(|o| o.torque).collect();
    let strain = cell::pass(
        rig,
        effects,
        &cell::Loads { step: h, window: 1.0 / rig.hz, speed: &speed, thrust: &thrust, torque: &torque, air: &air },
        &mut Chance::new(seed, stream + 2),
    );

    let mut clock = Chance::new(seed, stream + 3);
    let step = 1.0 / rig.hz;
    // stamps wander; the sample is taken at the nearest point of the grid
    let shift: Vec<f64> =
        (0..rows).map(|r| if rig.jitter > 0.0 && r > 0 { (clock.normal() * rig.jitter).clamp(-0.2, 0.2) } else { 0.0 }).collect();
    let at: Vec<usize> =
        shift.iter().enumerate().map(|(r, s)| (((r as f64 + s) * per as f64).round().max(0.0) as usize).min(n - 1)).collect();
    let t: Vec<f64> = shift.iter().enumerate().map(|(r, s)| (r as f64 + s) * step).collect();
    let mut r = Run { t, ..Run::default() };
    let sampled = |y: &[f64]| -> Vec<f64> { at.iter().map(|i| y[*i]).collect() };
    let mut log = Chance::new(seed, stream + 4);
    let mut hits = Chance::new(seed, stream + 5);
    let top_speed = rig.top;

    r.columns.push(("pulse_us", sampled(&pulse)));
    for (name, gain) in &rig.speeds {
        let stream: Vec<f64> = sense::meter(effects, name, h, per, speed.clone());
        let quiet: Vec<f64> =
            at.iter().map(|i| gain * sense::speed(effects, name, stream[*i], revolutions[*i], &mut hits)).collect();
        let mut y: Vec<f64> = quiet
            .iter()
            .map(|v| if noisy { ((v * (1.0 + rig.speed_noise * log.normal())) * 10.0).round() / 10.0 } else { *v })
            .collect();
        sense::samples(effects, rig, name, &r.t, &mut y, &mut hits);
        r.quiet.insert(name, quiet);
        r.columns.push((name, y));
    }
    let channels: [(&'static str, bool, Vec<f64>); 5] = [
        ("thrust_n", true, strain.reading.clone()),
        ("torque_nm", rig.present[0], torque),
        ("current_a", rig.present[1], out.iter().map(|o| o.current).collect()),
        ("voltage_v", rig.present[2], out.iter().map(|o| o.voltage).collect()),
        ("temp_c", rig.present[3], air.iter().map(|a| a.temperature).collect()),
    ];
    for (k, (name, present, stream)) in channels.into_iter().enumerate() {
        let mut quiet = sampled(&sense::meter(effects, name, h, per, stream));
        let mut y = quiet.clone();
        if noisy {
            let noise = rig.noise[k];
            let mut e = log.normal();
            for (v, i) in y.iter_mut().zip(&at) {
                e = noise.rho * e + (1.0 - noise.rho * noise.rho).sqrt() * log.normal();
                *v += e * noise.fixed.hypot(noise.at_full * speed[*i] / top_speed);
            }
        }
        sense::samples(effects, rig, name, &r.t, &mut y, &mut hits);
        if noisy {
            y.iter_mut().for_each(|v| *v = (*v / rig.noise[k].quantum).round() * rig.noise[k].quantum);
        }
        if present {
            // what a model of the true form would say: it clips and holds as well
            let known: Vec<Effect> =
                effects.iter().filter(|e| matches!(e.id, "amplifier_saturation" | "sample_hold")).cloned().collect();
            sense::samples(&known, rig, name, &r.t, &mut quiet, &mut hits);
            r.quiet.insert(name, quiet);
            r.columns.push((name, y));
        }
    }
    covariates(rig, &mut r, &strain.rms, &air, &at, &mut log, noisy);
    if noisy && rig.missing > 0.0 {
        for (name, y) in &mut r.columns {
            if *name != "pulse_us" {
                y.iter_mut().for_each(|v| {
                    if log.happens(rig.missing) {
                        *v = f64::NAN
                    }
                });
            }
        }
    }
    r
}

fn covariates(rig: &Rig, r: &mut Run, rms: &[f64], air: &[Air], at: &[usize], k: &mut Chance, noisy: bool) {
    let mut noise = |s: f64| if noisy { s * k.normal() } else { 0.0 };
    let full = poly(&rig.thrust, rig.top / 1000.0);
    if rig.pressure {
        let y = at.iter().map(|i| air[*i].pressure + noise(0.08)).collect();
        r.columns.push(("pressure_hpa", y));
    }
    if rig.strain_rms {
        let y = at.iter().map(|i| (rms[*i] + rig.noise[0].fixed + 0.002 * full * (1.0 + noise(0.08))).abs()).collect();
        r.columns.push(("thrust_rms_n", y));
    }
    for name in &rig.decoys {
        let y = match *name {
            "humidity_pct" => at.iter().map(|i| air[*i].humidity + noise(0.3)).collect(),
            "esc_temp_c" => at.iter().map(|i| 30.0 + 12.0 * (1.0 - (-(*i as f64) / 4000.0).exp()) + noise(0.15)).collect(),
            _ => at.iter().map(|_| 0.05 + noise(0.01).abs()).collect(),
        };
        r.columns.push((name, y));
    }
}

/// Median of the speed channels of a row.
#[must_use]
pub fn consensus(columns: &[(&'static str, Vec<f64>)], row: usize) -> f64 {
    let mut v: Vec<f64> = columns.iter().filter(|c| c.0.starts_with("rpm")).map(|c| c.1[row]).filter(|v| v.is_finite()).collect();
    if v.is_empty() {
        return f64::NAN;
    }
    v.sort_by(f64::total_cmp);
    0.5 * (v[(v.len() - 1) / 2] + v[v.len() / 2])
}

/// Where the refitted baseline has its starting pulse: the pulse that parts standing from turning with the fewest exceptions. A brake that
/// only makes the rotor start later leaves nothing over there.
fn starts_at(rig: &Rig, pulse: &[f64], n: &[f64]) -> f64 {
    let stands: Vec<bool> = n.iter().map(|n| *n < 0.01 * rig.top).collect();
    let mut cuts: Vec<f64> = pulse.iter().copied().filter(|p| *p >= rig.start).collect();
    cuts.sort_by(f64::total_cmp);
    cuts.dedup();
    let exceptions = |cut: f64| pulse.iter().zip(&stands).filter(|(p, stands)| (**p >= cut) == **stands).count();
    let best = cuts.into_iter().map(|cut| (exceptions(cut), cut)).min_by(|a, b| a.0.cmp(&b.0));
    best.map_or(rig.start, |(_, cut)| cut)
}

/// What the declared baseline, refitted, leaves over in each channel of a quiet run, over the channel's noise floor.
#[must_use]
pub fn sizes(rig: &Rig, quiet: &Run) -> Vec<(&'static str, f64)> {
    let rows = quiet.t.len();
    let pulse = &quiet.columns[0].1;
    let n: Vec<f64> = (0..rows).map(|r| consensus(&quiet.columns, r)).collect();
    let start = starts_at(rig, pulse, &n);
    quiet
        .columns
        .iter()
        .filter_map(|(name, y)| {
            let (x, degree, keep): (Vec<f64>, usize, Vec<bool>) = match *name {
                c if c.starts_with("rpm") => {
                    (pulse.iter().map(|p| (p - 1000.0) / 1000.0).collect(), 3, pulse.iter().map(|p| *p >= start).collect())
                }
                "thrust_n" | "torque_nm" => (n.iter().map(|v| v / 1000.0).collect(), 2, vec![true; rows]),
                "current_a" => (n.iter().map(|v| v / 1000.0).collect(), 3, vec![true; rows]),
                "voltage_v" => (vec![0.0; rows], 0, vec![true; rows]),
                _ => return None,
            };
            let pick = |v: &[f64]| -> Vec<f64> { v.iter().zip(&keep).filter(|k| *k.1).map(|k| *k.0).collect() };
            let floor = (n.iter().map(|v| rig.sigma(name, *v).powi(2)).sum::<f64>() / rows as f64).sqrt();
            Some((*name, fit::left_over(&pick(&x), &pick(y), degree) / floor))
        })
        .collect()
}
