//! The entries of a verdict on several runs.
//!
//! What it is: each effect of the rig with the parameters that all runs share and what it takes off the error of a run that no fit saw; each
//! run's own drifts and events; what is left.
//! What can go wrong: what is left on one run only is told with that run's name.
//! Units: as the channels.
//! Reference: specification `formats.md`, "Verdict".

use super::Run;
use super::choose::Named;
use super::joint::{Across, Joint};
use super::own::Worth;
use super::words::root_mean;
use crate::attribution::rivals::TEMPERATURE;
use crate::attribution::unexplained::LOUD;
use crate::channel::{Context, is_contrast};
use crate::effects::placed::Placed;
use crate::effects::reported::parameter;
use crate::effects::{EffectEntry, Estimate};
use crate::model::{AddedEffect, RunLevel};
use crate::verdict::Scope;
use crate::verdict::words::channel as spoken;
use crate::verdict::{Alternative, Change, Channels, Kin, Unexplained};

/// What could stand in the place of a name, with its probability.
pub(super) type Others = Vec<(&'static str, f64)>;

/// An effect of the rig, with the errors of the runs without it and with all.
pub(super) fn entry(
    joint: &Joint<'_, '_>,
    named: &Named,
    [without, after]: [&[Across]; 2],
    estimates: &[Estimate],
) -> (EffectEntry, Others) {
    let p = &named.placed;
    let (probability, others) = probabilities(named.score, &named.rivals);
    let taken = |channel: &str| {
        let pooled = |list: &[Across]| root_mean(list.iter().filter(|a| a.channel == channel).map(|a| a.rms));
        1.0 - pooled(after) / pooled(without)
    };
    let mut channels: Vec<String> = p.instance.channels.iter().filter(|c| !is_contrast(c)).cloned().collect();
    channels.sort_by(|a, b| or_nothing(taken(b)).total_cmp(&or_nothing(taken(a))));
    let first = channels.first().cloned().unwrap_or_default();
    let reduction = or_nothing(taken(&first));
    let shapes = joint.members.first().map(|m| p.effect.shapes(m.context, &p.instance)).unwrap_or_default();
    let reported =
        joint.members.first().map_or_else(|| estimates.to_vec(), |m| p.effect.report(m.context, &p.instance, estimates.to_vec()));
    let about = p.effect.about();
    let better = |a: &&Across| without.iter().any(|w| w.run == a.run && w.channel == a.channel && w.rms > a.rms);
    let helped = after.iter().filter(|a| a.channel == first).filter(better).count();
    let entry = EffectEntry {
        kin: joint.members.first().map_or(Kin::Own, |m| p.effect.kin(m.context, &p.instance, &reported)),
        id: p.effect.id().to_owned(),
        scope: p.effect.scope(&p.instance),
        run: None,
        depends_on: about.depends_on.iter().map(|v| (*v).to_owned()).collect(),
        equation: equation(p),
        probability,
        parameters: reported.iter().map(|e| parameter(e, &shapes, &first)).collect(),
        heldout_error_reduction: reduction,
        evidence: format!(
            "{}; learnt from the other runs it makes the error of {} smaller on {helped} of {} runs, {:.2} times over all",
            about.signature,
            spoken(&first),
            after.iter().filter(|a| a.channel == first).count(),
            1.0 / (1.0 - reduction).max(1e-6)
        ),
        channels,
    };
    (entry, others)
}

fn or_nothing(reduction: f64) -> f64 {
    if reduction.is_finite() { reduction.max(0.0) } else { 0.0 }
}

/// The drifts and events of one run.
pub(super) fn own_entries(context: &Context, own: &RunLevel, worths: &[Worth]) -> Vec<(EffectEntry, Others)> {
    let told = |(added, worth): (&AddedEffect, &Worth)| {
        let p = &added.placed;
        let (probability, others) = probabilities(worth.gain, &worth.rivals);
        let (first, reduction) = worth
            .reduction
            .iter()
            .copied()
            .filter(|(c, _)| !is_contrast(c))
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or(("", 0.0));
        let mut channels: Vec<String> = p.instance.channels.iter().filter(|c| !is_contrast(c)).cloned().collect();
        if let Some(at) = channels.iter().position(|c| c == first) {
            channels.swap(0, at);
        }
        let shapes = p.effect.shapes(context, &p.instance);
        let reported = p.effect.report(context, &p.instance, added.estimates.clone());
        let scope = match p.effect.scope(&p.instance) {
            Scope::Rig => Scope::Run,
            own => own,
        };
        let times = 1.0 / (1.0 - or_nothing(reduction)).max(1e-6);
        let entry = EffectEntry {
            kin: p.effect.kin(context, &p.instance, &reported),
            id: p.effect.id().to_owned(),
            scope,
            run: Some(context.name.clone()),
            depends_on: p.effect.about().depends_on.iter().map(|v| (*v).to_owned()).collect(),
            equation: equation(p),
            probability,
            parameters: reported.iter().map(|e| parameter(e, &shapes, first)).collect(),
            heldout_error_reduction: or_nothing(reduction),
            evidence: format!(
                "on {} alone; {}; without it the error of {} there is {times:.2} times as large",
                context.name,
                p.effect.about().signature,
                spoken(first)
            ),
            channels,
        };
        (entry, others)
    };
    own.effects.iter().zip(worths).map(told).collect()
}

fn equation(p: &Placed) -> String {
    let about = p.effect.about();
    if p.instance.form.is_empty() { about.equation.to_owned() } else { format!("{} [{}]", about.equation, p.instance.form) }
}

/// Probability of a name by its evidence, against that of what could stand in its place and against nothing; that of each of the others.
fn probabilities(score: f64, rivals: &[(&'static str, f64)]) -> (f64, Vec<(&'static str, f64)>) {
    let against = |evidence: f64| ((evidence - score) / TEMPERATURE).exp();
    let total = 1.0 + against(0.0) + rivals.iter().map(|r| against(r.1)).sum::<f64>();
    (1.0 / total, rivals.iter().map(|(id, evidence)| (*id, against(*evidence) / total)).collect())
}

/// Probability from which on another hypothesis is listed.
const LISTED: f64 = 0.005;

/// The verdict's names with one of them replaced by what could stand in its place, most probable first. `told` are the names, each with its
/// others.
pub(super) fn alternatives(told: &[(EffectEntry, Others)]) -> Vec<Alternative> {
    let swapped = |k: usize, id: &str| {
        let name = |(j, (e, _)): (usize, &(EffectEntry, Others))| if j == k { id.to_owned() } else { e.id.clone() };
        told.iter().enumerate().map(name).collect()
    };
    let all = told.iter().enumerate().flat_map(|(k, (_, others))| others.iter().map(move |(id, p)| (k, *id, *p)));
    let listed = all.filter(|(.., p)| *p >= LISTED);
    let channels = |k: usize| told.get(k).map(|(e, _)| e.channels.clone()).unwrap_or_default();
    let change = |place, id: &str, probability| Some(Change { place, id: id.to_owned(), channels: channels(place), probability });
    let of = |(k, id, probability)| Alternative { ids: swapped(k, id), probability, change: change(k, id, probability) };
    let mut out: Vec<Alternative> = listed.map(of).collect();
    out.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    out
}

/// The run that is left with the largest error on a channel, predicted by the others.
pub(super) fn loudest<'a>(after: &'a [Across], channel: &str) -> Option<&'a Across> {
    after.iter().filter(|a| a.channel == channel).max_by(|a, b| a.rms.total_cmp(&b.rms))
}

