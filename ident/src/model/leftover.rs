//! What a model leaves over of the run that it was identified from.
//!
//! What it is: no model is a rig. By how much it is off on a day when nothing was wrong is written down beside each channel's polynomial: as
//! a curve over the load where the load is held, and about that curve as a scatter that depends on the time since the load last jumped.
//! The noise is part of the scatter: a rotor in gusts wanders, and how much of that the noise of a run is said to hold differs from day to
//! day. When a later run is held against the model (`--model`) the curve is known and the scatter weighs, so that a departure which the
//! healthy day has as well is no news.
//! What can go wrong: what is off while the load changes repeats itself from run to run, and looks like noise here.
//! Units: the channel's; the curve's load in krpm or kus as the polynomial's.
//! Reference: model discrepancy, Kennedy & O'Hagan 2001, JRSS B 63:425; specification `closing-the-loop.md`, step 1.

use crate::channel::{Context, Target};

/// Times since the load last jumped that part the classes of a scatter, s.
pub const AGES: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];
/// Classes of a scatter: one before, between and after [`AGES`], one for a load that moves evenly, and one for a rotor that runs down with
/// its motor off, comes to rest or leaves it.
pub const CLASSES: usize = AGES.len() + 3;

/// Parts of the range of the load that a scatter is told apart in: a rotor is slower to settle at low speeds.
pub const PARTS: usize = 3;

/// Part of the range of the load that one point of a curve stands for.
const BINS: f64 = 40.0;
/// Fewest rows that make a point of a curve, and a class of its own.
const FEWEST: usize = 5;
/// Rows right before a jump that may hold some of it.
const LATE: usize = 2;
/// Classes in which the load is held and has settled, where the curve is read off.
const HELD: std::ops::Range<usize> = 4..AGES.len() + 1;
/// Class of a load that moves evenly.
const MOVING: usize = AGES.len() + 1;
/// Class of a rotor that runs down with its motor off, comes to rest or leaves it.
const RUNS_DOWN: usize = AGES.len() + 2;
/// Fewest rows of a load that moves evenly.
const RAMP: usize = 10;
/// Rows before and after a rotor comes to rest that belong to its running down.
const REST: usize = 3;

/// Error of a model on one channel of its own run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Leftover {
    /// Where the load is held: load and mean error, from low to high.
    pub curve: Vec<(f64, f64)>,
    /// Root mean square about the curve by part of the curve's range of loads and class of row, the noise included.
    pub scatter: [[f64; CLASSES]; PARTS],
}

impl Leftover {
    /// The known error at a load: straight lines between the points, the outer ones beyond.
    #[must_use]
    pub fn known(&self, load: f64) -> f64 {
        along(&self.curve, load)
    }

    /// The largest scatter where the load is held.
    pub(crate) fn held(&self) -> f64 {
        self.scatter.iter().flat_map(|part| &part[HELD]).copied().fold(0.0, f64::max)
    }

    /// What the model was off by about the known error on rows of a class at a load, rms, the noise included. While the load is on its way it was off in
    /// proportion to the jump: `jumps` tells how many of its own run's this one is. `None` where no claim is made: of a rotor that runs down, and of a load on its
    /// way where the jumps are not known.
    pub(crate) fn floor(&self, load: f64, class: usize, jumps: f64) -> Option<f64> {
        let scatter = &self.scatter[self.part(load)];
        if class == RUNS_DOWN || jumps.is_nan() && !settled(class) {
            return None;
        }
        let held = scatter[HELD.start];
        let more = (scatter[class].powi(2) - held * held).max(0.0) * jumps.max(1.0).powi(2);
        Some(if settled(class) { scatter[class] } else { (held * held + more).sqrt() })
    }

    /// The part of the curve's range that a load is in.
    fn part(&self, load: f64) -> usize {
        let (Some(first), Some(last)) = (self.curve.first(), self.curve.last()) else { return 0 };
        let share = (load - first.0) / (last.0 - first.0).max(1e-9);
        ((share * PARTS as f64).max(0.0) as usize).min(PARTS - 1)
    }

    /// Variance of a row of a class at a load beyond a run's own noise, rms. What is off while the load settles is off after every jump in
    /// the same way: many jumps are no more witnesses than one.
    pub(crate) fn variance(&self, load: f64, class: usize, alike: &Alike, noise: f64) -> f64 {
        (self.scatter[self.part(load)][class].powi(2) - noise * noise).max(0.0) * alike.0[class]
    }
}

