//! The best shapes of a new term, sought from far.
//!
//! What it is: a simplex search within bounds; once near, `fit` goes on by linear steps.
//! What can go wrong: a function that is flat or ends at a bound stays where it is.
//! Units: shapes in shares of their range, the function in nats.
//! Reference: Nelder & Mead 1965, Computer Journal 7:308.

use crate::numeric::simplex::nelder_mead;

/// Evaluations for each shape.
const EVALUATIONS: usize = 16;

/// Where `f` is largest within the unit cube, from `start` and with first steps of `step`.
pub(crate) fn climb(f: &dyn Fn(&[f64]) -> f64, start: &[f64], step: f64) -> Vec<f64> {
    let inside = |x: &[f64]| -> Vec<f64> { x.iter().map(|v| v.clamp(0.0, 1.0)).collect() };
    let cost = |x: &[f64]| {
        let at = inside(x);
        // a soft wall keeps the simplex inside
        -f(&at) + 1e3 * x.iter().zip(&at).map(|(a, b)| (a - b).abs()).sum::<f64>()
    };
    let steps: Vec<f64> = start.iter().map(|v| if v + step <= 1.0 { step } else { -step }).collect();
    inside(&nelder_mead(&cost, start, &steps, EVALUATIONS * start.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hill_is_climbed() {
        let hill = |x: &[f64]| -0.5 * ((x[0] - 0.3).powi(2) / 1e-4 + (x[1] - 0.62).powi(2) / 4e-4);
        let at = climb(&hill, &[0.4, 0.5], 0.1);
        assert!((at[0] - 0.3).abs() < 1e-2 && (at[1] - 0.62).abs() < 2e-2, "{at:?}");
    }

    #[test]
    fn a_bound_holds() {
        assert!((climb(&|x: &[f64]| 10.0 * x[0], &[0.5], 0.1)[0] - 1.0).abs() < 1e-2);
    }
}
