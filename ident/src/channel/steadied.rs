//! How much of what a speed sensor reads within a level is its own error.
//!
//! What it is: thrust, torque and current follow what the rotor does, and not what its sensor adds: the slope of their fluctuations over those of
//! the speed, against the slope of their curve, is the share that is real (reliability ratio). Of the rest the speed is freed, so that no load is
//! predicted from a sensor's error.
//! What can go wrong: a slow meter shows less than there is, so that what is alike from row to row counts as real. Where the loads say too little
//! nothing is known, and the speed stays as it was read. Several sensors check each other, and stay too.
//! Units: rev/min; shares 0 to 1.
//! Reference: Fuller 1987, Measurement Error Models, section 1.1; local lines, Cleveland 1979, J. Am. Stat. Assoc. 74:829.

use super::{Context, Relation};
use crate::log::Log;
use crate::numeric::solve::Normal;

/// Rows on either side that tell the course of a level at a row: an error is left with less than a quarter of its size, and a course that bends
/// within two seconds at ten rows a second is kept.
const BESIDE: usize = 10;
/// Standard error of a share from which on a channel says nothing of it.
const UNKNOWN: f64 = 0.2;
/// Standard errors from which on a share is none by chance: one in a thousand among the tries of three loads.
const BY_CHANCE: f64 = 4.0;
/// Rows by which a meter may be early or late.
const LAGS: std::ops::RangeInclusive<isize> = -2..=5;

impl Context {
    /// A run made ready for a fit of its own.
    pub(crate) fn of_run(log: &Log) -> Self {
        let mut context = Self::new(log, None);
        context.steady_speed(context.sensor_share());
        context
    }

    /// Share of the fluctuations of the speed within a level that no load follows; 0 where the loads do not tell.
    pub(crate) fn sensor_share(&self) -> f64 {
        if !self.has_lone_sensor() || self.time_is_row || self.is_table() {
            return 0.0;
        }
        let speed = self.about_levels(&self.rpm);
        let loads = self.targets.iter().filter(|t| matches!(t.relation, Relation::Thrust | Relation::Torque | Relation::Current));
        let shares: Vec<f64> = loads.filter_map(|load| share_of(self, load, &speed)).collect();
        // a slow meter follows less than there is; what is alike from row to row is no error that a reading has by itself
        if shares.is_empty() { 0.0 } else { 1.0 - shares.into_iter().fold(alike(&speed), f64::max).min(1.0) }
    }

    /// Whether one sensor alone reads the speed.
    fn has_lone_sensor(&self) -> bool {
        self.consensus.channels.len() == 1
    }

    /// Takes a share of each row's distance from the course of its level off the speed of a lone sensor.
    pub(crate) fn steady_speed(&mut self, share: f64) {
        if share > 0.0 && self.has_lone_sensor() {
            let about = self.about_levels(&self.rpm);
            self.rpm.iter_mut().zip(about).filter(|(_, about)| about.is_finite()).for_each(|(rpm, about)| *rpm -= share * about);
            self.powers = Default::default();
            self.facts = Default::default();
            self.consensus.sensor_share = share;
        }
    }

    /// What values are off the course of their level; not a number elsewhere, and where a level is too short to tell.
    fn about_levels(&self, values: &[f64]) -> Vec<f64> {
        let mut out = vec![f64::NAN; values.len()];
        for (from, to) in &self.steady {
            let from = (*from..*to).find(|row| !self.settling.get(*row).copied().unwrap_or(false)).unwrap_or(*to);
            if to - from > BESIDE {
                (from..*to).for_each(|row| out[row] = values[row] - line_at(values, row, (from, *to)));
            }
        }
        out
    }
}

/// Share of the fluctuations that a row has in common with the next one: an error of single readings has none.
fn alike(about: &[f64]) -> f64 {
    let sum = |of: fn(f64, f64) -> f64| about.windows(2).map(|w| of(w[0], w[1])).filter(|v| v.is_finite()).sum::<f64>();
    let (common, all) = (sum(|a, b| a * b), sum(|a, b| 0.5 * (a * a + b * b)));
    if all > 0.0 { (common / all).max(0.0) } else { 0.0 }
}

