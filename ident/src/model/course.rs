//! What a model was off by, row for row, while the load of its own run was on its way.
//!
//! What it is: after a jump a rotor takes the same way every day, and no model of a dozen numbers is right about it to the noise. A run that
//! repeats the commands of the model's own run finds in its course what the model is off by on the same row, instead of how badly models are off
//! after jumps (see [`crate::model::leftover`]). Where the load is held the course is empty: there the curve over the load knows more than one row.
//! One day's noise is no part of what a model is off by: it is smoothed away as far as the course does not bend.
//! What can go wrong: a row whose commands of the last seconds were others has no counterpart; two clocks that are not in step have none at all.
//! Units: s, us, the channels' own.
//! Reference: repetitive operation, Bristow, Tharayil & Alleyne 2006, IEEE Control Systems Magazine 26(3):96; smoothing, Goldenshluger &
//! Nemirovski 1997, Mathematical Methods of Statistics 6:135; specification `closing-the-loop.md`, step 1.

use crate::channel::{Context, Relation, Target};
use crate::model::leftover;
use crate::numeric::order::median;

/// How long the commands must have been the same for a row to have a counterpart, s.
const HISTORY: f64 = 5.0;
/// Commands that count as the same, us.
const SAME_US: f64 = 1.0;
/// Share of a row by which the times of counterparts may differ.
const SAME_TIME: f64 = 0.02;
/// Most rows that a model keeps.
const MOST: usize = 20_000;

/// Rows of a model's own run, in order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Course {
    /// Times at which the command changed, and the command from there on.
    pub commands: Vec<(f64, f64)>,
    /// Times of the rows.
    pub t: Vec<f64>,
    /// For each channel its error on each of them; not a number where it was not measured.
    pub errors: Vec<(String, Vec<f64>)>,
}

/// Keys of the table beside the channels: when the command changed, to what, and the times of the rows.
pub(crate) const COURSE_KEYS: [&str; 3] = ["changed_s", "pulse_us", "t_s"];

/// The course of a run under a fit; `None` where nothing is commanded or nothing moves.
pub(crate) fn of(context: &Context, residuals: &[Vec<f64>]) -> Option<Course> {
    let pulse = context.pulse.as_ref()?;
    let classes = leftover::classes(context);
    let rows: Vec<usize> = (0..context.len()).filter(|row| leftover::on_its_way(classes[*row])).collect();
    if rows.is_empty() || rows.len() > MOST || context.time_is_row {
        return None;
    }
    let mut commands: Vec<(f64, f64)> = Vec::new();
    for (t, pulse) in context.t.iter().zip(pulse) {
        if commands.last().is_none_or(|(_, last)| (pulse - last).abs() > 0.5 * SAME_US) {
            commands.push((*t, *pulse));
        }
    }
    if commands.len() > MOST {
        return None;
    }
    // sensors differ from each other by where each of them looks: that is another thing every day
    let repeats = context.targets.iter().zip(residuals).filter(|(target, _)| target.relation != Relation::SpeedDifference);
    let errors = repeats.map(|(target, residual)| {
        let mut all = vec![f64::NAN; context.len()];
        for (row, r) in target.rows.iter().zip(residual).filter(|(row, _)| target.claims(**row)) {
            all[*row] = target.as_it_stands(*row, *r);
        }
        let noise = target.noise.rms.min(from_row_to_row(&all));
        for (from, to) in &context.calm {
            let smooth = smoothed(&all[*from..*to], noise);
            all[*from..*to].copy_from_slice(&smooth);
        }
        (target.name.to_owned(), rows.iter().map(|row| all[*row]).collect())
    });
    Some(Course { commands, errors: errors.collect(), t: rows.iter().map(|row| context.t[*row]).collect() })
}

/// Half the widths of the means that a course is smoothed by, rows.
const HALVES: [usize; 4] = [1, 2, 4, 8];
/// Standard errors by which a wider mean may differ from all narrower ones.
const BENDS: f64 = 2.0;

