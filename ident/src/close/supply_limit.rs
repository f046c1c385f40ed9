//! A supply at its current limit, read off its own meters.
//!
//! What it is: below its limit a supply holds its voltage; from there on it holds the current, and the voltage gives way. Where the command rises from
//! one level to the next while the current stands still and the voltage falls, both meters show it: no lead does that, and no throttle that
//! rises no further. Two levels suffice, so that a table of eleven rows tells it. Where only the highest level reaches the limit, the current
//! rises by clearly less than from the level before, and the voltage falls by clearly more than the levels before cost for it. It is named from
//! there, and these levels are left out of what hangs on a supply that holds its voltage.
//! What can go wrong: a lead that comes loose on the highest level looks the same; the level is then left out as well.
//! Units: A, V, us.
//! Reference: constant-current mode of laboratory supplies.

use crate::channel::{Context, unit_of};
use crate::close::marks::{self, CERTAIN};
use crate::effects::reported::parameter;
use crate::effects::{CurrentLimit, Effect, Estimate, Instance};
use crate::identify::{TABLE_ERROR, settled};
use crate::log::Log;
use crate::model::Model;
use crate::numeric::solve::Normal;
use crate::plateau::Plateau;
use crate::signal::stretches::CALM_US;
use crate::verdict::OF_THE_SUPPLY;
use crate::verdict::words::{amount, channel};
use crate::verdict::{EffectEntry, Kin, Verdict};

/// Standard errors by which a voltage must have fallen to be said to fall.
const CLEARLY: f64 = 3.0;
/// Relative change of the current over that of the voltage below which it is the current that is held. A motor whose duty no longer rises draws
/// less as its voltage falls, by as large a share at the least; a lead costs voltage for more current only, and a share of it that is smaller
/// still. Both are beyond one; half of it parts them from a supply that holds its current.
const HELD: f64 = 0.5;

/// What both meters show at one level, and its command.
#[derive(Debug, Clone, Copy)]
struct Level {
    pulse: f64,
    current: (f64, f64),
    voltage: (f64, f64),
}

/// A stretch of levels at the limit.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Limit {
    /// A, with its standard error.
    current: (f64, f64),
    /// Command at the first and at the last level, us.
    pulses: [f64; 2],
    /// The same of the voltage, V.
    volts: [f64; 2],
    /// Command of the first level at the limit, us.
    begins: f64,
}

/// The limit that a log shows, if it shows one.
pub(crate) fn found(log: &Log, context: &Context) -> Option<Limit> {
    let measured = ["pulse_us", "current_a", "voltage_v"].iter().all(|name| log.column(name).is_some());
    measured.then(|| limit(&levels(log, &settled(context, log))))?
}

/// How far off the levels at the limit are from what a model says of the channels that they were left out of, at the most.
pub(crate) fn missed(log: &Log, context: &Context, model: &Model, left_out: &[&'static str]) -> Vec<String> {
    let (Some(pulse), Some(from)) = (&context.pulse, context.limited_from) else { return Vec::new() };
    let of_channel = |name: &&'static str| {
        let (readings, prediction) = (log.column(name)?, model.predict_at_its_own_supply(context, name)?);
        let off = (0..pulse.len()).filter(|row| pulse[*row] > from - CALM_US).map(|row| (readings[row] - prediction[row]).abs());
        let most = off.filter(|v| v.is_finite()).fold(0.0, f64::max);
        Some(format!("{} by up to {}", channel(name), amount(most, unit_of(name))))
    };
    left_out.iter().filter_map(of_channel).collect()
}

/// What a verdict says of it, and of what was left out for it.
fn told(limit: &Limit, missed: &[String]) -> EffectEntry {
    let instance = Instance::new(&["current_a", "voltage_v"], OF_THE_SUPPLY);
    let about = CurrentLimit.about();
    let (value, se) = limit.current;
    let held = Estimate { name: "limit".to_owned(), unit: "A".to_owned(), value, se };
    let ([from, to], [before, after]) = (limit.pulses, limit.volts);
    let current = if limit.begins == from { "stands still" } else { "rises by less than before" };
    EffectEntry {
        kin: Kin::Own,
        id: CurrentLimit.id().to_owned(),
        scope: CurrentLimit.scope(&instance),
        run: None,
        depends_on: about.depends_on.iter().map(|v| (*v).to_owned()).collect(),
        equation: format!("current_a <= limit, voltage_v gives way [{OF_THE_SUPPLY}]"),
        probability: CERTAIN,
        parameters: vec![parameter(&held, &[], "current_a")],
        heldout_error_reduction: 0.0,
        evidence: format!(
            "the command rises from {from:.0} to {to:.0} us, the current {current}, and the voltage falls from {} to {}; \
             both meters show it{}",
            amount(before, "V"),
            amount(after, "V"),
            without(missed)
        ),
        channels: instance.channels,
    }
}

