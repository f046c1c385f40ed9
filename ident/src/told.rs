//! The fit of somebody who was told which effects act.
//!
//! What it is: the named effects are placed one after the other, each in the form and on the channels that explain most, and refined
//! together; nothing is tested, nothing may be left out, nothing else may join. A yardstick for what the search found by itself.
//! What can go wrong: a name that is not in the library, or has no instance on this log, gives no fit.
//! Units: as the channels state.
//! Reference: specification `closing-the-loop.md`, "What counts as proof" (error of a fit with the true form).

use crate::close::validation;
use crate::context::Context;
use crate::effects;
use crate::hypothesis::{Declared, Placed, Rows, fit};
use crate::log::Log;
use crate::model::Model;
use crate::search::{base, refine, scan};
use crate::verdict::Validation;

/// Steps of the refinement.
const EVALUATIONS: usize = 200;

/// Errors on another run of the same rig, before, and after a fit of the effects that were told.
///
/// Nothing where a name cannot be placed on the log.
#[must_use]
pub fn told(log: &Log, names: &[&str], other: &Log) -> Option<Validation> {
    let context = Context::new(log, None);
    let declared = Declared::default();
    let start = fit(&context, declared, &[], None, Rows::All)?;
    let mut placed = Vec::new();
    for name in names {
        placed.push(best(&context, declared, &placed, name)?);
        placed = refine(&context, declared, &placed, Rows::All, EVALUATIONS);
    }
    let fitted = fit(&context, declared, &placed, Some(&start), Rows::All)?;
    let before = Model::from_fit(&context, log, declared, &start);
    let after = Model::from_fit(&context, log, declared, &fitted);
    Some(validation(other, &before, &after))
}

/// The instance of an effect that explains most beside what is placed.
fn best(context: &Context, declared: Declared<'_>, placed: &[Placed], name: &str) -> Option<Placed> {
    let effect = *effects::library().iter().find(|e| e.id() == name)?;
    let loud = vec![true; context.targets.len()];
    let beside = base(context, declared, placed);
    let tried = effect.instances(context).into_iter().filter_map(|instance| {
        let (shape, gain) = scan(context, &beside, effect, &instance, &loud)?;
        Some((gain, Placed { effect, instance, shape }))
    });
    tried.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, placed)| placed)
}
