//! What is left when no name fits.
//!
//! What it is: the linear function of rate, specific force or time that predicts left-out stretches best, with the variables that
//! it stands on; a correction, not a cause.
//! What can go wrong: nothing helps; the correction is then empty and says so.
//! Units: those of the channel per unit of the variable.
//! Reference: specification `closing-the-loop.md`, step 7.

use super::least::{Column, Readings, Solved, Term};
use super::model::Added;
use super::search::{Scene, descending, parameter, predict, reductions};
use super::shown::Shown;
use crate::verdict::Scope;
use crate::verdict::{EffectEntry, Kin};
use nalgebra::Vector3;

/// An empirical correction.
pub(crate) struct Correction<'a> {
    /// Base terms first, then its own.
    pub(crate) solved: Solved,
    pub(crate) terms: Vec<Term<'a>>,
    pub(crate) entry: EffectEntry,
    variable: &'static str,
    /// The axis that it helps most.
    axis: usize,
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// Rate, specific force, time.
const VARIABLES: [&str; 3] = ["g", "a", "t"];

/// The terms of a correction that is linear in a variable.
pub(crate) fn terms<'a>(name: &str, scene: &Scene<'a>, channels: [&'static str; 3]) -> Vec<Term<'a>> {
    let recording = scene.recording;
    let known = |v: Vector3<f64>| if v.iter().all(|c| c.is_finite()) { v } else { Vector3::zeros() };
    let which = VARIABLES.iter().position(|v| *v == name);
    let value = move |i: usize| match which {
        Some(0) => known(recording.gyro[i]),
        Some(1) => known(recording.accel[i]),
        _ => Vector3::new(recording.t[i], 0.0, 0.0),
    };
    let axes = if name == "t" { 1 } else { 3 };
    let mut terms = Vec::new();
    for (i, channel) in channels.iter().enumerate() {
        for (j, axis) in AXES.iter().enumerate().take(axes) {
            let label = if name == "t" { format!("{channel}_t") } else { format!("{channel}_{name}{axis}") };
            terms.push(Term { prior: 1e3, ..Term::new(&label, unit(channel, name), move |row| Vector3::ith(i, value(row)[j])) });
        }
    }
    terms
}

/// Unit of a channel for one of a variable.
fn unit(channel: &str, variable: &str) -> &'static str {
    match (&channel[..1], variable) {
        ("m", "g") => "uT/(rad/s)",
        ("m", "a") => "uT/(m/s^2)",
        ("m", _) => "uT/s",
        ("a", "g") => "m/s^2/(rad/s)",
        ("a", _) => "m/s^2/s",
        (_, "a") => "rad/s/(m/s^2)",
        _ => "rad/s/s",
    }
}

/// The best correction on top of the declared model.
pub(crate) fn correct<'a>(
    readings: &Readings,
    base: &[Term<'a>],
    scene: &Scene<'a>,
    channels: [&'static str; 3],
    noise: f64,
) -> Option<Correction<'a>> {
    let fixed: Vec<Column> = base.iter().map(|t| readings.column(t)).collect();
    let before = readings.solve(&fixed.iter().collect::<Vec<_>>(), noise)?.heldout;
    // a channel does not explain itself
    let variables = VARIABLES.into_iter().filter(|name| !channels[0].starts_with(name));
    let mut best: Option<(f64, &'static str, Vec<Term<'a>>, Solved)> = None;
    for name in variables {
        let terms = terms(name, scene, channels);
        let own: Vec<Column> = terms.iter().map(|t| readings.column(t)).collect();
        let Some(solved) = readings.solve(&fixed.iter().chain(&own).collect::<Vec<_>>(), noise) else { continue };
        let left = Readings::square(&solved.heldout);
        if best.as_ref().is_none_or(|b| left < b.0) {
            best = Some((left, name, terms, solved));
        }
    }
    let (_, name, terms, solved) = best?;
    let by_axis = reductions(&before, &solved.heldout);
    let axes = descending(by_axis);
    let depends_on: Vec<String> = match name {
        "g" => vec!["gx", "gy", "gz"],
        "a" => vec!["ax", "ay", "az"],
        _ => vec!["t_s"],
    }
    .into_iter()
    .map(str::to_owned)
    .collect();
    let parameters = terms
        .iter()
        .zip(solved.coefficients.iter().zip(&solved.sigma).skip(base.len()))
        .map(|(t, (c, s))| parameter(&t.name, *c, t.unit, *s))
        .collect();
    let entry = EffectEntry {
        kin: Kin::Own,
        id: "unknown".to_owned(),
        scope: Scope::Run,
        run: None,
        channels: axes.map(|k| channels[k].to_owned()).to_vec(),
        evidence: format!(
            "no known cause takes away half of what is over; linear in {} predicts left-out stretches best",
            depends_on.join(", ")
        ),
        depends_on,
        equation: format!("{} += A {name}", &channels[0][..1]),
        probability: 1.0,
        parameters,
        heldout_error_reduction: by_axis[axes[0]].max(0.0),
    };
    Some(Correction { solved, terms, entry, variable: name, axis: axes[0] })
}

impl Correction<'_> {
    /// What is said where it would predict an axis worse: something is there, and nothing is corrected.
    pub(crate) fn refused(&self) -> EffectEntry {
        EffectEntry {
            kin: Kin::Own,
            depends_on: Vec::new(),
            equation: "no correction".to_owned(),
            parameters: Vec::new(),
            heldout_error_reduction: 0.0,
            evidence: "no known cause takes away half of what is over; no correction predicts left-out stretches of every axis"
                .to_owned(),
            ..self.entry.clone()
        }
    }

    /// What convinces of it, behind so many coefficients of the declared model.
    pub(crate) fn shown(&self, base: usize, scene: &Scene<'_>, claimed: &[bool]) -> Shown {
        Shown::of_correction((self.variable, self.axis), &self.terms, &self.solved.coefficients[base..], scene, claimed)
    }

    /// Its share of the model, behind so many coefficients of the declared one.
    pub(crate) fn added(&self, base: usize) -> Added {
        Added {
            id: self.entry.id.clone(),
            shape_s: None,
            until_s: None,
            variable: Some(self.variable.to_owned()),
            coefficients: self.solved.coefficients[base..].to_vec(),
        }
    }

    /// The declared model and the correction at a row.
    pub(crate) fn predict(&self, base: &[Term<'_>], t: f64, row: usize) -> Vector3<f64> {
        let c = &self.solved.coefficients;
        predict(base, c, t, row) + predict(&self.terms, &c[base.len()..], t, row)
    }
}
