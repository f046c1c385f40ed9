//! How far a correction is believed beyond what its run has shown.
//!
//! What it is: on its own run an effect adds something between a lowest and a highest value to a channel. On another run it may add more:
//! a longer run, a higher load, a parabola that goes on. What goes beyond is an extrapolation, and is taken in the measure in which the
//! parameters carry it. Before the extrapolation is looked at, it may be as large as what was seen, `m`; the parameters say `e` with a
//! standard error `s`; together they say `e m^2 / (m^2 + s^2)`.
//! What only moves readings in time is no extrapolation, whatever the step ([`crate::effects::Effect::runs_on`]).
//! What can go wrong: a form that is wrong may have narrow errors, and then runs on. What lies within the range that was seen is not touched,
//! however little its parameters are known. Errors of amplitudes and of shapes count as independent.
//! Units: those of the channel.
//! Reference: posterior mean of two normal distributions, Gelman et al. 2013, Bayesian Data Analysis, section 2.5.

use super::read::{Refusal, finite, refusal};
use super::{AddedEffect, Model, keyed};
use crate::channel::{Context, Target, unit_of};
use crate::effects::design::{Label, TargetDesign};
use crate::effects::placed::Placed;
use crate::effects::{Estimate, Instance};
use crate::numeric::digits;
use nalgebra::DMatrix;
use toml::{Table, Value};

/// Key of the covariance.
const COVARIANCE: &str = "covariance";

/// What a run has shown of an effect on one channel.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Reach {
    /// Channel.
    pub channel: String,
    /// Lowest and highest value that the effect adds on its own run, in the channel's unit.
    pub seen: [f64; 2],
    /// Covariance of its amplitudes, in their order, row by row.
    pub covariance: Vec<Vec<f64>>,
}

impl Reach {
    /// Of a channel that the effect at a position with so many amplitudes touches, from what was fitted of it. Nothing was seen yet.
    pub(crate) fn fitted(channel: &str, labels: &[Label], covariance: &DMatrix<f64>, position: usize, amplitudes: usize) -> Self {
        let at = |amplitude: usize| labels.iter().position(|l| *l == Label::Effect { effect: position, amplitude });
        let of = |a: usize, b: usize| at(a).zip(at(b)).map_or(0.0, |(a, b)| covariance[(a, b)]);
        let covariance = (0..amplitudes).map(|a| (0..amplitudes).map(|b| of(a, b)).collect()).collect();
        Self { channel: channel.to_owned(), seen: [0.0; 2], covariance }
    }

    /// Channel and table of `[effect.seen]`.
    pub(super) fn to_table(&self) -> (String, Value) {
        let [lowest, highest] = keys(&self.channel);
        let mut t = Table::new();
        // outward, so that what the run has shown stays within
        t.insert(lowest, digits::lowest(self.seen[0]).into());
        t.insert(highest, (0.0 - digits::lowest(-self.seen[1])).into());
        if !self.covariance.is_empty() {
            t.insert(
                COVARIANCE.into(),
                self.covariance
                    .iter()
                    .map(|row| row.iter().map(|v| Value::from(digits::plain(*v))).collect::<Vec<_>>())
                    .collect::<Vec<_>>()
                    .into(),
            );
        }
        (self.channel.clone(), Value::Table(t))
    }

    /// How far a contribution goes beyond what was seen, of an effect that runs on downward, upward.
    fn beyond(&self, contribution: f64, [down, up]: [bool; 2]) -> f64 {
        let [low, high] = self.seen;
        match contribution {
            v if v < low && down => v - low,
            v if v > high && up => v - high,
            _ => 0.0,
        }
    }

    /// What is to be taken off a contribution that goes so far beyond, with a standard error.
    fn excess(&self, beyond: f64, error: impl FnOnce() -> f64) -> f64 {
        let [low, high] = self.seen;
        if beyond == 0.0 {
            return 0.0;
        }
        let (known, open) = (low.abs().max(high.abs()).powi(2), error().powi(2));
        if known + open > 0.0 { beyond * open / (known + open) } else { 0.0 }
    }
}

