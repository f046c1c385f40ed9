//! What a channel's readings show by themselves.
//!
//! What it is: values that repeat at even intervals are a hold, and values that lie on a grid far coarser than the noise are rounded, whether or not a
//! prediction gets better by it. Where the search has named neither, they are named from the readings. No prediction changes.
//! What can go wrong: few readings show neither. Against a declared model nothing is told: it does not keep what its own day's readings showed.
//! Units: s; the channel's.
//! Reference: Widrow & Kollar 2008, *Quantization Noise*; zero-order hold.

use super::marks::{CERTAIN, stand};
use crate::channel::{Context, Target};
use crate::effects::acquisition::{quantisation, sample_hold};
use crate::effects::reported::parameter;
use crate::effects::{Effect, Estimate, Instance};
use crate::verdict::words::channel;
use crate::verdict::{BY_READINGS, EffectEntry, Kin, Verdict};

/// An effect that a channel's readings show, with what they say of it.
type Shown = (&'static dyn Effect, Instance, Vec<Estimate>);

/// Adds to a verdict what the readings show and it does not say.
pub(crate) fn tell(verdict: &mut Verdict, context: &Context) {
    // a model has no term for it, and what the logger did on its day too is no news
    if context.against_model {
        return;
    }
    let told = |verdict: &Verdict, (effect, instance, _): &Shown| {
        verdict.effects.iter().any(|e| e.id == effect.id() && e.channels.iter().any(|c| instance.touches(c)))
    };
    let judged = context.targets.iter().filter(|t| !t.relation.is_evidence());
    let news: Vec<EffectEntry> =
        judged.filter_map(|t| shown(context, t)).filter(|found| !told(verdict, found)).map(|found| entry(&found)).collect();
    if !news.is_empty() {
        stand(verdict, news);
    }
}

/// A channel that repeats its values is rounded at its updates only: of the two the hold is told.
fn shown(context: &Context, target: &Target) -> Option<Shown> {
    if context.time_is_row || context.is_table() {
        return None;
    }
    let hold = || sample_hold::by_readings(context, target).map(|(i, e)| (&sample_hold::SampleHold as &'static dyn Effect, i, e));
    let steps =
        || quantisation::by_readings(context, target).map(|(i, e)| (&quantisation::Quantisation as &'static dyn Effect, i, e));
    hold().or_else(steps)
}

fn entry((effect, instance, estimates): &Shown) -> EffectEntry {
    let about = effect.about();
    let on = instance.channels.first().map_or("", String::as_str);
    EffectEntry {
        kin: Kin::Own,
        id: effect.id().to_owned(),
        scope: effect.scope(instance),
        run: None,
        channels: instance.channels.clone(),
        depends_on: about.depends_on.iter().map(|v| (*v).to_owned()).collect(),
        equation: format!("{} [{BY_READINGS}]", about.equation),
        probability: CERTAIN,
        parameters: estimates.iter().map(|e| parameter(e, &[], on)).collect(),
        heldout_error_reduction: 0.0,
        evidence: format!("the readings of {} show it by themselves: {}", channel(on), about.signature),
    }
}