/// The value at a row of the straight line through those beside it, within bounds.
fn line_at(values: &[f64], row: usize, (from, to): (usize, usize)) -> f64 {
    let beside = row.saturating_sub(BESIDE).max(from)..(row + BESIDE + 1).min(to);
    let (mut n, mut x, mut y, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for k in beside.filter(|k| values[*k].is_finite()) {
        let at = k as f64 - row as f64;
        (n, x, y, xx, xy) = (n + 1.0, x + at, y + values[k], xx + at * at, xy + at * values[k]);
    }
    let determinant = n * xx - x * x;
    if determinant > 0.0 { (xx * y - x * xy) / determinant } else { f64::NAN }
}

/// The share that a load follows, at the lag at which it follows most; nothing where its own scatter hides it.
fn share_of(context: &Context, load: &super::Target, speed: &[f64]) -> Option<f64> {
    let krpm = |row: usize| context.rpm[row] / 1000.0;
    let points = load.rows.iter().zip(&load.y).map(|(row, y)| (krpm(*row), *y, 1.0));
    let curve = Normal::of_polynomial(load.relation.degree(), points).solve()?.coefficients;
    let slope = |x: f64| (1..curve.len()).map(|k| k as f64 * curve[k] * x.powi(k as i32 - 1)).sum::<f64>() / 1000.0;
    let expected: Vec<f64> = (0..speed.len()).map(|row| slope(krpm(row)) * speed[row]).collect();
    let mut read = vec![f64::NAN; speed.len()];
    load.rows.iter().zip(&load.y).for_each(|(row, y)| read[*row] = *y);
    let read = context.about_levels(&read);
    let at = |lag: isize| {
        let pair = |row: usize| Some((expected[row], *read.get(row.checked_add_signed(lag)?)?));
        let sum = |of: &dyn Fn(f64, f64) -> f64| {
            let pairs = (0..speed.len()).filter_map(pair).map(|(e, r)| of(e, r)).filter(|v| v.is_finite());
            pairs.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0))
        };
        let ((ee, _), (er, _), (rr, n)) = (sum(&|e, r| e * e + 0.0 * r), sum(&|e, r| e * r), sum(&|e, r| r * r + 0.0 * e));
        let se = (rr / n / ee).sqrt();
        // of three loads at eight lags the largest is a few standard errors by chance
        (se < UNKNOWN).then_some(if er / ee > BY_CHANCE * se { er / ee } else { 0.0 })
    };
    LAGS.filter_map(at).reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use crate::channel::Context;
    use crate::log::{Column, Log};

    /// Levels of 4 s at which the rotor wanders by `real` and the sensor errs by `error`, rev/min, every row anew.
    fn context(real: f64, error: f64) -> (Context, Vec<f64>) {
        // evenly spread, of variance one, no two rows alike (splitmix64)
        let noise = |k: usize, seed: u64| {
            let mut z = (k as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(seed << 40);
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) as f64 / u64::MAX as f64 - 0.5) * 12.0_f64.sqrt()
        };
        let rows = 0..2400;
        let pulse: Vec<f64> = rows.clone().map(|k| 1200.0 + 100.0 * (k / 80 % 7) as f64).collect();
        let truth: Vec<f64> = rows.clone().map(|k| 12.0 * (pulse[k] - 1000.0) + real * noise(k, 0)).collect();
        let rpm = rows.clone().map(|k| truth[k] + error * noise(k, 1)).collect();
        let thrust = rows.clone().map(|k| 2e-7 * truth[k].powi(2) + 0.004 * noise(k, 2)).collect();
        let columns = [("pulse_us", pulse), ("rpm", rpm), ("thrust_n", thrust)];
        let columns = columns.map(|(name, values)| Column { name: name.into(), values }).to_vec();
        (Context::new(&Log { t: rows.map(|k| 0.05 * k as f64).collect(), columns, ..Log::default() }, Some(1100.0)), truth)
    }

    #[test]
    fn what_the_thrust_follows_is_real_and_what_it_does_not_is_the_sensor_s() {
        for (real, error, share) in [(15.0, 0.0, 0.0), (0.0, 15.0, 1.0), (15.0, 15.0, 0.5)] {
            let (context, _) = context(real, error);
            let found = context.sensor_share();
            assert!((found - share).abs() < 0.1, "{found} for {share}");
        }
    }

    /// A rotor that wanders slowly is real, although the meters are too slow to tell.
    #[test]
    fn what_is_alike_from_row_to_row_is_no_error_of_a_reading() {
        let wave: Vec<f64> = (0..400).map(|k| (0.8 * f64::from(k)).sin()).collect();
        assert!((super::alike(&wave) - 0.8_f64.cos()).abs() < 0.02, "{}", super::alike(&wave));
        let signs: Vec<f64> = (0..400).map(|k| if k % 4 < 2 { 1.0 } else { -1.0 }).collect();
        assert!(super::alike(&signs) < 0.02);
    }

    #[test]
    fn a_sensor_s_own_error_is_taken_off_the_speed() {
        let (mut context, truth) = context(0.0, 15.0);
        let off = |context: &Context| {
            let square: f64 = context.rpm.iter().zip(&truth).map(|(rpm, truth)| (rpm - truth).powi(2)).sum();
            (square / truth.len() as f64).sqrt()
        };
        let before = off(&context);
        context.steady_speed(context.sensor_share());
        assert!(off(&context) < 0.5 * before, "{} of {before}", off(&context));
    }
}
