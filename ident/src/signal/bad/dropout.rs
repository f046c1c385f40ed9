//! A speed probe that has lost its mark.
//!
//! What it is: readings that fall at once below what the other probes, the command and the load say, for as long as it takes, and the slow way
//! back. Each witness counts as far as it can tell a departure of that depth on that row: a command knows little while the rotor is
//! on its way, a slow load cell little after a jump.
//! What can go wrong: with no witness that can tell, nothing is found; of two probes alone without a command and without a load none is believed.
//! Units: rows, rev/min.
//! Reference: analytical redundancy, Chow & Willsky 1984; contaminated normal distribution, Tukey 1960.

use super::curve::Curve;
use super::excursion::{Event, LONGEST};
use super::scale::times;
use super::witness::Witnesses;
use crate::log::SPEED;
use crate::numeric::chance::gathers;
use crate::numeric::order::{median, quantum};
use crate::signal::drive::{Drive, SIGMA};
use crate::signal::stretches::{blocks, bridge};

/// Share of a channel's readings that may be lost: one that loses more has a fault with a name.
const MOST: f64 = 1.0 / 3.0;
/// Share of a departure that a witness must see of it, and that the reading must fall by at once.
const HALF: f64 = 0.5;
/// Rows along which the beginning of a loss is looked for: a probe that is dead all along must not cost the square of them.
const REACH: usize = 4 * LONGEST;
/// Rows after a step of the command in which what recurs belongs to the rotor.
const RIGHT_AFTER: usize = 4;
/// Least share of the speed that a probe without its mark loses: less is what rotors, supplies and other causes do.
const DEPTH: f64 = 0.1;
/// Scales within which a reading is back.
const BACK: f64 = 3.0;
/// Share of the depth that may be left when it is back, and times the usual scale of a witness up to which that can be told.
const RECOVERED: f64 = 0.1;
const ABLE: f64 = 1.5;
/// Readings in a row that must be back.
const AGAIN: usize = 3;
/// Readings that a way back is followed along.
const ALONG: usize = 15;
/// Time before and after in which a load that moves may be late, s: the slowest meters of thrust stands average half a second.
const LATE: f64 = 1.0;

/// What one witness says of a probe.
struct Witness {
    /// Speed on every row, rev/min.
    said: Vec<f64>,
    /// How well it knows, one standard deviation.
    sd: Vec<f64>,
    /// The same on most rows.
    usual: f64,
    /// How far above what it said the speed may be for all it knows, rev/min.
    above: Vec<f64>,
}

impl Witness {
    fn new(said: Vec<f64>, sd: Vec<f64>) -> Self {
        let usual = median(&mut sd.clone());
        Self { usual, above: vec![0.0; said.len()], said, sd }
    }
}

/// The rows in which a probe has lost its mark.
pub(super) fn found(witnesses: &Witnesses<'_>, name: &'static str) -> Vec<Event> {
    let Some(read) = witnesses.clean(name) else { return Vec::new() };
    let all = [others(witnesses, name, read), drive(witnesses, read), load(witnesses, read)];
    let all: Vec<Witness> = all.into_iter().flatten().collect();
    let measured = read.iter().filter(|v| v.is_finite()).count();
    let top = read.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
    if all.is_empty() || measured < super::FEWEST || top <= 0.0 {
        return Vec::new();
    }
    let step = quantum(read).max(1e-4 * top);
    let judge =
        Judge { read, all: &all, measured, top, step, steps: witnesses.jumps(), blocks: blocks(&witnesses.log.t, read, false) };
    let mut out = Vec::new();
    let (mut row, mut told) = (0, 0);
    while row < read.len() {
        match judge.event(row).filter(|e| e.rows.start >= told) {
            Some(event) => {
                row = event.rows.end;
                told = row;
                out.push(event);
            }
            None => row += 1,
        }
    }
    judge.without_recurring(&mut out);
    let lost: usize = out.iter().map(|e| e.rows.len()).sum();
    if lost as f64 > MOST * measured as f64 { Vec::new() } else { out }
}

struct Judge<'w> {
    read: &'w [f64],
    all: &'w [Witness],
    measured: usize,
    top: f64,
    /// Step of its display, or the last digit that is trusted.
    step: f64,
    /// First rows of the steps of the command, in order.
    steps: Vec<usize>,
    /// First rows after gaps in time.
    blocks: Vec<(usize, f64)>,
}

