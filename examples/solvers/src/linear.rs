//! Linear least squares: normal equations with scaled columns, QR, SVD.
//!
//! What it is: a design of the size that a channel of a run has, well and badly conditioned, and the fits that leave out a fifth of the rows in turn.
//! What can go wrong: a design without full rank: QR refuses it, the normal equations hold it by their ridge.
//! Units: none.
//! Reference: Bjorck 1996, sections 2.2 and 2.4.

use crate::lag::{ROWS, STEP, lagged, load};
use crate::timed;
use ident::numeric::solve::Normal;
use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Calls of which the median counts.
const ROUNDS: usize = 21;

/// Columns of a channel's design: powers of the speed between two ends, lags, time.
fn design(low: f64, high: f64) -> Vec<Vec<f64>> {
    let load = load();
    let speed: Vec<f64> = load.iter().map(|f| low + (high - low) * f.sqrt()).collect();
    let mut out: Vec<Vec<f64>> = (0..4).map(|k| speed.iter().map(|v| v.powi(k)).collect()).collect();
    out.extend([0.2, 0.5, 2.0, 8.0, 30.0].map(|tau: f64| lagged(&load, tau.ln()).0));
    out.push((0..ROWS).map(|i| i as f64 * STEP).collect());
    out.push(load.windows(2).map(|w| w[1] - w[0]).chain([0.0]).collect());
    out
}

/// The table of linear fits.
pub fn compare() {
    println!(
        "| design (6000 rows, 11 columns) | way | time, us | of five folds, us | largest error of a coefficient, standard errors |"
    );
    println!("| --- | --- | ---: | ---: | ---: |");
    for (name, low, high) in [("speeds 0 to 8 krpm", 0.0, 8.0), ("speeds 5 to 6 krpm", 5.0, 6.0)] {
        one(name, &design(low, high));
    }
}

fn one(name: &str, columns: &[Vec<f64>]) {
    let k = columns.len();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let truth: Vec<f64> = (0..k).map(|_| rng.random_range(-1.0..1.0)).collect();
    let exact: Vec<f64> = (0..ROWS).map(|i| columns.iter().zip(&truth).map(|(c, t)| c[i] * t).sum()).collect();
    let y: Vec<f64> = exact.iter().map(|v| v + 0.01 * (rng.random_range(-1.0..1.0_f64) + rng.random_range(-1.0..1.0))).collect();
    let weights = vec![1.0; ROWS];
    let matrix = DMatrix::from_fn(ROWS, k, |i, j| columns[j][i]);
    let right = DVector::from_vec(y.clone());
    let fold = |b: usize| b * ROWS / 5..(b + 1) * ROWS / 5;
    // the reference: SVD of columns of length one
    let norms: Vec<f64> = columns.iter().map(|c| c.iter().map(|v| v * v).sum::<f64>().sqrt()).collect();
    let scaled = DMatrix::from_fn(ROWS, k, |i, j| columns[j][i] / norms[j]);
    let svd = scaled.clone().svd(true, true);
    let best = svd.solve(&right, 0.0).expect("a solution");
    let condition = svd.singular_values.max() / svd.singular_values.min();
    let best: Vec<f64> = best.iter().zip(&norms).map(|(b, n)| b / n).collect();
    let errors = {
        let solved = Normal::of_columns(columns, &y, &weights).solve().expect("a solution");
        let variance = solved.rss / (ROWS - k) as f64;
        (0..k).map(|j| (variance * solved.inverse[(j, j)]).sqrt()).collect::<Vec<f64>>()
    };
    let off = |found: &[f64]| found.iter().zip(&best).zip(&errors).map(|((a, b), e)| (a - b).abs() / e).fold(0.0, f64::max);
    let normal = || Normal::of_columns(columns, &y, &weights).solve().expect("a solution").coefficients;
    let normal_folds = || {
        // each fold is added up once; what is left out is taken off
        let of_fold = |b: usize| {
            let part: Vec<Vec<f64>> = columns.iter().map(|c| c[fold(b)].to_vec()).collect();
            Normal::of_columns(&part, &y[fold(b)], &weights[fold(b)])
        };
        let folds: Vec<Normal> = (0..5).map(of_fold).collect();
        let mut whole = Normal::new(k);
        folds.iter().for_each(|fold| whole.absorb(fold));
        folds.iter().map(|fold| whole.less(fold, 1.0).solve().expect("a solution").coefficients[0]).sum()
    };
    let by_qr = |matrix: DMatrix<f64>, mut right: DVector<f64>| {
        let qr = matrix.qr();
        qr.q_tr_mul(&mut right);
        qr.r().solve_upper_triangular(&right.rows(0, k)).expect("full rank")
    };
    let qr = || by_qr(scaled.clone(), right.clone()).iter().zip(&norms).map(|(b, n)| b / n).collect::<Vec<f64>>();
    let left_out = |b: usize| {
        let keep: Vec<usize> = (0..ROWS).filter(|i| !fold(b).contains(i)).collect();
        (scaled.select_rows(&keep), right.select_rows(&keep))
    };
    let qr_folds = || (0..5).map(left_out).map(|(matrix, right)| by_qr(matrix, right)[0]).sum();
    let svd = || {
        let found = matrix.clone().svd(true, true).solve(&right, 1e-14).expect("a solution");
        found.iter().copied().collect::<Vec<f64>>()
    };
    let by_svd =
        |(matrix, right): (DMatrix<f64>, DVector<f64>)| matrix.svd(true, true).solve(&right, 1e-14).expect("a solution")[0];
    let svd_folds = || (0..5).map(left_out).map(by_svd).sum();
    println!("| {name}, condition {condition:.1e} | | | | |");
    for (way, fit, folds) in [
        ("normal equations, columns scaled (the engine)", &normal as &dyn Fn() -> Vec<f64>, &normal_folds as &dyn Fn() -> f64),
        ("QR of nalgebra, columns scaled", &qr, &qr_folds),
        ("SVD of nalgebra", &svd, &svd_folds),
    ] {
        let (us, found) = timed(ROUNDS, fit);
        let (folds_us, _) = timed(5, folds);
        println!("| | {way} | {us:.0} | {folds_us:.0} | {:.1e} |", off(&found));
    }
}
