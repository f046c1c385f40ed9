//! Lines that turn with the rotor: once a revolution, and once a blade.
//!
//! What it is: on every hold the power of a residual at the frequency of an order, against its neighbourhood, and all holds together.
//! What can go wrong: the log samples slower than the rotor turns, so that a line appears folded; its place is then known only as
//! well as the speed. A hold on which that is not good enough, or the line folds onto zero, says nothing.
//! Units: Hz, s; p-values.
//! Reference: order analysis with aliasing, Brandt 2011, *Noise and Vibration Analysis*, chapter 12; ratio of a periodogram's
//! ordinate to a mean of others (F law), Brockwell & Davis 1991, section 10.2; Fisher 1932 (joint p-value).

use super::Start;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::f64::consts::TAU;

/// Ordinates of the neighbourhood on each side of the searched band.
const NEIGHBOURS: usize = 12;
/// Most ordinates of the searched band: beyond them the speed is not known well enough for the line to have a place.
const WIDEST: usize = 12;
/// Fewest samples of a hold.
const FEWEST: usize = 40;
/// Speed below which the rotor is taken to stand, rev/min.
const STANDSTILL: f64 = 300.0;
/// Share by which a sound speed sensor may be off: its clock.
const CLOCK: f64 = 1e-4;

/// Joint p-value of the line `order` times a revolution in the residual of a target; `None` where no hold can show it.
pub(super) fn order_p(start: &Start, target: usize, order: f64) -> Option<f64> {
    let (mut sum, mut holds) = (0.0, 0);
    for hold in &start.context.steady {
        if let Some(p) = hold_p(start, target, order, *hold) {
            sum -= 2.0 * p.max(f64::MIN_POSITIVE).ln();
            holds += 1;
        }
    }
    (holds > 0).then(|| ChiSquared::new(2.0 * f64::from(holds)).map_or(1.0, |d| d.sf(sum)).clamp(0.0, 1.0))
}

/// p-value of the largest ordinate of the band in which the line of one hold must lie.
fn hold_p(start: &Start, target: usize, order: f64, (from, to): (usize, usize)) -> Option<f64> {
    let (context, rows) = (&start.context, &start.context.targets[target].rows);
    // the first tenth of a hold belongs to settling
    let settled = from + 2 + (to - from) / 10;
    let (lo, hi) = (rows.partition_point(|r| *r < settled), rows.partition_point(|r| *r < to));
    let speeds: Vec<f64> = rows.get(lo..hi)?.iter().filter_map(|r| context.rpm.get(*r).copied()).collect();
    let n = speeds.len();
    if n < FEWEST {
        return None;
    }
    let t: Vec<f64> = rows[lo..hi].iter().map(|r| context.t[*r]).collect();
    let span = (t[n - 1] - t[0]) * n as f64 / (n as f64 - 1.0);
    let (speed, slope, scatter) = line(&t, &speeds);
    if speed < STANDSTILL {
        return None;
    }
    let per = order / 60.0;
    let uncertain = per * (3.0 * scatter / (n as f64).sqrt() + 0.5 * slope.abs() * span + CLOCK * speed);
    let half = (uncertain * span).ceil() as usize + 1;
    if 2 * half + 1 > WIDEST {
        return None;
    }
    let z = detrended(&t, start.residuals[target].get(lo..hi)?);
    let usual = span / n as f64;
    let ordinate = |k: i64| -> Option<f64> {
        let f = per * speed + k as f64 / span;
        // where the line appears after folding at the log's rate; next to zero the trend has been taken away
        let folded = (f * usual - (f * usual).round()).abs();
        let edge = 1.5 / n as f64;
        (folded > edge && folded < 0.5 - edge).then(|| power(&t, &z, f))
    };
    let half = half as i64;
    let band: Vec<f64> = (-half..=half).map(ordinate).collect::<Option<_>>()?;
    let beside = (half + 2)..(half + 2 + NEIGHBOURS as i64);
    let around: Vec<f64> = beside.flat_map(|k| [ordinate(k), ordinate(-k)]).flatten().collect();
    if around.len() < NEIGHBOURS {
        return None;
    }
    let m = around.len() as f64;
    let top = band.iter().copied().fold(0.0, f64::max);
    // an exponential over the mean of m others: Pareto law; then the largest of the band
    let one = (1.0 + top / around.iter().sum::<f64>().max(f64::MIN_POSITIVE)).powf(-m);
    Some((-(band.len() as f64 * (-one).ln_1p()).exp_m1()).clamp(0.0, 1.0))
}

