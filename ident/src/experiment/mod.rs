//! The next experiment: the schedule on which two hypotheses differ most.
//!
//! What it is: both hypotheses predict each of a few schedules that the rig can fly; the one with the largest squared
//! difference over the noise is proposed.
//! What can go wrong: where no schedule separates them none is proposed (`separates` is false) and the reason says so; where they differ by
//! something that no schedule commands the reason says what to change. A log without a command lends its speeds to the pulses.
//! Units: pulse in us, hold in s.
//! Reference: T-optimal designs, Atkinson & Fedorov 1975, Biometrika 62:57.

pub(crate) mod weather;

use crate::attribution::diagnose::Diagnosis;
use crate::attribution::rivals::beyond;
use crate::channel::Context;
use crate::experiment::weather::continued;
use crate::fit::Fit;
use crate::log::{Column, Log, SPEED};
use crate::model::Declared;
use crate::model::simulate::from_command;
use crate::model::{AddedEffect, Model};
use crate::verdict::words::digits;
use crate::verdict::{NextExperiment, ScheduleStep};
use std::borrow::Cow;

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

/// The best of the families for the winner and its closest rival, both of them added to `declared`.
#[must_use]
pub fn next(context: &Context, declared: Declared<'_>, model: &Model, diagnosis: &Diagnosis) -> Option<NextExperiment> {
    let rival = diagnosis.rivals.first()?;
    between(context, model, &model_of(context, declared, &rival.fit), &apart(&diagnosis.best.ids(), &rival.ids))
}

/// What each of two hypotheses has and the other lacks; what both have is no question.
fn apart(own: &[String], rival: &[String]) -> [String; 2] {
    [(own, rival), (rival, own)].map(|(of, other)| match beyond(of, other) {
        left if left.is_empty() => "nothing more".to_owned(),
        left => left.join(" + "),
    })
}

/// The model that a fit of a log makes.
pub(crate) fn model_of(context: &Context, declared: Declared<'_>, fit: &Fit) -> Model {
    let source = Log { name: context.name.clone(), ..Log::default() };
    Model::from_fit(context, &source, declared, fit)
}

/// The best of the families for two models of one log, each with the names that it holds.
pub(crate) fn between(context: &Context, model: &Model, other: &Model, [own, rival]: &[String; 2]) -> Option<NextExperiment> {
    let top = context.pulse.as_ref().map_or(2000.0, |p| p.iter().copied().fold(1000.0, f64::max));
    let both = format!("this run cannot settle between {own} and {rival}");
    let mut families = families(top);
    let weather = uncontrolled(context, model, other);
    let moved = |schedule: &[ScheduleStep]| {
        size(&less(difference(context, model, other, schedule), difference(context, model, other, &at_rest(schedule))))
    };
    if !weather.is_empty() && families.iter().all(|(_, schedule)| moved(schedule) < TOLD) {
        // what the rig does in a long rest is the one thing that a schedule can still give
        let schedule = families.pop()?.1;
        let names = weather.join(" and ");
        let how = if weather.iter().any(|w| w == "temp_c") {
            ": after a pause in which the rig cools down, much longer than the run, or at another ambient temperature"
        } else {
            ": on another day"
        };
        let why = format!(
            "{both}, and the load alone cannot tell them apart: they differ by what {names} does, which in this run followed time; fly the schedule below while {names} takes another course{how}"
        );
        return Some(NextExperiment { why, separates: true, schedule });
    }
    let (apart, good, schedule) = families
        .into_iter()
        .map(|(why, schedule)| (size(&difference(context, model, other, &schedule)), why, schedule))
        .max_by(|a, b| a.0.total_cmp(&b.0))?;
    let separates = apart >= TOLD;
    let why = if separates {
        let lent = if context.pulse.is_some() { "" } else { LENT };
        format!("{both}; {good}: their predictions then differ by {} times the noise (rms){lent}", times(apart))
    } else {
        format!(
            "{both}, and no run at hand separates them: on every schedule that was tried their predictions differ by less than {TOLD} times the noise (rms)"
        )
    };
    Some(NextExperiment { why, separates, schedule })
}

/// To a tenth, to three digits from a hundred on.
fn times(apart: f64) -> String {
    if apart < 100.0 { format!("{apart:.1}") } else { digits(apart, 0.0) }
}

/// What is said where a log has no command of its own.
const LENT: &str = ", the speed taken in proportion to the pulse, as no command was logged";

/// A model whose speed is taken as given.
fn without_speed(model: &Model) -> Model {
    let polynomials = model.polynomials.iter().filter(|p| !SPEED.contains(&p.channel.as_str())).cloned().collect();
    Model { polynomials, ..model.clone() }
}

/// The speed that a command is taken to give where the log had none: in proportion, up to the fastest of the run at full throttle.
fn lent(context: &Context, pulse: &[f64]) -> Column {
    let fastest = context.rpm.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
    Column { name: "rpm".into(), values: pulse.iter().map(|p| fastest * (p - 1000.0).max(0.0) / 1000.0).collect() }
}

