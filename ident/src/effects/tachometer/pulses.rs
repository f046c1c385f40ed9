//! Pulses of a speed channel: too few, too many, and which readings hold them.
//!
//! What it is: what `missed_pulses` and `double_pulses` share: readings beside the consensus of the channels, those that are grossly off, and the
//! probability of a pulse that they speak of.
//! What can go wrong: a late reading is off while the speed changes, by no more than the change; an old reading is no reading.
//! Units: rev/min; shares of the speed.
//! Reference: Beharie 2013, section 5.7.1; Garwood 1936 (interval of a count).

use crate::channel::{Context, DIFFERENCES, Relation, Target};
use crate::effects::design::TargetDesign;
use crate::effects::rotor::blade_damage::STANDSTILL;
use crate::effects::tachometer::speed_channel::{difference, instances};
use crate::effects::{Amplitude, Estimate, Instance};
use crate::numeric::order::median;

/// A speed channel's reading on one row, beside the consensus.
#[derive(Debug, Clone, Copy)]
struct Reading {
    /// Row of the log.
    row: usize,
    /// Reading over the consensus.
    share: f64,
    /// Share of its speed by which the rotor changed within the last rows: a late reading is off by no more.
    change: f64,
}

impl Reading {
    /// Whether the reading is grossly too low (`sign` -1) or too high (+1): three times what lateness could explain.
    fn is_gross(&self, sign: f64) -> bool {
        sign * (self.share - 1.0) > GROSS.max(LATE * self.change)
    }
}

/// Rows of a difference target on which the rotor turns and has not changed its speed by more than [`STEADY`] within a few rows.
fn readings<'c>(context: &'c Context, target: &'c Target) -> impl Iterator<Item = Reading> + 'c {
    let change = |i: usize| {
        let now = context.rpm[i];
        (1..=4).map(|back| (context.rpm[i.saturating_sub(back)] - now).abs()).fold(0.0, f64::max) / now.max(1.0)
    };
    // a reading that repeats the last one to the last digit is an old one
    let reading = |k: usize| target.y[k] + context.rpm[target.rows[k]];
    let fresh = move |k: usize| k == 0 || (reading(k) - reading(k - 1)).abs() > 1e-6;
    let rows = target.rows.iter().zip(&target.y).enumerate();
    let turning = rows.filter(move |(k, (i, _))| context.rpm[**i] > STANDSTILL && fresh(*k));
    turning
        .map(move |(_, (i, d))| Reading { row: *i, share: 1.0 + d / context.rpm[*i], change: change(*i) })
        .filter(|r| r.change < STEADY)
}

/// Those of them on which the speed has changed by less than a hundredth: row, and reading over the consensus.
pub(crate) fn held<'c>(context: &'c Context, target: &'c Target) -> impl Iterator<Item = (usize, f64)> + 'c {
    readings(context, target).filter(|r| r.change < HELD).map(|r| (r.row, r.share))
}

/// Change within a few rows below which the speed counts as held.
pub(crate) const HELD: f64 = 0.01;

/// Largest change of the speed within a few rows at which a channel is compared with the others.
const STEADY: f64 = 0.1;

/// Times that change by which a reading must be off: a late one is off by the change itself.
const LATE: f64 = 3.0;

/// Share by which a reading must be off at least to be counted as one pulse too few or too many.
const GROSS: f64 = 0.03;

/// Form in which single samples are off.
pub(crate) const SCATTERED: &str = "scattered";

/// The form in which a channel reads grossly too low (`sign` -1) or too high (+1): on some of less than half of its rows, or on none. One reading
/// alone is a bad sample. Pulses are lost by chance: where most readings that are low stand beside another one, the sensor has dropped out.
fn form(context: &Context, target: &Target, sign: f64) -> Option<&'static str> {
    let off: Vec<bool> = readings(context, target).map(|r| r.is_gross(sign)).collect();
    form_of(&off, sign)
}

/// The form that readings have which are grossly off, or not, in the order of their rows.
fn form_of(off: &[bool], sign: f64) -> Option<&'static str> {
    let count = off.iter().filter(|off| **off).count();
    let in_a_row = off.windows(2).filter(|pair| pair[0] && pair[1]).count();
    let by_chance = sign > 0.0 || 2 * in_a_row < count;
    let recurs = count > 1 && count * 2 < off.len();
    (recurs && by_chance).then_some(SCATTERED)
}

