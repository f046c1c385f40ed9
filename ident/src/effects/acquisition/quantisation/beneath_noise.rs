//! The grid of readings to which noise is added after the rounding, so that none of them lies on it.
//!
//! What it is: the spacing at which readings gather, as the peak of their periodogram, and where one of its lines is.
//! What can go wrong: a run that holds few levels has readings that gather somewhere by chance; whether they are roundings of what the relation
//! expects is not asked here. Noise above a sixth of the step leaves no grid to see.
//! Units: the channel's.
//! Reference: directional statistics, Mardia & Jupp 2000, section 5.2; Rayleigh's test, section 6.3.

use crate::channel::{Context, Relation, Target};
use crate::effects::NEEDED_EVIDENCE;

impl Grid {
    /// The line that a reading lies nearest to.
    pub(super) fn line(&self, reading: f64) -> f64 {
        self.step * ((reading - self.offset) / self.step).round() + self.offset
    }
}

/// A grid: multiples of `step` from `offset` on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Grid {
    pub(super) step: f64,
    pub(super) offset: f64,
}

/// Samples that say where readings gather.
const SAMPLES: usize = 800;
/// Smallest step, in noises.
const LEAST: f64 = 3.0;
/// Fewest steps in the span of the readings.
const FEWEST: f64 = 6.0;
/// Concentration about the grid's lines from which on they are seen: what a noise of 0.15 steps leaves.
const GATHERED: f64 = 0.6;
/// Trials for each step that fits into the span once more.
const FINE: f64 = 4.0;
/// Most trials: a step of less than a thousandth of the span is as good as none.
const MOST: usize = 4000;
/// Trials on either side of the best, and how much finer they lie.
const FINER: (i32, f64) = (10, 10.0);

/// The grid of a channel, where it has one.
pub(super) fn grid(context: &Context, target: &Target) -> Option<Grid> {
    let of_all = || context.targets.iter().map(|t| found(context, t).map(|g| [g.step, g.offset])).collect();
    let [step, offset] = context.facts.grids.get_or_init(of_all).get(context.target(target.name)?).copied().flatten()?;
    Some(Grid { step, offset })
}

/// Whether a channel is one whose meter may round.
pub(super) fn rounds(target: &Target) -> bool {
    matches!(target.relation, Relation::Thrust | Relation::Torque | Relation::Current)
}

/// The rows and the readings of each level of a target that has any.
pub(super) fn levels<'c>(context: &'c Context, target: &'c Target) -> impl Iterator<Item = (&'c [usize], &'c [f64])> {
    let of = |(from, to): &(usize, usize)| {
        let at = target.rows.partition_point(|row| row < from)..target.rows.partition_point(|row| row < to);
        Some((target.rows.get(at.clone())?, target.y.get(at)?))
    };
    context.steady.iter().filter_map(of).filter(|(rows, _)| !rows.is_empty())
}

/// The mean of the readings of a level.
pub(super) fn mean(readings: &[f64]) -> f64 {
    readings.iter().sum::<f64>() / readings.len() as f64
}

/// The grid is looked for once; the load must be held for the reading to be one of it.
fn found(context: &Context, target: &Target) -> Option<Grid> {
    if !rounds(target) {
        return None;
    }
    let mut held = vec![false; context.len()];
    context.steady.iter().for_each(|(from, to)| held[*from..*to].fill(true));
    let rows = target.rows.iter().zip(&target.y).filter(|(row, _)| held[**row] && target.claims(**row));
    let readings: Vec<f64> = rows.map(|(_, y)| *y).collect();
    let readings: Vec<f64> = readings.iter().copied().step_by(readings.len().div_ceil(SAMPLES).max(1)).collect();
    let (low, high) = readings.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), y| (a.min(*y), b.max(*y)));
    let (span, least) = (high - low, LEAST * target.noise.rms);
    if readings.len() < SAMPLES / 4 || span < FEWEST * least {
        return None;
    }
    let trials = ((FINE * (span / least - FEWEST)) as usize).min(MOST);
    let best = |frequencies: &mut dyn Iterator<Item = f64>| -> Option<(f64, f64, f64)> {
        let gathered = frequencies.map(|f| {
            let (strength, phase) = gather(&readings, f);
            (f, strength, phase)
        });
        gathered.max_by(|a, b| a.1.total_cmp(&b.1))
    };
    let (coarse, ..) = best(&mut (0..=trials).map(|k| (FEWEST + k as f64 / FINE) / span))?;
    let (frequency, strength, phase) = best(&mut (-FINER.0..=FINER.0).map(|k| coarse + f64::from(k) / (FINER.1 * FINE * span)))?;
    let grid = (strength > GATHERED).then(|| Grid { step: 1.0 / frequency, offset: phase / frequency })?;
    // a declared model says where each level ought to lie; without one the levels alone must say that they are no chance. Of the trials one in FINE is
    // independent, so that the finer ones add none
    let tried = (trials + 1) as f64;
    (context.against_model || beyond_chance(context, target, &grid) - tried.ln() > NEEDED_EVIDENCE).then_some(grid)
}

