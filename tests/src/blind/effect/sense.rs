//! Effects of the speed sensors and of the acquisition.
//!
//! What it is: streams on the fine grid in, logged samples out.
//! What can go wrong: a delay longer than the run so far reads the first value.
//! Units: those of the channels; s.
//! Reference: edge counting (a missed mark lengthens a period, a bounce splits one); two magnets that are not opposite each other;
//! meters that average, lag, hold or keep their own clock.

use super::Effect;
use crate::blind::chance::Chance;

/// One speed sample of a sensor. `revolutions` is the shaft's angle in turns.
#[must_use]
pub fn speed(effects: &[Effect], name: &str, n: f64, revolutions: f64, k: &mut Chance) -> f64 {
    let mut out = n;
    for e in effects.iter().filter(|e| e.channel == name) {
        match e.id {
            // two forms: marks counted over the sample interval (e.c), or the last period alone
            "missed_pulses" | "double_pulses" => {
                let marks = if e.form == 0 { (n / 60.0 * e.c).round().max(1.0) } else { 1.0 };
                let hits = f64::from(k.binomial(marks as u32, e.strength)) / marks;
                out *= match (e.id, e.form) {
                    ("missed_pulses", 0) => 1.0 - hits,
                    ("missed_pulses", _) => 1.0 / (1.0 + hits),
                    _ => 1.0 + hits,
                };
            }
            // the last half turn was the long or the short one
            "alternating_period" => {
                let half = 0.5 + e.strength / 360.0;
                let last = if revolutions.fract() < half { 1.0 - half } else { half };
                out *= 0.5 / last;
            }
            "blade_twist" if n > e.b => out += e.strength * (n - e.b),
            "coupling_slip" if n > e.b => out -= e.strength * (n - e.b),
            "dead_rotor_speed" => out *= 1.0 - e.strength,
            _ => {}
        }
    }
    out
}

/// A channel's stream as its meter hands it on. `h` is the grid step, `per` the grid steps of a logged sample.
#[must_use]
pub fn meter(effects: &[Effect], name: &str, h: f64, per: usize, mut y: Vec<f64>) -> Vec<f64> {
    for e in effects {
        let here = e.channel == name || (e.id == "clock_drift" && (name == "thrust_n" || name == "torque_nm"));
        if !here {
            continue;
        }
        match e.id {
            "channel_delay" => y = shifted(&y, per, e.form, |x| x - e.strength / h),
            "clock_drift" => y = shifted(&y, per, e.form, |x| x * (1.0 - e.strength)),
            "channel_filter" if e.form == 0 => {
                let m = (e.strength / h).max(1.0);
                let mut sum = vec![0.0; y.len() + 1];
                for i in 0..y.len() {
                    sum[i + 1] = sum[i] + y[i];
                }
                y = (0..y.len())
                    .map(|i| {
                        let from = (i as f64 + 1.0 - m).max(0.0);
                        (sum[i + 1] - at(&sum, from)) / (i as f64 + 1.0 - from)
                    })
                    .collect();
            }
            "channel_filter" => {
                let keep = (-h / e.strength).exp();
                let mut s = y[0];
                for v in &mut y {
                    s = *v + (s - *v) * keep;
                    *v = s;
                }
            }
            _ => {}
        }
    }
    y
}

/// A stream read at another instant: on the grid itself, or (form 1) by a logger that draws lines between its own samples.
fn shifted(y: &[f64], per: usize, form: u8, when: impl Fn(f64) -> f64) -> Vec<f64> {
    if form == 0 {
        return (0..y.len()).map(|i| at(y, when(i as f64))).collect();
    }
    let coarse: Vec<f64> = y.iter().step_by(per).copied().collect();
    (0..y.len()).map(|i| at(&coarse, when(i as f64) / per as f64)).collect()
}

fn at(y: &[f64], x: f64) -> f64 {
    let x = x.clamp(0.0, (y.len() - 1) as f64);
    let i = (x.floor() as usize).min(y.len() - 1);
    let j = (i + 1).min(y.len() - 1);
    y[i] + (y[j] - y[i]) * (x - i as f64)
}

/// What happens to logged samples after the noise: clipping, holding, coarse steps, garbage.
pub fn samples(effects: &[Effect], rig: &crate::blind::rig::Rig, name: &str, t: &[f64], y: &mut [f64], k: &mut Chance) {
    let full = y.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    for e in effects {
        match e.id {
            "amplifier_saturation" if name == "thrust_n" => {
                let top = super::cell::level(e, rig);
                y.iter_mut().for_each(|v| *v = v.min(top));
            }
            "sample_hold" if e.channel == name => {
                let (mut due, mut held) = (f64::NEG_INFINITY, y[0]);
                for (v, t) in y.iter_mut().zip(t) {
                    if *t >= due - 1e-9 {
                        held = *v;
                        due = ((t / e.strength).floor() + 1.0) * e.strength;
                    }
                    *v = held;
                }
            }
            "quantisation" if e.channel == name => y.iter_mut().for_each(|v| *v = (*v / e.strength).round() * e.strength),
            "glitch_rows" if e.channel == name => {
                for v in y.iter_mut() {
                    if k.happens(e.strength) {
                        *v = if e.form == 0 {
                            *v + k.sign() * e.b * full * k.between(0.3, 1.0)
                        } else {
                            k.of(&[0.0, -e.b * full, full * 1.2])
                        };
                    }
                }
            }
            _ => {}
        }
    }
}
