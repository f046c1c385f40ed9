//! What is left beside the names, told channel by channel.
//!
//! What it is: every predicted channel whose error on left-out rows is above [`LOUD`] noise floors, every one on which something smaller and
//! coloured is left, and what one speed sensor reads beyond the others, with the variables that it goes with.
//! What can go wrong: a sensor that is off by a constant share of the speed reads with a gain of its own, and is listed only where that is
//! larger than sensors have it.
//! Units: noise floors of the channel.
//! Reference: specification `formats.md`, "Verdict" (`unexplained`); `closing-the-loop.md`, steps 2 and 7.

use crate::attribution::depends::{goes_with, seems_to_go_with};
use crate::attribution::jump;
use crate::attribution::opponent::{is_second_meter, left_over};
use crate::channel::{Context, DIFFERENCES, Relation, Target};
use crate::fit::Fit;
use crate::fit::heldout;
use crate::model::Declared;
use crate::signal::colour::effective_share;
use crate::signal::stretches::CALM_US;
use crate::verdict::{Channels, Unexplained};
use std::ops::Range;

/// Error on left-out rows, in noise floors, from which on a channel must be told.
pub const LOUD: f64 = 3.0;
/// Share of the rows that may be anything when sensors are held against each other.
const FEW: f64 = 0.01;
/// The same, of rows one after the other, as a multiple.
const STRETCH: f64 = 4.0;
/// Share of a stretch that the rows which it is told by hold.
const NINE_TENTHS: f64 = 0.9;
/// Share of independent samples below which a residual is slow.
const SLOW: f64 = 0.1;

/// Something that is left, and the target that it is left on.
pub(crate) struct Left {
    pub(crate) target: usize,
    /// What the verdict says of it.
    pub(crate) told: Unexplained,
}

/// Everything that is left, in the order of the targets.
pub(crate) fn unexplained(context: &Context, declared: Declared<'_>, fit: &Fit, channels: &Channels) -> Vec<Left> {
    let residuals = heldout::residuals(context, declared, fit);
    let mut out = Vec::new();
    for (i, target) in context.targets.iter().enumerate() {
        let over_floor = match target.relation {
            Relation::SpeedDifference => Some(contrast(target, &residuals[i])).filter(|over| *over > LOUD),
            _ => channels
                .get(target.name)
                .map(|c| c.after.heldout_rms / c.noise_floor_rms)
                .filter(|over| *over > LOUD || left_over(context, target, &residuals[i])),
        };
        if let Some(over_floor) = over_floor.filter(|over| over.is_finite()) {
            let (meters, depends_on): (Vec<String>, Vec<String>) =
                goes_with(context, i, &residuals[i]).into_iter().partition(|name| is_second_meter(context, target.name, name));
            let mut looks_like = looks_like(context, target, &residuals[i]) + &borne_out(&meters);
            if let Some(variable) = seems_to_go_with(context, i, &residuals[i]) {
                let said = crate::verdict::words::channel(&variable);
                looks_like += &format!("; goes with {said}, as far as {} rows can show", target.rows.len());
            }
            let told = Unexplained { channel: spoken(target.name), over_floor, depends_on, looks_like };
            out.push(Left { target: i, told });
        }
    }
    out
}

/// That further meters of the same quantity read what is left as well; the raw codes of the one meter bear out nothing.
fn borne_out(meters: &[String]) -> String {
    match meters.iter().find(|name| !name.ends_with("_raw")) {
        Some(second) => format!("; {second} reads it as well, so that it is no error of one meter"),
        None => String::new(),
    }
}

/// The name of a channel as people say it.
fn spoken(target: &str) -> String {
    let of = DIFFERENCES.iter().find(|(_, difference)| *difference == target);
    of.map_or_else(|| target.to_owned(), |(channel, _)| format!("{channel} - others"))
}

