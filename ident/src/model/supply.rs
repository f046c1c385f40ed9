//! What speed and current do at another supply voltage.
//!
//! What it is: a speed controller gives the motor a share of its supply. One run says how speed and current go with the load at the voltage that
//! its supply gave; at another voltage the speed is higher and the current at a speed lower, by powers that are known of brushless motors. The
//! model keeps the voltage of its own run by load, and compares that of another run with it.
//! What can go wrong: a controller that holds the speed by itself does not follow its supply. A run without a voltage is taken to have the
//! model's own. Where an effect of the model speaks of the voltage and of the channel, its part is not counted twice.
//! Units: V; loads in kus or krpm as the channel's polynomial.
//! Reference: V = k omega + R I at a fixed duty, d ln(omega) / d ln(V) = 1 / (1 + R I / V); the powers and where they come from:
//! [`crate::effects`], `supply_voltage`.

use super::read::{Refusal, finite, refusal};
use super::{AddedEffect, Model, load_unit};
use crate::channel::{Context, Relation, Target};
use crate::effects::placed::Placed;
use crate::effects::supply::supply_voltage::{OF_CURRENT, OF_SPEED};
use crate::model::leftover::{along, binned};
use crate::numeric::digits;
use crate::numeric::order::median;
use std::borrow::Cow;
use toml::{Table, Value};

/// The channel of the supply's voltage.
const VOLTAGE: &str = "voltage_v";
/// Least ratio of two voltages.
const LEAST: f64 = 0.1;
/// Significant digits of a voltage.
const DIGITS: usize = 6;

/// Voltage of a run by the load of a channel, from low to high.
pub(crate) type ByLoad = Vec<(f64, f64)>;

/// What was measured at a load and its standard error.
struct Level {
    load: f64,
    value: f64,
    se: f64,
}

/// Power of the voltage that a relation goes with; `None` of one that does not follow the supply.
fn power(relation: Relation) -> Option<f64> {
    match relation {
        Relation::SpeedFromPulse => Some(OF_SPEED.0),
        Relation::Current => Some(-OF_CURRENT.0),
        _ => None,
    }
}

/// Keys of a channel's table: loads, and the voltage there.
pub(super) fn keys(channel: &str) -> [String; 2] {
    [format!("supply_at_{}", load_unit(channel)), "supply_v".to_owned()]
}

/// What a channel's table holds of it.
pub(super) fn to_keys(channel: &str, by_load: &ByLoad) -> [(String, Value); 2] {
    let [at, volts] = keys(channel);
    let list = |of: fn(&(f64, f64)) -> f64| -> Value {
        by_load.iter().map(|p| Value::from(digits::significant(of(p), DIGITS))).collect::<Vec<_>>().into()
    };
    [(at, list(|p| p.0)), (volts, list(|p| p.1))]
}

/// Both lists of a channel's table, or neither.
pub(super) fn read(channel: &str, value: &Value) -> Result<Option<ByLoad>, Refusal> {
    let [at, volts] = keys(channel);
    if value.get(&at).is_none() && value.get(&volts).is_none() {
        return Ok(None);
    }
    let list = |key: &str| -> Option<Vec<f64>> { value.get(key)?.as_array()?.iter().map(finite).collect() };
    let loads = list(&at).filter(|l| l.is_sorted_by(|a, b| a < b));
    let loads = loads.ok_or_else(|| refusal(&at, value.get(&at), "a list of finite numbers, each larger than the one before"))?;
    let fits = |v: &Vec<f64>| v.len() == loads.len() && v.iter().all(|v| *v > 0.0);
    let expected = || format!("a list of {} numbers above zero, as {at} has", loads.len());
    let levels = list(&volts).filter(fits).ok_or_else(|| refusal(&volts, value.get(&volts), &expected()))?;
    Ok(Some(loads.into_iter().zip(levels).collect()))
}

impl Model {
    /// The model with the voltage that its own run's supply gave.
    #[must_use]
    pub fn supplied_by(mut self, context: &Context) -> Self {
        let of_target = |target: &Target| {
            power(target.relation)?;
            let mut volts = self.follows_by_itself(target).then(|| readings(context))??;
            self.less_what_it_says(context, target, &mut volts)?;
            let levels = levels(&volts, &context.regressor(target.relation)?);
            let by_load: ByLoad = levels.iter().map(|l| (l.load, l.value)).collect();
            (!by_load.is_empty()).then(|| (target.name.to_owned(), by_load))
        };
        self.supply = context.targets.iter().filter_map(of_target).collect();
        self
    }