/// Noise by what most rows differ from the line between their neighbours: a channel that swings about a new level is no noisier for it.
fn from_row_to_row(values: &[f64]) -> f64 {
    let bend = |w: &[f64]| (w[0] - 2.0 * w[1] + w[2]).abs();
    let mut bends: Vec<f64> = values.windows(3).map(bend).filter(|b| b.is_finite()).collect();
    if bends.is_empty() { f64::INFINITY } else { median(&mut bends) / (QUANTILES[0].1 * 6.0_f64.sqrt()) }
}

/// Between two jumps of the load: each value's mean over as many rows to both sides as differ from it by no more than the noise.
fn smoothed(values: &[f64], noise: f64) -> Vec<f64> {
    let of_row = |row: usize| {
        let mut value = values[row];
        let (mut low, mut high) = (value - BENDS * noise, value + BENDS * noise);
        for half in HALVES.into_iter().take_while(|half| *half <= row && row + half < values.len()) {
            let about = values[row - half..=row + half].iter().filter(|v| v.is_finite());
            let (sum, count) = about.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
            let (mean, within) = (sum / f64::max(count, 1.0), BENDS * noise / f64::sqrt(f64::max(count, 1.0)));
            (low, high) = (low.max(mean - within), high.min(mean + within));
            if low > high {
                break;
            }
            value = mean;
        }
        value
    };
    (0..values.len()).map(|row| if values[row].is_finite() { of_row(row) } else { f64::NAN }).collect()
}

impl Course {
    /// For each row of a run its counterpart.
    pub(crate) fn counterparts(&self, context: &Context) -> Vec<Option<usize>> {
        let Some(pulse) = &context.pulse else { return vec![None; context.len()] };
        let apart = SAME_TIME * context.step();
        // since when the commands have been the same
        let mut since: Option<f64> = None;
        let mut out = Vec::with_capacity(context.len());
        for (row, t) in context.t.iter().enumerate() {
            let after = self.commands.partition_point(|(at, _)| *at <= t + apart);
            let command = after.checked_sub(1).and_then(|k| self.commands.get(k)).map(|(_, pulse)| *pulse);
            if !command.is_some_and(|command| (command - pulse[row]).abs() <= SAME_US) {
                since = None;
            } else if since.is_none() {
                // a run that starts where the model's own run did has all of its history
                let first = row == 0 && self.commands.first().is_some_and(|(at, _)| (at - t).abs() <= apart);
                since = Some(if first { t - HISTORY } else { *t });
            }
            let known = since.is_some_and(|since| t - since >= HISTORY);
            let near = self.t.partition_point(|at| *at < t - apart);
            out.push((known && self.t.get(near).is_some_and(|at| (at - t).abs() <= apart)).then_some(near));
        }
        out
    }

    /// The table of the model's file.
    pub(crate) fn to_toml(&self) -> String {
        let list = |values: &mut dyn Iterator<Item = String>| values.collect::<Vec<_>>().join(", ");
        let [changed, pulse, t] = COURSE_KEYS;
        let mut out = format!(
            "\n# What the model is off by on its own run while the load is on its way, row for row; the command from each change on.\n[course]\n{changed} = [{}]\n{pulse} = [{}]\n{t} = [{}]\n",
            list(&mut self.commands.iter().map(|c| c.0.to_string())),
            list(&mut self.commands.iter().map(|c| c.1.to_string())),
            list(&mut self.t.iter().map(ToString::to_string)),
        );
        for (channel, errors) in &self.errors {
            let short = |v: &f64| if v.is_nan() { "nan".to_owned() } else { format!("{v:.3e}") };
            out += &format!("{channel} = [{}]\n", list(&mut errors.iter().map(short)));
        }
        out
    }

    /// The error of a channel on each of the rows.
    pub(crate) fn of_channel(&self, channel: &str) -> Option<&[f64]> {
        self.errors.iter().find(|(name, _)| name == channel).map(|(_, errors)| errors.as_slice())
    }
}

/// What a course knows of a channel of a run.
#[derive(Clone, Copy)]
pub(crate) struct Counterparts<'c> {
    /// Errors of the channel on the rows of the course.
    pub(crate) errors: &'c [f64],
    /// For each row of the run its counterpart.
    pub(crate) rows: &'c [Option<usize>],
    /// The model's prediction of the run.
    pub(crate) prediction: &'c [f64],
    /// From row to row, s.
    pub(crate) step: f64,
}

