//! The loop itself: log in, verdict and corrected model out.
//!
//! What it is: `diagnose` put into the contract's words, with figures before and after, intervals and evidence.
//! What can go wrong: a log with no relation to test is refused.
//! Units: as the channels state.
//! Reference: specification `closing-the-loop.md`, steps 1 to 8.

use crate::context::{Context, DIFFERENCES, unit_of};
use crate::diagnose::Diagnosis;
use crate::effects::Estimate;
use crate::heldout;
use crate::hypothesis::{Declared, Fit};
use crate::log::Log;
use crate::long::diagnose_any;
use crate::model::Model;
use crate::residual::whiteness;
use crate::sparse;
use crate::verdict::{Alternative, BeforeAfter, Channel, EffectEntry, FORMAT, Figures, Kind, Parameter, Validation, Verdict};
use std::collections::BTreeMap;

/// Why the loop cannot be closed on a log.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CloseError {
    /// Nothing can be predicted from anything.
    #[error(
        "{run}: no channel can be fitted; expected at least two related channels (pulse, rpm, thrust, torque, current, voltage) with more than 8 common samples"
    )]
    NoRelation {
        /// The log.
        run: String,
    },
}

/// Everything that closing the loop on one log gives.
#[derive(Debug, Clone)]
pub struct Closed {
    /// The log made ready.
    pub context: Context,
    /// What the search found.
    pub diagnosis: Diagnosis,
    /// Declared model.
    pub declared: Model,
    /// Corrected model.
    pub model: Model,
    /// The contract's words.
    pub verdict: Verdict,
}

/// Closes the loop on a log. Channels with too few samples are left out, and the verdict names them.
///
/// # Errors
/// [`CloseError`] when no channel can be fitted.
pub fn close(log: &Log, model: Option<&Model>, validate: &[Log], progress: &mut dyn FnMut(f64)) -> Result<Closed, CloseError> {
    let left_out = sparse::left_out(log);
    let log = &*sparse::without(log, &left_out);
    let context = Context::new(log, model.map(|m| m.start_pulse_us));
    let declared = Declared { model };
    let refused = || CloseError::NoRelation { run: log.name.clone() };
    if !context.targets.iter().any(|t| t.relation.degree() > 0 && t.rows.len() > sparse::TOO_FEW) {
        return Err(refused());
    }
    let found = diagnose_any(log, &context, declared, progress).ok_or_else(refused)?;
    let diagnosis = found.diagnosis;
    let fit = &diagnosis.best.fit;
    let estimates =
        found.estimates.unwrap_or_else(|| (0..fit.placed.len()).map(|k| fit.profiled_estimates(&context, declared, k)).collect());
    let before_model = Model::from_fit(&context, log, declared, &diagnosis.declared);
    let after_model = Model::of_estimates(&context, log, declared, fit, estimates.clone());
    let mut verdict = Verdict {
        format: FORMAT,
        run: log.name.clone(),
        verdict: kind(&diagnosis),
        channels: channels(&context, declared, &diagnosis),
        effects: entries(&context, &diagnosis, estimates),
        alternatives: diagnosis.rivals.iter().map(|r| Alternative { ids: r.ids.clone(), probability: r.probability }).collect(),
        next_experiment: None,
        left_out,
        validation: validate.iter().map(|other| validation(other, &before_model, &after_model)).collect(),
    };
    if verdict.verdict == Kind::Ambiguous {
        verdict.next_experiment =
            crate::experiment::next(found.searched.as_ref().unwrap_or(&context), declared, &after_model, &diagnosis);
    }
    Ok(Closed { context, diagnosis, declared: before_model, model: after_model, verdict })
}

fn kind(diagnosis: &Diagnosis) -> Kind {
    if diagnosis.best.fit.placed.is_empty() {
        Kind::None
    } else if diagnosis.unknown {
        Kind::Unattributed
    } else if diagnosis.ambiguous() {
        Kind::Ambiguous
    } else {
        Kind::Attributed
    }
}