/// Difference over the noise (rms) that a command must make for a schedule to tell two hypotheses apart.
const TOLD: f64 = 0.5;

/// The quantities that no schedule commands, that the log holds, and that only one of the two models depends on (or both, by
/// different effects).
fn uncontrolled(context: &Context, a: &Model, b: &Model) -> Vec<String> {
    let apart = |model: &Model, other: &Model| -> Vec<&'static str> {
        let of_other = |id: &str| other.effects.iter().any(|o| o.placed.effect.id() == id);
        let own = model.effects.iter().map(|e| e.placed.effect).filter(|e| !of_other(e.id()));
        own.flat_map(|e| e.about().depends_on.iter().copied()).collect()
    };
    let asked: Vec<&str> = apart(a, b).into_iter().chain(apart(b, a)).collect();
    let held = context.temperature.iter().map(|_| "temp_c").chain(context.covariates.iter().map(|c| c.0.as_str()));
    held.filter(|name| asked.contains(name)).map(str::to_owned).collect()
}

/// The same time with the motor off.
fn at_rest(schedule: &[ScheduleStep]) -> Vec<ScheduleStep> {
    schedule.iter().map(|s| ScheduleStep { pulse_us: 1000.0, ..*s }).collect()
}

/// By how much the predictions of two models differ on a schedule, over the noise, a list for each channel; what the schedule does
/// not command goes on as it went in the run.
fn difference(context: &Context, a: &Model, b: &Model, schedule: &[ScheduleStep]) -> Vec<Vec<f64>> {
    let dt = 0.2;
    let (mut t, mut pulse) = (Vec::new(), Vec::new());
    for s in schedule {
        for _ in 0..(s.hold_s / dt) as usize {
            t.push(t.len() as f64 * dt);
            pulse.push(s.pulse_us);
        }
    }
    let mut weather = continued(context, &t, &pulse);
    let mut models = [Cow::Borrowed(a), Cow::Borrowed(b)];
    if context.pulse.is_none() {
        weather.push(lent(context, &pulse));
        models = models.map(|m| Cow::Owned(without_speed(&m)));
    }
    let [la, lb] = models.map(|m| from_command(&m, "predicted", &t, &pulse, &weather));
    let asked = apart_on(a, b);
    context
        .targets
        .iter()
        .filter(|target| asked.is_empty() || asked.iter().any(|name| name == target.name))
        .filter_map(|target| {
            let (x, y) = (la.column(target.name)?, lb.column(target.name)?);
            Some(x.iter().zip(y).map(|(x, y)| (x - y) / target.noise.rms).collect())
        })
        .collect()
}

/// The channels of what one of two models has and the other lacks: elsewhere their fits differ by chance, and by more where they are continued.
fn apart_on(a: &Model, b: &Model) -> Vec<String> {
    let lacks = |e: &AddedEffect, other: &Model| !other.effects.iter().any(|o| o.placed.is_like(&e.placed));
    let own = a.effects.iter().filter(|e| lacks(e, b)).chain(b.effects.iter().filter(|e| lacks(e, a)));
    own.flat_map(|e| e.placed.instance.channels.iter().cloned()).collect()
}

fn less(mut a: Vec<Vec<f64>>, b: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    a.iter_mut().zip(&b).for_each(|(a, b)| a.iter_mut().zip(b).for_each(|(a, b)| *a -= b));
    a
}

