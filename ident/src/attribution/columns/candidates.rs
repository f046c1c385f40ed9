//! First stage: what could join a hypothesis, what it would bring, and whether this log can show it at all.
//!
//! What it is: for each candidate the evidence that its columns would add with the noise as it is, and the angle between them and all that
//! stands already. A shape asks by what its start values change (a secant), so that one look is enough for each.
//! What can go wrong: beside noise that still holds a large effect every gain looks small; the order is what counts here.
//! Units: nats; squared sines.
//! Reference: score tests, Rao 1948; isolability, Krysander & Frisk 2008, IEEE Trans. SMC-A 38:1183.

use super::design::{Column, Design, Owner, Prior};
use super::evidence::{Gain, White};
use super::fit::{Fit, Problem, difference};
use super::library::{Candidate, Placed};

/// Least share of a candidate's squares that nothing else spans. The compact form of an effect is off by some tenth of itself; what is
/// smaller than that (0.1 squared) is no evidence of it.
pub const LEAST_ANGLE: f64 = 0.01;

/// A candidate beside a hypothesis.
#[derive(Debug, Clone)]
pub struct Asked {
    /// What would join: the candidate, and with it what it needs.
    pub joins: Vec<Placed>,
    /// What it would bring.
    pub gain: Gain,
    /// Logarithm of the prior odds of what would join.
    pub prior: f64,
}

impl Asked {
    /// Evidence with the prior odds, nats.
    #[must_use]
    pub fn score(&self) -> f64 {
        self.gain.nats + self.prior
    }

    /// Whether an effect of its usual size would stand out on this log beside everything else.
    #[must_use]
    pub fn can_be_shown(&self) -> bool {
        let usual = 0.5 * (self.gain.reach - (1.0 + self.gain.reach).ln());
        self.gain.angle >= LEAST_ANGLE && usual + self.prior > 0.0
    }
}

/// Logarithm of the prior odds of a candidate: half a name is expected, each as likely as any other, its forms sharing alike; and so for
/// what has no name.
#[must_use]
pub fn prior_odds(all: &[Candidate], candidate: usize) -> f64 {
    let own = &all[candidate];
    let alike: Vec<&Candidate> = all.iter().filter(|c| c.is_named() == own.is_named()).collect();
    let mut ids: Vec<&str> = alike.iter().map(|c| c.id).collect();
    ids.sort_unstable();
    ids.dedup();
    let forms = alike.iter().filter(|c| c.id == own.id).count();
    let share = 0.5 / (ids.len() * forms) as f64;
    (share / (1.0 - share)).ln()
}

/// Whether a candidate may stand beside a hypothesis.
fn fits_beside(all: &[Candidate], placed: &[Placed], candidate: usize) -> bool {
    let own = &all[candidate];
    let hits = |excludes: &Candidate, other: &Candidate| {
        excludes.excludes.iter().any(|(id, form)| *id == other.id && *form == other.form)
    };
    placed.iter().map(|p| &all[p.candidate]).all(|p| !std::ptr::eq(p, own) && !hits(own, p) && !hits(p, own))
}

/// Everything of one kind that may join a fit, each at the best of its start values, the most promising first.
#[must_use]
pub fn ask(problem: &Problem<'_>, fit: &Fit, wanted: &dyn Fn(usize, &Candidate) -> bool) -> Vec<Asked> {
    let all = problem.library.candidates();
    let white = White::new(problem.channels, &fit.noise, &fit.design);
    let there = |id: &str| fit.placed.iter().any(|p| all[p.candidate].id == id);
    let mut out = Vec::new();
    for (k, candidate) in all.iter().enumerate().filter(|(k, c)| wanted(*k, c) && fits_beside(all, &fit.placed, *k)) {
        let lacking = !candidate.needs.is_empty() && !candidate.needs.iter().any(|id| there(id));
        let with: Vec<Option<usize>> = if lacking {
            (0..all.len())
                .filter(|j| candidate.needs.contains(&all[*j].id) && fits_beside(all, &fit.placed, *j))
                .map(Some)
                .collect()
        } else {
            vec![None]
        };
        for needed in with {
            let prior = prior_odds(all, k) + needed.map_or(0.0, |j| prior_odds(all, j));
            let joins = needed.map_or_else(|| vec![Vec::new()], |j| starts(all, j));
            let ways =
                joins.iter().flat_map(|first| starts(all, k).into_iter().map(move |own| [first.as_slice(), &own].concat()));
            let best = ways
                .map(|joins| Asked { gain: white.gain(&fit.solved, &brought(problem, fit, &joins)), joins, prior })
                .max_by(|a, b| a.gain.nats.total_cmp(&b.gain.nats));
            out.extend(best);
        }
    }
    out.sort_by(|a, b| b.score().total_cmp(&a.score()));
    out
}

/// A candidate at each of its start values.
fn starts(all: &[Candidate], candidate: usize) -> Vec<Vec<Placed>> {
    all[candidate].starts.iter().map(|shape| vec![Placed { candidate, shape: shape.clone() }]).collect()
}

/// The columns that terms bring: their own, and what they change of the others at their start values.
fn brought(problem: &Problem<'_>, fit: &Fit, joins: &[Placed]) -> Vec<Column> {
    if let [one] = joins
        && let Some(columns) = problem.library.addition(&fit.placed, one)
    {
        return columns;
    }
    let with = problem.library.design(&[fit.placed.as_slice(), joins].concat());
    let first = fit.placed.len();
    let is_new = |c: &Column| matches!(c.owner, Owner::Term(k) if k >= first);
    let (own, kept): (Vec<Column>, Vec<Column>) = with.columns.into_iter().partition(is_new);
    let parts = difference(problem.channels, &fit.amplitudes, &fit.design, &Design { columns: kept }, 1.0);
    let secant = Column { owner: Owner::Term(first), name: "change", prior: Prior::about_zero(1.0), parts };
    if secant.parts.is_empty() { own } else { own.into_iter().chain([secant]).collect() }
}
