//! Detectors side by side on one run: ours and the binary shift algorithm, with the settings that suit it best.
//!
//! What it is: scores over any run whose levels are known, from a simulator's truth or from a recorded command; and the threshold
//! study of section 5.7.4 over a grid of thresholds and offsets.
//! What can go wrong: a recorded command says where the levels are, but not how high: the value of a level is then taken from its
//! second half, carried back as a line, and has an error of its own.
//! Units: rows; the channel's.
//! Reference: Beharie 2013, section 5.7.4 and Figures 5.82 to 5.85.

use super::score::{Found, Score, Truth};
use super::{detect, means_over};
use crate::channel::Context;
use crate::log::Log;
use crate::numeric::order::median;
use crate::plateau::shift::{self, Form, Settings, filters};

/// Shortest held command that counts as a level, rows.
const SHORTEST: usize = 30;
/// Largest distance from the median of a quarter of a level, as a share of the channel's range, before a sample is a glitch.
const GLITCH: f64 = 0.02;

/// A channel whose levels are known.
#[derive(Debug, Clone, Default)]
pub struct Known {
    /// The levels.
    pub truths: Vec<Truth>,
    /// Settled value on every row, NaN outside the levels.
    pub level: Vec<f64>,
    /// Standard error of that value for each level: 0 for a simulator's truth.
    pub errors: Vec<f64>,
}

impl Known {
    /// The levels of some channels as a recorded command marks them, from the row at which the first of the channels answers a step to
    /// the row at which it answers the next; `None` without a command or with fewer than two levels.
    #[must_use]
    pub fn from_command<const N: usize>(log: &Log, channels: [&str; N]) -> Option<[Self; N]> {
        let command = log.column("pulse_us")?;
        let held: Vec<Truth> = super::change::held(command)
            .into_iter()
            .filter(|(a, b)| b - a >= SHORTEST)
            .map(|(from, to)| Truth { from, settled: from + (to - from) / 2, to })
            .collect();
        let first = log.column(channels.first()?)?;
        let truths = answered(&held, first);
        let mut values = channels.iter().map(|c| log.column(c));
        let known: [Option<Self>; N] = std::array::from_fn(|_| Some(Self::of(truths.clone(), values.next()??)));
        (truths.len() >= 2 && known.iter().all(Option::is_some)).then(|| known.map(Option::unwrap_or_default))
    }

    /// What a channel reads at known levels: a line through the clean means of the third and the fourth quarter of each.
    fn of(truths: Vec<Truth>, values: &[f64]) -> Self {
        let finite = values.iter().filter(|v| v.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
        let mut level = vec![f64::NAN; values.len()];
        let mut errors = Vec::with_capacity(truths.len());
        for t in &truths {
            let quarter = (t.to - t.from) / 4;
            let mean = |from: usize| {
                let z = &values[from..from + quarter];
                let mut there: Vec<f64> = z.iter().copied().filter(|v| v.is_finite()).collect();
                let middle = median(&mut there);
                let clean = |v: &f64| if (v - middle).abs() <= GLITCH * (high - low) { *v } else { f64::NAN };
                let clean: Vec<f64> = z.iter().map(clean).collect();
                means_over(&clean, &[(0, quarter)])[0]
            };
            let (third, fourth) = (mean(t.to - 2 * quarter), mean(t.to - quarter));
            let (Some((a, error_a)), Some((b, error_b))) = (third, fourth) else {
                errors.push(f64::INFINITY);
                continue;
            };
            let centre = t.to as f64 - 1.5 * quarter as f64;
            let slope = (b - a) / quarter as f64;
            for (row, v) in level.iter_mut().enumerate().take(t.to).skip(t.from) {
                *v = a + slope * (row as f64 - centre);
            }
            // at the middle of the level the line reads a and half of a less b
            errors.push((1.5 * error_a).hypot(0.5 * error_b));
        }
        Self { truths, level, errors }
    }

    /// Highest level.
    #[must_use]
    pub fn top(&self) -> f64 {
        self.level.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max)
    }

    /// Scores row ranges; the published form averages as the thesis does, missing samples included. All are given the same standard
    /// error, so that only where they look differs.
    #[must_use]
    pub fn score(&self, values: &[f64], ranges: &[(usize, usize)], form: Option<Form>) -> Score {
        let found: Vec<Found> = ranges
            .iter()
            .zip(means_over(values, ranges))
            .map(|((from, to), m)| {
                let (mean, se) = m.unwrap_or((f64::NAN, f64::NAN));
                let mean =
                    if form == Some(Form::Published) { shift::means(values, &[(*from, *to)], Form::Published)[0] } else { mean };
                let middle = from + (to - from) / 2;
                let own = self.truths.iter().position(|t| (t.from..t.to).contains(&middle)).map_or(0.0, |k| self.errors[k]);
                // a standing rotor reads exactly zero
                Found { from: *from, to: *to, mean, se: se.hypot(own).max(1e-9) }
            })
            .collect();
        Score::of(&self.truths, &self.level, &found)
    }
}