/// What one speed sensor reads beyond the others and its own gain, in noise floors of that difference, where the load is held.
fn contrast(target: &Target, residual: &[f64]) -> f64 {
    let held = |j: &usize| target.claims(target.rows[*j]) && target.unsettled.get(*j).is_none_or(|u| !u);
    let mut squares: Vec<f64> =
        (0..residual.len()).filter(held).map(|j| target.news(target.rows[j], residual[j]).powi(2)).collect();
    squares.sort_unstable_by(f64::total_cmp);
    squares.truncate(squares.len() - (FEW * squares.len() as f64).ceil() as usize);
    let rms = (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
    rms / target.noise.rms
}

/// What a residual is like.
#[derive(Debug, Clone, PartialEq)]
enum Look {
    /// Most of it while the load is on its way.
    OnTheWay,
    /// Most of it in one stretch of the samples.
    InOne(Range<usize>),
    /// Most of it in few rows that lie apart.
    InSingleRows,
    /// Most of it in few rows, several of them one after the other.
    InBursts,
    /// It wanders: few of its samples are independent.
    Slow,
    /// It lasts longer than a row.
    OverSeveralRows,
    /// From row to row.
    Quick,
}

fn look(target: &Target, residual: &[f64], squares: &[f64]) -> Look {
    let whole = squares.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let mut largest = squares.to_vec();
    largest.sort_unstable_by(|a, b| b.total_cmp(a));
    let few = (FEW * largest.len() as f64).ceil() as usize;
    let of_few = (2.0 * largest.iter().take(few).sum::<f64>() > whole).then(|| of_few_rows(residual, squares));
    let on_the_way: f64 = squares.iter().zip(&target.unsettled).filter(|(_, u)| **u).map(|(s, _)| s).sum();
    // one step of many tells more than that it was a step
    match of_few {
        Some(Look::InOne(stretch)) => return Look::InOne(stretch),
        _ if 2.0 * on_the_way > whole => return Look::OnTheWay,
        Some(of_few) => return of_few,
        None => {}
    }
    match effective_share(residual) {
        share if share < SLOW => Look::Slow,
        _ if neighbours_agree(residual) => Look::OverSeveralRows,
        _ => Look::Quick,
    }
}

/// How few rows lie that hold most of a residual.
fn of_few_rows(residual: &[f64], squares: &[f64]) -> Look {
    let (in_a_row, stretch) = loudest_stretch(squares);
    let most = 2.0 * in_a_row > squares.iter().sum::<f64>();
    let is_one = most && stretch.len() > 1 && squares.get(stretch.clone()).is_some_and(is_filled);
    match is_one {
        true => Look::InOne(stretch),
        false if neighbours_agree(residual) => Look::InBursts,
        false => Look::InSingleRows,
    }
}

/// The squares of a target's residual; of rows about which nothing is claimed nothing is told.
fn told_squares(target: &Target, residual: &[f64]) -> Vec<f64> {
    let of_row = |(r, row): (&f64, &usize)| if target.claims(*row) { r * r } else { 0.0 };
    residual.iter().zip(&target.rows).map(of_row).collect()
}

/// Whether a residual wanders: it is slow throughout, neither in few rows nor while the load is on its way.
pub(crate) fn wanders(target: &Target, residual: &[f64]) -> bool {
    look(target, residual, &told_squares(target, residual)) == Look::Slow
}

/// The shape of a residual in words.
pub(crate) fn looks_like(context: &Context, target: &Target, residual: &[f64]) -> String {
    let squares = told_squares(target, residual);
    let look = look(target, residual, &squares);
    if !matches!(look, Look::OnTheWay | Look::InOne(_)) && is_behind_steps(context, target, &squares) {
        return BEHIND_STEPS.to_owned();
    }
    let pace = match look {
        Look::OnTheWay => return ON_THE_WAY.to_owned(),
        Look::InOne(stretch) => return in_one(context, target, &stretch),
        Look::InSingleRows => return "in single rows".to_owned(),
        Look::InBursts => return "in short bursts".to_owned(),
        Look::Slow => match jump(context, target, residual) {
            Some(said) => return said,
            None => "slow",
        },
        Look::OverSeveralRows => "over several rows",
        Look::Quick => "from row to row",
    };
    let grows = grows_with_the_load(context, target, &squares);
    if grows { format!("{pace}, grows with the load") } else { pace.to_owned() }
}

/// Whether a residual lasts longer than a row: its correlation with itself a row later is above 1/e, where it falls to in one row if it is
/// forgotten in one, and above what so many rows of noise show by chance once in forty, which is 1.96 over their root.
fn neighbours_agree(residual: &[f64]) -> bool {
    let mean = residual.iter().sum::<f64>() / residual.len().max(1) as f64;
    let (whole, product) =
        residual.iter().zip(residual.iter().skip(1).map(Some).chain([None])).fold((0.0, 0.0), |(w, p), (a, b)| {
            let a = a - mean;
            (w + a * a, p + b.map_or(0.0, |b| a * (b - mean)))
        });
    product > whole * (-1.0_f64).exp().max(1.96 / (residual.len() as f64).sqrt())
}

/// Whether a stretch is loud throughout: the rows that hold nine tenths of it are at least half of its rows. Two edges with nothing between are
/// no stretch.
fn is_filled(stretch: &[f64]) -> bool {
    let mut largest = stretch.to_vec();
    largest.sort_unstable_by(|a, b| b.total_cmp(a));
    let enough = NINE_TENTHS * largest.iter().sum::<f64>();
    let sums = largest.iter().scan(0.0, |sum, square| {
        *sum += square;
        Some(*sum)
    });
    2 * (sums.take_while(|sum| *sum < enough).count() + 1) >= stretch.len()
}

/// What is said of a residual that lies where the load changes.
pub(crate) const ON_THE_WAY: &str = "while the load is on its way";
/// What is said of a residual that lies in the beginnings of holds.
pub(crate) const BEHIND_STEPS: &str = "right behind steps of the command";
/// Part of a hold of the command that is its beginning, and most of the rows that may lie in one: a command that never stops has no steps.
const BEGINNING: (f64, f64) = (0.1, 0.25);

/// Whether most of a residual's squares lie in the beginnings of holds: the first tenth of the time from one change of the command to the next.
fn is_behind_steps(context: &Context, target: &Target, squares: &[f64]) -> bool {
    let Some(pulse) = context.pulse.as_ref().filter(|_| !context.time_is_row) else { return false };
    let steps: Vec<usize> = (1..pulse.len()).filter(|i| (pulse[*i] - pulse[*i - 1]).abs() > 0.5).collect();
    let mut begins = vec![false; context.len()];
    for (k, from) in steps.iter().enumerate() {
        let to = steps.get(k + 1).copied().unwrap_or(context.len() - 1);
        let until = context.t[*from] + BEGINNING.0 * (context.t[to] - context.t[*from]);
        (*from..to).take_while(|i| context.t[*i] <= until).for_each(|i| begins[i] = true);
    }
    let (mut inside, mut whole, mut rows) = (0.0, 0.0, 0);
    for (row, square) in target.rows.iter().zip(squares) {
        whole += square;
        if begins.get(*row).is_some_and(|b| *b) {
            inside += square;
            rows += 1;
        }
    }
    2.0 * inside > whole && (rows as f64) < BEGINNING.1 * squares.len() as f64
}

/// A residual that jumps once, in words.
fn jump(context: &Context, target: &Target, residual: &[f64]) -> Option<String> {
    let load = context.regressor(target.relation).filter(|load| load.len() == context.len());
    let claimed: Vec<(f64, usize)> =
        residual.iter().copied().zip(target.rows.iter().copied()).filter(|(_, row)| target.claims(*row)).collect();
    let (left, rows): (Vec<f64>, Vec<usize>) = claimed.into_iter().unzip();
    let loads: Option<Vec<f64>> = load.map(|load| rows.iter().map(|row| load[*row]).collect());
    let jump = jump::found(&left, loads.as_deref(), target.noise.rms)?;
    let at = rows.get(jump.from).and_then(|row| context.t.get(*row))?;
    let when = if context.time_is_row { format!("at row {at:.0}") } else { format!("at {at:.1} s") };
    Some(format!("a jump {when}{}", if jump.grows { ", larger where the load is" } else { "" }))
}

/// Where a stretch of a target's samples lies in the log.
fn in_one(context: &Context, target: &Target, stretch: &Range<usize>) -> String {
    let at = |k: usize| target.rows.get(k).and_then(|row| context.t.get(*row)).copied().unwrap_or(f64::NAN);
    let (from, to) = (at(stretch.start), at(stretch.end.saturating_sub(1)));
    if context.time_is_row {
        format!("in one stretch, rows {from:.0} to {to:.0}")
    } else {
        let behind = if begins_with_a_step(context, target, stretch) { BEHIND_ONE } else { "" };
        format!("in one stretch, {from:.1} to {to:.1} s{behind}")
    }
}

/// What is said of a stretch that begins with a step of the command.
pub(crate) const BEHIND_ONE: &str = ", right behind a step";

/// Whether the command jumps at the beginning of a stretch of samples: no further before it than a sample, and no later than after a tenth of it.
fn begins_with_a_step(context: &Context, target: &Target, stretch: &Range<usize>) -> bool {
    let Some(pulse) = &context.pulse else { return false };
    let row = |k: usize| target.rows.get(k).copied();
    let (Some(from), Some(to)) = (row(stretch.start.saturating_sub(1)), row(stretch.start + stretch.len() / 10)) else {
        return false;
    };
    (from.max(1)..=to).any(|i| matches!((pulse.get(i - 1), pulse.get(i)), (Some(a), Some(b)) if (b - a).abs() > CALM_US))
}

/// The most that rows one after the other hold, a few times as many as count as few, and those of them that hold nine tenths of it: spikes over a
/// run are never so close.
pub(crate) fn loudest_stretch(squares: &[f64]) -> (f64, Range<usize>) {
    let rows = ((STRETCH * FEW * squares.len() as f64).ceil() as usize).clamp(1, squares.len().max(1));
    let mut sum: f64 = squares.iter().take(rows).sum();
    let (mut most, mut from) = (sum, 0);
    for (k, (new, old)) in squares.iter().skip(rows).zip(squares).enumerate() {
        sum += new - old;
        if sum > most {
            (most, from) = (sum, k + 1);
        }
    }
    let (mut range, mut held) = (from..(from + rows).min(squares.len()), most);
    while range.len() > 1 {
        let (first, last) = (squares[range.start], squares[range.end - 1]);
        held -= first.min(last);
        if held < NINE_TENTHS * most {
            break;
        }
        if first < last { range.start += 1 } else { range.end -= 1 }
    }
    (most, range)
}

/// Whether the upper half of the loads holds most of a residual's squares.
fn grows_with_the_load(context: &Context, target: &Target, squares: &[f64]) -> bool {
    let Some(load) = context.regressor(target.relation).filter(|load| load.len() == context.len()) else { return false };
    let mut loads: Vec<f64> = target.rows.iter().map(|row| load[*row]).collect();
    loads.sort_unstable_by(f64::total_cmp);
    let middle = loads.get(loads.len() / 2).copied().unwrap_or(0.0);
    let part = |above: bool| -> f64 {
        target.rows.iter().zip(squares).filter(|(row, _)| (load[**row] > middle) == above).map(|(_, s)| s).sum()
    };
    part(true) > 3.0 * part(false)
}

#[cfg(test)]
mod tests {
    use super::{Look, is_behind_steps, is_filled, loudest_stretch, neighbours_agree, of_few_rows};
    use crate::channel::Context;
    use crate::log::{Column, Log};

    #[test]
    fn two_edges_with_nothing_between_are_no_stretch() {
        let mut edges = vec![0.001; 80];
        (edges[0], edges[79]) = (1.0, 1.0);
        assert!(!is_filled(&edges) && is_filled(&[1.0; 80]) && is_filled(&[0.5, 1.0, 0.2]));
    }

    /// Ten bursts of eight rows each, ten rows that lie apart, one stretch.
    #[test]
    fn bursts_are_no_single_rows() {
        let look = |loud: &dyn Fn(usize) -> bool| {
            let residual: Vec<f64> = (0..4000).map(|i| if loud(i) { 50.0 } else { 0.1 * (0.7 * (i * i) as f64).sin() }).collect();
            of_few_rows(&residual, &residual.iter().map(|r| r * r).collect::<Vec<f64>>())
        };
        assert_eq!(look(&|i| i % 400 < 8), Look::InBursts);
        assert_eq!(look(&|i| i % 400 == 7), Look::InSingleRows);
        assert!(matches!(look(&|i| (2000..2030).contains(&i)), Look::InOne(_)));
    }

    /// A staircase of ten holds: what is loud at the beginning of each lies behind the steps, what is loud in the middle does not. A command that
    /// wanders on with each row has no steps.
    #[test]
    fn what_begins_with_a_hold_lies_behind_the_step() {
        let behind = |pulse: &dyn Fn(usize) -> f64, loud: &dyn Fn(usize) -> bool| {
            let wave = |i: usize| (0.7 * (i * i) as f64).sin();
            let pulses: Vec<f64> = (0..1000).map(pulse).collect();
            let rpm = pulses.iter().enumerate().map(|(i, p)| 7.0 * (p - 1000.0) + wave(i)).collect();
            let columns = vec![Column { name: "pulse_us".into(), values: pulses }, Column { name: "rpm".into(), values: rpm }];
            let context = Context::new(&Log { t: (0..1000).map(|i| 0.1 * i as f64).collect(), columns, ..Log::default() }, None);
            let target = context.targets.iter().find(|t| t.name == "rpm").expect("a speed");
            let squares: Vec<f64> = target.rows.iter().map(|row| if loud(*row) { 400.0 } else { wave(*row).powi(2) }).collect();
            is_behind_steps(&context, target, &squares)
        };
        let stairs = |i: usize| 1100.0 + 50.0 * (i / 100) as f64;
        assert!(behind(&stairs, &|i| i % 100 < 4));
        assert!(!behind(&stairs, &|i| (50..54).contains(&(i % 100))));
        assert!(!behind(&|i| 1100.0 + i as f64, &|i| i % 100 < 4));
    }

    #[test]
    fn what_lasts_over_rows_is_not_told_as_from_row_to_row() {
        let of = |n: i32, f: &dyn Fn(f64) -> f64| (0..n).map(|i| f(f64::from(i))).collect::<Vec<f64>>();
        assert!(neighbours_agree(&of(36, &|i| (i / 8.0).sin())), "a smooth residual of a short table");
        assert!(neighbours_agree(&of(2000, &|i| 3.0 + (i / 8.0).sin())));
        assert!(!neighbours_agree(&of(2000, &|i| (0.7 * i * i).sin())), "noise");
        assert!(!neighbours_agree(&of(36, &|i| if i % 2.0 == 0.0 { 1.0 } else { -1.0 })), "by turns");
        assert!(!neighbours_agree(&[]));
    }

    #[test]
    fn a_stretch_is_told_by_the_rows_that_hold_it() {
        let mut squares = vec![0.01; 1000];
        squares[400..420].fill(1.0);
        let (most, range) = loudest_stretch(&squares);
        assert!(most > 20.0 && range.start >= 400 && range.end <= 420 && range.len() >= 18, "{most} {range:?}");
        squares[700] = 1e4;
        assert_eq!(loudest_stretch(&squares).1, 700..701, "a single row is no stretch");
        assert_eq!(loudest_stretch(&[]).1, 0..0);
    }
}
