//! A cause named on one run of a rig, tried on the rig's other runs.
//!
//! What it is: the corrected model of a run, and the model refitted to that run without one effect, both predict another run as
//! they stand, but for one constant a channel, which is each run's own (tare, supply level); the cause holds where the first is better on a channel that the effect touches.
//! What can go wrong: a rig with one run has nothing to try.
//! Units: the channel's.
//! Reference: specification `closing-the-loop.md` (`--validate`); `formats.md`, effects act in the run's own time.

use super::Recorded;
use ident::close::Closed;
use ident::context::Context;
use ident::hypothesis::{Declared, Rows, fit};
use ident::log::Log;
use ident::model::Model;
use ident::search::refine;

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
    /// Whether the other run's own verdict names it too.
    pub(crate) named_there: bool,
}

impl Tried {
    /// Whether the cause holds on the other run.
    pub(crate) fn holds(&self) -> bool {
        self.errors.1 < (1.0 - HOLDS) * self.errors.0
    }
}

/// Every cause of every run on the other runs of its rig.
pub(crate) fn across(runs: &[Recorded]) -> Vec<Tried> {
    let mut out = Vec::new();
    for run in runs {
        let (Ok(closed), Some(log)) = (&run.closed, &run.log) else { continue };
        for (k, placed) in closed.diagnosis.best.fit.placed.iter().enumerate() {
            if !runs.iter().any(|o| o.rig == run.rig && o.name != run.name) {
                continue;
            }
            let Some(without) = without(closed, log, k) else { continue };
            for other in runs.iter().filter(|o| o.rig == run.rig && o.name != run.name) {
                let Some(there) = &other.log else { continue };
                let context = Context::new(there, Some(closed.model.start_pulse_us));
                let best = context
                    .targets
                    .iter()
                    .filter(|t| !t.relation.is_evidence() && placed.instance.touches(t.name))
                    .filter_map(|t| Some((t.name, error(&without, &context, t.name)?, error(&closed.model, &context, t.name)?)))
                    .min_by(|a, b| (a.2 / a.1).total_cmp(&(b.2 / b.1)));
                let Some((channel, before, after)) = best else { continue };
                let id = placed.effect.id();
                out.push(Tried {
                    from: run.name.clone(),
                    id: id.to_owned(),
                    channel: channel.to_owned(),
                    on: other.name.clone(),
                    errors: (before, after),
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
    Some(Model::from_fit(context, log, declared, &fitted))
}

fn error(model: &Model, context: &Context, name: &'static str) -> Option<f64> {
    let target = &context.targets[context.target(name)?];
    let prediction = model.predict(context, name)?;
    let n = target.rows.len() as f64;
    let residual = || target.rows.iter().zip(&target.y).map(|(i, y)| y - prediction[*i]);
    let own = residual().sum::<f64>() / n;
    let rms = (residual().map(|r| (r - own).powi(2)).sum::<f64>() / n).sqrt();
    rms.is_finite().then_some(rms)
}
