//! A run held against its model while it goes on.
//!
//! What it is: [`expected`], what a model is off by on each row of a run, in noise floors: in what it was off by itself on rows of the same kind of
//! the run that it was identified from, noise included. [`Watch`] takes rows as they come and says from which row on the run has left its
//! model ([`Departure`]), by a two-sided cumulative sum a channel.
//! What can go wrong: a model without `left_*` keys is held to the noise of the run alone, once that shows; rows right after a jump of the load,
//! where every model is rough, count for little. A rig that is not tared, or has another supply, leaves its model from the first row on,
//! and that is true.
//! Units: noise floors; s.
//! Reference: Page 1954, Biometrika 41:100; Moustakides 1986, Annals of Statistics 14:1379 (optimal for a known shift); Siegmund 1985,
//! "Sequential Analysis", section II.6 (run length).

use crate::channel::{Context, Target};
use crate::log::{Column, Log};
use crate::model::Declared;
use crate::model::Model;
use crate::model::leftover::{self, Leftover};
use crate::signal::stretches::CALM_US;

/// Judged values of a year: eight hours on each of 250 days, ten values a second, each way on nine channels. A healthy rig is falsely accused once in it.
const RUN_LENGTH: f64 = 250.0 * 8.0 * 3600.0 * 10.0 * 2.0 * 9.0;
/// Most rows in a row that can be a sensor's drop-out (see [`crate::signal::consensus::Consensus`]): as many alone accuse nobody.
const DROP_OUT: f64 = 3.0;
/// Excess of a random walk over its barrier, in standard deviations (Siegmund 1985).
const EXCESS: f64 = 1.166;
/// Rows right before a jump may hold some of it: a row is judged when so many have followed.
const LATE: usize = 2;
/// Faster rows are joined to means over this time, s: what is judged as one value has one noise.
const ROW_S: f64 = 0.1;
/// Fewest rows that a run is judged from.
const FEWEST: usize = 8;

/// What a model is off by on a channel of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Expected {
    /// Channel.
    pub channel: &'static str,
    /// Measured less predicted and less what the model is known to be off by at that load; not a number where nothing was measured.
    pub residuals: Vec<f64>,
    /// Noise floor of each row; not a number where the model makes no claim: while a rotor runs down, and, where it does not say what it is off
    /// by on its way, while the load is on its way.
    pub floors: Vec<f64>,
}

impl Expected {
    /// The residual of a row in noise floors.
    #[must_use]
    pub fn in_floors(&self, row: usize) -> f64 {
        self.residuals[row] / self.floors[row]
    }
}

/// What a model is off by on every channel that it knows, row for row.
#[must_use]
pub fn expected(model: &Model, log: &Log) -> Vec<Expected> {
    let mut context = Context::of_clean(log, Some(model.start_pulse_us));
    context.steady_speed(model.sensor_share);
    context.against(Declared { model: Some(model) });
    let classes = leftover::classes(&context);
    let jumps = jumps(model, &context);
    let targets = context.targets.iter().filter(|t| !t.relation.is_evidence());
    targets.filter_map(|target| of_target(model, &context, target, &classes, &jumps)).collect()
}

/// For each row by how much the command has moved in the time that a load takes to settle, in jumps of the model's own run: a model is off
/// after a jump in proportion to it. Not a number where the model does not tell its jumps, and after a fall of the command deeper than any of
/// its own run: a rotor that nothing drives coasts, and in what time the model has not seen.
fn jumps(model: &Model, context: &Context) -> Vec<f64> {
    let own: Vec<f64> = model.course.iter().flat_map(|c| c.commands.windows(2).map(|w| (w[1].1 - w[0].1).powi(2))).collect();
    let usual = (own.iter().sum::<f64>() / own.len() as f64).sqrt();
    let Some(pulse) = context.pulse.as_ref().filter(|_| usual > 0.0) else { return vec![f64::NAN; context.len()] };
    let commands = model.course.iter().flat_map(|c| c.commands.windows(2));
    let deepest = commands.map(|w| w[0].1 - w[1].1).fold(0.0, f64::max);
    let settles = leftover::AGES[leftover::AGES.len() - 1];
    let mut from = 0;
    let of_row = |row: usize| {
        while context.t[from] < context.t[row] - settles {
            from += 1;
        }
        let (low, high) = pulse[from..=row].iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
        if high - pulse[row] > deepest + CALM_US { f64::NAN } else { (high - low) / usual }
    };
    (0..context.len()).map(of_row).collect()
}