    /// What the model says of a run at another voltage, for the reader of a page.
    pub(crate) fn said_of_the_supply(&self) -> Option<String> {
        let known = |name: &str| self.supply.iter().any(|(channel, _)| channel.starts_with(name));
        let parts = [
            known("rpm").then(|| format!("the speed goes with the voltage to the power {}", OF_SPEED.0)),
            known("current").then(|| format!("the current at a speed goes with it to the power -{}", OF_CURRENT.0)),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        let said = "This is known of brushless motors; this run alone cannot show it.";
        (!parts.is_empty()).then(|| format!("On a run at another supply voltage {}. {said}", parts.join(", and ")))
    }

    /// Prediction of a channel at the voltage that was measured; `None` where the model or the run does not know the one that its own supply
    /// gave, or the channel does not follow it. What effects of the model make of the voltage is measured here, and left out.
    pub(super) fn predict_at_the_supply_of(&self, context: &Context, target: &Target) -> Option<Vec<f64>> {
        let (_, own) = self.supply.iter().find(|(channel, _)| channel == target.name)?;
        let (power, loads) = (power(target.relation)?, context.regressor(target.relation)?);
        // what a supply gives hangs on the command, also where it cannot give what the motor asks for
        let commands = context.regressor(Relation::SpeedFromPulse).unwrap_or_else(|| loads.clone());
        // as many times the voltage of the model's own run at the same load, where both have settled: a rotor on its way is at another load
        let mut times = readings(context)?;
        times.iter_mut().for_each(|(row, v)| *v /= along(own, loads[*row]));
        let levels = levels(&times, &commands);
        let (settled, errors): (ByLoad, ByLoad) = levels.iter().map(|l| ((l.load, l.value), (l.load, l.se))).unzip();
        let trend = trend(context, &times, |row| along(&settled, commands[row]));
        let mut out = self.without_what_it_says(context, target).predict_at_its_own_supply(context, target.name)?;
        for (row, p) in out.iter_mut().enumerate() {
            let (times, se) = ((along(&settled, commands[row]) + trend[row]).max(LEAST), along(&errors, commands[row]));
            let (apart, open) = (times.ln(), 2.0 * (se / times).powi(2));
            // two supplies that only the noise of their meters tells apart are one
            *p *= (power * apart.powi(3) / (apart * apart + open).max(f64::MIN_POSITIVE)).exp();
        }
        Some(out)
    }

    /// The model for the run that it was fitted to.
    pub(super) fn at_its_own_supply(&self) -> Cow<'_, Self> {
        if self.supply.is_empty() { Cow::Borrowed(self) } else { Cow::Owned(Self { supply: Vec::new(), ..self.clone() }) }
    }

    /// Whether no effect of the model says already how a channel follows the voltage.
    fn follows_by_itself(&self, target: &Target) -> bool {
        let says = |p: &Placed| match p.effect.id() {
            "supply_voltage" => p.instance.touches(target.name),
            "supply_sag" => p.effect.follows_supply(&p.instance, target.name),
            _ => false,
        };
        !self.effects.iter().any(|e| says(&e.placed))
    }

    /// Positions of the effects that speak of the voltage and of this channel.
    fn of_both(&self, context: &Context, target: &Target) -> Vec<usize> {
        let both = |e: &AddedEffect| e.placed.instance.touches(target.name) && e.placed.instance.touches(VOLTAGE);
        let known = context.target(VOLTAGE).is_some();
        (0..self.effects.len()).filter(|k| known && both(&self.effects[*k])).collect()
    }

    /// Takes what they say of the voltage off its readings.
    fn less_what_it_says(&self, context: &Context, target: &Target, volts: &mut [(usize, f64)]) -> Option<()> {
        let meter = &context.targets[context.target(VOLTAGE)?];
        let Some((design, coefficients)) = self.design(context, meter, &self.placed()) else { return Some(()) };
        let all = design.predict(&coefficients, context.len());
        for k in self.of_both(context, target) {
            let part = self.part(context, meter, &all, k)?;
            volts.iter_mut().for_each(|(row, v)| *v -= part[*row]);
        }
        Some(())
    }

