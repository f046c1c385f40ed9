//! The least of a likelihood's cost in a box.
//!
//! What it is: Levenberg and Marquardt's descent on what a fit leaves once its coefficients are solved for (variable projection). The curvature
//! comes from the residuals' differences, the slope from those of the cost, which holds priors and profiled scales too. A parameter on its bound
//! that the cost would push further stays there.
//! What can go wrong: it ends in the valley it starts in. Where a parameter moves rows across an edge, points beside it are asked as well.
//! Units: parameters in their first steps; costs in nats; residuals whitened.
//! Reference: Marquardt 1963, J. SIAM 11:431; Golub & Pereyra 1973, SIAM J. Numer. Anal. 10:413; bounds: Kanzow, Yamashita & Fukushima 2004.

use nalgebra::{DMatrix, DVector};

/// A gain that no decision sees, nats.
const SMALL: f64 = 0.01;
/// Difference of a parameter by which the cost rises by about this much, nats: far above rounding, small beside what decides.
const RISE: f64 = 0.005;
/// First, least and largest difference, in first steps.
const DIFFERENCE: [f64; 3] = [0.02, 1e-5, 0.1];
/// Longest move of a parameter, in first steps.
const LONGEST: f64 = 4.0;
/// Damping at the start, and by what a move that fails multiplies it; one that succeeds divides by the same.
const DAMPING: [f64; 2] = [1e-3, 10.0];
/// Moves that may fail one after the other.
const FAILURES: usize = 5;
/// Share of a parameter's curvature that one residual holds from which on it moves rows across an edge, as an instant does: its slope says little.
const SHARP: f64 = 0.2;

/// Cost and whitened residuals at some parameters; `None` where there is no fit.
pub(crate) type Left<'a> = &'a dyn Fn(&[f64]) -> Option<(f64, Vec<f64>)>;

struct Point {
    u: DVector<f64>,
    cost: f64,
    left: Vec<f64>,
}

struct Asked<'a> {
    left: Left<'a>,
    x0: &'a [f64],
    steps: &'a [f64],
    low: DVector<f64>,
    high: DVector<f64>,
    used: usize,
    difference: DVector<f64>,
    sharp: Vec<bool>,
}

impl Asked<'_> {
    fn x(&self, u: &DVector<f64>) -> Vec<f64> {
        (0..u.len()).map(|i| self.x0[i] + u[i] * self.steps[i]).collect()
    }

    fn at(&mut self, u: &DVector<f64>) -> Option<Point> {
        let u = DVector::from_fn(u.len(), |i, _| u[i].clamp(self.low[i], self.high[i]));
        self.used += 1;
        let (cost, left) = (self.left)(&self.x(&u)).filter(|l| l.0.is_finite())?;
        Some(Point { u, cost, left })
    }

    /// Slope and curvature at a point.
    fn slopes(&mut self, here: &Point) -> (DVector<f64>, DMatrix<f64>) {
        let n = here.u.len();
        let mut slope = DVector::zeros(n);
        let mut jacobian = DMatrix::zeros(here.left.len(), n);
        for i in 0..n {
            let own = self.difference[i];
            let h = if here.u[i] + own > self.high[i] { -own } else { own };
            let mut u = here.u.clone();
            u[i] += h;
            let Some(there) = self.at(&u).filter(|t| t.left.len() == here.left.len() && t.u[i] != here.u[i]) else { continue };
            let h = there.u[i] - here.u[i];
            jacobian.column_mut(i).iter_mut().zip(there.left.iter().zip(&here.left)).for_each(|(j, (a, b))| *j = (a - b) / h);
            let curvature = jacobian.column(i).norm_squared();
            slope[i] = (there.cost - here.cost) / h - 0.5 * curvature * h;
            if curvature > 0.0 {
                self.difference[i] = (2.0 * RISE / curvature).sqrt().clamp(DIFFERENCE[1], DIFFERENCE[2]);
                self.sharp[i] = jacobian.column(i).amax().powi(2) > SHARP * curvature;
            }
        }
        (slope, jacobian.transpose() * &jacobian)
    }

    /// A better point a step away along one of the parameters of which the slope says little.
    fn beside(&mut self, here: &Point) -> Option<Point> {
        for i in (0..here.u.len()).filter(|i| self.sharp[*i]).collect::<Vec<_>>() {
            for by in [-DIFFERENCE[2], DIFFERENCE[2]] {
                let mut u = here.u.clone();
                u[i] += by;
                if let Some(there) = self.at(&u).filter(|t| t.cost < here.cost - SMALL) {
                    return Some(there);
                }
            }
        }
        None
    }
}

/// The move that a quadratic with this slope and curvature asks for, damped, within the room that each parameter has below and above. One that
/// would leave its room goes to the end of it, and the others are asked again.
fn step(slope: &DVector<f64>, curvature: &DMatrix<f64>, room: &[(f64, f64)], damping: f64) -> Option<DVector<f64>> {
    let n = room.len();
    let mut out = DVector::zeros(n);
    let mut own: Vec<usize> =
        (0..n).filter(|i| !(room[*i].0 >= 0.0 && slope[*i] > 0.0 || room[*i].1 <= 0.0 && slope[*i] < 0.0)).collect();
    let largest = own.iter().map(|i| curvature[(*i, *i)]).fold(0.0, f64::max);
    while !own.is_empty() {
        let damped = DMatrix::from_fn(own.len(), own.len(), |a, b| {
            let v = curvature[(own[a], own[b])];
            if a == b { v + damping * v.max(1e-6 * largest) + f64::MIN_POSITIVE } else { v }
        });
        let given = curvature * &out;
        let down = DVector::from_fn(own.len(), |a, _| -slope[own[a]] - given[own[a]]);
        let moved = damped.cholesky()?.solve(&down);
        let beyond = |a: usize| (room[own[a]].0 - moved[a]).max(moved[a] - room[own[a]].1);
        let furthest = (0..own.len()).max_by(|a, b| beyond(*a).total_cmp(&beyond(*b)))?;
        if beyond(furthest) <= 0.0 {
            own.iter().zip(moved.iter()).for_each(|(i, v)| out[*i] = *v);
            break;
        }
        let i = own.remove(furthest);
        out[i] = moved[furthest].clamp(room[i].0, room[i].1);
    }
    let longest = out.amax();
    if longest > LONGEST {
        out *= LONGEST / longest;
    }
    Some(out)
}

