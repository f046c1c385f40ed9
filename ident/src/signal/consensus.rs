//! One speed from up to four sensors.
//!
//! What it is: the median of the channels that agree, each over its own gain, drop-outs bridged. A sample that its board flags as wrong is left
//! out where another channel has one that is not.
//! What can go wrong: of two channels that disagree before or after all rows on which they agree none can be outvoted, and both are kept.
//! Units: rev/min.
//! Reference: specification `formats.md` (primary relations).

use super::stretches::{CALM_US, bridge, far};
use crate::log::board;
use crate::log::{Log, SPEED};
use crate::numeric::order::median;
use crate::signal::drive::Drive;

/// How the consensus speed is made; stands in `model.toml`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Consensus {
    /// Channels whose median is taken.
    pub channels: Vec<String>,
    /// Channels that disagree with the others, left out.
    pub excluded: Vec<String>,
    /// Rows without a speed that can be believed: bridged.
    pub bridged_rows: usize,
    /// Share of the fluctuations within a level that is the sensor's own error, and was taken off.
    pub sensor_share: f64,
}

/// Fewest rows in a row without a speed that the command bridges: fewer are a straight line.
const STRETCH: usize = 4;

/// Share within which healthy sensors on real rigs agree (specification `rig.md`).
const HEALTHY: f64 = 0.01;
/// Share of the speed within which most readings of a healthy sensor stay about its gain.
const UNSTEADY: f64 = 0.005;
/// Share beyond what a rotor does within a row or two by which a reading is a drop-out.
const LEAVES: f64 = 0.02;
/// Times that gains and speed are found from each other.
const PASSES: usize = 2;

/// A speed on every row.
pub(crate) struct Fused {
    /// rev/min; empty without a speed.
    pub(crate) rpm: Vec<f64>,
    /// Standard deviation beyond that of the sensors where the speed was bridged, rev/min; 0 where it was measured, empty where it was everywhere.
    pub(crate) sd: Vec<f64>,
    /// Rows on which nobody read it while the rotor went from one speed to another, in order.
    pub(crate) unread: Vec<usize>,
    /// How it was made.
    pub(crate) how: Consensus,
}

/// The consensus speed.
pub(crate) fn of(log: &Log) -> Fused {
    let present: Vec<&str> =
        SPEED.into_iter().filter(|s| log.column(s).is_some_and(|c| c.iter().any(|v| v.is_finite()))).collect();
    if present.is_empty() {
        return Fused { rpm: Vec::new(), sd: Vec::new(), unread: Vec::new(), how: Consensus::default() };
    }
    let all = median_of(log, &present, &vec![1.0; present.len()]);
    let scale = all.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max).max(1.0);
    let excluded: Vec<&str> = if present.len() >= 3 {
        present.iter().copied().filter(|name| disagrees(log, name, &all, scale)).collect()
    } else {
        Vec::new()
    };
    let kept: Vec<&str> = if excluded.len() * 2 < present.len() {
        present.iter().copied().filter(|n| !excluded.contains(n)).collect()
    } else {
        present.clone()
    };
    let excluded = if kept.len() == present.len() { Vec::new() } else { excluded };
    let mut rpm = if excluded.is_empty() { all } else { median_of(log, &kept, &vec![1.0; kept.len()]) };
    // a median of sensors that differ by their gains is now one of them and now another, where one is lost or bends away; one alone is itself
    for _ in 0..if kept.len() > 1 { PASSES } else { 0 } {
        let gains: Vec<f64> = kept.iter().map(|name| gain(log, name, &rpm, scale)).collect();
        rpm = median_of(log, &kept, &gains);
    }
    let dropped = remove_dropouts(&mut rpm, scale);
    let sd = bridge_by_command(log, &mut rpm);
    let unread = unread(&rpm, log.column("pulse_us"));
    let bridged_rows = dropped + sd.iter().filter(|sd| **sd > 0.0).count();
    let how = Consensus {
        channels: kept.iter().map(|s| (*s).to_owned()).collect(),
        excluded: excluded.iter().map(|s| (*s).to_owned()).collect(),
        bridged_rows,
        sensor_share: 0.0,
    };
    Fused { rpm: bridge(&log.t, &rpm), sd, unread, how }
}