impl Judge<'_> {
    /// By how much a reading is too low for a witness, and how much it would have to be.
    fn low(&self, witness: &Witness, row: usize) -> (f64, f64) {
        let sd = self.sd(witness, row);
        (witness.said[row] - self.read[row], sd * times(self.measured, self.top / sd))
    }

    /// How well a witness knows the probe's reading: no better than its display.
    fn sd(&self, witness: &Witness, row: usize) -> f64 {
        witness.sd[row].max(self.step)
    }

    /// A loss that begins at a row, by the witness that tells it best and is not refuted.
    fn event(&self, row: usize) -> Option<Event> {
        let tells = |w: &&Witness| self.read[row].is_finite() && self.low(w, row).0 > self.low(w, row).1;
        let mut telling: Vec<&Witness> = self.all.iter().filter(tells).collect();
        telling.sort_by(|a, b| a.sd[row].total_cmp(&b.sd[row]));
        telling.into_iter().find_map(|witness| {
            let depth = self.low(witness, row).0;
            self.event_by(self.begins(row, depth, witness), row, depth, witness)
        })
    }

    /// Whether a witness that could tell a departure says on most of its rows that there is none.
    fn refuted(&self, event: &Event, depth: f64, best: &Witness) -> bool {
        let gone = |i: &usize| self.read[*i].is_finite() && self.low(best, *i).0 > HALF * depth;
        let rows: Vec<usize> = event.rows.clone().filter(gone).collect();
        let says_no = |w: &Witness| {
            let able: Vec<usize> = rows.iter().copied().filter(|i| BACK * self.sd(w, *i) + w.above[*i] < HALF * depth).collect();
            let against = able.iter().filter(|i| self.low(w, **i).0 < HALF * depth).count();
            2 * against > able.len()
        };
        self.all.iter().any(says_no)
    }

    /// Whether a departure begins with a step of the command and ends with one: so does what the level itself is off by. A probe that sees
    /// less than half of what turns has lost its mark all the same.
    fn is_of_level(&self, event: &Event, depth: f64) -> bool {
        let at_step = |row: usize| (row.saturating_sub(1)..=row + 1).any(|i| self.steps.binary_search(&i).is_ok());
        at_step(event.rows.start) && at_step(event.rows.end) && depth < HALF * event.expected
    }

    /// Takes out what begins right after steps of the command, where more does than chance brings there: it is how the rotor arrives.
    fn without_recurring(&self, events: &mut Vec<Event>) {
        let after = |row: usize| {
            let last = self.steps.partition_point(|s| *s <= row + 1).checked_sub(1);
            last.is_some_and(|k| row < self.steps[k] + RIGHT_AFTER)
        };
        let share = (0..self.read.len()).filter(|row| after(*row)).count() as f64 / self.read.len() as f64;
        let there = events.iter().filter(|e| after(e.rows.start)).count();
        if gathers(there, events.len(), share) {
            events.retain(|e| !after(e.rows.start));
        }
    }

    /// First row of its block from which on the reading is half as low as on this one: while the rotor is on its way nobody can tell at once.
    fn begins(&self, row: usize, depth: f64, witness: &Witness) -> usize {
        let block = self.block(row);
        let low = |i: &usize| !self.read[*i].is_finite() || witness.said[*i] - self.read[*i] > HALF * depth;
        (block..row).rev().take(REACH).take_while(low).last().unwrap_or(row)
    }

    /// The same, or the row of a step right before it: there the rotor has made a small part of its way, of which a lost mark shows next to nothing.
    fn head(&self, row: usize, witness: &Witness) -> usize {
        let before = row.saturating_sub(1);
        let low = self.read[before] < HALF * witness.said[before];
        if low && before >= self.block(row) && self.steps.binary_search(&before).is_ok() { before } else { row }
    }

    /// First row of the stretch without a gap in time that a row is in.
    fn block(&self, row: usize) -> usize {
        self.blocks.partition_point(|b| b.0 <= row).checked_sub(1).map_or(0, |k| self.blocks[k].0)
    }

    /// Whether the reading has fallen at once, and by itself, from where it was right. Of a rotor that the log has not seen turn yet nobody knows.
    fn falls(&self, row: usize, depth: f64, witness: &Witness) -> bool {
        let before: Vec<usize> = (self.block(row)..row).rev().filter(|i| self.read[*i].is_finite()).take(2 * AGAIN - 1).collect();
        let right = |i: &&usize| (witness.said[**i] - self.read[**i]).abs() < HALF * depth;
        // its first readings may be missing already: zeros are no readings
        let Some(first) = (row..self.read.len()).find(|i| self.read[*i].is_finite()) else { return false };
        let fell = |i: &usize| (self.read[*i] - self.read[first]) - (witness.said[*i] - witness.said[first]) > HALF * depth;
        before.iter().filter(right).count() >= AGAIN && before.iter().take(2).any(fell)
    }

    /// Whether the reading itself has lost half of the share that the whole loss comes to, beside its witness too, or is next to nothing of a rotor
    /// that turns. A rotor that coasts down ahead of what the witness says gets there as well, but not at once; and a load that rises late makes a
    /// steady reading look low.
    fn falls_at_once(&self, row: usize, worst: usize, witness: &Witness) -> bool {
        let is_read = |i: &usize| self.read[*i].is_finite();
        let before = || (self.block(row)..row).rev().filter(is_read).take(2);
        let share = |i: usize| self.read[i] / witness.said[i];
        let (reading, beside) = (before().map(|i| self.read[i]).fold(0.0, f64::max), before().map(share).fold(0.0, f64::max));
        let mut first = (row..self.read.len()).filter(is_read).take(AGAIN);
        let kept = 1.0 - HALF * self.loses(worst, witness);
        first.clone().all(|i| self.read[i] < DEPTH * witness.said[i])
            || first.any(|i| self.read[i] < kept * reading && share(i) < kept * beside)
    }

    /// Share of the speed that the reading lacks.
    fn loses(&self, row: usize, witness: &Witness) -> f64 {
        1.0 - self.read[row] / witness.said[row]
    }

    /// The loss that began at a row and that a witness tells on a later one to be so deep.
    fn event_by(&self, row: usize, tells: usize, first: f64, witness: &Witness) -> Option<Event> {
        if !self.falls(row, first, witness) {
            return None;
        }
        let usual = ABLE * witness.usual.max(self.step);
        let (mut worst, mut depth, mut back, mut end) = (tells, first, 0, row + 1);
        for i in row..self.read.len() {
            if !self.read[i].is_finite() {
                continue;
            }
            let (off, sd) = (self.low(witness, i).0, self.sd(witness, i));
            // where the command steps a witness is off by the step itself, and knows it
            if off > depth && off > BACK * sd {
                (worst, depth) = (i, off);
            }
            // on its way the rotor hides whether the probe is back
            if BACK * sd > (BACK * usual).max(RECOVERED * depth) {
                continue;
            }
            // what was lost is so until it reads as much as the rotor's way says
            let near = off + witness.above[i] < BACK * sd || self.rests(row, i, worst, witness);
            back = if near && i > tells { back + 1 } else { 0 };
            if back == 0 {
                end = i + 1;
            }
            if back == AGAIN {
                break;
            }
        }
        // a single reading is for those who look at single readings
        let rows = self.head(row, witness)..end;
        let event = Event { expected: witness.said[worst], rows, worst, at_step: false, silent: false };
        let loses = depth > DEPTH * event.expected && self.falls_at_once(row, worst, witness);
        let stands = loses
            && event.rows.len() > super::SINGLE
            && !self.is_of_level(&event, depth)
            && !self.refuted(&event, depth, witness);
        stands.then_some(event)
    }

    /// Whether a reading has come most of its way back and stays there, for as long again as it took: what is left is what the witness is off by.
    fn rests(&self, from: usize, row: usize, worst: usize, witness: &Witness) -> bool {
        let off = |i: usize| witness.said[i] + witness.above[i] - self.read[i];
        let long = ALONG.max(row - from);
        let next = (row + 1..self.read.len()).filter(|i| self.read[*i].is_finite()).take(long);
        let mut next: Vec<f64> = next.map(off).collect();
        if self.loses(row, witness) > HALF * self.loses(worst, witness) || next.len() < ALONG {
            return false;
        }
        // from one reading to the next: a way back that goes on is no noise
        let mut steps: Vec<f64> = next.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
        let noise = SIGMA * std::f64::consts::FRAC_1_SQRT_2 * median(&mut steps);
        off(row) - median(&mut next) < BACK * noise.max(self.step)
    }
}

