//! Separable fits: the shapes of an effect by a simplex over projected residuals, by variable projection, by Levenberg-Marquardt in all parameters.
//!
//! What it is: a constant, a load and one or two lags of it under noise, from three starts as the engine's effects have; how often the best
//! of all ways is reached, and in what time.
//! What can go wrong: a start far off ends elsewhere: that is what is counted.
//! Units: s.
//! Reference: Golub & Pereyra 2003; O'Leary & Rust 2013; Nelder & Mead 1965; More 1978.

use crate::lag::{ROWS, lagged, load};
use ident::numeric::simplex::nelder_mead;
use ident::numeric::solve::Normal;
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra34::storage::Owned;
use nalgebra34::{DMatrix, DVector, Dyn};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::time::Instant;
use varpro::prelude::*;
use varpro::problem::SeparableProblemBuilder;
use varpro::solvers::levmar::LevMarSolver;

/// Drawn cases.
const CASES: usize = 60;
/// Starts of each lag, s: those of `creep` in the engine are as far apart.
const STARTS: [f64; 3] = [2.0, 8.0, 30.0];
/// Log-likelihood that a fit may lack and still be as good, nats: the engine decides by whole ones.
const AS_GOOD: f64 = 0.01;
/// Evaluations of the simplex, as the engine allows for an effect of so many shapes.
const EVALUATIONS: usize = 80;

/// The table of separable fits.
pub fn compare() {
    println!("\n| lags | way | as good as the best, of {CASES} | median time from all starts, ms |");
    println!("| --- | --- | ---: | ---: |");
    for lags in [1, 2] {
        let cases: Vec<Vec<f64>> = (0..CASES as u64).map(|seed| case(seed, lags)).collect();
        let ways: [(&str, fn(&[f64], &[f64], &[f64]) -> f64); 3] = [
            ("simplex over projected residuals (the engine)", simplex),
            ("varpro", projected),
            ("levenberg-marquardt, all parameters", whole),
        ];
        let results: Vec<Vec<(f64, f64)>> =
            ways.iter().map(|(_, way)| cases.iter().map(|y| from_all_starts(lags, y, *way)).collect()).collect();
        for (k, (name, _)) in ways.iter().enumerate() {
            let least = |case: usize| results.iter().map(|r| r[case].0).fold(f64::INFINITY, f64::min);
            let good = (0..CASES).filter(|c| 0.5 * ROWS as f64 * (results[k][*c].0 / least(*c)).ln() <= AS_GOOD).count();
            let mut times: Vec<f64> = results[k].iter().map(|r| r.1).collect();
            times.sort_by(f64::total_cmp);
            println!("| {lags} | {name} | {good} | {:.1} |", times[CASES / 2]);
        }
    }
}

/// A run: constant, load, lags of it, noise.
fn case(seed: u64, lags: usize) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let load = load();
    let mut y = load.clone();
    for _ in 0..lags {
        let tau: f64 = (rng.random_range(0.0..1.0) * 60f64.ln()).exp();
        let size = rng.random_range(0.02..0.1) * if rng.random_bool(0.5) { 1.0 } else { -1.0 };
        let (lagged, _) = lagged(&load, tau.ln());
        y.iter_mut().zip(lagged).for_each(|(y, l)| *y += size * l);
    }
    y.iter_mut().for_each(|y| *y += 0.01 * (rng.random_range(-1.0..1.0_f64) + rng.random_range(-1.0..1.0)));
    y
}

/// The least sum of squares that any start leads to, and the time that all took, ms.
fn from_all_starts(lags: usize, y: &[f64], way: fn(&[f64], &[f64], &[f64]) -> f64) -> (f64, f64) {
    let load = load();
    let begun = Instant::now();
    let starts: Vec<Vec<f64>> = match lags {
        1 => STARTS.iter().map(|s| vec![s.ln()]).collect(),
        _ => (0..3).flat_map(|a| (a + 1..3).map(move |b| vec![STARTS[a].ln(), STARTS[b].ln()])).collect(),
    };
    let least = starts.iter().map(|start| way(&load, y, start)).filter(|s| s.is_finite()).fold(f64::INFINITY, f64::min);
    (least, 1e3 * begun.elapsed().as_secs_f64())
}