    /// The model in which they do not speak of this channel.
    fn without_what_it_says(&self, context: &Context, target: &Target) -> Cow<'_, Self> {
        let both = self.of_both(context, target);
        if both.is_empty() {
            return Cow::Borrowed(self);
        }
        let mut out = self.clone();
        for k in both {
            out.effects[k].placed.instance.channels.retain(|c| c != target.name);
            out.effects[k].reach.retain(|r| r.channel != target.name);
        }
        Cow::Owned(out)
    }
}

/// The readings of the supply's voltage by row, where the motor is driven and has settled.
fn readings(context: &Context) -> Option<Vec<(usize, f64)>> {
    let meter = &context.targets[context.target(VOLTAGE)?];
    let drives = |row: usize| context.pulse.as_ref().is_none_or(|p| p[row] >= context.start_pulse_us);
    let held = |k: usize| meter.unsettled.get(k).is_none_or(|u| !u);
    let rows = meter.rows.iter().copied().zip(meter.y.iter().copied()).enumerate();
    let counts = |(k, (row, v)): &(usize, (usize, f64))| held(*k) && meter.claims(*row) && drives(*row) && *v > 0.0;
    let out: Vec<(usize, f64)> = rows.filter(counts).map(|(_, reading)| reading).collect();
    (!out.is_empty()).then_some(out)
}

/// Readings by a load.
fn levels(readings: &[(usize, f64)], loads: &[f64]) -> Vec<Level> {
    binned(readings.iter().map(|(row, v)| (loads[*row], *v)).collect()).iter().map(|part| level(part)).collect()
}

/// What readings do on each row beside their levels: a straight line in time, as a battery that empties.
fn trend(context: &Context, readings: &[(usize, f64)], level: impl Fn(usize) -> f64) -> Vec<f64> {
    let n = readings.len() as f64;
    let middle = readings.iter().map(|(row, _)| context.t[*row]).sum::<f64>() / n;
    let (mut with, mut square) = (0.0, 0.0);
    for (row, v) in readings {
        let t = context.t[*row] - middle;
        with += t * (v - level(*row));
        square += t * t;
    }
    let slope = if square > 0.0 { with / square } else { 0.0 };
    context.t.iter().map(|t| slope * (t - middle)).collect()
}