/// The other probes: the highest of them that two agree on, or the only one.
fn others(witnesses: &Witnesses<'_>, name: &str, read: &[f64]) -> Option<Witness> {
    let channels: Vec<&[f64]> = SPEED.iter().filter(|s| **s != name).filter_map(|s| witnesses.clean(s)).collect();
    let of = |i: usize| median(&mut channels.iter().map(|c| c[i]).filter(|v| v.is_finite()).collect::<Vec<_>>());
    let said: Vec<f64> = (0..read.len()).map(of).collect();
    let said = bridged(witnesses, &said)?;
    let usual = usual(read, &said, &|_| true)?;
    let moves = |i: usize| 0.5 * (said[i] - said[i.saturating_sub(1)]).abs();
    let sd = (0..said.len()).map(|i| usual.hypot(moves(i))).collect();
    Some(Witness::new(said, sd))
}

/// The command and the rotor's own dynamics. A rotor that slows down is anywhere between what one time constant says and where it goes to: what
/// it is at least is the lower of the two.
fn drive(witnesses: &Witnesses<'_>, read: &[f64]) -> Option<Witness> {
    let drive = Drive::of(witnesses.log, read)?;
    let least: Vec<f64> = drive.speed.iter().zip(&drive.asked).map(|(speed, asked)| speed.min(*asked)).collect();
    let above = drive.speed.iter().zip(&least).map(|(speed, least)| speed - least).collect();
    Some(Witness { above, ..Witness::new(least, drive.sd) })
}