/// Quantiles of the sizes of normal deviates, and where they lie.
const QUANTILES: [(f64, f64); 2] = [(0.5, 0.6745), (0.8, 1.2816)];
/// Fewest rows that tell how well two days agree, and that make a level.
const FEWEST: usize = 8;
/// How far around a row it is looked for how much a channel changes, s: a sensor holds its last value until a slow rotor passes it again.
const NEAR: f64 = 0.15;
/// Change about a row, in noises, from which on a row tells how well the two days are in step.
const MOVES: f64 = 3.0;

/// Parts of a run of which the best but one tells how well two days agree: what sets in or grows does not hide in their disagreement.
const PARTS: usize = 4;

/// Share of its change about a row by which a channel differs from day to day, rms, of rows in order as change and difference: sensors that look
/// at different moments differ by that. Wide enough for most of the rows in two parts of the run.
fn out_of_step(rows: &[(f64, f64)], noise: f64) -> Option<f64> {
    let moving: Vec<f64> =
        rows.iter().filter(|(change, _)| *change > MOVES * noise).map(|(change, d)| d.abs() / change).collect();
    let of_part = |part: &[f64]| -> Option<f64> {
        let mut shares = part.to_vec();
        shares.sort_by(f64::total_cmp);
        let at = |(share, normal): (f64, f64)| Some(shares.get((share * shares.len() as f64) as usize)? / normal);
        if shares.len() < FEWEST { None } else { QUANTILES.into_iter().filter_map(at).reduce(f64::max) }
    };
    let mut parts: Vec<f64> = moving.chunks(moving.len().div_ceil(PARTS).max(FEWEST)).filter_map(of_part).collect();
    parts.sort_by(f64::total_cmp);
    parts.get(1).or(parts.first()).copied()
}

/// Of a residual what it is where the load is next held, for each of the target's samples.
fn next_level(target: &Target, residual: &[f64], classes: &[usize]) -> Vec<f64> {
    let mut out = vec![0.0; residual.len()];
    let mut level = 0.0;
    let mut held: Vec<f64> = Vec::new();
    for k in (0..residual.len()).rev() {
        if leftover::settled(classes[target.rows[k]]) {
            held.push(residual[k]);
        } else {
            if held.len() >= FEWEST {
                level = median(&mut held);
            }
            held.clear();
        }
        out[k] = level;
    }
    out
}

/// For each row of the run the error that the course knows of a target, and the variance by which two days differ there.
pub(crate) fn ahead(course: Counterparts<'_>, target: &Target, classes: &[usize]) -> Vec<Option<(f64, f64)>> {
    let n = course.rows.len();
    let noise = target.noise.rms;
    let error = |row: usize| course.rows[row].map(|k| course.errors[k]).filter(|e| e.is_finite());
    let expected: Vec<f64> = (0..n).map(|row| course.prediction[row] + error(row).unwrap_or(target.known[row])).collect();
    let near = (NEAR / course.step).ceil().max(1.0) as usize;
    let change = |row: usize| {
        let about = &expected[row.saturating_sub(near)..(row + near + 1).min(n)];
        about.iter().copied().fold(f64::NEG_INFINITY, f64::max) - about.iter().copied().fold(f64::INFINITY, f64::min)
    };
    let residual: Vec<f64> = target.rows.iter().zip(&target.y).map(|(row, y)| y - expected[*row]).collect();
    let level = next_level(target, &residual, classes);
    let rows =
        target.rows.iter().zip(residual.iter().zip(&level)).filter(|(row, _)| error(**row).is_some() && target.claims(**row));
    let rows: Vec<(f64, f64)> = rows.map(|(row, (r, level))| (change(*row), r - level)).collect();
    let Some(share) = out_of_step(&rows, noise) else { return vec![None; n] };
    // what has arrived is better known from the whole curve than from one row
    let moves = |row: &usize| change(*row) > MOVES * noise;
    (0..n).map(|row| Some((error(row).filter(|_| moves(&row))?, noise * noise + (share * change(row)).powi(2)))).collect()
}

