//! Several runs of one rig, in one fit.
//!
//! What it is: what belongs to the rig (its declared polynomials, effects of scope `rig`) has one set of values for all runs; the constant of
//! each channel, and drifts and events, belong to a run. Each run is predicted whole by a fit to the others, and what predicts them best
//! is named.
//! What can go wrong: runs of two rigs have no common model: every name fails on the other's runs.
//! Units: as the channels.
//! Reference: specification `formats.md`, "Scope" and `across_runs_rms`; cross-validation over groups, Roberts et al. 2017, Ecography 40:913.

mod alone;
mod choose;
mod differing;
mod entries;
mod equations;
mod folds;
mod joint;
mod outcome;
mod own;
pub mod runs;
mod scatter;
mod words;

use crate::channel::{Context, Relation, Target};
use crate::close::Closed;
use crate::effects::Stage;
use crate::effects::placed::Placed;
use crate::fit::samples::{Known, Samples};
use crate::fit::{Rows, design};
use crate::model::Declared;
use crate::verdict::Scope;

pub use alone::{RunsError, close_each};
pub use outcome::{Outcome, Shown, close_together};
pub use runs::Run;
pub(crate) use scatter::disagreement;

/// Fewest runs that can predict each other.
pub const FEWEST: usize = 2;

/// A run with what a joint fit knows of it.
#[derive(Debug, Clone)]
struct Member<'a> {
    /// The run made ready.
    context: &'a Context,
    /// Its own drifts and events, and what no other run can tell of, as it alone has them.
    own: Vec<Placed>,
    /// For each target and sample its weight, in independent samples of unit variance.
    weights: Vec<Vec<f64>>,
    /// For each target how many independent samples it holds.
    independent: Vec<f64>,
}

impl<'a> Member<'a> {
    /// A run on which the loop was closed alone. Its weights are one over the variance that its own best hypothesis leaves, less what the
    /// colour of the residual takes; a channel that this hypothesis does not fit says nothing.
    fn of(closed: &Closed, context: &'a Context, all: &[Context]) -> Self {
        let best = &closed.diagnosis.best.fit;
        let of_one = |p: &Placed| all.iter().filter(|c| tells(c, p)).count() < FEWEST;
        let is_own =
            |p: &&Placed| p.effect.id() != "unknown" && (p.effect.scope(&p.instance) != Scope::Rig || of_one(p)) && !p.is_tare();
        let own = best.placed.iter().filter(is_own).cloned().collect();
        let of_target = |(k, target): (usize, &Target)| {
            let fit = best.targets.get(k)?;
            Some((weights(context, &best.placed, k, fit.share)?, target.rows.len() as f64 * fit.share))
        };
        let targets = context.targets.iter().enumerate();
        let silent = |target: &Target| (vec![0.0; target.rows.len()], 0.0);
        let (weights, independent) = targets.map(|(k, t)| of_target((k, t)).unwrap_or_else(|| silent(t))).unzip();
        Self { context, own, weights, independent }
    }

    fn tells(&self, p: &Placed) -> bool {
        tells(self.context, p)
    }
}

/// Whether a run can tell of an effect: it has one of its channels, and is no table of levels where the effect acts between two levels.
fn tells(context: &Context, p: &Placed) -> bool {
    let acts = !matches!(p.stage(), Stage::Output | Stage::Hold) || !context.is_table();
    acts && p.instance.channels.iter().any(|c| context.target(c).is_some())
}

fn weights(context: &Context, placed: &[Placed], k: usize, share: f64) -> Option<Vec<f64>> {
    let target = &context.targets[k];
    let design = design(context, Declared::default(), placed, target);
    let samples = Samples::new(target, Rows::All, context.len());
    let (solution, _, kept) = samples.solve(&design, false, Known::default())?;
    let excess = |i: usize| kept.jumps.map_or(1.0, |(unsettled, excess)| if unsettled[i] { excess } else { 1.0 });
    let residual = kept.residual(&solution.coefficients);
    let weighted = residual.iter().zip(&target.levelled).enumerate().map(|(i, (r, v))| r * r / (v * excess(i)));
    let scale = (weighted.sum::<f64>() / residual.len() as f64).max(target.least_scale());
    Some(target.levelled.iter().enumerate().map(|(i, v)| share / (v * excess(i) * scale)).collect())
}

/// Whether a channel is one that a prediction of another run is judged on.
fn is_judged(relation: Relation) -> bool {
    !matches!(relation, Relation::ThrustRms | Relation::SpeedAlone)
}
