//! How much of a cause a schedule shows.
//!
//! What it is: the run with everything less the run without one cause, both without noise, relation by relation; the declared baseline's
//! columns are projected out; what remains over the floor of that relation is the cause's size. A fault of one speed sensor is measured in
//! the contrast against the others, whose common wander cancels.
//! What can go wrong: the rotor's own wander is in the floor of speed(pulse), so that a small lag of a rotor that wanders has a small size.
//! Units: noise floors.
//! Reference: specification `closing-the-loop.md`, "Sizes are measured in the noise of what shows the effect".

use crate::blind::effect::Effect;
use crate::blind::fit;
use crate::blind::rig::{Rig, poly};
use crate::blind::run::{self, Run};
use crate::blind::schedule::Schedule;

/// Size at and above which a cause counts as shown (specification: "at least three times the noise floor").
pub const SHOWN: f64 = 3.0;

/// Size of one of several effects, and the channel that shows it most.
#[must_use]
pub fn size(rig: &Rig, effects: &[Effect], one: usize, schedule: &Schedule, seed: u64, command: bool) -> (f64, &'static str) {
    let without: Vec<Effect> = effects.iter().enumerate().filter(|(i, _)| *i != one).map(|(_, e)| e.clone()).collect();
    let [a, b] = [effects, &without[..]].map(|e| run::run(rig, e, schedule, seed, 100, false));
    relations(rig, &a, &b, command).into_iter().max_by(|p, q| p.0.total_cmp(&q.0)).unwrap_or((0.0, "thrust_n"))
}

fn column<'r>(run: &'r Run, name: &str) -> &'r [f64] {
    run.columns.iter().find(|c| c.0 == name).map_or(&[], |c| &c.1)
}

fn rms(v: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = v.fold((0.0, 0.0), |(s, n), v| (s + v * v, n + 1.0));
    (sum / f64::max(n, 1.0)).sqrt()
}

fn relations(rig: &Rig, a: &Run, b: &Run, command: bool) -> Vec<(f64, &'static str)> {
    let rows = a.t.len();
    let speed = |run: &Run| -> Vec<f64> { (0..rows).map(|r| run::consensus(&run.columns, r)).collect() };
    let (na, nb) = (speed(a), speed(b));
    let mut out = Vec::new();
    for (name, _) in &rig.speeds {
        let (ya, yb) = (column(a, name), column(b, name));
        let turning: Vec<usize> = (0..rows).filter(|r| a.columns[0].1[*r] >= rig.start).collect();
        let pick = |f: &dyn Fn(usize) -> f64| -> Vec<f64> { turning.iter().map(|r| f(*r)).collect() };
        if command {
            let left = fit::left_over(&pick(&|r| (a.columns[0].1[r] - 1000.0) / 1000.0), &pick(&|r| ya[r] - yb[r]), 3);
            out.push((left / rms(turning.iter().map(|r| rig.sigma(name, na[*r]))), *name));
        }
        if rig.speeds.len() > 1 {
            let others = |run: &Run, r: usize| run::consensus(&rest(run, name), r);
            let left = fit::left_over(&pick(&|r| na[r]), &pick(&|r| ya[r] - others(a, r) - yb[r] + others(b, r)), 1);
            // the contrast's noise: this sensor's own and that of the others' middle
            let own = (1.0 + 1.0 / (rig.speeds.len() - 1) as f64).sqrt();
            out.push((left / rms(turning.iter().map(|r| own * (na[*r] * rig.speed_noise).hypot(0.03))), *name));
        }
    }
    for (name, curve, degree) in [
        ("thrust_n", &rig.thrust[..], 2),
        ("torque_nm", &rig.torque[..], 2),
        ("current_a", &rig.current[..], 3),
        ("voltage_v", &[][..], 0),
    ] {
        let (ya, yb) = (column(a, name), column(b, name));
        if ya.is_empty() {
            continue;
        }
        let of = |n: f64| poly(curve, n / 1000.0);
        let x: Vec<f64> = na.iter().map(|n| n / 1000.0).collect();
        let y: Vec<f64> = (0..rows).map(|r| (ya[r] - of(na[r])) - (yb[r] - of(nb[r]))).collect();
        let through = |n: f64| (of(n * (1.0 + rig.speed_noise)) - of(n)).abs();
        out.push((fit::left_over(&x, &y, degree) / rms(na.iter().map(|n| rig.sigma(name, *n).hypot(through(*n)))), name));
    }
    out
}

fn rest(run: &Run, name: &str) -> Vec<(&'static str, Vec<f64>)> {
    run.columns.iter().filter(|c| c.0.starts_with("rpm") && c.0 != name).cloned().collect()
}