/// The value of a curve at a load: straight lines between the points, the outer ones beyond; nothing on a curve without a point.
pub(crate) fn along(curve: &[(f64, f64)], load: f64) -> f64 {
    let after = curve.partition_point(|(at, _)| *at < load);
    match (after.checked_sub(1).and_then(|k| curve.get(k)), curve.get(after)) {
        (Some(a), Some(b)) => a.1 + (b.1 - a.1) * (load - a.0) / (b.0 - a.0),
        (Some(only), None) | (None, Some(only)) => only.1,
        (None, None) => 0.0,
    }
}

/// Whether rows of a class are those of a load that is held and has settled.
pub(crate) fn settled(class: usize) -> bool {
    HELD.contains(&class)
}

/// Whether rows of a class are those of a load that has jumped or moves, the motor on: sensors of a rotor that comes to rest hold what they saw
/// last, which is another thing every day.
pub(crate) fn on_its_way(class: usize) -> bool {
    !settled(class) && class != RUNS_DOWN
}

/// How often a run repeats what is in each class.
pub(crate) struct Alike([f64; CLASSES]);

impl Alike {
    /// Of a run with these rows. Where the load is held there is a level for each load; and a run that hardly ever holds it is one ramp.
    pub(crate) fn of(context: &Context, classes: &[usize]) -> Self {
        let jumps = context.calm.len().max(1) as f64;
        let moves = 2 * classes.iter().filter(|class| **class == MOVING).count() > classes.len();
        Self(std::array::from_fn(|class| if HELD.contains(&class) || moves && class == MOVING { 1.0 } else { jumps }))
    }
}

/// The class of every row of a log.
pub(crate) fn classes(context: &Context) -> Vec<usize> {
    let mut out = vec![0; context.len()];
    let ramps = context.calm.iter().filter(|(from, to)| to - from >= RAMP);
    ramps.for_each(|(from, to)| out[*from..*to].fill(MOVING));
    for (from, to) in &context.steady {
        for (class, t) in out[*from..*to].iter_mut().zip(&context.t[*from..*to]) {
            let age = t - context.t[*from];
            *class = AGES.partition_point(|edge| *edge <= age);
        }
    }
    // the command of a row is not always that of its whole reading
    for (_, to) in context.calm.iter().filter(|(_, to)| *to < context.len()) {
        out[to.saturating_sub(LATE)..*to].fill(0);
    }
    // a rotor that comes to rest, or leaves it, jumps between none and the slowest speed that its sensors see
    let near =
        |row: usize| context.rpm.get(row.saturating_sub(REST)..(row + REST + 1).min(context.rpm.len())).unwrap_or_default();
    let turns = |row: usize| near(row).iter().any(|rpm| *rpm > 0.0);
    let rests = |row: usize| near(row).iter().any(|rpm| *rpm <= 0.0);
    let off = |row: usize| context.pulse.as_ref().is_some_and(|p| p[row] < context.start_pulse_us);
    (0..context.len()).filter(|row| turns(*row) && (off(*row) || rests(*row))).for_each(|row| out[row] = RUNS_DOWN);
    out
}

/// Of each target of the run, what a fit leaves over.
pub(crate) fn of(context: &Context, residuals: &[Vec<f64>]) -> Vec<Leftover> {
    let classes = classes(context);
    let of_target = |(residual, target): (&Vec<f64>, &Target)| {
        let load = context.regressor(target.relation).unwrap_or_default();
        let rows = target.rows.iter().zip(residual).filter(|(row, _)| target.claims(**row));
        let rows: Vec<(usize, f64, f64)> =
            rows.filter_map(|(row, r)| Some((classes[*row], *load.get(*row)?, target.as_it_stands(*row, *r)))).collect();
        leftover(&rows)
    };
    residuals.iter().zip(&context.targets).map(of_target).collect()
}

/// Of rows as class, load and residual.
fn leftover(rows: &[(usize, f64, f64)]) -> Leftover {
    let mut left = Leftover { curve: curve(rows), ..Leftover::default() };
    let mut sums = [[Sum::default(); CLASSES]; PARTS];
    for (class, load, residual) in rows {
        sums[left.part(*load)][*class].add((residual - left.known(*load)).powi(2));
    }
    let mut whole = [0.0; CLASSES];
    for class in 0..CLASSES {
        // a class that the run hardly has is taken to be as bad as the one before it, or as the worst
        let before = class.checked_sub(1).map_or(0.0, |k| whole[k]);
        let unknown = if HELD.contains(&class) { before } else { whole.iter().copied().fold(0.0, f64::max) };
        whole[class] = sums.iter().map(|part| part[class]).fold(Sum::default(), Sum::with).rms().unwrap_or(unknown);
        for (scatter, sums) in left.scatter.iter_mut().zip(&sums) {
            // a part may be worse than the whole; that it is better few rows cannot tell
            scatter[class] = sums[class].rms().unwrap_or(0.0).max(whole[class]);
        }
    }
    left
}