fn of_target(model: &Model, context: &Context, target: &Target, classes: &[usize], jumps: &[f64]) -> Option<Expected> {
    let prediction = model.predict_at_its_own_supply(context, target.name)?;
    let left = model.leftovers.iter().find(|(channel, _)| channel == target.name).map(|(_, left)| left);
    let load = context.regressor(target.relation)?;
    let none = Leftover::default();
    let mut residuals = vec![f64::NAN; context.len()];
    for (row, y) in target.rows.iter().zip(&target.y) {
        residuals[*row] = y - prediction[*row] - left.unwrap_or(&none).known(load[*row]);
    }
    let own = target.noise.a.sqrt();
    let floor = |row: usize| match left {
        Some(left) => left.floor(load[row], classes[row], jumps[row]).map_or(f64::NAN, |floor| floor.max(own)),
        None => target.noise.rms,
    };
    Some(Expected { channel: target.name, residuals, floors: (0..context.len()).map(floor).collect() })
}

/// A cumulative sum one way.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    value: f64,
    /// Values since it was last empty, and their sum.
    values: usize,
    total: f64,
    /// Row at which it began.
    from: usize,
}

/// How a channel is judged: by the shift that is looked for, in noise floors.
#[derive(Debug, Clone, Copy)]
struct Rule {
    /// What is looked for. No value counts as more: a single wild one is no shift.
    shift: f64,
    /// Taken off each value: half of the shift, what days may differ by.
    slack: f64,
    /// The sum that accuses.
    barrier: f64,
}

impl Rule {
    fn of(shift: f64) -> Self {
        let slack = 0.5 * shift;
        // Siegmund's run length (exp(2kb) - 2kb - 1)/(2k^2), b = h + 1.166, solved for the barrier
        let wanted = 2.0 * slack * slack * RUN_LENGTH;
        let mut exponent = wanted.ln();
        for _ in 0..20 {
            exponent = (wanted + exponent + 1.0).ln();
        }
        let by_run_length = exponent / (2.0 * slack) - EXCESS;
        Self { shift, slack, barrier: by_run_length.max(DROP_OUT * (shift - slack)) }
    }
}

impl Sum {
    /// Takes a value; whether the barrier is passed.
    fn take(&mut self, value: f64, row: usize, rule: &Rule) -> bool {
        if self.value <= 0.0 {
            *self = Self { from: row, ..Self::default() };
        }
        self.value = (self.value + value.min(rule.shift) - rule.slack).max(0.0);
        self.values += 1;
        self.total += value;
        self.value > rule.barrier
    }
}

/// A run has left its model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Departure {
    /// Channel that shows it.
    pub channel: &'static str,
    /// Row from which on it is off, from 0.
    pub row: usize,
    /// Its time, s.
    pub t_s: f64,
    /// Mean departure since then, noise floors.
    pub floors: f64,
    /// Row at which that was certain.
    pub seen_row: usize,
    /// Its time, s.
    pub seen_s: f64,
}

/// What is shown of a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shown {
    /// Channel.
    pub channel: &'static str,
    /// Residual of the last row, noise floors; not a number where there is none.
    pub floors: f64,
}

/// Both sums of a channel.
#[derive(Debug, Clone, Copy)]
struct Judged {
    channel: &'static str,
    up: Sum,
    down: Sum,
}

/// Rows that are joined to one.
#[derive(Debug, Clone, Default)]
struct Joined {
    /// The first of them, and its time.
    row: usize,
    since_s: f64,
    last_s: f64,
    rows: usize,
    /// Sum and number of what was measured, column by column.
    sums: Vec<(f64, u32)>,
}

impl Joined {
    /// Whether a row at `t_s` begins another one.
    fn is_full(&self, t_s: f64) -> bool {
        self.rows > 0 && t_s - self.since_s > ROW_S * 0.999
    }

