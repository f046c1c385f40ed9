//! The correction of a cause without a name, chosen by rows that it has not seen.
//!
//! What it is: polynomials of 1, 2, 3 and 6 terms in each variable that a channel may depend on, and no correction at all, each
//! judged on the rows that the folds leave out, its range that of the rows that taught it. Of those that are better than no
//! correction by more than a standard error the plainest within one standard error of the best is taken; else none.
//! What can go wrong: what the folds leave out lies between rows that were seen; another run may lie beyond them, where the
//! correction is held at the ends of its range.
//! Units: squares in noise floors of each channel.
//! Reference: one-standard-error rule, Breiman et al. 1984, *Classification and Regression Trees*, section 3.4.3; specification
//! `closing-the-loop.md`, step 7.

use crate::attribution::choose::NEEDED_REDUCTION;
use crate::attribution::opponent::{correction, is_load};
use crate::channel::{Context, Relation};
use crate::effects::placed::Placed;
use crate::effects::unknown::{Unknown, variables};
use crate::effects::{Effect, Instance};
use crate::fit::Fit;
use crate::fit::heldout::{self, Sum};
use crate::model::Declared;
use crate::verdict::Scope;
use crate::verdict::words::plain::form;

/// Numbers of terms that are tried.
const TERMS: [usize; 4] = [1, 2, 3, 6];

/// One correction on the rows that the folds leave out.
struct Tried {
    /// Number of terms; none for no correction.
    terms: usize,
    fit: Fit,
    /// By fold and target.
    sums: Vec<Vec<Sum>>,
    /// Square sum of the group's claimed rows in each fold, in squared noise floors.
    squares: Vec<f64>,
}

/// A fit with the correction of a group of channels added that predicts left-out rows best beside what is placed already; the plain one where
/// several do. The second is whether it corrects anything.
pub(crate) fn correct(
    context: &Context,
    declared: Declared<'_>,
    base: &Fit,
    folds: &[Vec<bool>],
    group: &[usize],
) -> (Fit, bool) {
    let wanted: Vec<bool> = (0..context.targets.len()).map(|k| group.contains(&k)).collect();
    let tried = |terms: usize, fit: Fit| {
        let placed = |_: &[bool]| fit.placed.clone();
        // a form that was only tried shows by its wild guesses that it is the wrong one
        let sums: Vec<Vec<Sum>> =
            folds.iter().map(|out| heldout::left_out(context, declared, out, &wanted, None, &placed)).collect();
        let in_floors = |fold: &Vec<Sum>, k: &usize| fold[*k].claimed_squares / context.targets[*k].noise.rms.powi(2).max(1e-300);
        let squares = sums.iter().map(|fold| group.iter().map(|k| in_floors(fold, k)).sum()).collect();
        Tried { terms, fit, sums, squares }
    };
    let mut all = vec![tried(0, without_correction(context, base, group))];
    let beside_names = base.placed.iter().any(|p| p.effect.id() != Unknown.id());
    let offered = variables(context);
    for variable in offered.iter().filter(|v| may_correct(context, group[0], v, beside_names)) {
        for terms in TERMS {
            let fitted = correction(context, declared, base, group, &form(variable, terms));
            // where a fold cannot be fitted its rows are missing, and the rest is no comparison
            all.extend(fitted.map(|f| tried(terms, f)).filter(|t| t.judged() == all[0].judged()));
        }
    }
    let chosen = all.swap_remove(plainest(&all));
    (chosen.fit, chosen.terms > 0)
}

/// A fit with an entry for a group of channels that something is left on and nothing corrects.
pub(crate) fn without_correction(context: &Context, base: &Fit, group: &[usize]) -> Fit {
    let names: Vec<&str> = group.iter().map(|k| context.targets[*k].name).collect();
    let nothing = Placed { effect: &Unknown, instance: Instance::new(&names, ""), shape: Vec::new() };
    let placed = base.placed.iter().cloned().chain([nothing]).collect();
    Fit { placed, targets: base.targets.clone() }
}

/// Whether a correction of a channel may stand on a variable: no reading that follows the channel's load, but the command of a speed; and
/// beside names no clock of the run, over which they would have what they leave of themselves corrected on this run alone.
fn may_correct(context: &Context, target: usize, variable: &str, beside_names: bool) -> bool {
    let target = &context.targets[target];
    if beside_names && Unknown.scope(&Instance::new(&[target.name], variable)) == Scope::Run {
        return false;
    }
    let of_command = target.relation == Relation::SpeedFromPulse && variable == "pulse_us";
    of_command || !is_load(context, target, variable)
}

impl Tried {
    fn judged(&self) -> usize {
        self.sums.iter().flatten().map(|s| s.claimed).sum()
    }

    fn total(&self) -> f64 {
        self.squares.iter().sum()
    }

    /// Whether this leaves no more than another, or more by less than the standard error over the folds of the difference.
    fn as_good_as(&self, other: &Self) -> bool {
        let differences: Vec<f64> = self.squares.iter().zip(&other.squares).map(|(a, b)| a - b).collect();
        let n = differences.len() as f64;
        let mean = differences.iter().sum::<f64>() / n;
        let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        mean <= (variance / n).sqrt()
    }
}

/// Position of the plainest that is as good as the best of those that are clearly better than the first, which corrects nothing; of
/// several with as many terms the one that leaves least. The first where none is: by more than the standard error, and by as much of
/// the error as a name would need.
fn plainest(all: &[Tried]) -> usize {
    let order = |a: &usize, b: &usize| all[*a].total().total_cmp(&all[*b].total());
    let enough = (1.0 - NEEDED_REDUCTION).powi(2) * all[0].total();
    let helps = |k: &usize| all[*k].total() < enough && !all[0].as_good_as(&all[*k]);
    let Some(best) = (1..all.len()).filter(helps).min_by(order) else { return 0 };
    (1..all.len())
        .filter(|k| helps(k) && all[*k].as_good_as(&all[best]))
        .min_by(|a, b| all[*a].terms.cmp(&all[*b].terms).then(order(a, b)))
        .unwrap_or(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tried(terms: usize, squares: &[f64]) -> Tried {
        Tried { terms, fit: Fit { placed: Vec::new(), targets: Vec::new() }, sums: Vec::new(), squares: squares.to_vec() }
    }

    #[test]
    fn the_plainest_of_what_helps_is_taken_and_nothing_where_nothing_does() {
        let none = tried(0, &[10.0, 11.0, 9.0, 10.0, 10.0]);
        let (rich, plain) = (tried(6, &[2.0, 1.0, 2.0, 3.0, 2.0]), tried(1, &[1.0, 3.0, 2.0, 1.0, 3.4]));
        let (worse, lucky) = (tried(2, &[5.0, 5.0, 5.0, 5.0, 5.0]), tried(3, &[0.0, 11.0, 12.0, 9.0, 15.0]));
        let tiny = tried(1, &[9.9, 10.9, 8.9, 9.9, 9.9]);
        let choice = |others: Vec<Tried>| {
            let all: Vec<Tried> = std::iter::once(tried(0, &none.squares)).chain(others).collect();
            plainest(&all)
        };
        assert_eq!(choice(vec![rich, worse, plain]), 3, "one term does what six do");
        assert_eq!(choice(vec![lucky, tiny]), 0, "one block won and three lost; a hundredth everywhere");
    }
}