/// Fills stretches without a speed with what the command makes of the rotor, moved to the readings at both ends: by what its level is off all along,
/// by what it is off on its way for as long as the way takes. What is left is bridged by straight lines. Gives the standard deviation of each
/// row that was filled; empty where none was.
fn bridge_by_command(log: &Log, rpm: &mut [f64]) -> Vec<f64> {
    let measured: Vec<usize> = (0..rpm.len()).filter(|i| rpm[*i].is_finite()).collect();
    let stretches: Vec<(usize, usize)> = measured.windows(2).filter(|w| w[1] - w[0] > STRETCH).map(|w| (w[0], w[1])).collect();
    // a speed that is logged on some rows only has no gaps
    if stretches.is_empty() || stretches.len() * 2 * STRETCH > measured.len() {
        return Vec::new();
    }
    let Some(drive) = Drive::of(log, rpm) else { return Vec::new() };
    let mut sd = vec![0.0; rpm.len()];
    for (from, to) in stretches {
        let off = [from, to].map(|i| drive.off(i, rpm[i]));
        for i in from + 1..to {
            let share = (log.t[i] - log.t[from]) / (log.t[to] - log.t[from]);
            let of_end = |end: usize, (level, moving): (f64, f64)| level + moving * drive.left(end, log.t[i] - log.t[end]);
            rpm[i] = (drive.speed[i] + (1.0 - share) * of_end(from, off[0]) + share * of_end(to, off[1])).max(0.0);
            // what is known at both ends is known less in between
            sd[i] = drive.sd[i] * (4.0 * share * (1.0 - share)).sqrt();
        }
    }
    sd
}

/// Rows without a speed between readings that are far apart: a straight line says nothing of when the rotor went from the one to the other. So before
/// the first reading and behind the last one, where the command is another than there. None where the speed is logged on some rows only: there
/// lines are all there is.
fn unread(rpm: &[f64], pulse: Option<&[f64]>) -> Vec<usize> {
    let measured: Vec<usize> = (0..rpm.len()).filter(|i| rpm[*i].is_finite()).collect();
    let (Some(first), Some(last)) = (measured.first().copied(), measured.last().copied()) else { return Vec::new() };
    if measured.len() * 2 <= rpm.len() {
        return Vec::new();
    }
    let another = |i: usize, reading: usize| pulse.is_some_and(|p| (p[i] - p[reading]).abs() > CALM_US);
    let between = measured.windows(2).filter(|w| far(rpm[w[0]], rpm[w[1]])).flat_map(|w| w[0] + 1..w[1]);
    let behind = (last + 1..rpm.len()).filter(|i| another(*i, last));
    (0..first).filter(|i| another(*i, first)).chain(between).chain(behind).collect()
}

/// One sensor of the speed.
struct Sensor<'l> {
    readings: &'l [f64],
    flags: Option<&'l [f64]>,
    gain: f64,
}

impl Sensor<'_> {
    /// Its reading over its gain; nothing where it is missing.
    fn at(&self, row: usize) -> Option<f64> {
        self.readings[row].is_finite().then(|| self.readings[row] / self.gain)
    }

    fn is_wrong(&self, row: usize) -> bool {
        self.flags.is_some_and(|f| board::is_wrong(f[row]))
    }
}

/// Median of some channels on each row, each over its gain. Where no two agree, readings that the rows around rule out have no part.
fn median_of(log: &Log, names: &[&str], gains: &[f64]) -> Vec<f64> {
    let of =
        |(name, gain): (&&str, &f64)| Some(Sensor { readings: log.column(name)?, flags: board::flags(log, name), gain: *gain });
    let sensors: Vec<Sensor<'_>> = names.iter().zip(gains).filter_map(of).collect();
    settled(log.len(), &|i| {
        let good: Vec<f64> = sensors.iter().filter(|s| !s.is_wrong(i)).filter_map(|s| s.at(i)).collect();
        if good.is_empty() { sensors.iter().filter_map(|s| s.at(i)).collect() } else { good }
    })
}