/// Where the cost is least within `ranges`: from `x0` with first `steps`, after about so many evaluations.
pub(crate) fn descend(left: Left<'_>, x0: &[f64], steps: &[f64], ranges: &[(f64, f64)], evaluations: usize) -> Vec<f64> {
    let n = x0.len();
    let bound = |of: &dyn Fn(&(f64, f64)) -> f64| DVector::from_fn(n, |i, _| (of(&ranges[i]) - x0[i]) / steps[i]);
    let (low, high) = (bound(&|r| r.0), bound(&|r| r.1));
    let difference = DVector::from_element(n, DIFFERENCE[0]);
    let mut asked = Asked { left, x0, steps, low, high, used: 0, difference, sharp: vec![false; n] };
    let Some(mut here) = asked.at(&DVector::zeros(n)) else { return x0.to_vec() };
    let mut damping = DAMPING[0];
    while asked.used + n < evaluations {
        let next = down(&mut asked, &here, &mut damping).or_else(|| asked.beside(&here));
        let Some(next) = next else { break };
        // a short step may gain little on a long way
        let done = here.cost - next.cost < SMALL && damping <= DAMPING[0];
        here = next;
        if done {
            break;
        }
    }
    asked.x(&here.u)
}

/// The next point downhill, less and less far away; `None` where nothing better is near.
fn down(asked: &mut Asked<'_>, here: &Point, damping: &mut f64) -> Option<Point> {
    let (slope, curvature) = asked.slopes(here);
    let room = |i: usize| (asked.low[i] - here.u[i], asked.high[i] - here.u[i]);
    let room: Vec<(f64, f64)> = (0..here.u.len()).map(room).collect();
    let free = step(&slope, &curvature, &room, DAMPING[0])?;
    if -slope.dot(&free) - 0.5 * (&curvature * &free).dot(&free) < SMALL {
        return None;
    }
    for _ in 0..=FAILURES {
        let moved = step(&slope, &curvature, &room, *damping)?;
        if let Some(there) = asked.at(&(&here.u + &moved)).filter(|t| t.cost < here.cost) {
            *damping = (*damping / DAMPING[1]).max(1e-9);
            return Some(there);
        }
        *damping = damping.max(DAMPING[0]) * DAMPING[1];
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    fn least(left: &dyn Fn(&[f64]) -> Vec<f64>, x0: &[f64], ranges: &[(f64, f64)]) -> (Vec<f64>, f64, usize) {
        let asked = Cell::new(0);
        let half = |r: &[f64]| 0.5 * r.iter().map(|v| v * v).sum::<f64>();
        let counted = |x: &[f64]| {
            asked.set(asked.get() + 1);
            let r = left(x);
            Some((half(&r), r))
        };
        let steps: Vec<f64> = x0.iter().map(|x| 0.15 * x.abs().max(0.1)).collect();
        let found = descend(&counted, x0, &steps, ranges, 300);
        let cost = half(&left(&found));
        (found, cost, asked.get())
    }

    #[test]
    fn a_curved_valley_is_walked_down() {
        let left = |x: &[f64]| vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0], 30.0 * (x[2] - 0.7)];
        let (found, cost, asked) = least(&left, &[-1.2, 1.0, 1.0], &[(-10.0, 10.0); 3]);
        assert!(cost < 0.02 && asked < 120, "{found:?} {asked}");
    }

    #[test]
    fn a_bound_holds_and_the_rest_goes_on() {
        let left = |x: &[f64]| vec![14.0 * (x[0] + 1.0), 8.0 * (x[1] - 2.0 + 0.3 * x[0])];
        let (found, _, asked) = least(&left, &[0.5, 1.0], &[(0.2, 4.0), (0.1, 5.0)]);
        assert!((found[0] - 0.2).abs() < 1e-9 && (found[1] - 1.94).abs() < 0.02 && asked < 20, "{found:?} {asked}");
    }

    /// An instant moves rows across an edge: between two rows nothing changes.
    #[test]
    fn an_instant_is_found_beside() {
        let left = |x: &[f64]| {
            (0..200)
                .map(|k| {
                    let of = |at: f64| if f64::from(k) >= 100.0 * at { 1.0 } else { 0.0 };
                    2.0 * (of(1.173) - of(x[0]))
                })
                .collect()
        };
        let (found, cost, _) = least(&left, &[0.9], &[(0.0, 2.0)]);
        assert!(cost < 0.1, "{found:?} {cost}");
    }

    #[test]
    fn the_least_is_left_after_a_look_around() {
        let left = |x: &[f64]| vec![45.0 * (x[0] - 1.0), 3.0 * (x[1] - 1.0)];
        let (found, _, asked) = least(&left, &[1.0, 1.0], &[(0.0, 4.0); 2]);
        assert!(found == [1.0, 1.0] && asked <= 7, "{found:?} {asked}");
    }
}
