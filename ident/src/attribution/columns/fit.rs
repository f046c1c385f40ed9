//! One hypothesis on one log.
//!
//! What it is: noise, shapes and amplitudes of a hypothesis, each the best given the others, with the evidence for the whole: exact over
//! amplitudes, Laplace's approximation over shapes.
//! What can go wrong: a hypothesis whose numbers are not finite has no fit.
//! Units: evidence in nats; parameters in their own.
//! Reference: see `evidence`, `shapes`, `noise`.

use super::channel::Channel;
use super::design::{Column, Design, Owner, Prior, Values};
use super::evidence::{Solved, White};
use super::library::{Library, Placed};
use super::noise::Noise;
use super::shapes::climb;
use nalgebra::DMatrix;
use statrs::function::erf::erfc;
use std::sync::Arc;

/// Evidence between two rounds below which noise and shapes are settled, nats.
const SETTLED: f64 = 0.05;
/// Most rounds.
const ROUNDS: usize = 6;
/// First step of a search for new shapes, as a share of their range.
const STEP: f64 = 0.1;
/// A residual that has moved by less than this share of the white noise has not moved.
const SAME: f64 = 0.02;
/// Step over which the columns' change with a shape is taken, as a share of its range.
const DIFFERENCE: f64 = 2e-3;
/// What is expected of a shape beforehand: evenly anywhere in its range, which has this standard deviation.
const EVEN: f64 = 0.288_675;

/// What is measured, and what may be behind it.
#[derive(Clone, Copy)]
pub struct Problem<'p> {
    /// The channels.
    pub channels: &'p [Channel],
    /// What may be asked.
    pub library: &'p dyn Library,
}

/// A hypothesis with everything that the log says of it.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Its terms beside the declared model.
    pub placed: Vec<Placed>,
    /// Noise of each channel beside it.
    pub noise: Vec<Noise>,
    /// Its columns.
    pub design: Design,
    /// Amplitude of each column.
    pub amplitudes: Vec<f64>,
    /// Covariance of the amplitudes with shapes and noise as they are.
    pub covariance: DMatrix<f64>,
    /// Log marginal likelihood, nats.
    pub evidence: f64,
    /// The solved amplitudes, for what stands beside them.
    pub(crate) solved: Solved,
    /// What is left of each channel, to which its noise was fitted.
    pub(crate) residuals: Vec<Vec<f64>>,
}

impl Fit {
    /// The prediction of a channel.
    #[must_use]
    pub fn predict(&self, channels: &[Channel], channel: usize) -> Vec<f64> {
        self.design.predict(&self.amplitudes, channel, channels[channel].len())
    }

    /// What is left of a channel.
    #[must_use]
    pub fn residual(&self, channels: &[Channel], channel: usize) -> Vec<f64> {
        channels[channel].y.iter().zip(self.predict(channels, channel)).map(|(y, p)| y - p).collect()
    }

    /// Positions of the columns of the term at `place`.
    pub fn columns_of(&self, place: usize) -> impl Iterator<Item = usize> + '_ {
        self.design.columns.iter().enumerate().filter(move |(_, c)| c.owner == Owner::Term(place)).map(|(i, _)| i)
    }
}

/// Bounds of all shapes of a hypothesis, in order.
fn bounds(problem: &Problem<'_>, placed: &[Placed]) -> Vec<(f64, f64)> {
    placed.iter().flat_map(|p| problem.library.candidates()[p.candidate].shapes.iter().map(|s| s.range)).collect()
}

/// The hypothesis with other shapes, given as shares of their ranges.
fn reshaped(placed: &[Placed], bounds: &[(f64, f64)], shares: &[f64]) -> Vec<Placed> {
    let mut all = bounds.iter().zip(shares).map(|((lo, hi), s)| lo + s * (hi - lo));
    placed
        .iter()
        .map(|p| Placed { shape: p.shape.iter().map(|_| all.next().unwrap_or(f64::NAN)).collect(), ..p.clone() })
        .collect()
}

fn shares(placed: &[Placed], bounds: &[(f64, f64)]) -> Vec<f64> {
    placed.iter().flat_map(|p| &p.shape).zip(bounds).map(|(v, (lo, hi))| ((v - lo) / (hi - lo)).clamp(0.0, 1.0)).collect()
}

/// A hypothesis with its shapes and noise as they are.
struct State {
    placed: Vec<Placed>,
    noise: Vec<Noise>,
    design: Design,
    solved: Solved,
}

impl State {
    fn new(problem: &Problem<'_>, placed: Vec<Placed>, noise: Vec<Noise>) -> Option<Self> {
        let design = problem.library.design(&placed);
        let solved = White::new(problem.channels, &noise, &design).solve()?;
        Some(Self { placed, noise, design, solved })
    }