/// Keys of the lowest and the highest value.
fn keys(channel: &str) -> [String; 2] {
    ["lowest", "highest"].map(|k| keyed(k, unit_of(channel)))
}

/// `[effect.seen]`, for an effect with so many amplitudes.
pub(super) fn read(instance: &Instance, amplitudes: usize, value: &Value) -> Result<Vec<Reach>, Refusal> {
    let table = value.as_table().ok_or_else(|| refusal("seen", Some(value), "one table for each channel"))?;
    let of_channel = |(channel, own): (&String, &Value)| {
        let place = |key: &str| format!("seen.{channel}{}{key}", if key.is_empty() { "" } else { "." });
        if !instance.channels.contains(channel) {
            return Err(refusal(
                &place(""),
                Some(own),
                &format!("one of the channels that it acts on: {}", instance.channels.join(", ")),
            ));
        }
        let own = own
            .as_table()
            .ok_or_else(|| refusal(&place(""), Some(own), "a table with the lowest and the highest that it adds"))?;
        let number = |key: &String| {
            let value = own.get(key);
            value
                .and_then(finite)
                .ok_or_else(|| refusal(&place(key), value, "a finite number in the unit that its key ends with"))
        };
        let [lowest, highest] = keys(channel);
        let seen = [number(&lowest)?, number(&highest)?];
        if seen[0] > seen[1] {
            return Err(refusal(&place(&lowest), own.get(&lowest), &format!("a number that is not above {highest}")));
        }
        let numbers = |value: &Value| -> Option<Vec<f64>> { value.as_array()?.iter().map(finite).collect() };
        let rows = |value: &Value| -> Option<Vec<Vec<f64>>> { value.as_array()?.iter().map(numbers).collect() };
        let covariance = match own.get(COVARIANCE) {
            None => Vec::new(),
            Some(value) => {
                rows(value).filter(|rows| rows.len() == amplitudes && rows.iter().all(|r| r.len() == amplitudes)).ok_or_else(
                    || refusal(&place(COVARIANCE), Some(value), &format!("{amplitudes} lists of {amplitudes} finite numbers")),
                )?
            }
        };
        Ok(Reach { channel: channel.clone(), seen, covariance })
    };
    table.iter().map(of_channel).collect()
}

impl Model {
    /// Widens what was seen of its effects by what they add on a run that they were fitted to; of the first `known` effects nothing.
    pub(crate) fn saw(&mut self, context: &Context, known: usize) {
        for target in &context.targets {
            let Some((design, coefficients)) = self.design(context, target, &self.placed()) else { continue };
            let all = design.predict(&coefficients, context.len());
            for k in known..self.effects.len() {
                let Some(at) = self.effects[k].reach.iter().position(|r| r.channel == target.name) else { continue };
                let Some(part) = self.part(context, target, &all, k) else { continue };
                let seen = &mut self.effects[k].reach[at].seen;
                for row in target.rows.iter().filter(|row| target.claims(**row)) {
                    *seen = [seen[0].min(part[*row]), seen[1].max(part[*row])];
                }
            }
        }
    }

    /// What a prediction of a channel goes too far, row by row; nothing where no effect goes beyond what it has shown.
    pub(super) fn excess(&self, context: &Context, target: &Target, whole: (&TargetDesign, &[f64])) -> Option<Vec<f64>> {
        let n = context.len();
        let all = whole.0.predict(whole.1, n);
        let mut out: Option<Vec<f64>> = None;
        for (k, added) in self.effects.iter().enumerate() {
            let Some(reach) = added.reach.iter().find(|r| r.channel == target.name) else { continue };
            let part = self.part(context, target, &all, k)?;
            let runs_on = added.placed.effect.runs_on(&added.placed.instance);
            let beyond: Vec<f64> = part.iter().map(|p| reach.beyond(*p, runs_on)).collect();
            if beyond.iter().all(|b| *b == 0.0) {
                continue;
            }
            let moved = added.moved(|i, to| self.varied(context, target, |placed| placed[k].shape[i] = to));
            let error = |row: usize| {
                let of_shapes: f64 = moved.iter().map(|m| (m[row] - all[row]).powi(2)).sum();
                (of_shapes + variance(whole.0, k, &reach.covariance, row)).sqrt()
            };
            let out = out.get_or_insert_with(|| vec![0.0; n]);
            for (row, (o, b)) in out.iter_mut().zip(&beyond).enumerate() {
                *o += reach.excess(*b, || error(row));
            }
        }
        out
    }

