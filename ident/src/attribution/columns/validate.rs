//! Third stage: what a hypothesis is worth on readings that its fit did not see.
//!
//! What it is: contiguous blocks of time, each predicted by a fit to the others.
//! What can go wrong: what happens in one block alone cannot be predicted by the others, and says so.
//! Units: the channels' own.
//! Reference: specification `formats.md` (`heldout_rms`); blocked cross-validation, Roberts et al. 2017, Ecography 40:913.

use super::channel::{Channel, rms};
use super::evidence::White;
use super::fit::{Fit, Problem, shapes_on};
use super::library::Placed;
use super::noise::Noise;

/// Number of blocks.
pub const BLOCKS: usize = 5;

/// A fit that one block of time took no part in.
#[derive(Debug, Clone)]
pub struct Fold {
    /// First time of the block, s.
    pub from: f64,
    /// Last time of it, s.
    pub to: f64,
    /// The hypothesis with the shapes of the rest.
    pub placed: Vec<Placed>,
    /// Its amplitudes.
    pub amplitudes: Vec<f64>,
}

impl Fold {
    /// Whether an instant lies in the block.
    #[must_use]
    pub fn holds(&self, t: f64) -> bool {
        (self.from..self.to).contains(&t)
    }
}

/// Bounds of the blocks; the last holds the last reading.
fn blocks(channels: &[Channel]) -> Vec<(f64, f64)> {
    let first = channels.iter().filter_map(|c| c.t.first()).copied().fold(f64::INFINITY, f64::min);
    let last = channels.iter().filter_map(|c| c.t.last()).copied().fold(f64::NEG_INFINITY, f64::max);
    let at = |k: usize| first + (last - first) * k as f64 / BLOCKS as f64;
    let end = |k: usize| if k + 1 < BLOCKS { at(k + 1) } else { f64::INFINITY };
    (0..BLOCKS).map(|k| (if k == 0 { f64::NEG_INFINITY } else { at(k) }, end(k))).collect()
}

/// One fit for each block, to everything else; with `shapes` they too are sought on the rest alone.
#[must_use]
pub fn folds(problem: &Problem<'_>, placed: &[Placed], noise: &[Noise], shapes: bool) -> Option<Vec<Fold>> {
    let moves = shapes && placed.iter().any(|p| !p.shape.is_empty());
    let whole = problem.library.design(placed);
    let one = |(from, to): (f64, f64)| {
        let stays = |c: &Channel| (0..c.len()).filter(|i| !(from..to).contains(&c.t[*i])).collect();
        let rows: Vec<Vec<usize>> = problem.channels.iter().map(stays).collect();
        let channels: Vec<Channel> = problem.channels.iter().zip(&rows).map(|(c, r)| c.at(r)).collect();
        let own = if moves { shapes_on(problem, placed, noise, &channels, &rows) } else { placed.to_vec() };
        let design = if moves { problem.library.design(&own).at(&rows) } else { whole.at(&rows) };
        let solved = White::new(&channels, noise, &design).solve()?;
        Some(Fold { from, to, placed: own, amplitudes: solved.amplitudes })
    };
    blocks(problem.channels).into_iter().map(one).collect()
}

/// What is left of every reading when its block took no part in the fit; `shapes` as in [`folds`].
#[must_use]
pub fn held_out(problem: &Problem<'_>, placed: &[Placed], noise: &[Noise], shapes: bool) -> Option<Vec<Vec<f64>>> {
    let mut out: Vec<Vec<f64>> = problem.channels.iter().map(|c| vec![f64::NAN; c.len()]).collect();
    for fold in folds(problem, placed, noise, shapes)? {
        let design = problem.library.design(&fold.placed);
        for (c, channel) in problem.channels.iter().enumerate() {
            let predicted = design.predict(&fold.amplitudes, c, channel.len());
            for i in (0..channel.len()).filter(|i| fold.holds(channel.t[*i])) {
                out[c][i] = channel.y[i] - predicted[i];
            }
        }
    }
    Some(out)
}

/// The noise with a channel's readings weighted evenly.
fn even(noise: &Noise) -> Noise {
    Noise { white: noise.total(), wander: 0.0, ..*noise }
}

/// For each channel the weighting, by the noise as it was found or even, that predicts left-out readings better, and what is left of those with
/// it. A wander that the model cannot follow leaves weight to fast changes alone, which a wrong model fits at the price of all that is slow.
#[must_use]
pub fn fairest(problem: &Problem<'_>, fit: &Fit) -> Option<(Vec<Noise>, Vec<Vec<f64>>)> {
    fairest_of(problem, &fit.placed, &fit.noise, true)
}

/// The same of any hypothesis beside a noise that another one was found with; `shapes` as in [`folds`].
#[must_use]
pub fn fairest_of(
    problem: &Problem<'_>,
    placed: &[Placed],
    found: &[Noise],
    shapes: bool,
) -> Option<(Vec<Noise>, Vec<Vec<f64>>)> {
    let left = |noise: &[Noise]| held_out(problem, placed, noise, shapes);
    let evens: Vec<Noise> = found.iter().map(even).collect();
    let (a, b) = (left(found)?, left(&evens)?);
    let noise: Vec<Noise> = (0..a.len()).map(|c| if rms(&a[c]) <= rms(&b[c]) { found[c] } else { evens[c] }).collect();
    let mixed = left(&noise)?;
    let total = |left: &[Vec<f64>]| left.iter().map(|r| rms(r).max(f64::MIN_POSITIVE).ln()).sum::<f64>();
    [(noise, mixed), (found.to_vec(), a), (evens, b)].into_iter().min_by(|x, y| total(&x.1).total_cmp(&total(&y.1)))
}