/// That the levels took no part, and how far off they would be.
fn without(missed: &[String]) -> String {
    if missed.is_empty() {
        return String::new();
    }
    format!(
        ". What the supply cannot give is no matter of the rig: these levels are left out, and are off what the others say of {}",
        missed.join(", ")
    )
}

/// Adds it to a verdict. One that names a current limit already says beside it what was left out.
pub(crate) fn tell(verdict: &mut Verdict, limit: &Limit, missed: &[String]) {
    match verdict.effects.iter_mut().find(|e| e.id == CurrentLimit.id()) {
        Some(known) => known.evidence += &without(missed),
        None => marks::stand(verdict, vec![told(limit, missed)]),
    }
}

fn levels(log: &Log, plateaus: &[Plateau]) -> Vec<Level> {
    let level = |p: &Plateau| {
        let of = |name| p.of(log, name);
        // no meter is better than what a row of a table is given
        let read = |name| of(name).map(|(v, se): (f64, f64)| (v, se.max(TABLE_ERROR * v.abs())));
        Some(Level { pulse: of("pulse_us")?.0, current: read("current_a")?, voltage: read("voltage_v")? })
    };
    plateaus.iter().filter_map(level).collect()
}

impl Limit {
    /// Command of the first level at the limit, us.
    pub(crate) fn begins_us(&self) -> f64 {
        self.begins
    }
}

fn limit(levels: &[Level]) -> Option<Limit> {
    stretch(levels).or_else(|| levels.windows(3).find_map(|w| highest(w, levels)))
}

/// The highest level, where it alone is at the limit. A motor's current grows ever faster with the command: it is no less than what the rise before
/// continues to. A lead costs as much for each ampere as it did before.
fn highest(step: &[Level], levels: &[Level]) -> Option<Limit> {
    let [a, b, c] = step else { return None };
    let rises = a.pulse + CALM_US < b.pulse && b.pulse + CALM_US < c.pulse && a.current.0 < b.current.0;
    let is_most = levels.iter().all(|l| l.pulse <= c.pulse && l.current.0 <= c.current.0);
    if !rises || !is_most {
        return None;
    }
    let further = (c.pulse - b.pulse) / (b.pulse - a.pulse);
    let short = b.current.0 + further * (b.current.0 - a.current.0) - c.current.0;
    let error = ((1.0 + further) * b.current.1).hypot(further * a.current.1).hypot(c.current.1);
    let (expected, error_v) = by_the_lead(levels, c)?;
    let fell = expected - c.voltage.0;
    let is_limit = short > CLEARLY * error && fell > CLEARLY * error_v.hypot(c.voltage.1);
    is_limit.then_some(Limit {
        current: c.current,
        pulses: [b.pulse, c.pulse],
        volts: [b.voltage.0, c.voltage.0],
        begins: c.pulse,
    })
}

/// The voltage that a lead leaves at a level by all the others, with its standard error: a straight line over the current.
fn by_the_lead(levels: &[Level], at: &Level) -> Option<(f64, f64)> {
    let others: Vec<&Level> = levels.iter().filter(|l| l.pulse < at.pulse).collect();
    let columns = [vec![1.0; others.len()], others.iter().map(|l| l.current.0).collect()];
    let volts: Vec<f64> = others.iter().map(|l| l.voltage.0).collect();
    let weights: Vec<f64> = others.iter().map(|l| l.voltage.1.powi(-2)).collect();
    let line = Normal::of_columns(&columns, &volts, &weights).solve()?;
    let place = [1.0, at.current.0];
    let expected = line.coefficients.iter().zip(place).map(|(c, x)| c * x).sum();
    let terms = (0..2).flat_map(|i| (0..2).map(move |j| (i, j)));
    let variance: f64 = terms.map(|(i, j)| place[i] * line.inverse[(i, j)] * place[j]).sum();
    Some((expected, variance.max(0.0).sqrt()))
}