    /// Columns that say how the prediction changes with each shape, for one of its whole range.
    fn slopes(&self, problem: &Problem<'_>, bounds: &[(f64, f64)]) -> Vec<Column> {
        let at = shares(&self.placed, bounds);
        let slope = |i: usize| {
            let step = if at[i] + DIFFERENCE <= 1.0 { DIFFERENCE } else { -DIFFERENCE };
            let mut beside = at.clone();
            beside[i] += step;
            let other = problem.library.design(&reshaped(&self.placed, bounds, &beside));
            let parts = difference(problem.channels, &self.solved.amplitudes, &self.design, &other, 1.0 / step);
            Column { owner: Owner::Declared, name: "slope", prior: Prior::about_zero(EVEN), parts }
        };
        (0..bounds.len()).map(slope).collect()
    }

    /// One linear step of all shapes and amplitudes together; as it is where that makes nothing better.
    fn stepped(self, problem: &Problem<'_>, bounds: &[(f64, f64)]) -> Self {
        let Some(whole) = self.beside(problem, bounds) else { return self };
        let at = shares(&self.placed, bounds);
        let change = &whole.amplitudes[self.design.columns.len()..];
        for damping in [1.0, 0.5, 0.2] {
            let next: Vec<f64> = at.iter().zip(change).map(|(a, c)| (a + damping * c).clamp(0.0, 1.0)).collect();
            match Self::new(problem, reshaped(&self.placed, bounds, &next), self.noise.clone()) {
                Some(there) if there.solved.evidence > self.solved.evidence => return there,
                _ => {}
            }
        }
        self
    }

    /// Amplitudes and shapes solved together, linear about what they are.
    fn beside(&self, problem: &Problem<'_>, bounds: &[(f64, f64)]) -> Option<Solved> {
        let mut wide = self.design.clone();
        wide.columns.extend(self.slopes(problem, bounds));
        White::new(problem.channels, &self.noise, &wide).solve()
    }
}

/// What `other` predicts beyond `design` with the same amplitudes, times a factor; channels that do not change are left out.
pub(crate) fn difference(
    channels: &[Channel],
    amplitudes: &[f64],
    design: &Design,
    other: &Design,
    factor: f64,
) -> Vec<(usize, Values)> {
    let mut sums: Vec<Option<Vec<f64>>> = vec![None; channels.len()];
    for ((old, new), amplitude) in design.columns.iter().zip(&other.columns).zip(amplitudes) {
        let mut add = |(channel, values): &(usize, Values), factor: f64| {
            let sum = sums[*channel].get_or_insert_with(|| vec![0.0; values.len()]);
            sum.iter_mut().zip(values.iter()).for_each(|(s, v)| *s += factor * v);
        };
        for part in &new.parts {
            let before = old.parts.iter().find(|p| p.0 == part.0);
            if before.is_none_or(|b| !Arc::ptr_eq(&b.1, &part.1) && b.1 != part.1) {
                add(part, amplitude * factor);
                before.into_iter().for_each(|b| add(b, -amplitude * factor));
            }
        }
    }
    sums.into_iter().enumerate().filter_map(|(c, s)| Some((c, Arc::new(s?)))).collect()
}

/// Fits a hypothesis, from the noise of another (or from the floors); the shapes of its last `fresh` terms may lie far off.
#[must_use]
pub fn fit(problem: &Problem<'_>, placed: &[Placed], from: Option<&Fit>, fresh: usize) -> Option<Fit> {
    let bounds = bounds(problem, placed);
    let noise: Vec<Noise> = from.map_or_else(|| problem.channels.iter().map(Noise::floor).collect(), |f| f.noise.clone());
    let mut residuals = from.map_or_else(|| vec![Vec::new(); problem.channels.len()], |f| f.residuals.clone());
    let placed = from_far(problem, placed, &noise, placed.len() - fresh);
    let mut state = State::new(problem, placed, noise)?;
    for _ in 0..ROUNDS {
        let before = state.solved.evidence;
        if !bounds.is_empty() {
            state = state.stepped(problem, &bounds);
        }
        refit_noise(problem.channels, &mut state, &mut residuals);
        state.solved = White::new(problem.channels, &state.noise, &state.design).solve()?;
        if state.solved.evidence - before < SETTLED {
            break;
        }
    }
    let covariance = state.solved.covariance();
    let signs = sign_evidence(&state.design, &state.solved.amplitudes, &covariance);
    let evidence = state.solved.evidence + shape_evidence(problem, &state, &bounds) + signs;
    let State { placed, noise, design, solved } = state;
    Some(Fit { placed, noise, design, amplitudes: solved.amplitudes.clone(), covariance, evidence, solved, residuals })
}