/// What the load says of the speed that makes it.
fn load(witnesses: &Witnesses<'_>, read: &[f64]) -> Option<Witness> {
    let of_channel = |name: &&str| {
        let signal = bridged(witnesses, witnesses.clean(name)?)?;
        let curve = Curve::through(signal.iter().zip(read).map(|(x, y)| (*x, *y)).collect())?;
        let said: Vec<f64> = signal.iter().map(|x| curve.at(*x)).collect();
        let moves = spread(&witnesses.t, &said);
        let quiet = median(&mut moves.clone());
        let usual = usual(read, &said, &|i| moves[i] <= quiet)?;
        // next to no load does not tell slow from standing: the speed goes with its root, and the curve's first line knows nothing of that
        let least = curve.first_line();
        let unsure = |(m, (x, said)): (&f64, (&f64, &f64))| usual.hypot(HALF * m).max(if *x <= least { *said } else { 0.0 });
        let sd = moves.iter().zip(signal.iter().zip(&said)).map(unsure).collect();
        Some(Witness::new(said, sd))
    };
    let all = ["thrust_n", "torque_nm", "current_a"].iter().filter_map(of_channel);
    all.min_by(|a, b| a.usual.total_cmp(&b.usual))
}

/// What a signal changes by within the time that a meter may be late.
fn spread(t: &[f64], said: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; said.len()];
    let mut sums = vec![0.0];
    said.iter().for_each(|v| sums.push(sums[sums.len() - 1] + v));
    let mean = |a: usize, b: usize| (sums[b] - sums[a]) / (b - a).max(1) as f64;
    let (mut from, mut to) = (0, 0);
    for (i, own) in out.iter_mut().enumerate() {
        while t[from] < t[i] - LATE {
            from += 1;
        }
        while to < t.len() && t[to] <= t[i] + LATE {
            to += 1;
        }
        // ends and middle tell a jump; noise within is the witness' own
        let part = ((to - from) / 4).max(1);
        *own = (mean(from, (from + part).min(to)) - mean(to.saturating_sub(part).max(from), to)).abs();
    }
    out
}

/// Standard deviation of a probe about what a witness says, on the rows where it can be told.
fn usual(read: &[f64], said: &[f64], counts: &dyn Fn(usize) -> bool) -> Option<f64> {
    let measured = (0..read.len()).filter(|i| read[*i].is_finite() && counts(*i));
    let mut off: Vec<f64> = measured.map(|i| (read[i] - said[i]).abs()).collect();
    (!off.is_empty()).then(|| SIGMA * median(&mut off))
}