/// What a rest looks like, and the variables that it goes with.
pub(super) type Looks = (String, Vec<String>);

/// Every channel that is loud on a run after all, once, as large as over all runs, with the run on which it is loudest, and what is left there
/// goes with; and every contrast of a speed sensor that a run alone left unexplained.
pub(super) fn unexplained(
    runs: &[Run],
    looks: &dyn Fn(&Across) -> Option<Looks>,
    after: &[Across],
    channels: &Channels,
) -> Vec<Unexplained> {
    let mut out: Vec<Unexplained> = Vec::new();
    for a in after.iter().filter(|a| a.rms > LOUD * a.floor && !is_contrast(a.channel)) {
        let (Some(loudest), Some(whole)) = (loudest(after, a.channel), channels.get(a.channel)) else { continue };
        if out.iter().any(|u| u.channel == a.channel) {
            continue;
        }
        let run = &runs[loudest.run].closed.verdict;
        let alone = run.unexplained.iter().any(|u| u.channel == a.channel);
        let (shape, depends_on) = looks(loudest).map_or_else(Default::default, |(looks, with)| (format!(": {looks}"), with));
        let differ = if alone { "" } else { "; a fit to that run alone removes it, the runs differ" };
        let looks_like = format!("loudest on {}{shape}{differ}", run.run);
        let over_floor = whole.after.heldout_rms / whole.noise_floor_rms;
        out.push(Unexplained { channel: a.channel.to_owned(), over_floor, depends_on, looks_like });
    }
    out.sort_by(|a, b| b.over_floor.total_cmp(&a.over_floor));
    for run in runs.iter().map(|r| &r.closed.verdict) {
        for told in run.unexplained.iter().filter(|u| u.channel.ends_with(" - others")) {
            if !out.iter().any(|u| u.channel == told.channel) {
                out.push(Unexplained { looks_like: format!("on {}: {}", run.run, told.looks_like), ..told.clone() });
            }
        }
    }
    out
}