/// Mean, slope and scatter about the line.
fn line(t: &[f64], y: &[f64]) -> (f64, f64, f64) {
    let n = t.len() as f64;
    let (mt, my) = (t.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let stt: f64 = t.iter().map(|t| (t - mt).powi(2)).sum();
    let slope = t.iter().zip(y).map(|(t, y)| (t - mt) * (y - my)).sum::<f64>() / stt.max(f64::MIN_POSITIVE);
    let rest: f64 = t.iter().zip(y).map(|(t, y)| (y - my - slope * (t - mt)).powi(2)).sum();
    (my, slope, (rest / n).sqrt())
}

fn detrended(t: &[f64], y: &[f64]) -> Vec<f64> {
    let (mean, slope, _) = line(t, y);
    let middle = t.iter().sum::<f64>() / t.len() as f64;
    t.iter().zip(y).map(|(t, y)| y - mean - slope * (t - middle)).collect()
}

/// Power at a frequency, taken at the samples' own instants: folding happens by itself.
fn power(t: &[f64], z: &[f64], f: f64) -> f64 {
    let (c, s) = t.iter().zip(z).fold((0.0, 0.0), |(c, s), (t, v)| {
        let (sin, cos) = (TAU * f * t).sin_cos();
        (c + v * cos, s + v * sin)
    });
    c * c + s * s
}

#[cfg(test)]
mod tests {
    use super::super::{Start, left};
    use super::*;
    use crate::log::{Column, Log};

    /// Normal numbers: sums of twelve uniform ones of a xorshift stream (Marsaglia 2003).
    struct Noise(u64);

    impl Noise {
        fn next(&mut self) -> f64 {
            (0..12)
                .map(|_| {
                    self.0 ^= self.0 << 13;
                    self.0 ^= self.0 >> 7;
                    self.0 ^= self.0 << 17;
                    (self.0 >> 11) as f64 / (1u64 << 53) as f64
                })
                .sum::<f64>()
                - 6.0
        }
    }

    /// Eight holds of 7 s at 10 Hz with two speed sensors, thrust and torque; `line_n` is a line in the thrust, `order` times a
    /// revolution.
    fn run(seed: u64, order: f64, line_n: f64) -> Log {
        let mut noise = Noise(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        (0..50).for_each(|_| {
            noise.next();
        });
        let (mut t, mut turns) = (Vec::new(), 0.0);
        let mut columns: Vec<Vec<f64>> = vec![Vec::new(); 5];
        for i in 0..560 {
            let level = (i / 70) as f64;
            let speed = 1500.0 + 471.3 * level;
            turns += speed / 60.0 * 0.1;
            let k = speed / 1000.0;
            let phase = TAU * order * turns;
            t.push(f64::from(i) * 0.1);
            let thrust = 0.1 + 0.15 * k * k + line_n * phase.cos() + 0.01 * noise.next();
            let row = [
                1200.0 + 80.0 * level,
                speed + 1.0 * noise.next(),
                speed + 1.0 * noise.next(),
                thrust,
                0.002 * k * k + 1e-4 * noise.next(),
            ];
            columns.iter_mut().zip(row).for_each(|(c, v)| c.push(v));
        }
        let names = ["pulse_us", "rpm_opto", "rpm_hall", "thrust_n", "torque_nm"];
        let columns = names.iter().zip(columns).map(|(n, values)| Column { name: (*n).to_owned(), values }).collect();
        Log { name: "orders".into(), t, columns, ..Log::default() }
    }

    fn p(log: &Log, channel: &str, order: f64) -> f64 {
        let start = Start::new(log).expect("a run with speed and thrust");
        order_p(&start, start.context.target(channel).expect("measured"), order).expect("holds that can show it")
    }

    #[test]
    fn a_folded_line_is_found_at_its_order_and_channel_only() {
        for seed in 1..=10 {
            let log = run(seed, 1.0, 0.008);
            assert!(p(&log, "thrust_n", 1.0) < 1e-5, "seed {seed}: {}", p(&log, "thrust_n", 1.0));
            assert!(p(&log, "torque_nm", 1.0) > 1e-4, "seed {seed}");
            assert!(p(&run(seed, 2.0, 0.008), "thrust_n", 2.0) < 1e-5, "seed {seed}");
        }
    }

    #[test]
    fn two_hundred_clean_runs_raise_the_alarm_no_more_often_than_the_level_says() {
        let (mut alarms, mut low) = (0, 0);
        for seed in 1..=200 {
            let start = Start::new(&run(seed, 1.0, 0.0)).expect("a run with speed and thrust");
            let (columns, rows, _) = left::anything(&start);
            let verdict = columns.iter().position(|c| *c == "verdict").expect("a verdict");
            alarms += usize::from(rows.iter().any(|r| r[verdict] == "something"));
            low += usize::from((0..start.context.targets.len()).filter_map(|k| order_p(&start, k, 1.0)).any(|p| p < 0.05 / 4.0));
        }
        // a family of level 0.01: two expected, seven or more once in 200 times; and the order's own p-values at level 0.05:
        // ten expected of 200 runs, 20 or more once in 400 times
        assert!(alarms <= 6, "{alarms} of 200");
        assert!((2..20).contains(&low), "{low} of 200");
    }
}
