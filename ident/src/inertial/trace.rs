//! From a search to a sensor's trace.
//!
//! What it is: the predictions of every row, the figures and the entries of the verdict, for a sensor whose causes are linear.
//! What can go wrong: where the names leave more than half of the excess, the unnamed correction takes their place.
//! Units: those of the channels.
//! Reference: specification `formats.md`, "Verdict".

use super::account::{Sensor, by_axis, judge};
use super::least::{Readings, Term};
use super::model::{Added, Part};
use super::search::{Cause, Found, Outcome, Scene, descending, parameters, predict, search, spoils};
use super::shown::Shown;
use super::unknown::correct;
use crate::attribution::unexplained::LOUD;
use crate::verdict::Scope;
use crate::verdict::words::{channel, digits, list};
use crate::verdict::{Alternative, EffectEntry, Kin, Kind};
use nalgebra::Vector3;

/// What a sensor is and how well it can be predicted at best.
pub(crate) struct Setting {
    pub(crate) channels: [&'static str; 3],
    pub(crate) unit: &'static str,
    /// Noise of a reading, by axis.
    pub(crate) floor: [f64; 3],
    /// Noise of a block's mean.
    pub(crate) noise: f64,
    /// What the attitude's own error makes of it, one axis.
    pub(crate) doubt: f64,
}

/// A trace and, for whoever needs it, what was found alone: its contribution at each row.
pub(crate) struct Traced {
    pub(crate) sensor: Sensor,
    pub(crate) effect: Vec<Vector3<f64>>,
    /// What was found, whatever the word for it all is, the predictions with it and its share of the model.
    pub(crate) named: (Vec<EffectEntry>, Vec<Vector3<f64>>, Part),
}

/// Searches and reports; `claimed` rows are predicted.
pub(crate) fn trace<'a>(
    setting: &Setting,
    readings: &Readings,
    base: &[Term<'a>],
    causes: &[Box<dyn Cause>],
    scene: &Scene<'a>,
    claimed: &[bool],
) -> Option<Traced> {
    let Setting { noise, doubt, .. } = *setting;
    let outcome = search(readings, base, causes, scene, noise, doubt)?;
    let n = outcome.before.heldout.len() as f64;
    let explained = noise * noise + doubt * doubt;
    let mean = |r: &[f64]| Readings::square(r) / n;
    let (before, after) = (mean(&outcome.before.heldout), mean(&outcome.after.heldout));
    let kind = judge(before, after, explained, !outcome.found.is_empty(), outcome.probability);
    let t = &scene.recording.t;
    let rows = |value: &dyn Fn(usize) -> Vector3<f64>| -> Vec<Vector3<f64>> {
        (0..t.len()).map(|i| if claimed[i] { value(i) } else { Vector3::repeat(f64::NAN) }).collect()
    };
    let declared = rows(&|i| predict(base, &outcome.before.coefficients, t[i], i));
    let over = |mean: f64| (mean / explained).sqrt();
    let mut sensor = Sensor {
        channels: setting.channels,
        unit: setting.unit,
        corrected: declared.clone(),
        declared,
        floor: setting.floor,
        heldout_before: by_axis(&outcome.before.heldout),
        heldout_after: by_axis(&outcome.before.heldout),
        effects: Vec::new(),
        shown: shown(&outcome, base, scene, claimed),
        alternatives: Vec::new(),
        kind,
        excess: [over(before), over(before)],
        part: part(setting, &outcome.before.coefficients, Vec::new()),
    };
    let mut effect = vec![Vector3::zeros(); t.len()];
    let with = rows(&|i| predict(base, &outcome.after.coefficients, t[i], i) + contribution(&outcome, base.len(), t[i], i));
    let all = part(setting, &outcome.after.coefficients[..base.len()], added(&outcome, base.len()));
    let named = (entries(&outcome, base.len(), setting), with, all);
    match kind {
        Kind::None => {}
        Kind::Unattributed => {
            let correction = correct(readings, base, scene, setting.channels, noise);
            if let Some(c) = correction.as_ref().filter(|c| spoils(&outcome.before.heldout, &c.solved.heldout).contains(&true)) {
                // what no correction predicts and nobody hears above the noise is nothing
                if sensor.excess[0] > LOUD {
                    sensor.effects = vec![c.refused()];
                } else {
                    sensor.kind = Kind::None;
                }
            } else if let Some(c) = correction {
                sensor.corrected = rows(&|i| c.predict(base, t[i], i));
                sensor.heldout_after = by_axis(&c.solved.heldout);
                sensor.excess[1] = over(mean(&c.solved.heldout));
                sensor.part = part(setting, &c.solved.coefficients[..base.len()], vec![c.added(base.len())]);
                let mut shown = c.shown(base.len(), scene, claimed);
                let rows = sensor.corrected.iter().zip(&sensor.declared);
                shown.added = rows.map(|(with, without)| with[shown.axis] - without[shown.axis]).collect();
                sensor.shown.push(shown);
                sensor.effects = vec![c.entry];
            }
        }
        Kind::Attributed | Kind::Ambiguous => {
            sensor.corrected.clone_from(&named.1);
            sensor.part.clone_from(&named.2);
            sensor.heldout_after = by_axis(&outcome.after.heldout);
            sensor.excess[1] = over(after);
            sensor.effects.clone_from(&named.0);
            for (i, e) in effect.iter_mut().enumerate() {
                *e = contribution(&outcome, base.len(), t[i], i);
            }
        }
    }
    if matches!(kind, Kind::None | Kind::Unattributed) {
        return Some(Traced { sensor, effect, named });
    }
    sensor.alternatives = outcome
        .alternatives
        .iter()
        .filter(|(ids, _)| !ids.is_empty())
        .map(|(ids, p)| Alternative { ids: ids.iter().map(|i| (*i).to_owned()).collect(), probability: *p, change: None })
        .collect();
    Some(Traced { sensor, effect, named })
}

/// What a cause belongs to: what stands in the room, or was taken off again, is not the board's.
fn scope(found: &Found<'_>) -> Scope {
    if found.instance.id == "stationary_magnet" || found.until.is_finite() { Scope::Run } else { Scope::Rig }
}

/// The axes of which a cause speaks, the one that it helps most first: none that is predicted worse with all that was found.
fn helped(outcome: &Outcome<'_>, found: &Found<'_>) -> Vec<usize> {
    let worse = spoils(&outcome.before.heldout, &outcome.after.heldout);
    descending(found.by_axis).into_iter().filter(|k| !worse[*k]).collect()
}

/// What convinces of each cause that was found: what it changes beside the others, which stand in for it where they can.
fn shown(outcome: &Outcome<'_>, base: &[Term<'_>], scene: &Scene<'_>, claimed: &[bool]) -> Vec<Shown> {
    let t = &scene.recording.t;
    let mut at = base.len();
    let one = |(k, f): (usize, &Found<'_>)| {
        let from = at;
        at += f.instance.terms.len();
        let axis = helped(outcome, f).first().copied().unwrap_or(0);
        let own = &outcome.after.coefficients[from..at];
        let mut shown = Shown::of((f.instance.id, axis), &f.instance.terms, own, scene, claimed);
        if !f.without.is_empty() {
            let others = |i: usize| without(outcome, base, k, t[i], i)[axis];
            let with = |i: usize| {
                (predict(base, &outcome.after.coefficients, t[i], i) + contribution(outcome, base.len(), t[i], i))[axis]
            };
            shown.added = (0..t.len()).map(|i| if claimed[i] { with(i) - others(i) } else { f64::NAN }).collect();
        }
        shown
    };
    outcome.found.iter().enumerate().map(one).collect()
}