fn channels(context: &Context, declared: Declared<'_>, d: &Diagnosis) -> BTreeMap<String, Channel> {
    let figures = |fit: &Fit, held: &[heldout::Held]| -> Vec<Figures> {
        heldout::residuals(context, declared, fit)
            .iter()
            .zip(held)
            .zip(&context.targets)
            .map(|((r, held), target)| {
                let judged = |k: &usize| target.claims(target.rows[*k]);
                let r: Vec<f64> = (0..r.len()).filter(judged).map(|k| r[k]).collect();
                let t: Vec<f64> = target.rows.iter().filter(|i| target.claims(**i)).map(|i| context.t[*i]).collect();
                let rms = (r.iter().map(|v| v * v).sum::<f64>() / r.len().max(1) as f64).sqrt();
                let heldout_rms = if held.claimed.is_finite() { held.claimed } else { rms };
                Figures { rms, heldout_rms, whiteness_p: whiteness(&t, &r) }
            })
            .collect()
    };
    let (before, after) = (figures(&d.declared, &d.heldout_before), figures(&d.best.fit, &d.heldout_after));
    context
        .targets
        .iter()
        .zip(before.into_iter().zip(after))
        .filter(|(t, _)| !t.relation.is_evidence())
        .map(|(t, (before, after))| {
            (t.name.to_owned(), Channel { unit: unit_of(t.name).to_owned(), noise_floor_rms: t.noise.rms, before, after })
        })
        .collect()
}

/// One entry an effect, the one that helps most first.
fn entries(context: &Context, d: &Diagnosis, estimates: Vec<Vec<Estimate>>) -> Vec<EffectEntry> {
    let mut out: Vec<EffectEntry> = d
        .best
        .fit
        .placed
        .iter()
        .zip(estimates)
        .enumerate()
        .map(|(k, (p, estimates))| {
            let about = p.effect.about();
            let estimates = p.effect.report(context, &p.instance, estimates);
            let (first, reduction) = quoted(context, d, k);
            let mut channels: Vec<String> =
                p.instance.channels.iter().filter(|c| !DIFFERENCES.iter().any(|d| d.1 == *c)).cloned().collect();
            if let Some(at) = channels.iter().position(|c| *c == first) {
                channels.swap(0, at);
            }
            let mut depends_on: Vec<String> = about.depends_on.iter().map(|v| (*v).to_owned()).collect();
            if p.effect.id() == "unknown" {
                depends_on.push(p.instance.form.clone());
            }
            EffectEntry {
                id: p.effect.id().to_owned(),
                depends_on,
                equation: if p.instance.form.is_empty() {
                    about.equation.to_owned()
                } else {
                    format!("{} [{}]", about.equation, p.instance.form)
                },
                probability: d.probability,
                parameters: estimates.iter().map(parameter).collect(),
                heldout_error_reduction: reduction,
                evidence: format!(
                    "{}; without it the held-out error of {first} is {:.2} times as large",
                    about.signature,
                    1.0 / (1.0 - reduction).max(1e-6)
                ),
                channels,
            }
        })
        .collect();
    out.sort_by(|a, b| b.heldout_error_reduction.total_cmp(&a.heldout_error_reduction));
    out
}

/// The channel that an effect's figure is quoted for (the one it helps most) and the figure.
fn quoted(context: &Context, d: &Diagnosis, k: usize) -> (String, f64) {
    let p = &d.best.fit.placed[k];
    context
        .targets
        .iter()
        .enumerate()
        .filter(|(_, t)| p.instance.touches(t.name) && !t.relation.is_evidence())
        .map(|(i, t)| (t.name.to_owned(), 1.0 - d.heldout_after[i].rms / d.heldout_without[k][i].rms))
        .filter(|(_, r)| r.is_finite())
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or_else(|| (p.instance.channels.first().cloned().unwrap_or_default(), 0.0))
}

fn parameter(e: &Estimate) -> Parameter {
    let half = if e.se.is_finite() { 1.96 * e.se } else { 0.0 };
    Parameter { name: e.name.clone(), value: e.value, unit: e.unit.clone(), ci95: [e.value - half, e.value + half] }
}

/// Both models on another run of the same rig, as they stand.
pub(crate) fn validation(other: &Log, before: &Model, after: &Model) -> Validation {
    let context = Context::new(other, Some(after.start_pulse_us));
    let error = |model: &Model, name: &'static str| -> Option<f64> {
        let prediction = model.predict(&context, name)?;
        let target = &context.targets[context.target(name)?];
        let judged = target.rows.iter().zip(&target.y).filter(|(i, _)| target.claims(**i));
        let (sum, n) = judged.fold((0.0, 0.0), |(s, n), (i, y)| (s + (y - prediction[*i]).powi(2), n + 1.0));
        Some((sum / n).sqrt())
    };
    let channels = context
        .targets
        .iter()
        .filter(|t| !t.relation.is_evidence())
        .filter_map(|t| Some((t.name.to_owned(), BeforeAfter { before: error(before, t.name)?, after: error(after, t.name)? })))
        .collect();
    Validation { run: other.name.clone(), channels }
}