/// Instances of pulses too few (`sign` -1) or too many (+1) for every speed channel that can be compared: in single samples where some
/// are seen, on the whole where none is.
pub(crate) fn pulse_instances(context: &Context, sign: f64) -> Vec<Instance> {
    let seen = |i: &Instance| difference(context, i).and_then(|t| form(context, t, sign));
    let with_form = |mut i: Instance| {
        i.form = seen(&i).unwrap_or_default().to_owned();
        i
    };
    instances(context, "").into_iter().map(with_form).collect()
}

/// What pulses too few (`sign` -1) or too many (+1) do to the difference from the others; the channel's own polynomial takes a constant share,
/// and about readings that are off nothing is claimed there.
pub(crate) fn apply_pulses(context: &Context, instance: &Instance, sign: f64, position: usize, design: &mut TargetDesign) {
    let (Relation::SpeedDifference, Some(target)) = (design.relation, difference(context, instance)) else { return };
    let on = if instance.form.is_empty() { vec![1.0; context.len()] } else { gross(context, target, sign) };
    design.add(position, 0, on.iter().zip(&context.rpm).map(|(s, r)| sign * s * r).collect());
}

/// Whether single readings are off, and not the channel as a whole.
pub(crate) fn is_of_single_readings(instance: &Instance) -> bool {
    !instance.form.is_empty()
}

/// Amplitude of such an instance.
pub(crate) fn pulse_amplitudes(instance: &Instance) -> Vec<Amplitude> {
    match instance.form.as_str() {
        SCATTERED => vec![Amplitude { name: "depth", unit: "1" }],
        _ => vec![Amplitude { name: "probability", unit: "1" }],
    }
}

/// Adds the probability of a pulse to what was fitted to single samples.
pub(crate) fn report_pulses(context: &Context, instance: &Instance, sign: f64, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
    if let Some(target) = difference(context, instance).filter(|_| !instance.form.is_empty()) {
        fitted.insert(0, pulse_probability(context, target, sign));
    }
    fitted
}

/// Whether what was fitted can be pulses.
pub(crate) fn plausible_pulses(instance: &Instance, fitted: &[Estimate]) -> bool {
    let most = if instance.form == SCATTERED { 3.0 } else { 0.3 };
    fitted.iter().all(|e| e.value > 0.0 && e.value < most)
}

/// 1 on rows that read grossly too low (`sign` -1) or too high (+1), 0 elsewhere.
fn gross(context: &Context, target: &Target, sign: f64) -> Vec<f64> {
    let mut out = vec![0.0; context.len()];
    for reading in readings(context, target).filter(|r| r.is_gross(sign)) {
        out[reading.row] = 1.0;
    }
    out
}

/// At what speeds the readings with pulses too many are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StruckSpeeds {
    /// Lowest of them, rev/min.
    pub(crate) lowest: f64,
    /// How unlikely it is that chance would strike such speeds only, nats.
    pub(crate) unlikely: f64,
    /// How far below the lowest the next reading without is, rev/min.
    pub(crate) spacing: f64,
}

/// How unlikely it must be, in nats, that readings struck by chance are all as fast as they are, for speed to be what strikes them.
const UNLIKELY: f64 = 7.0;

/// The speeds of the readings with pulses too many, where it is no chance that they are among the upper ones.
pub(crate) fn struck_speeds(context: &Context, instance: &Instance) -> Option<StruckSpeeds> {
    let target = difference(context, instance)?;
    if form(context, target, 1.0) != Some(SCATTERED) {
        return None;
    }
    let speed = |r: &Reading| context.rpm[r.row];
    let struck: Vec<f64> = readings(context, target).filter(|r| r.is_gross(1.0)).map(|r| speed(&r)).collect();
    let all: Vec<f64> = readings(context, target).map(|r| speed(&r)).collect();
    let lowest = struck.iter().copied().fold(f64::INFINITY, f64::min);
    // levels wander a little: what is as fast as the lowest but for that is at its level
    let above = all.iter().filter(|s| **s > (1.0 - HELD) * lowest).count() as f64;
    let below = all.iter().copied().filter(|s| *s <= (1.0 - HELD) * lowest).fold(0.0, f64::max);
    let speeds =
        StruckSpeeds { lowest, unlikely: -(struck.len() as f64) * (above / all.len() as f64).ln(), spacing: lowest - below };
    (speeds.unlikely > UNLIKELY).then_some(speeds)
}