#[cfg(test)]
mod tests {
    use super::{Course, HISTORY, out_of_step, smoothed};
    use crate::channel::Context;
    use crate::log::{Column, Log};

    /// A run of these commands, ten rows a second from an instant on.
    fn context(from: f64, pulse: Vec<f64>) -> Context {
        let t = (0..pulse.len()).map(|i| from + 0.1 * i as f64).collect();
        Context::bare(
            &Log { t, columns: vec![Column { name: "pulse_us".to_owned(), values: pulse }], ..Log::default() },
            Some(1000.0),
        )
    }

    #[test]
    fn a_row_has_a_counterpart_where_the_commands_of_the_last_seconds_were_the_same() {
        let course = Course {
            commands: vec![(0.0, 1100.0), (10.0, 1500.0), (20.0, 1300.0)],
            t: (0..20).map(|i| 10.0 + 0.1 * f64::from(i)).chain((0..20).map(|i| 20.0 + 0.1 * f64::from(i))).collect(),
            errors: Vec::new(),
        };
        let pulse = |row: usize| [1100.0, 1500.0, 1300.0][(row / 100).min(2)];
        let same: Vec<f64> = (0..300).map(pulse).collect();
        let found = course.counterparts(&context(0.0, same.clone()));
        assert_eq!((found[99], found[100], found[119], found[120], found[200]), (None, Some(0), Some(19), None, Some(20)));
        // another command for a row, and the rows of the next seconds have none
        let mut other = same.clone();
        other[60] = 1200.0;
        let found = course.counterparts(&context(0.0, other));
        let back = 61 + (HISTORY / 0.1) as usize;
        assert!((100..back).all(|row| found[row].is_none()) && found[back + 1] == Some(back - 99) && found[200] == Some(20));
        // a run that was begun later has a past of its own
        let found = course.counterparts(&context(11.0, (110..300).map(pulse).collect()));
        assert!(found[..49].iter().all(Option::is_none) && found[90] == Some(20), "{found:?}");
        // rows between the model's own rows have none
        assert!(course.counterparts(&context(0.03, same)).iter().all(Option::is_none));
    }

    #[test]
    fn a_course_loses_its_noise_and_keeps_its_bends() {
        let noise = |i: usize| 0.1 * if i * i % 7 < 3 { 1.0 } else { -1.0 };
        // a rotor that arrives within four rows, and a level
        let way = |i: usize| 10.0 * (-(i as f64) / 1.5).exp();
        let values: Vec<f64> = (0..60).map(|i| way(i) + noise(i)).collect();
        let smooth = smoothed(&values, 0.1);
        let off = |i: usize| (smooth[i] - way(i)).abs();
        assert!((0..5).all(|i| off(i) < 0.25), "{:?}", &smooth[..5]);
        assert!((20..50).all(|i| off(i) < 0.07), "{:?}", &smooth[20..50]);
        let gap: Vec<f64> = (0..9).map(|i| if i == 4 { f64::NAN } else { 1.0 }).collect();
        let kept = smoothed(&gap, 0.1);
        assert!(kept[4].is_nan() && (0..9).all(|i| i == 4 || kept[i] == 1.0));
    }

    #[test]
    fn two_days_are_out_of_step_by_what_most_rows_of_two_parts_of_the_run_say() {
        let wave = |i: u32| 1.3 * (0.7 * f64::from(i * i)).sin();
        let rows = |late: f64| -> Vec<(f64, f64)> {
            (0..400)
                .map(|i| {
                    (
                        100.0,
                        wave(i)
                            + if i >= 200 {
                                late
                            } else if i % 20 == 0 {
                                40.0
                            } else {
                                0.0
                            },
                    )
                })
                .collect()
        };
        let share = out_of_step(&rows(0.0), 1.0).expect("enough rows");
        assert!((share - 0.01).abs() < 0.004, "{share}");
        let late = out_of_step(&rows(30.0), 1.0).expect("enough rows");
        assert!((late / share - 1.0).abs() < 0.2, "what sets in half way does not count: {late} {share}");
        assert_eq!(out_of_step(&rows(0.0), 50.0), None, "nothing moves");
    }
}