/// How much rarer than by chance the levels of a run gather about the lines of a grid, nats: of each line that any level lies by, one level counts.
fn beyond_chance(context: &Context, target: &Target, grid: &Grid) -> f64 {
    let mut levels: Vec<f64> = levels(context, target).map(|(_, readings)| mean(readings)).collect();
    levels.sort_unstable_by(f64::total_cmp);
    levels.dedup_by(|b, a| *b - *a < 0.5 * grid.step);
    // Rayleigh's test
    let (gathered, _) = gather(&levels, 1.0 / grid.step);
    levels.len() as f64 * gathered.powi(2)
}

/// How closely readings gather about multiples of a spacing, 0 to 1, and by which share of it they lie above those.
fn gather(readings: &[f64], frequency: f64) -> (f64, f64) {
    let turn = |y: &f64| (std::f64::consts::TAU * frequency * y).sin_cos();
    let (sin, cos) = readings.iter().map(turn).fold((0.0, 0.0), |(a, b), (sin, cos)| (a + sin, b + cos));
    (sin.hypot(cos) / readings.len() as f64, sin.atan2(cos) / std::f64::consts::TAU)
}

#[cfg(test)]
mod tests {
    use super::{gather, grid};
    use crate::channel::Context;
    use crate::log::{Column, Log};

    /// A thrust on levels of 100 rows, as a conditioner passes it on.
    fn context(passes: &dyn Fn(f64) -> f64) -> Context {
        let noise = |i: usize| 0.02 * ((0.7 * (i * i) as f64).sin() + (1.9 * (i * i) as f64).sin());
        let pulse: Vec<f64> = (0..2000).map(|i| 1100.0 + 40.0 * f64::from((i / 100) as u32)).collect();
        let rpm: Vec<f64> = pulse.iter().map(|p| 7.0 * (p - 1000.0)).collect();
        let thrust = rpm.iter().enumerate().map(|(i, r)| passes(2.5e-7 * r * r) + 0.5 * noise(i)).collect();
        let columns = [("pulse_us", pulse), ("rpm", rpm), ("thrust_n", thrust)];
        let columns = columns.into_iter().map(|(name, values)| Column { name: name.to_owned(), values }).collect();
        let t = (0..2000).map(|i| 0.05 * f64::from(i)).collect();
        Context::new(&Log { name: "steps.csv".to_owned(), t, columns, ..Log::default() }, None)
    }

    #[test]
    fn readings_gather_about_the_lines_of_a_grid() {
        let coarse = context(&|thrust| 0.15 * (thrust / 0.15).round() + 0.04);
        let thrust = &coarse.targets[coarse.target("thrust_n").expect("a thrust")];
        let found = grid(&coarse, thrust).expect("a grid");
        assert!((found.step - 0.15).abs() < 0.001, "{found:?} {}", thrust.noise.rms);
        assert!((found.offset - 0.04).abs() < 0.01, "{found:?}");
        // of few lines levels may lie by each by chance, and no model says that they ought to
        let few = context(&|thrust| 1.5 * (thrust / 1.5).round() + 0.04);
        assert_eq!(grid(&few, &few.targets[few.target("thrust_n").expect("a thrust")]), None);
        assert!(gather(&[0.1, 0.4, 0.7], 1.0 / 0.3).0 > 0.999 && gather(&[0.0, 0.1, 0.2, 0.3], 2.5).0 < 1e-9);
    }
}
