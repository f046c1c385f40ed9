//! Causes that a run cannot show.
//!
//! What it is: an effect may be there and leave a residual that other things leave as well: an encoder that is never uncoupled brakes like any
//! friction, a load cell's hysteresis is a bend of its curve where the load only climbs, a sag that no voltage shows is a weak motor. Such a
//! cause is never named. Where the cause is unknown and it would explain most of what is left, or where names explain no more than it does alone,
//! it is listed, so that the next run can ask: uncouple the encoder, come back down, measure the voltage.
//! What can go wrong: what is listed has not been tested against anything but nothing.
//! Units: evidence in nats.
//! Reference: specification `closing-the-loop.md`, step 7.

use crate::attribution::evidence::{Candidate, evidence_over, weigh};
use crate::attribution::rivals::Rival;
use crate::attribution::round::Scanned;
use crate::channel::Context;
use crate::effects;
use crate::effects::NEEDED_EVIDENCE;
use crate::effects::placed::Placed;
use crate::fit::heldout::residuals;
use crate::fit::search::{base, refine_newest, scan};
use crate::fit::{Fit, Rows, fit};
use crate::model::Declared;

/// Share of the squared residual above the noise that a suspect must take away on one of its channels.
const MOST: f64 = 0.5;

/// The suspects of a run that explain most of what the start leaves over on one of their channels: best first.
pub(crate) fn suspects(context: &Context, declared: Declared<'_>, start: &Fit) -> Vec<Candidate> {
    let ground = base(context, declared, &[]);
    let loud = vec![true; context.targets.len()];
    let offered = effects::library().iter().flat_map(|e| e.suspects(context).into_iter().map(|i| Scanned::new(*e, i)));
    let fitted = offered.filter_map(|o| {
        let (shape, _) = scan(context, &ground, o.effect, &o.instance, &loud)?;
        let placed = refine_newest(context, declared, &[Placed { effect: o.effect, instance: o.instance, shape }], Rows::All, 60);
        fit(context, declared, &placed, Some(start), Rows::All).filter(|f| makes_sense(context, f))
    });
    let explain = fitted.filter(|f| takes_most(context, declared, start, f));
    let mut all: Vec<Candidate> = explain.map(|fit| Candidate { evidence: evidence_over(context, &fit, start), fit }).collect();
    all.retain(|c| c.evidence > NEEDED_EVIDENCE);
    all.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
    all
}

/// The suspects and the effects that do best alone: best first.
pub(crate) fn nearest(context: &Context, start: &Fit, suspects: &[Candidate], singles: &[Candidate]) -> Vec<Candidate> {
    let mut all: Vec<Candidate> = suspects.iter().chain(singles).cloned().collect();
    weigh(context, &Candidate { fit: start.clone(), evidence: 0.0 }, &mut all);
    all.retain(|c| c.evidence > NEEDED_EVIDENCE);
    all
}

/// Puts the best suspect beside other names on its channels that explain no more than it does alone: it is then as probable as they are.
pub(crate) fn stand_beside<'s>(
    best: &Candidate,
    probability: &mut f64,
    rivals: &mut Vec<Rival>,
    suspects: &'s [Candidate],
) -> Option<&'s Candidate> {
    let names = best.names();
    let another = |s: &&Candidate| {
        let on_its_channels = |p: &Placed| s.fit.placed.iter().any(|q| q.instance.channels.iter().any(|c| p.instance.touches(c)));
        s.evidence > best.evidence && best.fit.placed.iter().any(on_its_channels) && s.ids().iter().all(|id| !names.contains(id))
    };
    let suspect = suspects.iter().find(another)?;
    *probability *= 0.5;
    rivals.iter_mut().for_each(|r| r.probability *= 0.5);
    rivals.insert(0, Rival { ids: suspect.ids(), probability: *probability, fit: suspect.fit.clone() });
    Some(suspect)
}

/// Whether a suspect's estimates make physical sense. A shape on its bound does no harm: nothing is named.
fn makes_sense(context: &Context, fit: &Fit) -> bool {
    let sensible = |(k, p): (usize, &Placed)| {
        let estimates = fit.estimates_given(context, k, vec![f64::NAN; p.shape.len()]);
        p.effect.plausible(context, &p.instance, &estimates)
    };
    fit.placed.iter().enumerate().all(sensible)
}

/// Whether a fit takes away most of what stands above the noise on one of the channels that it touches.
fn takes_most(context: &Context, declared: Declared<'_>, start: &Fit, fit: &Fit) -> bool {
    let (before, after) = (residuals(context, declared, start), residuals(context, declared, fit));
    let touched = |name: &str| fit.placed.iter().any(|p| p.instance.touches(name));
    let square = |i: usize, r: &[f64]| {
        let target = &context.targets[i];
        target.rows.iter().zip(r).map(|(row, v)| target.news(*row, *v).powi(2)).sum::<f64>() / r.len().max(1) as f64
    };
    context.targets.iter().enumerate().filter(|(_, t)| touched(t.name)).any(|(i, t)| {
        let (b, a, floor) = (square(i, &before[i]), square(i, &after[i]), t.noise.rms.powi(2));
        b > 1.5 * floor && b - a > MOST * (b - floor)
    })
}