/// Where something is left and nothing has a name.
pub(super) fn unnamed(left: &Unexplained) -> EffectEntry {
    EffectEntry {
        kin: Kin::Own,
        id: "unknown".to_owned(),
        scope: Scope::Run,
        run: None,
        channels: vec![left.channel.trim_end_matches(" - others").to_owned()],
        depends_on: left.depends_on.clone(),
        equation: "none: nothing that was tried predicts the other runs".to_owned(),
        probability: 1.0,
        parameters: Vec::new(),
        heldout_error_reduction: 0.0,
        evidence: left.looks_like.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{Instance, by_id};
    use crate::log::{Column, Log};

    /// A lag that only one of the runs shows is what every rig has all the same; a zero that slipped is that run's own.
    #[test]
    fn what_every_rig_has_is_told_apart_on_one_run_too() {
        let column = |name: &str, by: f64| Column { name: name.into(), values: (0..40).map(|i| by * f64::from(i)).collect() };
        let columns = vec![column("pulse_us", 10.0), column("rpm", 100.0), column("thrust_n", 0.1)];
        let log = Log { t: (0..40).map(|i| 0.1 * f64::from(i)).collect(), columns, ..Log::default() };
        let context = Context::new(&log, Some(1000.0));
        let added = |id: &str, channel: &str, shape: &[f64]| AddedEffect {
            placed: Placed {
                effect: by_id(id).expect("an effect"),
                instance: Instance::new(&[channel], ""),
                shape: shape.to_vec(),
            },
            amplitudes: Vec::new(),
            estimates: Vec::new(),
            mean: Vec::new(),
            reach: Vec::new(),
            shape_errors: Vec::new(),
        };
        let effects = vec![added("spinup_lag", "rpm", &[0.1]), added("tare_shift", "thrust_n", &[2.0])];
        let worth = || Worth { gain: 30.0, reduction: vec![("rpm", 0.5)], rivals: Vec::new() };
        let told = own_entries(&context, &RunLevel { effects, ..RunLevel::default() }, &[worth(), worth()]);
        assert_eq!(told.iter().map(|(e, _)| e.kin).collect::<Vec<_>>(), [Kin::OfEvery, Kin::Own]);
    }

    #[test]
    fn what_could_stand_in_its_place_takes_from_a_name() {
        assert!(probabilities(30.0, &[]).0 > 0.99);
        let (own, others) = probabilities(30.0, &[("creep", 30.0)]);
        assert!((own - 0.5).abs() < 1e-3 && (others[0].1 - own).abs() < 1e-12, "one that explains as much is as probable");
        assert!(probabilities(30.0, &[("creep", -100.0), ("stall", 2.0)]).0 > 0.99, "others are far behind");
        assert!((probabilities(0.0, &[]).0 - 0.5).abs() < 1e-12);
    }
}