/// Levels whose edges are moved from the command's step to the row at which the channel has gone a tenth of the way and stays there.
fn answered(held: &[Truth], values: &[f64]) -> Vec<Truth> {
    let mut out = held.to_vec();
    let settled = |t: &Truth| {
        let mut z: Vec<f64> = values[t.from + (t.to - t.from) / 2..t.to].iter().copied().filter(|v| v.is_finite()).collect();
        median(&mut z)
    };
    for k in 1..held.len() {
        let (before, after) = (settled(&held[k - 1]), settled(&held[k]));
        let gone = |row: usize| (values[row] - before) / (after - before) > 0.1;
        let limit = held[k].from + (held[k].to - held[k].from) / 3;
        let Some(row) = (held[k].from..limit).find(|r| gone(*r) && gone(r + 1)) else { continue };
        out[k].from = row;
        // a level that the command leaves for another without a gap lasts until then
        if held[k].from <= held[k - 1].to + 2 {
            out[k - 1].to = row;
        }
    }
    out
}

/// One setting of the binary shift algorithm on one run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tried {
    /// Threshold of Filter 2, in the channel's unit per sample.
    pub threshold: f64,
    /// Offset, samples.
    pub offset: usize,
    /// What it scores.
    pub score: Score,
}

/// Offsets of the threshold study, samples.
pub const OFFSETS: [usize; 5] = [1, 3, 6, 12, 25];
/// Thresholds of the study, as quantiles of Filter 1; the thesis' own 0.2, 0.7 and 1.2 are tried too.
const QUANTILES: [f64; 12] = [0.2, 0.4, 0.6, 0.7, 0.8, 0.87, 0.92, 0.95, 0.97, 0.98, 0.99, 0.995];

/// Every threshold and offset of a grid that spans the differences which a channel has (section 5.7.4), by rising threshold.
#[must_use]
pub fn threshold_study(values: &[f64], known: &Known, form: Form) -> Vec<Tried> {
    let mut steps: Vec<f64> = values.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|d| d.is_finite()).collect();
    steps.sort_unstable_by(f64::total_cmp);
    let quantile = |q: f64| steps.get((q * steps.len() as f64) as usize).copied();
    let mut thresholds: Vec<f64> = QUANTILES.iter().filter_map(|q| quantile(*q)).chain([0.2, 0.7, 1.2]).collect();
    thresholds.sort_unstable_by(f64::total_cmp);
    thresholds.dedup();
    let mut out = Vec::with_capacity(thresholds.len() * OFFSETS.len());
    for threshold in thresholds {
        for offset in OFFSETS {
            let settings = Settings { form, threshold: Some(threshold), offset: Some(offset), ..Settings::default() };
            let found = filters(values, &settings).stretches();
            out.push(Tried { threshold, offset, score: known.score(values, &found, Some(form)) });
        }
    }
    out
}

/// The setting of a study that finds most levels rightly, fewer wrong ones where two find as many: what only who knows the truth
/// can choose.
#[must_use]
pub fn best(study: &[Tried]) -> Option<Tried> {
    let merit = |s: &Score| s.within as f64 + 0.01 * s.found as f64 - 0.2 * s.wrong as f64;
    study.iter().copied().max_by(|a, b| merit(&a.score).total_cmp(&merit(&b.score)))
}

/// Row ranges of our detector, with the command that the log holds or without it.
#[must_use]
pub fn ours(log: &Log, with_command: bool) -> Vec<(usize, usize)> {
    let mut log = log.clone();
    if !with_command {
        log.columns.retain(|c| c.name != "pulse_us");
    }
    detect(&log, &Context::bare(&log, None).rpm).iter().map(|p| (p.first, p.first + p.rows)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Column;

    fn log() -> Log {
        let n = 400;
        let pulse: Vec<f64> = (0..n).map(|i| 1100.0 + 100.0 * (i / 100) as f64).collect();
        let wobble = |i: usize| ((i * 7919) % 101) as f64 / 101.0 - 0.5;
        let mut rpm: Vec<f64> = pulse.iter().enumerate().map(|(i, p)| 10.0 * (p - 1000.0) + wobble(i)).collect();
        rpm[370] = 1e5;
        let columns = vec![Column { name: "pulse_us".into(), values: pulse }, Column { name: "rpm".into(), values: rpm }];
        Log { t: (0..n).map(|i| i as f64 * 0.1).collect(), columns, ..Log::default() }
    }

    #[test]
    fn a_recorded_command_marks_the_levels_and_a_glitch_does_not_move_them() {
        let [known] = Known::from_command(&log(), ["rpm"]).unwrap();
        assert_eq!(known.truths.len(), 4);
        assert!((known.level[399] - 4000.0).abs() < 0.2, "{}", known.level[399]);
        assert!(known.errors.iter().all(|e| *e > 0.0 && *e < 0.2));
    }

    #[test]
    fn a_level_lasts_until_the_channel_answers() {
        let truths = [Truth { from: 0, settled: 50, to: 100 }, Truth { from: 100, settled: 150, to: 200 }];
        let late: Vec<f64> = (0..200).map(|i| if i < 112 { 1.0 } else { 2.0 }).collect();
        let moved = answered(&truths, &late);
        assert_eq!((moved[0].to, moved[1].from, moved[1].to), (112, 112, 200));
    }

    #[test]
    fn the_study_has_a_setting_that_works_and_some_that_do_not() {
        let log = log();
        let [known] = Known::from_command(&log, ["rpm"]).unwrap();
        let rpm = log.column("rpm").unwrap();
        let study = threshold_study(rpm, &known, Form::Published);
        assert_eq!(best(&study).unwrap().score.found, 4);
        assert!(study.iter().any(|t| t.score.found == 0));
        assert_eq!(known.score(rpm, &ours(&log, false), None).found, 4);
    }
}
