//! `channel_filter`: a slow meter: the channel is an average of the past.
//!
//! What it is: the reading is the mean over a window, or a first-order lag, of the true value.
//! What can go wrong: a pure delay looks alike on steps that are longer than the window; the shape of the edge tells.
//! Units: s.
//! Reference: boxcar and RC filters; RCbenchmark load cells average over about half a second.

use crate::channel::Context;
use crate::effects::design::TargetDesign;
use crate::effects::{
    About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, geometric, lone_speed, meters,
    operator, reads_meter, through_meter,
};
use crate::signal::stretches::CALM_US;

/// See the module.
pub(crate) struct ChannelFilter;

/// Its forms; the last two where the load jumps within rows.
const FORMS: [&str; 4] = ["moving_average", "first_order", "moving_average_of_steps", "first_order_of_steps"];

fn is_lag(instance: &Instance) -> bool {
    instance.form.starts_with("first_order")
}

impl Effect for ChannelFilter {
    fn id(&self) -> &'static str {
        "channel_filter"
    }

    fn about(&self) -> About {
        About {
            title: "Slow meter: the channel is filtered",
            equation: "reading = mean of the truth over the last `window` seconds, or tau d(reading)/dt = truth - reading",
            source: "boxcar and first-order filters",
            depends_on: &["t_s", "time_since_step"],
            signature: "the residual spikes at every change of the load, with the sign of the change, and is flat elsewhere",
            look_alikes: &["channel_delay", "spinup_lag", "creep"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        {
            let lag = found.tell("tau", |v| format!("follows the truth with a lag of {v}"), "answers slowly");
            Clause::new(found.meter(), found.tell("window", |v| format!("reads the mean of its last {v}"), &lag))
        }
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Output
    }

    fn runs_on(&self, _: &Instance) -> [bool; 2] {
        [false, false]
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let forms: &[&str] = if operator::abrupt(context) { &FORMS[2..] } else { &FORMS[..2] };
        let of_meters = meters(context);
        // an average cannot be undone: the truth is read off a lag only; the lag itself hides whether the load jumps
        let of_speed = lone_speed(context).into_iter().flat_map(|s| [FORMS[1], FORMS[3]].map(|form| Instance::new(&s, form)));
        of_meters.iter().flat_map(|s| forms.iter().map(|form| Instance::new(s, form))).chain(of_speed).collect()
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        let dt = context.step();
        let (lo, hi) = (0.5 * dt, (60.0 * dt).max(4.0));
        let name = if is_lag(instance) { "tau" } else { "window" };
        let width = Shape { name, unit: "s", range: (0.1 * dt, 1.5 * hi), starts: geometric(lo, hi, 14) };
        if instance.form.ends_with(operator::OF_STEPS) { vec![width, operator::phase()] } else { vec![width] }
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        Vec::new()
    }

    fn plausible(&self, context: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        // an average over one row of straight lines is a delay by half of it, and within two rows of a jump it cannot be told from one; where
        // the command jumps between rows, the average over a row is what any logger may take
        let least = match (is_lag(instance), operator::abrupt(context)) {
            (true, true) => 0.6,
            (true, false) => 0.0,
            (false, _) => 2.0,
        };
        let width = fitted.iter().find(|e| e.name == "tau" || e.name == "window");
        width.is_some_and(|e| e.value > least * context.step())
            || operator::commands_abruptly(context) && self.is_within_a_row(context, fitted)
    }

    fn is_within_a_row(&self, context: &Context, fitted: &[Estimate]) -> bool {
        // an average is late by half of its window
        let late = |e: &Estimate| match &*e.name {
            "tau" => operator::is_within_a_row(context, e.value),
            "window" => operator::is_within_a_row(context, 0.5 * e.value),
            _ => false,
        };
        fitted.iter().any(late)
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], _: usize, design: &mut TargetDesign) {
        let [width, phase @ ..] = shape else { return };
        let course = operator::course(&instance.form, phase);
        if is_lag(instance) {
            if reads_meter(instance, design.relation) {
                let jumped = |i: usize| context.pulse.as_ref().is_some_and(|p| (p[i] - p[i - 1]).abs() > CALM_US);
                let truth = operator::Lag::undone(&context.t, *width, phase.first().copied().unwrap_or(0.0), jumped);
                design.map_together(|columns| truth.of(columns));
            } else {
                let lag = operator::Lag::new(&context.t, *width, course);
                through_meter(context, design, |columns| lag.of(columns));
            }
        } else {
            let average = operator::Average::new(&context.t, *width, course);
            through_meter(context, design, |columns| columns.iter().map(|c| average.of(c)).collect());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Column, Log};

    /// Two names for one thing are no question that an experiment could answer.
    #[test]
    fn an_average_that_is_a_delay_is_not_called_an_average() {
        let t: Vec<f64> = (0..300).map(|i| 0.2 * f64::from(i)).collect();
        let wave: Vec<f64> = t.iter().map(|t| 3000.0 + 800.0 * (0.4 * t).sin()).collect();
        let window = 0.14;
        let average = operator::Average::new(&t, window, operator::Course::Line).of(&wave);
        let delay = operator::Late::new(&t, operator::Course::Line, |_| 0.5 * window).of(&wave);
        assert!(average.iter().zip(&delay).skip(1).all(|(a, d)| (a - d).abs() < 1e-9));
        let column = |name: &str, values: &[f64]| Column { name: name.to_owned(), values: values.to_vec() };
        let log = Log { t, columns: vec![column("rpm", &wave), column("thrust_n", &average)], ..Log::default() };
        let context = Context::new(&log, None);
        assert!(!operator::abrupt(&context));
        let stands = |form: &str, name: &str, value: f64| {
            let width = Estimate { name: name.into(), unit: "s".into(), value, se: 0.01 };
            ChannelFilter.plausible(&context, &Instance::new(&["thrust_n"], form), &[width])
        };
        assert!(!stands(FORMS[0], "window", window) && stands(FORMS[0], "window", 0.6) && stands(FORMS[1], "tau", window));
    }
}