/// The median of each row's readings. Where no two of them agree, those that lie beyond what the nearest rows with agreement span are left out, if
/// another lies within: of two sensors one of which drops out none can be outvoted, but no rotor leaves its way for a row.
fn settled(rows: usize, readings: &dyn Fn(usize) -> Vec<f64>) -> Vec<f64> {
    let mut out: Vec<f64> = (0..rows).map(|i| agreement(readings(i))).collect();
    let (mut before, mut i) = (None, 0);
    while i < rows {
        if out[i].is_finite() {
            before = Some(out[i]);
            i += 1;
            continue;
        }
        let end = (i..rows).find(|k| out[*k].is_finite()).unwrap_or(rows);
        let after = out.get(end).copied();
        let span = before.zip(after).map(|(a, b): (f64, f64)| (1.0 - LEAVES) * a.min(b)..=(1.0 + LEAVES) * a.max(b));
        for (k, slot) in out.iter_mut().enumerate().take(end).skip(i) {
            let mut row = readings(k);
            if let Some(span) = span.as_ref().filter(|span| row.iter().any(|v| span.contains(v))) {
                row.retain(|v| span.contains(v));
            }
            *slot = if row.is_empty() { f64::NAN } else { median(&mut row) };
        }
        i = end;
    }
    out
}

/// The median of a row's readings where two of them agree as healthy sensors do; nothing finite elsewhere.
fn agreement(mut row: Vec<f64>) -> f64 {
    row.sort_unstable_by(f64::total_cmp);
    let agree = |w: &[f64]| w[1] - w[0] <= HEALTHY * w[1].abs();
    if row.windows(2).any(agree) { median(&mut row) } else { f64::NAN }
}

/// Readings of a channel over the speed of all, while the rotor turns.
fn shares(log: &Log, name: &str, all: &[f64], scale: f64) -> Vec<f64> {
    let readings = log.column(name).unwrap_or_default().iter().zip(all);
    readings.filter(|(v, m)| v.is_finite() && m.is_finite() && **m > 0.1 * scale).map(|(v, m)| v / m).collect()
}

/// Gain of a channel against the speed of all; one that reads next to nothing has none.
fn gain(log: &Log, name: &str, all: &[f64], scale: f64) -> f64 {
    let gain = median(&mut shares(log, name, all, scale));
    if gain > 0.5 { gain } else { 1.0 }
}

/// Whether a channel disagrees with the median of all, while the rotor turns: by more than the gains of healthy sensors, or mostly by more than
/// [`UNSTEADY`] about its own gain.
fn disagrees(log: &Log, name: &str, all: &[f64], scale: f64) -> bool {
    let mut shares = shares(log, name, all, scale);
    if shares.is_empty() {
        return false;
    }
    let gain = median(&mut shares);
    let unsteady = median(&mut shares.iter().map(|share| (share - gain).abs()).collect::<Vec<f64>>());
    (gain - 1.0).abs() > HEALTHY || unsteady > UNSTEADY
}

