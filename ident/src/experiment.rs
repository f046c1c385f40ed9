//! The next experiment: the schedule on which two hypotheses differ most.
//!
//! What it is: both hypotheses predict each of a few schedules that the rig can fly; the one with the largest squared
//! difference over the noise is proposed.
//! What can go wrong: where no schedule separates them the best is still proposed, and the reason says how little it gives.
//! Units: pulse in us, hold in s.
//! Reference: T-optimal designs, Atkinson & Fedorov 1975, Biometrika 62:57.

use crate::context::Context;
use crate::diagnose::Diagnosis;
use crate::hypothesis::Declared;
use crate::log::Log;
use crate::model::Model;
use crate::simulate::from_command;
use crate::verdict::{NextExperiment, ScheduleStep};

/// Schedules that the rig can run, each with the reason for which it is good.
fn families(top: f64) -> Vec<(&'static str, Vec<ScheduleStep>)> {
    let step = |pulse_us: f64, hold_s: f64| ScheduleStep { pulse_us, hold_s };
    let level = |f: f64| (1000.0 + f * (top - 1000.0)).round();
    let up: Vec<ScheduleStep> = (0..=10).map(|k| step(level(f64::from(k) / 10.0), 6.0)).collect();
    let up_down = up.iter().chain(up.iter().rev().skip(1)).copied().collect();
    let repeated = (0..10).flat_map(|k| [step(level(0.2 + 0.08 * f64::from(k)), 5.0), step(level(0.5), 5.0)]).collect();
    let toggling = (0..30).map(|k| step(level(if k % 2 == 0 { 0.2 } else { 0.9 }), 2.0)).collect();
    let long = vec![step(level(0.0), 5.0), step(level(0.8), 120.0), step(level(0.0), 30.0), step(level(0.4), 60.0)];
    vec![
        ("an up-down staircase visits each level at two times and from both sides", up_down),
        ("one level visited again and again separates time from load", repeated),
        ("quick steps show what is slow", toggling),
        ("a long hold and a long rest show what accumulates and what recovers", long),
    ]
}

/// The best of the families for the winner and its closest rival.
#[must_use]
pub fn next(context: &Context, model: &Model, diagnosis: &Diagnosis) -> Option<NextExperiment> {
    let rival = diagnosis.rivals.first()?;
    let source = Log { name: context.name.clone(), ..Log::default() };
    let other = Model::from_fit(context, &source, Declared::default(), &rival.fit);
    let top = context.pulse.as_ref().map_or(2000.0, |p| p.iter().copied().fold(1000.0, f64::max));
    let best = families(top)
        .into_iter()
        .map(|(why, schedule)| (separation(context, model, &other, &schedule), why, schedule))
        .max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(NextExperiment {
        why: format!(
            "{} and {} explain this run about equally well; {}: their predictions then differ by {:.1} times the noise (rms)",
            diagnosis.best.ids().join(" + "),
            rival.ids.join(" + "),
            best.1,
            best.0
        ),
        schedule: best.2,
    })
}

/// Root mean square difference of two models over the noise, on the channel where it is largest.
fn separation(context: &Context, a: &Model, b: &Model, schedule: &[ScheduleStep]) -> f64 {
    let dt = 0.2;
    let (mut t, mut pulse) = (Vec::new(), Vec::new());
    for s in schedule {
        for _ in 0..(s.hold_s / dt) as usize {
            t.push(t.len() as f64 * dt);
            pulse.push(s.pulse_us);
        }
    }
    let (la, lb) = (from_command(a, "a", &t, &pulse, &[]), from_command(b, "b", &t, &pulse, &[]));
    context
        .targets
        .iter()
        .filter_map(|target| {
            let (x, y) = (la.column(target.name)?, lb.column(target.name)?);
            let mean = x.iter().zip(y).map(|(x, y)| x - y).sum::<f64>() / x.len() as f64;
            let ss: f64 = x.iter().zip(y).map(|(x, y)| (x - y - mean).powi(2)).sum();
            Some((ss / x.len() as f64).sqrt() / target.noise.rms)
        })
        .fold(0.0, f64::max)
}