/// Squares and how many.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    squares: f64,
    rows: usize,
}

impl Sum {
    fn add(&mut self, square: f64) {
        self.squares += square;
        self.rows += 1;
    }

    fn with(self, other: Self) -> Self {
        Self { squares: self.squares + other.squares, rows: self.rows + other.rows }
    }

    /// Root of the mean, where there are enough.
    fn rms(self) -> Option<f64> {
        (self.rows >= FEWEST).then(|| (self.squares / self.rows as f64).sqrt())
    }
}

/// Mean residual by load where the load is held, or, on a run that hardly ever holds it, moves evenly.
fn curve(rows: &[(usize, f64, f64)]) -> Vec<(f64, f64)> {
    let holds = 4 * rows.iter().filter(|(class, ..)| HELD.contains(class)).count() > rows.len();
    let counts = |class: &usize| HELD.contains(class) || !holds && *class == MOVING;
    let held: Vec<(f64, f64)> = rows.iter().filter(|(class, ..)| counts(class)).map(|(_, load, r)| (*load, *r)).collect();
    let mean = |part: &Vec<(f64, f64)>| {
        let n = part.len() as f64;
        (part.iter().map(|p| p.0).sum::<f64>() / n, part.iter().map(|p| p.1).sum::<f64>() / n)
    };
    binned(held).iter().filter(|part| part.len() >= FEWEST).map(mean).collect()
}

/// Points by load, from low to high, those together that one point of a curve stands for.
pub(crate) fn binned(mut points: Vec<(f64, f64)>) -> Vec<Vec<(f64, f64)>> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return Vec::new() };
    let (low, width) = (first.0, ((last.0 - first.0) / BINS).max(1e-9));
    let bin = |load: f64| ((load - low) / width) as usize;
    points.chunk_by(|a, b| bin(a.0) == bin(b.0)).map(<[_]>::to_vec).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_where_the_load_is_held_and_a_scatter_by_the_time_since_it_jumped() {
        // an error of the square of the load, one of 3 in the first quarter of a second, noise of 0.1
        let rows: Vec<(usize, f64, f64)> = (0..2000)
            .map(|i| {
                let (class, load) = (i % 6, f64::from((i / 100) as u32));
                let sign = if i / 6 % 2 == 0 { 1.0 } else { -1.0 };
                (class, load, load * load + sign * if class == 0 { 3.0 } else { 0.1 })
            })
            .collect();
        let left = leftover(&rows);
        for load in [0.0, 1.0, 7.0, 18.0, 19.0] {
            assert!((left.known(load) - load * load).abs() < 0.05, "{load}: {}", left.known(load));
        }
        assert!((left.known(7.5) - 56.5).abs() < 0.05 && (left.known(40.0) - 361.0).abs() < 0.05);
        for part in left.scatter {
            let noisy = part[1..6].iter().all(|s| (*s - 0.1).abs() < 0.05);
            assert!((part[0] - 3.0).abs() < 0.05 && noisy && part[7] > 2.9, "{part:?}");
        }
        assert_eq!(Leftover::default().known(3.0), 0.0);
    }

    #[test]
    fn what_a_day_wandered_weighs_where_another_day_hardly_has_noise() {
        let left = Leftover { curve: vec![(0.0, 0.0), (3.0, 0.0)], scatter: [[0.3; CLASSES]; PARTS] };
        let of = |noise: f64, alike: f64| left.variance(2.5, 0, &Alike([alike; CLASSES]), noise);
        assert!((of(0.1, 1.0) - 0.08).abs() < 1e-12 && (of(0.1, 5.0) - 0.4).abs() < 1e-12);
        assert_eq!(of(0.5, 5.0), 0.0);
    }

    #[test]
    fn a_part_of_the_loads_may_be_worse_than_the_whole() {
        // a rotor that is slow to settle below a third of its speed
        let error = |load: f64, class: usize| if class == 1 && load < 6.0 { 8.0 } else { 0.2 };
        let rows = (0..3000).map(|i| {
            let (class, load) = (i % 6, f64::from((i / 150) as u32));
            (class, load, if i / 6 % 2 == 0 { error(load, class) } else { -error(load, class) })
        });
        let left = leftover(&rows.collect::<Vec<_>>());
        let settling = left.scatter.map(|part| part[1]);
        assert!(settling[0] > 7.0 && settling[1] < 6.0 && settling[1] == settling[2], "{settling:?}");
        assert!(left.scatter.iter().all(|part| (part[3] - 0.2).abs() < 0.01), "{:?}", left.scatter);
    }
}