    fn take(&mut self, row: usize, t_s: f64, values: &[(&'static str, f64)]) {
        if self.rows == 0 {
            (self.row, self.since_s) = (row, t_s);
            self.sums = vec![(0.0, 0); values.len()];
        }
        self.rows += 1;
        self.last_s = t_s;
        for ((sum, n), (_, value)) in self.sums.iter_mut().zip(values).filter(|(_, (_, value))| value.is_finite()) {
            *sum += value;
            *n += 1;
        }
    }
}

/// A run under watch.
#[derive(Debug, Clone)]
pub struct Watch {
    model: Model,
    log: Log,
    /// For each row of the log the first of the rows that it was joined from.
    firsts: Vec<usize>,
    joined: Joined,
    rows: usize,
    rule: Rule,
    judged: usize,
    channels: Vec<Judged>,
    shown: Vec<Shown>,
    departure: Option<Departure>,
}

impl Watch {
    /// A run that has not begun; `floors` is the departure that is looked for, in noise floors.
    #[must_use]
    pub fn new(model: Model, floors: f64) -> Self {
        Self {
            model,
            log: Log::default(),
            firsts: Vec::new(),
            joined: Joined::default(),
            rows: 0,
            rule: Rule::of(floors),
            judged: 0,
            channels: Vec::new(),
            shown: Vec::new(),
            departure: None,
        }
    }

    /// Takes a row: its time and what was measured, column by column, the same columns each time.
    pub fn push(&mut self, t_s: f64, row: &[(&'static str, f64)]) {
        if self.log.columns.is_empty() {
            self.log.columns = row.iter().map(|(name, _)| Column { name: (*name).to_owned(), values: Vec::new() }).collect();
        }
        if self.joined.is_full(t_s) {
            self.join();
        }
        self.joined.take(self.rows, t_s, row);
        self.rows += 1;
    }

    fn join(&mut self) {
        let joined = std::mem::take(&mut self.joined);
        self.firsts.push(joined.row);
        self.log.t.push(joined.last_s);
        for (column, (sum, n)) in self.log.columns.iter_mut().zip(joined.sums) {
            column.values.push(if n > 0 { sum / f64::from(n) } else { f64::NAN });
        }
    }

    /// Judges the rows that came since the last time; gives the departure, once there is one.
    pub fn judge(&mut self) -> Option<Departure> {
        let rows = self.log.len();
        if rows < FEWEST || rows - LATE <= self.judged {
            return self.departure;
        }
        let expected = expected(&self.model, &self.log);
        self.shown = expected.iter().map(|e| Shown { channel: e.channel, floors: e.in_floors(rows - 1) }).collect();
        for row in self.judged..rows - LATE {
            for e in &expected {
                let value = e.in_floors(row);
                if value.is_finite() {
                    self.take(e.channel, row, value);
                }
            }
        }
        self.judged = rows - LATE;
        self.departure
    }

    fn take(&mut self, channel: &'static str, row: usize, value: f64) {
        let place = self.channels.iter().position(|c| c.channel == channel).unwrap_or_else(|| {
            self.channels.push(Judged { channel, up: Sum::default(), down: Sum::default() });
            self.channels.len() - 1
        });
        let judged = &mut self.channels[place];
        let up = judged.up.take(value, row, &self.rule);
        let down = judged.down.take(-value, row, &self.rule);
        let (sum, sign) = if up { (judged.up, 1.0) } else { (judged.down, -1.0) };
        if (up || down) && self.departure.is_none() {
            self.departure = Some(Departure {
                channel,
                row: self.firsts[sum.from],
                t_s: self.log.t[sum.from],
                floors: sign * sum.total / sum.values as f64,
                seen_row: self.rows - 1,
                seen_s: self.joined.last_s,
            });
        }
    }

    /// The last row in noise floors, channel by channel.
    #[must_use]
    pub fn shown(&self) -> &[Shown] {
        &self.shown
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A barrier is where the run length says; below it stands what three drop-outs give.
    #[test]
    fn the_barrier_keeps_the_run_length_and_outlasts_a_drop_out() {
        for shift in [1.0, 2.0, 8.0] {
            let rule = Rule::of(shift);
            let b = 2.0 * rule.slack * (rule.barrier + EXCESS);
            let run_length = (b.exp() - b - 1.0) / (2.0 * rule.slack * rule.slack);
            assert!(run_length >= 0.999 * RUN_LENGTH, "{shift}: {run_length}");
            let mut sum = Sum::default();
            assert!((0..3).all(|row| !sum.take(1000.0, row, &rule)), "{shift}: three rows alone");
        }
    }

    #[test]
    fn a_shift_is_named_from_its_first_row() {
        let rule = Rule::of(8.0);
        let mut sum = Sum::default();
        let noise = |row: usize| if row.is_multiple_of(2) { 0.8 } else { -0.8 };
        assert!((0..1000).all(|row| !sum.take(noise(row), row, &rule)));
        assert!((1000..1500).all(|row| !sum.take(3.5 + noise(row), row, &rule)), "less than half of it is how days differ");
        let seen = (1500..1600).find(|row| sum.take(9.0 + noise(*row), *row, &rule)).expect("it is seen");
        assert_eq!((seen, sum.from), (1503, 1500));
    }

    #[test]
    fn fast_rows_are_joined_to_means_and_slow_ones_stand_alone() {
        let mut fast = Watch::new(Model::default(), 8.0);
        (0..100).for_each(|row| fast.push(f64::from(row) * 0.01, &[("rpm", f64::from(row))]));
        assert_eq!((fast.log.len(), &fast.firsts[..3]), (9, &[0, 10, 20][..]));
        assert_eq!(fast.log.column("rpm").map(|v| v[3]), Some(34.5));
        let mut slow = Watch::new(Model::default(), 8.0);
        (0..100).for_each(|row| slow.push(f64::from(row) * 0.1, &[("rpm", if row == 7 { f64::NAN } else { 1.0 })]));
        assert_eq!(slow.log.len(), 99);
        assert!(slow.log.column("rpm").is_some_and(|v| v[7].is_nan() && v[8] == 1.0));
    }
}