/// Median of the readings of about one load.
fn level(rows: &[(f64, f64)]) -> Level {
    let n = rows.len() as f64;
    let value = median(&mut rows.iter().map(|r| r.1).collect::<Vec<f64>>());
    let spread = rows.iter().map(|r| (r.1 - value).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    Level { load: rows.iter().map(|r| r.0).sum::<f64>() / n, value, se: (spread / n).sqrt() }
}

/// For the table of a channel whose readings follow the supply.
pub(super) fn insert(table: &mut Table, channel: &str, supply: &[(String, ByLoad)]) {
    if let Some((_, by_load)) = supply.iter().find(|(name, _)| name == channel) {
        table.extend(to_keys(channel, by_load));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::close::close;
    use crate::log::{Column, Log};

    /// A motor behind a lead of 20 mohm: V duty = k omega + b omega^2, current from the power, 21 levels of 40 rows.
    fn run(volts: f64) -> Log {
        behind(volts, 0.02)
    }

    /// The same behind another lead, ohm.
    fn behind(volts: f64, lead: f64) -> Log {
        let noise = |i: usize, k: f64| (k * (i * i) as f64).sin();
        let pulse: Vec<f64> = (0..840).map(|i| 1100.0 + 45.0 * (i / 40 * 8 % 21) as f64).collect();
        let steady = |p: f64| {
            let (k, b, mut v) = (0.45, 0.006, volts);
            let mut amperes = 0.0;
            let mut krpm = 0.0;
            for _ in 0..50 {
                v = volts - lead * amperes;
                let drive = v * (p - 1000.0) / 1000.0;
                krpm = (-k + f64::sqrt(k * k + 4.0 * b * drive)) / (2.0 * b);
                amperes = 0.012 * f64::powi(krpm, 3) / v;
            }
            [1000.0 * krpm, amperes, v]
        };
        let of = |at: usize, size: f64, k: f64| -> Vec<f64> {
            pulse.iter().enumerate().map(|(i, p)| steady(*p)[at] + size * noise(i, k)).collect()
        };
        let columns = [
            ("rpm", of(0, 5.0, 0.7)),
            ("current_a", of(1, 0.02, 1.3)),
            ("voltage_v", of(2, 0.01, 2.9)),
            ("pulse_us", pulse.clone()),
        ];
        let columns = columns.into_iter().map(|(name, values)| Column { name: name.to_owned(), values }).collect();
        Log { name: format!("{volts}.csv"), t: (0..840).map(|i| 0.1 * f64::from(i)).collect(), columns, ..Log::default() }
    }

    #[test]
    fn a_run_at_another_voltage_is_predicted() {
        for (own, other) in [(7.4, 11.1), (11.1, 7.4), (16.0, 15.0)] {
            let closed = close(&run(own), None, &[run(other)], &mut |_| {}).expect("a run");
            let channels = &closed.verdict.validation[0].channels;
            for name in ["rpm", "current_a"] {
                let error = channels[name];
                assert!(error.after < 0.4 * error.before, "{own} V on {other} V, {name}: {error:?}");
            }
        }
    }

    /// The same power from a lower voltage is more current: no cubic of the speed holds that of a weak lead, and one run shows it.
    #[test]
    fn a_weak_lead_bends_the_current() {
        let closed = close(&behind(11.1, 0.25), None, &[behind(12.0, 0.25)], &mut |_| {}).expect("a run");
        let sag = closed.verdict.effects.iter().find(|e| e.id == "supply_sag").expect("a lead");
        assert!(sag.channels.iter().any(|c| c == "current_a"), "{:?}", sag.channels);
        let left = closed.verdict.effects.iter().find(|e| e.id == "unknown" && e.channels.iter().any(|c| c == "current_a"));
        assert!(left.is_none(), "{left:?}");
        let error = closed.verdict.validation[0].channels["current_a"];
        assert!(error.after < 0.1, "{error:?}");
    }

    #[test]
    fn the_same_supply_changes_nothing() {
        let closed = close(&run(11.1), None, &[], &mut |_| {}).expect("a run");
        // the same voltage, its noise another
        let mut again = run(11.1);
        let volts = again.columns.iter_mut().find(|c| c.name == "voltage_v").expect("a meter");
        volts.values.iter_mut().enumerate().for_each(|(i, v)| *v += 0.01 * (5.1 * (i * i) as f64).sin());
        let context = Context::new(&again, Some(closed.model.start_pulse_us));
        for name in ["rpm", "current_a"] {
            let moved = closed.model.predict(&context, name).expect("a prediction");
            let stays = closed.model.predict_at_its_own_supply(&context, name).expect("a prediction");
            let most = moved.iter().zip(&stays).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
            // three standard errors of the voltage of one level
            assert!(most < 5e-4, "{name} moved by {most}");
        }
        let mut blind = run(9.0);
        blind.columns.retain(|c| c.name != "voltage_v");
        let context = Context::new(&blind, Some(closed.model.start_pulse_us));
        assert_eq!(closed.model.predict(&context, "rpm"), closed.model.predict_at_its_own_supply(&context, "rpm"));
    }

    /// The same with a rotor that takes a second to follow; the current is that of its speed, 11.1 V at every load.
    fn slow(k: f64) -> Log {
        let mut log = run(11.1);
        let noise = |i: usize| (k * (i * i) as f64).sin();
        let target: Vec<f64> = log.column("rpm").expect("a speed").to_vec();
        let mut krpm = 0.0;
        let speed: Vec<f64> = target
            .iter()
            .map(|r| {
                krpm += 0.1 * (r / 1000.0 - krpm);
                krpm
            })
            .collect();
        for column in &mut log.columns {
            for (i, v) in column.values.iter_mut().enumerate() {
                match column.name.as_str() {
                    "rpm" => *v = 1000.0 * speed[i] + 5.0 * noise(i),
                    "current_a" => *v = 0.0011 * speed[i].powi(3) + 0.02 * noise(i + 1),
                    "voltage_v" => *v = 11.1 - 0.15 * speed[i] + 0.01 * noise(i + 2),
                    _ => {}
                }
            }
        }
        Log { name: format!("slow {k}.csv"), ..log }
    }

    #[test]
    fn a_rotor_on_its_way_is_at_no_other_supply() {
        let (own, other) = (slow(0.7), slow(1.9));
        let closed = close(&own, None, &[], &mut |_| {}).expect("a run");
        assert!(!closed.model.supply.is_empty());
        let context = Context::new(&other, Some(closed.model.start_pulse_us));
        let moved = closed.model.predict(&context, "current_a").expect("a prediction");
        let stays = closed.model.predict_at_its_own_supply(&context, "current_a").expect("a prediction");
        let most = moved.iter().zip(&stays).map(|(a, b)| (a - b).abs() / b.abs().max(0.1)).fold(0.0, f64::max);
        assert!(most < 2e-3, "moved by {most}");
    }

    #[test]
    fn the_run_of_the_fit_is_predicted_as_it_was_fitted() {
        let own = slow(0.7);
        let model = close(&own, None, &[], &mut |_| {}).expect("a run").model;
        let context = Context::new(&own, Some(model.start_pulse_us));
        for name in ["rpm", "current_a"] {
            assert_eq!(model.on(&own).predict(&context, name), model.predict_at_its_own_supply(&context, name));
        }
    }

    #[test]
    fn what_is_measured_of_the_voltage_is_not_guessed_from_the_charge() {
        let text = r#"
            format = "quadrig-model 1"
            source = "day.csv"
            start_pulse_us = 1000.0
            [consensus]
            channels = ["rpm"]
            [channel.voltage_v]
            c0_v = 12.0
            [channel.rpm]
            c0_rev_per_min = 0.0
            c1_rev_per_min_per_kus = 10000.0
            c2_rev_per_min_per_kus2 = 0.0
            c3_rev_per_min_per_kus3 = 0.0
            supply_at_kus = [0.1, 1.0]
            supply_v = [12.0, 12.0]
            [[effect]]
            id = "battery_discharge"
            channels = ["voltage_v", "rpm"]
            scope = "rig"
            shape = [5.0]
            [effect.amplitude.voltage_v]
            slope_v_per_ah = 60.0
        "#;
        let model = Model::parse("m.toml", text).expect("a model");
        // ten minutes at 6 A, the voltage as fresh as ever
        let of = |value: f64| vec![value; 600];
        let columns = [("pulse_us", of(1500.0)), ("rpm", of(5000.0)), ("current_a", of(6.0)), ("voltage_v", of(12.0))];
        let log = Log {
            t: (0..600).map(f64::from).collect(),
            columns: columns.into_iter().map(|(name, values)| Column { name: name.to_owned(), values }).collect(),
            ..Log::default()
        };
        let context = Context::new(&log, Some(1000.0));
        let last = |all: Option<Vec<f64>>| all.and_then(|v| v.last().copied()).expect("a prediction");
        assert!(last(model.predict_at_its_own_supply(&context, "rpm")) < 2000.0, "1 Ah at 5 per Ah");
        assert!((last(model.predict(&context, "rpm")) - 5000.0).abs() < 1.0);
    }

    #[test]
    fn it_stands_in_the_model_s_file() {
        let model = close(&slow(0.7), None, &[], &mut |_| {}).expect("a run").model;
        let text = model.to_toml();
        let again = Model::parse("m.toml", &text).expect("what was written");
        assert_eq!(again.supply.len(), 2);
        for (channel, a) in &model.supply {
            let b = again.supply.iter().find(|(other, _)| other == channel).map(|(_, by_load)| by_load).expect(channel);
            assert_eq!(a.len(), b.len());
            assert!(a.iter().zip(b).all(|(a, b)| (a.0 - b.0).abs() < 1e-4 && (a.1 - b.1).abs() < 1e-4));
        }
        let refused = |from: &str, to: &str| Model::parse("m.toml", &text.replacen(from, to, 1)).expect_err(to).to_string();
        assert!(refused("supply_v = [", "supply_v = [-1.0, ").contains("channel.current_a.supply_v"));
        assert!(refused("supply_at_kus = [", "supply_at_kus = [9.0, ").contains("channel.rpm.supply_at_kus"));
    }
}