/// The first stretch of levels one after the other over which the current is held, and no level draws more.
fn stretch(levels: &[Level]) -> Option<Limit> {
    let most = levels.iter().map(|l| l.current.0).fold(0.0, f64::max);
    let first = levels.windows(2).position(|w| is_held(w, most))?;
    let steps = levels[first..].windows(2).take_while(|w| is_held(w, most)).count();
    let held = &levels[first + 1..=first + steps];
    let n = held.len() as f64;
    let mean = held.iter().map(|l| l.current.0).sum::<f64>() / n;
    // one meter: what it is off by is the same on every level
    let se = held.iter().map(|l| l.current.1).sum::<f64>() / n;
    let last = held.last()?;
    Some(Limit {
        current: (mean, se),
        pulses: [levels[first].pulse, last.pulse],
        volts: [levels[first].voltage.0, last.voltage.0],
        begins: levels[first].pulse,
    })
}

/// Whether the current was held from one level to the next.
fn is_held(step: &[Level], most: f64) -> bool {
    let [a, b] = step else { return false };
    let falls = 1.0 - b.voltage.0 / a.voltage.0;
    let error = (a.voltage.1 / a.voltage.0).hypot(b.voltage.1 / a.voltage.0);
    let moves = (b.current.0 / a.current.0 - 1.0).abs();
    let highest = most - b.current.0 < CLEARLY * b.current.1;
    b.pulse > a.pulse + CALM_US && highest && falls > CLEARLY * error && moves < HELD * falls
}

#[cfg(test)]
mod tests {
    use super::{Level, limit};

    fn levels(of: &[[f64; 3]]) -> Vec<Level> {
        of.iter().map(|[pulse, a, v]| Level { pulse: *pulse, current: (*a, 0.01 * a), voltage: (*v, 0.01 * v) }).collect()
    }

    #[test]
    fn a_supply_that_holds_its_current_is_told() {
        let found = limit(&levels(&[
            [1620.0, 6.34, 10.93],
            [1715.0, 8.40, 10.86],
            [1810.0, 10.91, 10.59],
            [1905.0, 10.93, 8.81],
            [2000.0, 10.94, 7.79],
        ]))
        .expect("a limit");
        assert_eq!((found.pulses, found.volts), ([1810.0, 2000.0], [10.59, 7.79]));
        assert!((found.current.0 - 10.935).abs() < 1e-9);
    }

    #[test]
    fn a_limit_that_only_the_highest_level_reaches_is_told() {
        let of = |amps: f64, volts: f64| {
            let below = [[1430.0, 2.41, 11.03], [1525.0, 3.27, 11.006], [1620.0, 4.35, 10.973], [1715.0, 5.83, 10.931]];
            levels(&[&below[..], &[[1810.0, 7.74, 10.875], [1905.0, 9.92, 10.808], [2000.0, amps, volts]]].concat())
        };
        let found = limit(&of(10.94, 10.196)).expect("a limit");
        assert_eq!((found.begins, found.volts, found.current.0), (2000.0, [10.808, 10.196], 10.94));
        // a throttle that ends before 2000 us costs no voltage, and a battery that gives way at full load does not hold the current
        for other in [of(10.94, 10.78), of(12.2, 10.2)] {
            assert_eq!(limit(&other), None);
        }
    }

    #[test]
    fn leads_batteries_and_throttles_at_their_end_are_not() {
        for (what, of) in [
            ("a lead of 80 mohm", vec![[1700.0, 8.0, 10.4], [1800.0, 11.0, 10.1], [1900.0, 15.0, 9.8]]),
            (
                "a weak battery: more current for less voltage",
                vec![[1700.0, 8.0, 11.4], [1800.0, 11.0, 10.8], [1900.0, 15.0, 10.0]],
            ),
            ("a battery that empties at full throttle", vec![[1800.0, 15.0, 11.0], [1900.0, 13.4, 10.4], [2000.0, 11.6, 9.7]]),
            ("a throttle end point on a stiff supply", vec![[1800.0, 14.0, 12.0], [1900.0, 15.0, 11.9], [2000.0, 15.0, 11.9]]),
            ("the voltage of another battery", vec![[1800.0, 15.0, 12.0], [1200.0, 2.0, 12.0], [1300.0, 2.0, 10.0]]),
            ("a step down", vec![[2000.0, 10.9, 10.5], [1900.0, 10.9, 8.8]]),
        ] {
            assert_eq!(limit(&levels(&of)), None, "{what}");
        }
    }
}