/// The shapes of the terms from `first` on, sought from far while all others stay.
fn from_far(problem: &Problem<'_>, placed: &[Placed], noise: &[Noise], first: usize) -> Vec<Placed> {
    let own = bounds(problem, &placed[first..]);
    if own.is_empty() {
        return placed.to_vec();
    }
    let with = |x: &[f64]| [&placed[..first], reshaped(&placed[first..], &own, x).as_slice()].concat();
    let value = |x: &[f64]| State::new(problem, with(x), noise.to_vec()).map_or(f64::NEG_INFINITY, |s| s.solved.evidence);
    with(&climb(&value, &shares(&placed[first..], &own), STEP))
}

/// Laplace's approximation for the shapes: how much of their ranges the data leave.
fn shape_evidence(problem: &Problem<'_>, state: &State, bounds: &[(f64, f64)]) -> f64 {
    let n = state.design.columns.len();
    let Some(whole) = state.beside(problem, bounds).filter(|_| !bounds.is_empty()) else { return 0.0 };
    let width = whole.covariance().view((n, n), (bounds.len(), bounds.len())).into_owned();
    (half_log_det(&width) + 0.5 * bounds.len() as f64 * std::f64::consts::TAU.ln()).min(0.0)
}

/// The hypothesis with the shapes that are best on some of the readings alone (`channels`, which are those at `rows`), by one linear step.
pub(crate) fn shapes_on(
    problem: &Problem<'_>,
    placed: &[Placed],
    noise: &[Noise],
    channels: &[Channel],
    rows: &[Vec<usize>],
) -> Vec<Placed> {
    let bounds = bounds(problem, placed);
    let Some(state) = State::new(problem, placed.to_vec(), noise.to_vec()) else { return placed.to_vec() };
    let mut wide = state.design.clone();
    wide.columns.extend(state.slopes(problem, &bounds));
    let Some(solved) = White::new(channels, noise, &wide.at(rows)).solve() else { return placed.to_vec() };
    let change = &solved.amplitudes[state.design.columns.len()..];
    let next: Vec<f64> = shares(placed, &bounds).iter().zip(change).map(|(a, c)| (a + c).clamp(0.0, 1.0)).collect();
    reshaped(placed, &bounds, &next)
}

/// What is left of the evidence where physics asks for a sign: a prior of one side only, the other half of the posterior cut off.
fn sign_evidence(design: &Design, amplitudes: &[f64], covariance: &DMatrix<f64>) -> f64 {
    let signed = design.columns.iter().enumerate().filter(|(_, c)| c.prior.sign != 0.0);
    let right = |(i, c): (usize, &Column)| {
        let z = c.prior.sign * amplitudes[i] / covariance[(i, i)].sqrt().max(f64::MIN_POSITIVE);
        // 2 Phi(z), by its tail far on the wrong side
        if z < -5.0 { -0.5 * z * z - (-z * 1.2533).ln() } else { erfc(-z * std::f64::consts::FRAC_1_SQRT_2).ln() }
    };
    signed.map(right).sum()
}

fn half_log_det(matrix: &DMatrix<f64>) -> f64 {
    matrix.clone().cholesky().map_or(0.0, |c| c.l_dirty().diagonal().iter().map(|d| d.ln()).sum())
}

/// Fits the noise of each channel of which something else is left than `residuals` to that, and keeps it there.
fn refit_noise(channels: &[Channel], state: &mut State, residuals: &mut [Vec<f64>]) {
    for (c, (channel, old)) in channels.iter().zip(residuals).enumerate() {
        let predicted = state.design.predict(&state.solved.amplitudes, c, channel.len());
        let now: Vec<f64> = channel.y.iter().zip(&predicted).map(|(y, p)| y - p).collect();
        let slack = SAME * state.noise[c].white;
        let same = old.len() == now.len() && old.iter().zip(&now).all(|(a, b)| (a - b).abs() <= slack);
        if !same {
            state.noise[c] = state.noise[c].fitted(channel, &now);
            *old = now;
        }
    }
}

/// Values and covariance of all parameters of a fit, shapes (in the order of the hypothesis) first and amplitudes after them.
#[must_use]
pub fn parameters(problem: &Problem<'_>, fit: &Fit) -> (Vec<f64>, DMatrix<f64>) {
    let bounds = bounds(problem, &fit.placed);
    let (k, n) = (bounds.len(), fit.amplitudes.len());
    let shapes = fit.placed.iter().flat_map(|p| p.shape.iter().copied());
    let values: Vec<f64> = shapes.chain(fit.amplitudes.iter().copied()).collect();
    let state = State::new(problem, fit.placed.clone(), fit.noise.clone());
    let whole = state.and_then(|s| s.beside(problem, &bounds)).map_or_else(|| DMatrix::zeros(k + n, k + n), |s| s.covariance());
    let place = |i: usize| if i < k { (n + i, bounds[i].1 - bounds[i].0) } else { (i - k, 1.0) };
    let covariance = DMatrix::from_fn(k + n, k + n, |i, j| {
        let ((a, x), (b, y)) = (place(i), place(j));
        x * y * whole[(a, b)]
    });
    (values, covariance)
}