    /// What the effect at a position adds to a prediction of all.
    pub(super) fn part(&self, context: &Context, target: &Target, all: &[f64], k: usize) -> Option<Vec<f64>> {
        let rest = self.varied(context, target, |placed| placed[k].instance.channels.clear())?;
        Some(all.iter().zip(&rest).map(|(a, r)| a - r).collect())
    }

    /// The prediction with its effects changed.
    fn varied(&self, context: &Context, target: &Target, change: impl FnOnce(&mut [Placed])) -> Option<Vec<f64>> {
        let mut placed = self.placed();
        change(&mut placed);
        let (design, coefficients) = self.design(context, target, &placed)?;
        Some(design.predict(&coefficients, context.len()))
    }
}

impl AddedEffect {
    /// The prediction with each shape moved by its standard error, for those that have one.
    fn moved(&self, prediction: impl Fn(usize, f64) -> Option<Vec<f64>>) -> Vec<Vec<f64>> {
        let shapes = self.placed.shape.iter().zip(&self.shape_errors).enumerate();
        shapes.filter(|(_, (_, se))| **se > 0.0).filter_map(|(i, (value, se))| prediction(i, value + se)).collect()
    }
}

/// Standard errors of an effect's shapes, which stand first among its estimates; nothing where one is not known.
pub(crate) fn shape_errors(estimates: &[Estimate], placed: &Placed) -> Vec<f64> {
    let own: Vec<f64> = estimates.iter().take(placed.shape.len()).map(|e| e.se).collect();
    if own.iter().all(|se| se.is_finite()) { own } else { Vec::new() }
}