fn simplex(load: &[f64], y: &[f64], start: &[f64]) -> f64 {
    let weights = vec![1.0; ROWS];
    let rss = |shape: &[f64]| {
        let mut columns = vec![vec![1.0; ROWS], load.to_vec()];
        columns.extend(shape.iter().map(|l| lagged(load, *l).0));
        Normal::of_columns(&columns, y, &weights).solve().map_or(f64::INFINITY, |s| s.rss)
    };
    // the engine's cost is a log-likelihood
    let cost = |x: &[f64]| 0.5 * ROWS as f64 * rss(x).ln();
    let steps = vec![0.5; start.len()];
    rss(&nelder_mead(&cost, start, &steps, EVALUATIONS * start.len()))
}

fn projected(load: &[f64], y: &[f64], start: &[f64]) -> f64 {
    let names: Vec<String> = (0..start.len()).map(|k| format!("l{k}")).collect();
    let of = |load: &DVector<f64>, l: f64| DVector::from_vec(lagged(load.as_slice(), l).0);
    let slope = |load: &DVector<f64>, l: f64| DVector::from_vec(lagged(load.as_slice(), l).1);
    let mut builder = SeparableModelBuilder::<f64>::new(names.iter().map(String::as_str).collect::<Vec<_>>())
        .invariant_function(|x| DVector::from_element(x.len(), 1.0))
        .invariant_function(Clone::clone);
    for name in &names {
        builder = builder.function([name.as_str()], of).partial_deriv(name.as_str(), slope);
    }
    let model = builder.independent_variable(DVector::from_column_slice(load)).initial_parameters(start.to_vec()).build();
    let Ok(model) = model else { return f64::INFINITY };
    let problem = SeparableProblemBuilder::new(model).observations(DVector::from_column_slice(y)).build();
    let Ok(problem) = problem else { return f64::INFINITY };
    match LevMarSolver::default().solve(problem) {
        Ok(fit) => fit.best_fit().map_or(f64::INFINITY, |fit| fit.iter().zip(y).map(|(a, b)| (a - b).powi(2)).sum()),
        Err(_) => f64::INFINITY,
    }
}

/// The same in all parameters at once.
struct Whole<'y> {
    load: &'y [f64],
    y: &'y [f64],
    lags: usize,
    at: DVector<f64>,
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Whole<'_> {
    type ParameterStorage = Owned<f64, Dyn>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        self.at.copy_from(x);
    }

    fn params(&self) -> DVector<f64> {
        self.at.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let mut out: Vec<f64> = self.load.iter().zip(self.y).map(|(f, y)| self.at[0] + self.at[1] * f - y).collect();
        for k in 0..self.lags {
            let size = self.at[2 + 2 * k];
            lagged(self.load, self.at[3 + 2 * k]).0.iter().zip(&mut out).for_each(|(l, out)| *out += size * l);
        }
        Some(DVector::from_vec(out))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let mut out = DMatrix::zeros(ROWS, 2 + 2 * self.lags);
        out.column_mut(0).fill(1.0);
        out.column_mut(1).copy_from_slice(self.load);
        for k in 0..self.lags {
            let (of, slope) = lagged(self.load, self.at[3 + 2 * k]);
            out.column_mut(2 + 2 * k).copy_from_slice(&of);
            let size = self.at[2 + 2 * k];
            out.column_mut(3 + 2 * k).iter_mut().zip(slope).for_each(|(out, s)| *out = size * s);
        }
        Some(out)
    }
}

fn whole(load: &[f64], y: &[f64], start: &[f64]) -> f64 {
    let mut at = vec![0.0, 1.0];
    start.iter().for_each(|l| at.extend([0.01, *l]));
    let problem = Whole { load, y, lags: start.len(), at: DVector::from_vec(at) };
    let (_, report) = LevenbergMarquardt::new().minimize(problem);
    2.0 * report.objective_function
}