/// Root mean square about the mean, which is the next run's own tare, on the channel where it is largest.
fn size(channels: &[Vec<f64>]) -> f64 {
    let rms = |d: &Vec<f64>| {
        let mean = d.iter().sum::<f64>() / d.len() as f64;
        (d.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / d.len() as f64).sqrt()
    };
    channels.iter().map(rms).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::close::{Closed, close};

    /// A staircase up, on which the thrust drifts by 0.0015 N/s and a thermometer by 0.05 K/s and `warming` at full load.
    fn staircase(warming: f64) -> Log {
        let mut seed = 11_u64;
        let mut noise = move || {
            let mut uniform = || {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (seed >> 33) as f64 / f64::from(1_u32 << 31)
            };
            (0..12).map(|_| uniform()).sum::<f64>() - 6.0
        };
        let t: Vec<f64> = (0..660).map(|i| 0.1 * f64::from(i)).collect();
        let pulse: Vec<f64> = (0..660).map(|i| 1000.0 + 100.0 * f64::from(i / 60)).collect();
        let rpm: Vec<f64> = pulse.iter().map(|p| if *p > 1050.0 { 7.0 * (p - 1000.0) } else { 0.0 }).collect();
        let mut held = 0.0;
        let temperature: Vec<f64> = rpm
            .iter()
            .zip(&t)
            .map(|(r, t)| {
                held += 0.1 / 15.0 * ((r / 7000.0).powi(3) - held);
                20.0 + 0.05 * t + warming * held
            })
            .collect();
        let mut column = |name: &str, values: Vec<f64>, size: f64| Column {
            name: name.to_owned(),
            values: values.into_iter().map(|v| v + size * noise()).collect(),
        };
        let thrust = rpm.iter().zip(&temperature).map(|(r, c)| 1e-7 * r * r + 0.03 * (c - 20.0)).collect();
        let current = rpm.iter().map(|r| 3e-11 * r.powi(3)).collect();
        let columns = vec![
            column("pulse_us", pulse, 0.0),
            column("rpm", rpm.clone(), 8.0),
            column("thrust_n", thrust, 0.02),
            column("current_a", current, 0.03),
            column("temp_c", temperature, 0.0),
        ];
        Log { name: "run.csv".to_owned(), t, columns, ..Log::default() }
    }

    /// The question between thermal zero and zero drift, whatever the search itself asks.
    fn asked(closed: &Closed, declared: Declared<'_>) -> NextExperiment {
        let placed = |id: &str| {
            let effect = *crate::effects::library().iter().find(|e| e.id() == id).expect("in the library");
            let instance = effect.instances(&closed.context).into_iter().find(|i| i.touches("thrust_n")).expect("offered");
            let shapes = effect.shapes(&closed.context, &instance);
            vec![crate::effects::placed::Placed { effect, instance, shape: shapes.iter().map(|s| s.starts[0]).collect() }]
        };
        let fitted =
            |id: &str| crate::fit::fit(&closed.context, declared, &placed(id), None, crate::fit::Rows::All).expect("a fit");
        let mut diagnosis = closed.diagnosis.clone();
        diagnosis.best = crate::attribution::evidence::Candidate { fit: fitted("thermal_zero"), evidence: 0.0 };
        let ids = vec!["zero_drift".to_owned()];
        diagnosis.rivals = vec![crate::attribution::rivals::Rival { ids, probability: 0.5, fit: fitted("zero_drift") }];
        let model = Model::from_fit(&closed.context, &Log::default(), declared, &diagnosis.best.fit);
        next(&closed.context, declared, &model, &diagnosis).expect("a rival")
    }

    #[test]
    fn large_ratios_have_three_digits() {
        assert_eq!([2.94, 12.34, 1228.2].map(times), ["2.9", "12.3", "1230"]);
    }

    #[test]
    fn what_no_schedule_moves_is_said_to_be_so() {
        let closed = close(&staircase(0.0), None, &[], &mut |_| {}).expect("a log");
        for declared in [Declared::default(), Declared { model: Some(&closed.declared) }] {
            let next = asked(&closed, declared);
            assert!(next.why.contains("the load alone cannot tell them apart"), "{}", next.why);
            assert!(next.why.contains("another ambient temperature"), "{}", next.why);
            assert!(!next.schedule.is_empty());
        }
    }

    #[test]
    fn only_what_differs_is_a_question() {
        let ids = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect::<Vec<String>>();
        let both = apart(&ids(&["spinup_lag", "reynolds_thrust", "unknown"]), &ids(&["spinup_lag", "torque_crosstalk"]));
        assert_eq!(both, ["reynolds_thrust", "torque_crosstalk"]);
        assert_eq!(apart(&ids(&["glitch_rows", "glitch_rows"]), &ids(&["glitch_rows"])), ["glitch_rows", "nothing more"]);
    }

    #[test]
    fn a_temperature_that_follows_the_load_is_asked_by_a_schedule() {
        let closed = close(&staircase(10.0), None, &[], &mut |_| {}).expect("a log");
        let next = asked(&closed, Declared::default());
        assert!(next.separates && next.why.contains("times the noise"), "{}", next.why);
    }

    #[test]
    fn two_models_that_predict_the_same_on_every_schedule_get_no_run() {
        let closed = close(&staircase(10.0), None, &[], &mut |_| {}).expect("a log");
        let names = ["a".to_owned(), "b".to_owned()];
        let next = between(&closed.context, &closed.model, &closed.model, &names).expect("an answer");
        assert!(!next.separates && next.why.contains("no run at hand separates them"), "{}", next.why);
        assert!(!next.schedule.is_empty(), "the contract has a schedule");
    }

    #[test]
    fn a_log_without_a_command_lends_its_speeds_to_the_schedules() {
        let mut log = staircase(0.0);
        log.columns.retain(|c| !["pulse_us", "temp_c"].contains(&c.name.as_str()));
        let closed = close(&log, None, &[], &mut |_| {}).expect("a log");
        let mut other = closed.model.clone();
        let thrust = other.polynomials.iter_mut().find(|p| p.channel == "thrust_n").expect("a thrust");
        *thrust.coefficients.last_mut().expect("coefficients") *= 1.2;
        let next = between(&closed.context, &closed.model, &other, &["a".to_owned(), "b".to_owned()]).expect("an answer");
        assert!(next.separates && next.why.ends_with(LENT), "{}", next.why);
    }
}
