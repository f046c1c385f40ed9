//! The fit of somebody who was told which effects act.
//!
//! What it is: the named effects are placed one after the other, each in the form and on the channels that explain most, and refined
//! together; nothing is tested, nothing may be left out, nothing else may join. A yardstick for what the search found by itself.
//! What can go wrong: a name that is not in the library, or has no instance on this log, gives no fit.
//! Units: as the channels state.
//! Reference: specification `closing-the-loop.md`, "What counts as proof" (error of a fit with the true form).

use crate::channel::Context;
use crate::close::validation;
use crate::effects;
use crate::effects::placed::Placed;
use crate::fit::search::{base, refine, scan};
use crate::fit::{Rows, fit};
use crate::log::Log;
use crate::model::Declared;
use crate::model::Model;
use crate::verdict::Validation;

/// Steps of the refinement.
const EVALUATIONS: usize = 200;
/// Instances of an effect that are refined.
const PROMISING: usize = 4;

/// Errors on another run of the same rig, before, and after a fit of the effects that were told: of both what carries over to another run.
///
/// Nothing where a name cannot be placed on the log.
#[must_use]
pub fn told(log: &Log, names: &[&str], other: &Log) -> Option<Validation> {
    let context = Context::of_run(log);
    let declared = Declared::default();
    let start = fit(&context, declared, &[], None, Rows::All)?;
    let mut placed = Vec::new();
    for name in names {
        placed = with_best(&context, declared, &placed, name)?;
    }
    let fitted = fit(&context, declared, &placed, Some(&start), Rows::All)?;
    let before = Model::from_fit(&context, log, declared, &start);
    let after = Model::from_fit(&context, log, declared, &fitted);
    Some(validation(other, &before.elsewhere(), &after.elsewhere()))
}

/// What is placed, with the instance of an effect that explains most beside it.
fn with_best(context: &Context, declared: Declared<'_>, placed: &[Placed], name: &str) -> Option<Vec<Placed>> {
    let effect = *effects::library().iter().find(|e| e.id() == name)?;
    let loud = vec![true; context.targets.len()];
    let beside = base(context, declared, placed);
    let scanned = effect.instances(context).into_iter().filter_map(|instance| {
        let (shape, gain) = scan(context, &beside, effect, &instance, &loud)?;
        Some((gain, Placed { effect, instance, shape }))
    });
    let mut promising: Vec<(f64, Placed)> = scanned.collect();
    promising.sort_by(|a, b| b.0.total_cmp(&a.0));
    // a rough grid misplaces sharp effects: the first few are worked out
    let refined = promising.into_iter().take(PROMISING).filter_map(|(_, new)| {
        let all: Vec<Placed> = placed.iter().cloned().chain([new]).collect();
        let all = refine(context, declared, &all, Rows::All, EVALUATIONS);
        let fitted = fit(context, declared, &all, None, Rows::All)?;
        Some((fitted.targets.iter().map(|t| t.loglik.mean).sum::<f64>(), all))
    });
    refined.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, all)| all)
}
