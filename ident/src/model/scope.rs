//! What of a model holds on which run.
//!
//! What it is: an effect of the rig acts on every run; one of a run, or an event, belongs to the run that it was fitted to. On another run
//! of the rig an event acts as far as it left something behind, from the start. Of all else the mean goes into the declared polynomial, so that
//! leaving it out costs nothing; of an event, which does not happen again, as far as its name is in doubt.
//! What can go wrong: a log is the model's own only where its SHA-256 is the same; a copy with another head is another run.
//! Units: as the channels.
//! Reference: specification `formats.md`, "Scope".

use super::{AddedEffect, Model};
use crate::effects::placed::Placed;
use crate::effects::placed::is_named;
use crate::log::Log;
use crate::verdict::Scope;
use std::borrow::Cow;

/// A run that a model was fitted to.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct FittedTo {
    /// File name of its log.
    pub name: String,
    /// SHA-256 of its log.
    pub sha256: String,
    /// Rows of its log.
    pub rows: usize,
    /// Date, where the log states one.
    pub date: Option<String>,
}

/// What belongs to one of several runs.
#[derive(Debug, Clone, Default)]
pub struct RunLevel {
    /// For each channel the coefficients of its polynomial that stand on this run, from the constant up, as far as they differ from the rig's.
    pub polynomials: Vec<(String, Vec<f64>)>,
    /// Its own drifts and events.
    pub effects: Vec<AddedEffect>,
}

impl FittedTo {
    /// A log as the model names it.
    #[must_use]
    pub fn of(log: &Log) -> Self {
        let date = log.meta.get("date").map(|v| v.as_str().map_or_else(|| v.to_string(), str::to_owned));
        Self { name: log.name.clone(), sha256: log.digest(), rows: log.len(), date }
    }
}

/// What an effect does on another run of the rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Elsewhere {
    /// It acts as it stands.
    Acts,
    /// It acts from before the first row on.
    ActsFromTheStart,
    /// Nothing but its mean is left of it.
    Mean,
}

/// An instant before any run, s.
const LONG_AGO: f64 = -1e9;

fn elsewhere(placed: &Placed) -> Elsewhere {
    match placed.effect.scope(&placed.instance) {
        Scope::Rig => Elsewhere::Acts,
        Scope::Event if placed.effect.leaves_behind(&placed.instance) => Elsewhere::ActsFromTheStart,
        // a zero that is older than the run stands in the tare of each run, which no model knows
        Scope::Run | Scope::Event => Elsewhere::Mean,
    }
}

/// Whether nothing but its mean is left of an effect on another run of the rig.
pub(crate) fn is_mean_elsewhere(placed: &Placed) -> bool {
    elsewhere(placed) == Elsewhere::Mean
}

impl Model {
    /// Whether a log is one that the model was fitted to.
    #[must_use]
    pub fn is_of(&self, log: &Log) -> bool {
        let own = |digest: &str| self.runs.iter().any(|r| r.sha256 == digest);
        self.runs.iter().any(|r| r.rows == log.len()) && own(&log.digest())
    }

    /// The model for the rows of a log: as it stands on a run that it was fitted to, with what belongs to that run, else what carries over
    /// to it. A run of its own is predicted as it was fitted: its constants hold its supply already.
    #[must_use]
    pub fn on(&self, log: &Log) -> Cow<'_, Self> {
        if self.runs.is_empty() {
            return Cow::Borrowed(self);
        }
        if !self.is_of(log) {
            return Cow::Owned(self.elsewhere());
        }
        if self.own.is_empty() {
            return self.at_its_own_supply();
        }
        let digest = log.digest();
        match self.runs.iter().zip(&self.own).find(|(run, _)| run.sha256 == digest) {
            Some((_, own)) => Cow::Owned(self.with(own)),
            None => Cow::Borrowed(self),
        }
    }

    /// The model with what belongs to one run.
    fn with(&self, own: &RunLevel) -> Self {
        let mut out = self.clone();
        for (channel, coefficients) in &own.polynomials {
            let polynomial = out.polynomials.iter_mut().find(|p| p.channel == *channel);
            polynomial.into_iter().flat_map(|p| p.coefficients.iter_mut().zip(coefficients)).for_each(|(c, own)| *c = *own);
        }
        out.effects.extend(own.effects.iter().cloned());
        out
    }

    /// The model with names that are there with such probabilities, those of its last effects. What an event took for its own is the load's curve as
    /// far as it did not happen; a step on a run that only climbs looks like a part of the curve, and is none where it surely happened.
    pub(crate) fn believing(mut self, inclusion: &[f64]) -> Self {
        let first = self.effects.len().saturating_sub(inclusion.len());
        let is_event = |a: &AddedEffect| is_named(&a.placed) && a.placed.effect.scope(&a.placed.instance) == Scope::Event;
        for (added, probability) in self.effects.iter_mut().skip(first).zip(inclusion).filter(|(a, _)| is_event(a)) {
            let doubt = (1.0 - probability).clamp(0.0, 1.0);
            added.mean.iter_mut().flat_map(|(_, mean)| mean).for_each(|m| *m *= doubt);
        }
        self
    }

    /// The model for another run of its rig: effects of the rig, what events left behind, and the mean of the rest.
    #[must_use]
    pub fn elsewhere(&self) -> Self {
        let mut out = Self { effects: Vec::new(), ..self.clone() };
        for added in &self.effects {
            match elsewhere(&added.placed) {
                Elsewhere::Acts => out.effects.push(added.clone()),
                Elsewhere::ActsFromTheStart => out.effects.push(added.since_long_ago()),
                Elsewhere::Mean => {
                    for (channel, mean) in &added.mean {
                        let own = out.polynomials.iter_mut().find(|p| p.channel == *channel);
                        own.into_iter().flat_map(|p| p.coefficients.iter_mut().zip(mean)).for_each(|(c, m)| *c += m);
                    }
                }
            }
        }
        out
    }
}

impl AddedEffect {
    fn since_long_ago(&self) -> Self {
        let mut out = self.clone();
        let names = super::read::shape_names(self.placed.effect, &self.placed.instance);
        out.placed.shape.iter_mut().zip(names).filter(|(_, name)| *name == "t0").for_each(|(t0, _)| *t0 = LONG_AGO);
        out
    }
}