/// Takes readings with pulses too many above a speed for what they read, on the difference from the other channels: how many pulses each
/// of them holds too many is its own.
pub(crate) fn struck_readings(context: &Context, instance: &Instance, onset: f64, design: &mut TargetDesign) {
    let (Relation::SpeedDifference, Some(target)) = (design.relation, difference(context, instance)) else { return };
    let mut on = gross(context, target, 1.0);
    on.iter_mut().zip(&context.rpm).filter(|(_, rpm)| **rpm <= (1.0 - HELD) * onset).for_each(|(on, _)| *on = 0.0);
    as_they_read(target, &on, design);
}

/// Takes what a channel departs from the others by for what it is, on some rows.
fn as_they_read(target: &Target, on: &[f64], design: &mut TargetDesign) {
    design.fixed.resize(on.len(), 0.0);
    for (row, departure) in target.rows.iter().zip(&target.y) {
        design.fixed[*row] += on[*row] * departure;
    }
}

/// Loss of a reading that times one period and loses the pulse in its middle, and how near to it a loss must be.
const HALVED: (f64, f64) = (0.5, 0.05);

/// Standard deviations of a sensor's scatter, and the share of the speed, beyond which a reading holds a lost or doubled pulse.
const STRUCK: f64 = 6.0;
const STRUCK_LEAST: f64 = 0.002;

/// Probability of a lost (`sign` -1) or doubled (+1) pulse, from the readings that are grossly off, those that were set aside among them: the mean share that is lost or won, which
/// is that of a pulse whether a window holds many or one; where each loss halves the reading at every speed single periods are timed,
/// and the share of such readings is the probability.
fn pulse_probability(context: &Context, target: &Target, sign: f64) -> Estimate {
    let judged = against_the_others(context, target, STEADY);
    let aside = set_aside(context, target, sign).into_iter().map(|departure| (departure, 0.0));
    let departures: Vec<(f64, f64)> = judged.into_iter().chain(aside).map(|(d, late)| (sign * d, late)).collect();
    let mut sizes: Vec<f64> = departures.iter().map(|d| d.0.abs()).collect();
    // one pulse among many is less than a gross error, and still far outside of the scatter
    let least = (STRUCK * 1.4826 * median(&mut sizes)).clamp(STRUCK_LEAST, GROSS);
    let mut struck: Vec<f64> = departures.iter().filter(|d| d.0 > least.max(d.1)).map(|d| d.0).collect();
    let halved = |d: &&f64| (*d - HALVED.0).abs() < HALVED.1;
    let timed = sign < 0.0 && struck.iter().filter(halved).count() * 10 > struck.len() * 9;
    let whole = if timed { struck.len() as f64 } else { struck.iter().sum() };
    // rows on which one of the usual size would have been seen
    let usual = median(&mut struck);
    let seen = departures.iter().filter(|d| d.1 < usual).count();
    let value = whole / seen.max(1) as f64;
    Estimate { name: "probability".into(), unit: "1".into(), value, se: value * relative_error_of_a_count(struck.len().max(1)) }
}

/// Standard error of a count, as a share of it, by which 1.96 of them reach the upper end of its exact 95 % interval: of a few events
/// many more may have been due (Garwood 1936, by the cube root of Wilson and Hilferty 1931).
fn relative_error_of_a_count(count: usize) -> f64 {
    let next = count as f64 + 1.0;
    let upper = next * (1.0 - 1.0 / (9.0 * next) + 1.96 / (3.0 * next.sqrt())).powi(3);
    (upper - count as f64) / 1.96 / count as f64
}

/// Sum and number of the readings of the other speed channels on each row: the consensus holds the channel itself.
fn of_the_others(context: &Context, target: &Target) -> Vec<(f64, f64)> {
    let own = own_channel(target);
    let speeds = context.targets.iter().filter(|t| matches!(t.relation, Relation::SpeedFromPulse | Relation::SpeedAlone));
    let mut sums = vec![(0.0, 0.0); context.len()];
    for other in speeds.filter(|t| t.name != own) {
        for (i, y) in other.rows.iter().zip(&other.y) {
            sums[*i].0 += y;
            sums[*i].1 += 1.0;
        }
    }
    sums
}

/// The channel that a difference target holds against the others.
fn own_channel(target: &Target) -> &'static str {
    DIFFERENCES.iter().find(|d| d.1 == target.name).map_or("", |d| d.0)
}

