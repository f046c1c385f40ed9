//! A cause named on one run of a rig, tried on the rig's other runs.
//!
//! What it is: the corrected model of a run, and the model refitted to that run without one effect, both predict another run as
//! they stand, but for one constant a channel, which is each run's own (tare, supply level); the cause holds where the first is better on a channel that the effect touches. An effect that
//! the readings show by themselves (a grid that they lie on) holds where the other run's readings show it.
//! What can go wrong: a rig with one run has nothing to try.
//! Units: the channel's.
//! Reference: specification `closing-the-loop.md` (`--validate`); `formats.md`, effects act in the run's own time.

use super::Recorded;
use ident::channel::{Context, Relation, Target};
use ident::close::Closed;
use ident::fit::search::refine;
use ident::fit::{Rows, fit};
use ident::log::Log;
use ident::model::Declared;
use ident::model::Model;

/// Share of the error that a cause must remove on another run to hold there.
const HOLDS: f64 = 0.02;
/// Evaluations for the shapes of the model without the effect.
const EVALUATIONS: usize = 60;

/// One cause on one other run.
pub(crate) struct Tried {
    /// Run on which it was named.
    pub(crate) from: String,
    /// Its id.
    pub(crate) id: String,
    /// Channel of the figures.
    pub(crate) channel: String,
    /// The other run.
    pub(crate) on: String,
    /// Error there without the effect, and with it.
    pub(crate) errors: (f64, f64),
    /// Whether the other run's readings show it by themselves, whatever is predicted; unknown of an effect that readings do not show.
    pub(crate) seen_there: Option<bool>,
    /// Whether the verdict stands for it, and not for it or another.
    pub(crate) claimed: bool,
    /// Whether the other run's own verdict names it too.
    pub(crate) named_there: bool,
}

impl Tried {
    /// Whether the cause holds on the other run.
    pub(crate) fn holds(&self) -> bool {
        self.seen_there.unwrap_or(self.errors.1 < (1.0 - HOLDS) * self.errors.0)
    }
}

/// Every cause of every run on the other runs of its rig.
pub(crate) fn across(runs: &[Recorded], progress: &mut dyn FnMut(f64)) -> Vec<Tried> {
    let mut out = Vec::new();
    for (done, run) in runs.iter().enumerate() {
        progress(done as f64 / runs.len() as f64);
        let (Ok(closed), Some(log)) = (&run.closed, &run.log) else { continue };
        let corrected = closed.model.elsewhere();
        for (k, placed) in closed.diagnosis.best.fit.placed.iter().enumerate() {
            // a drift and an event belong to their run
            if !corrected
                .effects
                .iter()
                .any(|e| e.placed.effect.id() == placed.effect.id() && e.placed.instance == placed.instance)
            {
                continue;
            }
            if !runs.iter().any(|o| o.rig == run.rig && o.name != run.name) {
                continue;
            }
            let Some(without) = without(closed, log, k) else { continue };
            let seen_here = placed.effect.seen(&closed.context, &placed.instance) > 0.0;
            let moments = placed.effect.is_of_moments(&placed.instance);
            for other in runs.iter().filter(|o| o.rig == run.rig && o.name != run.name) {
                let Some(there) = &other.log else { continue };
                let context = closed.model.context(there);
                let best = context
                    .targets
                    .iter()
                    .filter(|t| !t.relation.is_evidence() && placed.instance.touches(t.name))
                    .filter_map(|t| {
                        Some((t.name, error(&without, &context, t.name, moments)?, error(&corrected, &context, t.name, moments)?))
                    })
                    .min_by(|a, b| (a.2 / a.1).total_cmp(&(b.2 / b.1)));
                let Some((channel, before, after)) = best else { continue };
                let id = placed.effect.id();
                out.push(Tried {
                    from: run.name.clone(),
                    id: id.to_owned(),
                    channel: channel.to_owned(),
                    on: other.name.clone(),
                    errors: (before, after),
                    seen_there: seen_here.then(|| placed.effect.seen(&context, &placed.instance) > 0.0),
                    claimed: closed.diagnosis.claims(k),
                    named_there: other.closed.as_ref().is_ok_and(|c| c.verdict.effects.iter().any(|e| e.id == id)),
                });
            }
        }
    }
    out
}

/// The run's model refitted without one of its effects.
fn without(closed: &Closed, log: &Log, k: usize) -> Option<Model> {
    let mut placed = closed.diagnosis.best.fit.placed.clone();
    placed.remove(k);
    let (context, declared) = (&closed.context, Declared::default());
    let placed = refine(context, declared, &placed, Rows::All, EVALUATIONS);
    let fitted = fit(context, declared, &placed, None, Rows::All)?;
    Some(Model::from_fit(context, log, declared, &fitted).supplied_by(context).elsewhere())
}

/// Error of a channel on the rows of which something is claimed; of an effect that is single readings, on those readings too.
fn error(model: &Model, context: &Context, name: &'static str, of_moments: bool) -> Option<f64> {
    let target = &context.targets[context.target(name)?];
    let prediction = model.predict(context, name)?;
    let of_speed = |t: &Target| matches!(t.relation, Relation::SpeedFromPulse | Relation::SpeedAlone);
    // nothing is predicted from a speed that is no speed
    let given = |i: usize| of_speed(target) || context.targets.iter().filter(|t| of_speed(t)).all(|t| t.claims(i));
    let judged = |i: usize| given(i) && (of_moments || target.claims(i));
    let residual = || target.rows.iter().zip(&target.y).filter(|(i, _)| judged(**i)).map(|(i, y)| y - prediction[*i]);
    let n = residual().count() as f64;
    let own = residual().sum::<f64>() / n;
    let rms = (residual().map(|r| (r - own).powi(2)).sum::<f64>() / n).sqrt();
    rms.is_finite().then_some(rms)
}