fn bridged(witnesses: &Witnesses<'_>, values: &[f64]) -> Option<Vec<f64>> {
    let samples = values.iter().filter(|v| v.is_finite()).count();
    (samples >= super::FEWEST).then(|| bridge(&witnesses.log.t, values))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether the readings have fallen at once at their third row, beside a witness.
    fn fell(read: &[f64], said: &[f64], worst: usize) -> bool {
        let witness = Witness::new(said.to_vec(), vec![6.0; said.len()]);
        let (steps, blocks, top) = (vec![0], Vec::new(), read.iter().copied().fold(0.0, f64::max));
        let judge = Judge { read, all: &[], measured: read.len(), top, step: 0.1, steps, blocks };
        judge.falls_at_once(2, worst, &witness)
    }

    /// A rotor that slows down a little faster than two time constants say is below its witness in the end, and never lost its mark.
    #[test]
    fn a_rotor_that_slows_down_has_not_fallen_at_once() {
        let read = [
            3412.0, 2983.0, 2623.0, 2321.0, 2064.0, 1848.0, 1668.0, 1514.0, 1379.0, 1270.0, 1177.0, 1098.0, 1030.0, 970.0, 920.0,
            881.0, 845.0,
        ];
        let said = [
            3420.0, 3003.0, 2671.0, 2384.0, 2140.0, 1931.0, 1754.0, 1603.0, 1475.0, 1366.0, 1272.0, 1193.0, 1126.0, 1068.0,
            1019.0, 978.0, 942.0,
        ];
        assert!(!fell(&read, &said, 16));
        // the same way down, the mark lost on it
        let lost = [3412.0, 2983.0, 1900.0, 1700.0, 1500.0, 1350.0, 1200.0, 1100.0, 1000.0];
        assert!(fell(&lost, &said[..9], 8));
        // a witness that rises late beside a steady reading
        let steady = [3000.0; 9];
        assert!(!fell(&steady, &[3000.0, 3001.0, 3600.0, 3900.0, 4000.0, 4000.0, 4000.0, 4000.0, 4000.0], 4));
    }

    /// A rotor that comes down quicker than one time constant says, and a probe that is lost on such a way.
    fn run(read: impl Fn(usize, f64) -> f64) -> crate::log::Log {
        let rows = 1500;
        let pulse: Vec<f64> = (0..rows).map(|i| [1900.0, 1100.0, 1500.0][i / 100 % 3]).collect();
        let mut rpm = vec![0.0_f64];
        for i in 1..rows {
            let (last, goal) = (rpm[i - 1], 7.0 * (pulse[i] - 1000.0));
            // the higher it turns the harder the air brakes it
            let tau = if goal > last { 0.2 } else { 0.2 / (0.4 + last / 4000.0) };
            rpm.push(goal + (last - goal) * f64::exp(-0.04 / tau) + 2.0 * (0.7 * (i * i) as f64).sin());
        }
        let read = rpm.iter().enumerate().map(|(i, v)| read(i, *v)).collect();
        let columns = [("pulse_us", pulse), ("rpm", read)].map(|(name, values)| crate::log::Column { name: name.into(), values });
        let t = (0..rows).map(|i| 0.04 * i as f64).collect();
        crate::log::Log { t, columns: columns.to_vec(), ..Default::default() }
    }

    /// The rows that are found lost of it.
    fn lost(read: impl Fn(usize, f64) -> f64) -> Vec<std::ops::Range<usize>> {
        found(&Witnesses::of(&run(read)), "rpm").into_iter().map(|e| e.rows).collect()
    }

    /// The command says where a rotor goes to, and that it may be anywhere above that on its way down.
    #[test]
    fn on_its_way_down_a_rotor_is_somewhere_above_where_it_goes_to() {
        let log = run(|_, v| v);
        let witness = drive(&Witnesses::of(&log), log.column("rpm").expect("a speed")).expect("a command");
        // from 6 300 to 700 rev/min at row 700, from 700 to 3 500 at row 800
        assert!((701..704).all(|i| witness.said[i] < 900.0 && witness.above[i] > 500.0), "{:?}", &witness.said[700..705]);
        assert!((801..810).all(|i| witness.above[i] < 1.0), "{:?}", &witness.above[800..810]);
    }

    #[test]
    fn a_rotor_on_its_way_down_has_not_lost_its_mark() {
        assert_eq!(lost(|_, v| v), Vec::<std::ops::Range<usize>>::new());
        // below where the command sends it no rotor goes
        let deep = lost(|i, v| if (730..750).contains(&i) { 0.1 * v } else { v });
        assert!(matches!(&deep[..], [rows] if (730..733).contains(&rows.start) && (748..753).contains(&rows.end)), "{deep:?}");
    }

    #[test]
    fn the_way_back_of_a_probe_is_found_behind_missing_zeros() {
        let back = lost(|i, v| match i {
            840..850 => f64::NAN,
            850..890 => v * (1.0 - f64::exp(-((i - 849) as f64) / 10.0)),
            _ => v,
        });
        assert!(matches!(&back[..], [rows] if rows.start <= 850 && (865..895).contains(&rows.end)), "{back:?}");
    }
}