/// A speed that leaves by more than 2 % for at most three rows and comes back to within 1 % is a sensor's drop-out:
/// no rotor does that. Such rows become missing and are bridged.
fn remove_dropouts(rpm: &mut [f64], scale: f64) -> usize {
    let mut removed = 0;
    let finite: Vec<usize> = (0..rpm.len()).filter(|i| rpm[*i].is_finite()).collect();
    let mut k = 1;
    while k + 1 < finite.len() {
        let before = rpm[finite[k - 1]];
        if before > 0.05 * scale && (rpm[finite[k]] - before).abs() > LEAVES * before {
            let back = (1..=3).find(|m| finite.get(k + m).is_some_and(|j| (rpm[*j] - before).abs() < 0.01 * before));
            if let Some(m) = back {
                for j in &finite[k..k + m] {
                    rpm[*j] = f64::NAN;
                    removed += 1;
                }
                k += m;
            }
        }
        k += 1;
    }
    removed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Column;

    /// A rotor that follows levels of the command; its only probe reads nothing from a start on, or is lost along a ramp that the levels know
    /// little of.
    #[test]
    fn a_gap_is_bridged_by_the_way_the_rotor_had() {
        let n = 3000;
        let t: Vec<f64> = (0..n).map(|i| 0.05 * f64::from(i)).collect();
        let ramp = |i: i32| (2000..2600).contains(&i).then(|| 1200.0 + f64::from(i - 2000) * 0.5);
        let level = |i: i32| if i < 100 { 1000.0 } else { 1150.0 + f64::from(i / 100 * 7 % 9) * 80.0 };
        let pulse: Vec<f64> = (0..n).map(|i| ramp(i).unwrap_or_else(|| level(i))).collect();
        // steps come half a row before they are logged, and a ramp is on another curve than the levels
        let goal = |i: usize| if ramp(i as i32).is_some() { 6.3 } else { 6.0 } * (pulse[i] - 1000.0);
        let mut truth = vec![0.0];
        for i in 1..pulse.len() {
            let late = if (pulse[i] - pulse[i - 1]).abs() > 10.0 { 0.5 } else { 1.0 };
            let last: f64 = truth[i - 1];
            truth.push(goal(i) + (last - goal(i)) * f64::exp(-0.05 * late / 0.2));
        }
        for lost in [101..140, 2150..2400] {
            let mut rpm = truth.clone();
            // the first reading of the start is one of nothing yet
            rpm[100] = 0.0;
            rpm[lost.clone()].fill(f64::NAN);
            let columns = [("pulse_us", pulse.clone()), ("rpm", rpm)].map(|(name, values)| Column { name: name.into(), values });
            let log = Log { t: t.clone(), columns: columns.to_vec(), ..Log::default() };
            let found = of(&log).rpm;
            let off = |i: usize| (found[i] - truth[i]).abs();
            let most = lost.clone().skip(4).map(off).fold(0.0, f64::max);
            assert!(most < 0.1 * truth[lost.end], "{lost:?}: {most} of {} rev/min", truth[lost.end]);
        }
    }

    /// Rows without a reading between two levels are unread, and those of another command at the ends; those of a level, and those of a speed that is
    /// seldom logged, are lines.
    #[test]
    fn nobody_has_read_the_rows_between_two_levels() {
        let levels: Vec<f64> = (0..60).map(|i| if i < 30 { 1000.0 } else { 4000.0 }).collect();
        let pulse: Vec<f64> = (0..60)
            .map(|i| [1100.0, 1200.0, 1400.0, 1500.0][usize::from(i > 0) + usize::from(i > 29) + usize::from(i > 58)])
            .collect();
        let without = |rows: &[usize]| {
            let mut rpm = levels.clone();
            rows.iter().for_each(|row| rpm[*row] = f64::NAN);
            unread(&rpm, Some(&pulse))
        };
        assert_eq!(without(&[10, 30, 31, 50]), vec![30, 31]);
        assert_eq!(without(&[0, 1, 2, 58, 59]), vec![0, 59]);
        assert_eq!(without(&(0..60).filter(|i| i % 3 > 0).collect::<Vec<_>>()), Vec::<usize>::new());
    }

    /// One of two sensors drops out while the rotor speeds up; of three one is lost and one on its way back. On the way up both of two may be right.
    #[test]
    fn the_rows_around_outvote_a_drop_out() {
        let mut rows: Vec<Vec<f64>> = (0..9).map(|i| 4000.0 + 30.0 * f64::from(i)).map(|v| vec![v, v + 4.0, v + 2.0]).collect();
        rows[2] = vec![2000.0, 4064.0];
        rows[5] = vec![1700.0, 4020.0, 4152.0];
        let speed = settled(rows.len(), &|i| rows[i].clone());
        assert_eq!((speed[1], speed[2], speed[5]), (4032.0, 4064.0, 4152.0));
        let step = [vec![2000.0, 2001.0], vec![2600.0, 2900.0], vec![3500.0, 3501.0]];
        assert_eq!(settled(3, &|i| step[i].clone())[1], 2750.0);
        let open = [vec![2000.0, 4000.0], vec![4000.0, 4001.0], vec![]];
        assert_eq!(settled(3, &|i| open[i].clone())[0], 3000.0, "nothing tells before they first agree");
        assert!(settled(3, &|i| open[i].clone())[2].is_nan());
    }
}
