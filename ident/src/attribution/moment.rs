//! Whether a name, or what nothing explains, is borne by more than one moment of a run.
//!
//! What it is: against a declared model, the evidence that an effect has left once the stretch of a second that speaks loudest for it is
//! taken out. A model is off here and there for a moment (a rotor that starts, a row between two commands), by more on one day than on
//! another, and something in the library always fits a single moment.
//! What can go wrong: an effect that acts once, for less than a second, is not named; effects whose nature are single rows are not asked.
//! Units: nats, s.
//! Reference: case deletion, Cook 1977, Technometrics 19:15.

use crate::attribution::evidence::penalty;
use crate::channel::Context;
use crate::effects::NEEDED_EVIDENCE;
use crate::fit::Fit;
use crate::fit::heldout;
use crate::model::Declared;

/// Half the length of a moment, s.
const HALF: f64 = 0.5;

/// Whether the newest effect of a fit brings enough over the fit `before` it without its best moment.
pub(crate) fn lasts(context: &Context, declared: Declared<'_>, before: &Fit, after: &Fit) -> bool {
    let Some(newest) = after.placed.last().filter(|p| context.against_model && !p.effect.is_of_moments(&p.instance)) else {
        return true;
    };
    let mut gains = vec![0.0; context.len()];
    let (without, with) = (heldout::residuals(context, declared, before), heldout::residuals(context, declared, after));
    for (i, target) in context.targets.iter().enumerate().filter(|(_, t)| newest.instance.touches(t.name)) {
        let square = |residuals: &[f64], j: usize| target.news(target.rows[j], residuals[j]).powi(2);
        let left = (0..target.rows.len()).map(|j| square(&with[i], j)).sum::<f64>() / target.rows.len().max(1) as f64;
        // half a square for each variance, that of the noise or of what is left
        let weight = 0.5 * after.targets[i].share / left.max(target.noise.rms.powi(2));
        for (j, row) in target.rows.iter().enumerate() {
            gains[*row] += weight * (square(&without[i], j) - square(&with[i], j));
        }
    }
    let shares: Vec<f64> = after.targets.iter().map(|t| t.share).collect();
    gains.iter().sum::<f64>() - best_moment(&context.t, &gains) - penalty(context, newest, &shares) > NEEDED_EVIDENCE
}

/// Largest sum over a moment.
pub(crate) fn best_moment(t: &[f64], gains: &[f64]) -> f64 {
    let (mut from, mut sum, mut best) = (0, 0.0, 0.0);
    for (to, gain) in gains.iter().enumerate() {
        sum += gain;
        while t[to] - t[from] > 2.0 * HALF {
            sum -= gains[from];
            from += 1;
        }
        best = f64::max(best, sum);
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_second_of_a_run() {
        let t: Vec<f64> = (0..100).map(|i| 0.1 * f64::from(i)).collect();
        let mut gains = vec![0.1; 100];
        gains[50] = 20.0;
        gains[55] = 10.0;
        gains[70] = 15.0;
        let best = best_moment(&t, &gains);
        assert!((best - (30.0 + 0.1 * 9.0)).abs() < 0.11, "{best}");
    }
}