/// What a channel departs from the mean of the other channels by, as a share of it, on the rows of [`readings`] whose speed changed by less
/// than a share, and what lateness could explain.
pub(crate) fn against_the_others(context: &Context, target: &Target, limit: f64) -> Vec<(f64, f64)> {
    let sums = of_the_others(context, target);
    let of = |r: Reading| {
        let (sum, n) = sums[r.row];
        let departure = if n > 0.0 && sum > 0.0 { r.share * context.rpm[r.row] * n / sum - 1.0 } else { r.share - 1.0 };
        (departure, LATE * r.change)
    };
    readings(context, target).filter(|r| r.change < limit).map(of).collect()
}

/// What the channel's readings depart from the other channels by that were set aside because they are too low (`sign` -1) or too high (+1), as a share
/// of the speed. A reading of next to nothing is no pulse too few: the sensor saw nothing.
fn set_aside(context: &Context, target: &Target, sign: f64) -> Vec<f64> {
    let (own, sums) = (own_channel(target), of_the_others(context, target));
    let struck = context.set_aside.iter().filter(|a| a.channel == own && !a.recurs && !a.silent && !a.stuck);
    let each = struck.filter(|a| sign * (a.value - a.expected) > 0.0).flat_map(|a| a.span().zip(&a.readings));
    each.filter_map(|(row, reading)| {
        let (sum, n) = *sums.get(row)?;
        (n > 0.0 && sum > 0.0).then(|| reading * n / sum).filter(|share| *share > NOTHING).map(|share| share - 1.0)
    })
    .collect()
}

/// Share of the speed below which a reading is that of a sensor that sees nothing.
const NOTHING: f64 = 0.05;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Column, Log};

    /// Four readings too low in a thousand: by chance they stand alone, and in a row they are a drop-out. Too many pulses may stand in a row.
    #[test]
    fn pulses_are_lost_by_chance_and_a_drop_out_is_a_row_of_readings() {
        let off = |rows: [usize; 4]| (0..1000).map(|row| rows.contains(&row)).collect::<Vec<bool>>();
        let (apart, in_a_row) = (off([100, 320, 321, 800]), off([320, 321, 322, 800]));
        assert_eq!((form_of(&apart, -1.0), form_of(&in_a_row, -1.0)), (Some(SCATTERED), None));
        assert_eq!((form_of(&apart, 1.0), form_of(&in_a_row, 1.0)), (Some(SCATTERED), Some(SCATTERED)));
    }

    #[test]
    fn a_few_events_may_be_many_more() {
        // exact upper ends: 5.572 of one event, 7.225 of two, 18.39 of ten
        for (count, upper) in [(1, 5.572), (2, 7.225), (10, 18.39)] {
            let n = count as f64;
            assert!((n * (1.0 + 1.96 * relative_error_of_a_count(count)) - upper).abs() < 0.02, "{count}");
        }
    }

    /// Three sensors, of which one loses a quarter in every twentieth reading, and in ten more in a row: what was set aside counts with the rest.
    #[test]
    fn readings_set_aside_count_with_the_rest() {
        let rows = 2000;
        let jitter = |i: usize, k: f64| 1.0 + 2e-4 * (k * (i * i) as f64).sin();
        let is_low = |i: usize| i % 20 == 7 || (100..110).contains(&i);
        let column = |name: &str, k: f64| Column {
            name: name.into(),
            values: (0..rows).map(|i| 4000.0 * jitter(i, k) * if name == "rpm_opto" && is_low(i) { 0.75 } else { 1.0 }).collect(),
        };
        let columns = vec![column("rpm_beam", 0.7), column("rpm_opto", 1.7), column("rpm_hall", 2.7)];
        let log = Log { t: (0..rows).map(|i| 0.1 * i as f64).collect(), columns, ..Log::default() };
        let context = Context::new(&log, None);
        let of_it = context.set_aside.iter().filter(|a| a.channel == "rpm_opto" && !a.recurs);
        assert!(of_it.map(|a| a.rows).sum::<usize>() > 5, "{:?}", context.set_aside);
        let instances = pulse_instances(&context, -1.0);
        let opto = instances.iter().find(|i| i.channels.iter().any(|c| c == "rpm_opto")).expect("it is compared");
        let target = difference(&context, opto).expect("a difference");
        let truth = 0.25 * (0..rows).filter(|i| is_low(*i)).count() as f64 / rows as f64;
        let told = pulse_probability(&context, target, -1.0).value;
        assert!((told / truth - 1.0).abs() < 0.02, "{told}, {truth}");
    }
}