/// What is predicted of a row without one of the causes.
fn without(outcome: &Outcome<'_>, base: &[Term<'_>], left_out: usize, t: f64, row: usize) -> Vector3<f64> {
    let coefficients = &outcome.found[left_out].without;
    let mut sum = predict(base, coefficients, t, row);
    let mut at = base.len();
    for (_, f) in outcome.found.iter().enumerate().filter(|(k, _)| *k != left_out) {
        sum += predict(&f.instance.terms, &coefficients[at..], t, row);
        at += f.instance.terms.len();
    }
    sum
}

fn part(setting: &Setting, declared: &[f64], effect: Vec<Added>) -> Part {
    let channels = setting.channels.map(str::to_owned).to_vec();
    Part { channels, declared: declared.to_vec(), effect, ..Part::default() }
}

/// The found causes for the model.
fn added(outcome: &Outcome<'_>, base: usize) -> Vec<Added> {
    let mut at = base;
    let one = |f: &Found<'_>| {
        let from = at;
        at += f.instance.terms.len();
        Added {
            id: f.instance.id.to_owned(),
            shape_s: f.instance.shape.map(|s| s.2).filter(|s| s.is_finite()),
            until_s: Some(f.until).filter(|s| s.is_finite()),
            variable: None,
            coefficients: outcome.after.coefficients[from..at].to_vec(),
        }
    };
    outcome.found.iter().map(one).collect()
}

/// What the found causes add at a row.
fn contribution(outcome: &Outcome<'_>, base: usize, t: f64, row: usize) -> Vector3<f64> {
    let mut at = base;
    let mut sum = Vector3::zeros();
    for f in &outcome.found {
        sum += predict(&f.instance.terms, &outcome.after.coefficients[at..], t, row);
        at += f.instance.terms.len();
    }
    sum
}

/// A share in per cent to two digits.
fn two_digits(percent: f64) -> String {
    format!("{} %", digits(percent, 10f64.powf(percent.abs().max(1.0).log10().floor() - 1.0)))
}

fn entries(outcome: &Outcome<'_>, base: usize, setting: &Setting) -> Vec<EffectEntry> {
    let mut at = base;
    let worse = spoils(&outcome.before.heldout, &outcome.after.heldout);
    let spoilt: Vec<String> = (0..3).filter(|k| worse[*k]).map(|k| channel(setting.channels[k])).collect();
    let but = if spoilt.is_empty() { String::new() } else { format!("; {} is predicted worse with them", list(&spoilt)) };
    let entry = |f: &Found<'_>, at: usize| {
        let count = f.instance.terms.len();
        let (c, s) = (&outcome.after.coefficients[at..at + count], &outcome.after.sigma[at..at + count]);
        let axes = helped(outcome, f);
        EffectEntry {
            kin: Kin::Own,
            id: f.instance.id.to_owned(),
            scope: scope(f),
            run: None,
            channels: axes.iter().map(|k| setting.channels[*k].to_owned()).collect(),
            depends_on: f.instance.depends_on.iter().map(|d| (*d).to_owned()).collect(),
            equation: f.instance.equation.to_owned(),
            probability: outcome.probability,
            parameters: parameters(f, c, s),
            heldout_error_reduction: axes.first().map_or(0.0, |k| f.by_axis[*k].max(0.0)),
            evidence: format!(
                "without it left-out stretches are predicted {} worse{but}",
                two_digits(100.0 * (1.0 / (1.0 - f.reduction).max(1e-9) - 1.0))
            ),
        }
    };
    let mut out = Vec::new();
    for f in &outcome.found {
        out.push(entry(f, at));
        at += f.instance.terms.len();
    }
    out
}