/// Variance of what an effect adds to a row, from that of its amplitudes.
fn variance(design: &TargetDesign, effect: usize, covariance: &[Vec<f64>], row: usize) -> f64 {
    let own = || {
        design.columns.iter().filter_map(move |c| match c.label {
            Label::Effect { effect: e, amplitude } if e == effect => Some((amplitude, c.values[row])),
            _ => None,
        })
    };
    let product = |a: usize, b: usize| covariance.get(a).and_then(|r| r.get(b)).copied().unwrap_or(0.0);
    own().map(|(a, x)| own().map(|(b, y)| x * product(a, b) * y).sum::<f64>()).sum::<f64>().max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Column, Log};

    fn reach() -> Reach {
        Reach { channel: "voltage_v".into(), seen: [-0.5, 0.1], covariance: Vec::new() }
    }

    #[test]
    fn what_was_seen_is_not_touched() {
        for inside in [-0.5, -0.2, 0.0, 0.1] {
            assert_eq!(reach().beyond(inside, [true; 2]), 0.0);
        }
    }

    #[test]
    fn an_extrapolation_is_believed_as_far_as_its_parameters_carry_it() {
        // sure parameters: all of it; as open as what was seen is large: half of it; wide open: next to nothing
        let beyond = -2.0;
        let left = |error: f64| beyond - reach().excess(reach().beyond(beyond - 0.5, [true; 2]), || error);
        assert_eq!(left(0.0), beyond);
        assert!((left(0.5) - 0.5 * beyond).abs() < 1e-12);
        assert!(left(50.0).abs() < 1e-3);
    }

    #[test]
    fn what_does_not_run_on_is_no_extrapolation() {
        assert_eq!(reach().beyond(-2.0, [false, true]), 0.0);
        assert!((reach().beyond(2.0, [false, true]) - 1.9).abs() < 1e-12);
        assert_eq!(reach().beyond(2.0, [true, false]), 0.0);
    }

    /// Constant current, a battery whose parabola turns at 0.1 Ah; on its own run no more than 0.1 Ah were drawn.
    fn model() -> Model {
        let text = r#"
            format = "quadrig-model 1"
            source = "short.csv"
            start_pulse_us = 1000.0
            [consensus]
            channels = ["rpm"]
            [channel.voltage_v]
            c0_v = 16.0
            [[effect]]
            id = "battery_discharge"
            channels = ["voltage_v"]
            scope = "rig"
            shape = []
            [effect.amplitude.voltage_v]
            slope_v_per_ah = 10.0
            bend_v_per_ah2 = -50.0
            [effect.seen.voltage_v]
            lowest_v = -0.5
            highest_v = 0.0
            covariance = [[1.0, -12.0], [-12.0, 160.0]]
        "#;
        Model::parse("m.toml", text).expect("a model")
    }

    /// A run at 36 A with a row every second: 0.01 Ah a row.
    fn drawn(rows: usize) -> Vec<f64> {
        let of = |f: &dyn Fn(usize) -> f64| (0..rows).map(f).collect::<Vec<f64>>();
        let channels = [("rpm", of(&|_| 5000.0)), ("current_a", of(&|_| 36.0)), ("voltage_v", of(&|i| 16.0 - 0.05 * i as f64))];
        let log = Log {
            t: of(&|i| i as f64),
            columns: channels.into_iter().map(|(name, values)| Column { name: name.to_owned(), values }).collect(),
            ..Log::default()
        };
        model().predict(&Context::new(&log, Some(1000.0)), "voltage_v").expect("a prediction")
    }

    #[test]
    fn a_parabola_does_not_run_away_on_a_longer_run() {
        let near = drawn(10);
        let charge = 0.01 * 9.0;
        assert!((near[9] - (16.0 - 10.0 * charge + 50.0 * charge * charge)).abs() < 0.02, "{}", near[9]);
        // at 1 Ah the parabola says 56 V; what was seen is 0.5 V
        let far = drawn(100);
        assert!((far[99] - 16.0).abs() < 1.0, "{}", far[99]);
    }

    #[test]
    fn a_model_says_what_was_seen_and_is_read_again() {
        let written = Model::parse("m.toml", &model().to_toml()).expect("what was written");
        assert_eq!(written.effects[0].reach, model().effects[0].reach);
        let refused = |from: &str, to: &str| {
            let text = model().to_toml().replacen(from, to, 1);
            Model::parse("m.toml", &text).expect_err(to).to_string()
        };
        assert!(refused("lowest_v = -0.5", "lowest_v = 0.5").contains("effect[0].seen.voltage_v.lowest_v"));
        assert!(refused("[effect.seen.voltage_v]", "[effect.seen.thrust_n]").contains("effect[0].seen.thrust_n"));
        assert!(refused("[1.0, -12.0], ", "").contains("2 lists of 2 finite numbers"));
    }

    /// A meter that is half a row late has shown that on small steps: it is as late on large ones.
    #[test]
    fn a_late_meter_is_as_late_on_a_larger_step() {
        let text = r#"
            format = "quadrig-model 1"
            source = "staircase.csv"
            start_pulse_us = 1000.0
            [consensus]
            channels = ["rpm"]
            [channel.thrust_n]
            c0_n = 0.0
            c1_n_per_krpm = 1.0
            c2_n_per_krpm2 = 0.0
            [[effect]]
            id = "channel_delay"
            channels = ["thrust_n"]
            scope = "rig"
            shape = [0.05]
            shape_se = [0.04]
            [effect.seen.thrust_n]
            lowest_n = -0.1
            highest_n = 0.1
        "#;
        let rpm = (0..40).map(|i| if i < 20 { 1000.0 } else { 8000.0 }).collect();
        let columns = vec![Column { name: "rpm".into(), values: rpm }, Column { name: "thrust_n".into(), values: vec![1.0; 40] }];
        let log = Log { t: (0..40).map(|i| 0.1 * f64::from(i)).collect(), columns, ..Log::default() };
        let model = Model::parse("m.toml", text).expect("a model");
        let thrust = model.predict(&Context::new(&log, Some(1000.0)), "thrust_n").expect("a prediction");
        assert!((thrust[20] - 4.5).abs() < 1e-9 && (thrust[21] - 8.0).abs() < 1e-9, "{:?}", &thrust[18..23]);
    }
}
