//! The page of several runs of one rig.
//!
//! What it is: the page that every closed loop has, on what the runs share; then each run, predicted by a fit to the others, with a link to its
//! own page, and each parameter run by run.
//! What can go wrong: a run that cannot tell of an effect has no value of it.
//! Units: as told.
//! Reference: specification `formats.md`, `across_runs_rms`.

use super::beside_runs::beside_runs;
use super::closed::{self as parts, Origin, Page, Vocabulary, pair};
use super::figure::{Figure, Layer, Mark};
use super::page::{SPEEDS, card_across, card_alone, is_drawn_together, left_across, over_runs, readings_apart, rest, speeds};
use super::svg::escape;
use crate::close::Closed;
use crate::effects::{EffectEntry, Estimate};
use crate::log::Log;
use crate::several::{Outcome, Run, Shown, disagreement};
use crate::verdict::words::{channel, digits, scaled, upper, upper_bound};
use crate::verdict::{BeforeAfter, Channel, Channels, Figures, Parameter, Unexplained, Validation, Verdict};

/// Most runs that have their numbers beneath a figure; of more every fifth has.
const MOST_NAMES: usize = 12;

/// The report of several runs as one self-contained page; `links` are the pages of the runs, in their order.
#[must_use]
pub fn several(runs: &[Run], outcome: &Outcome, links: &[String]) -> String {
    let v = &*outcome.verdict.briefly();
    let alone: Vec<Closed> = (0..runs.len()).map(|run| of_run(runs, outcome, run)).collect();
    // of the quantity that the sentence begins with, or else where the names took most
    let headed = parts::headed(v, Vocabulary::RIG);
    let shown = outcome.shown.iter().find(|shown| headed(shown.channel)).or(outcome.shown.first());
    let first = shown.map_or(0, |shown| shown.run);
    let loudest = parts::loudest(v);
    let own = |u: &&Unexplained| !is_drawn_together(&alone[first], u) || loudest.is_some_and(|l| l == *u);
    let on = |run: usize, figure: Figure| named(figure, &v.runs[run].run);
    let page = Page {
        verdict: v,
        words: Vocabulary::RIG,
        news: false,
        origin: Origin::of_several(&runs.iter().map(|r| &r.log).collect::<Vec<_>>()),
        declared: "Before: the declared baseline, one set of static curves for all runs, one constant a channel and run. After: the same with every effect of the rig that is named above. The error is that of a run predicted by a fit to the other runs, as the root of the mean square over the runs.".to_owned(),
        hero: shown.iter().flat_map(|shown| over_runs(v, shown)).map(|figure| on(first, figure)).collect(),
        cards: v.effects.iter().enumerate().map(|(k, e)| card(&alone, outcome, v, k, e)).collect(),
        left: v.unexplained.iter().zip(&outcome.left).filter(|(u, _)| own(u)).filter_map(|(u, shown)| left_of(&alone, u, shown.as_ref())).map(|(run, figure)| on(run, figure)).collect(),
        readings: outcome.contexts.iter().zip(&v.runs).flat_map(|(c, run)| readings_apart(c, v, &run.run)).collect(),
        parameters: parameters(outcome, v),
        speeds: (SPEEDS, speeds(&runs[first].log, &alone[first]).into_iter().map(|figure| on(first, figure)).collect()),
    };
    let mut sheet = parts::begin(&page);
    let each: Vec<(&str, &Log)> = v.runs.iter().zip(runs).map(|(of, run)| (of.run.as_str(), &run.log)).collect();
    beside_runs(&mut sheet, &each);
    for (run, of) in v.runs.iter().enumerate() {
        sheet.fold(&of.run, |sheet| {
            if let Some(link) = links.get(run) {
                sheet.html_part(&format!("<p><a href=\"{}\">The run alone</a>, with its own verdict.</p>\n", escape(link)));
            }
            sheet.say("What follows is not of the run alone. It is this run as a fit to the other runs predicts it:");
            sheet.html_part(&parts::bars(&channels(v, outcome, run, of), pair(v)));
        });
    }
    sheet.html()
}

/// One run under the models of all.
fn of_run(runs: &[Run], outcome: &Outcome, run: usize) -> Closed {
    let log = &runs[run].log;
    Closed {
        context: outcome.contexts[run].clone(),
        diagnosis: runs[run].closed.diagnosis.clone(),
        declared: outcome.declared.on(log).into_owned(),
        model: outcome.model.on(log).into_owned(),
        verdict: outcome.verdict.clone(),
    }
}

/// The figure, with the run that it is of.
fn named(mut figure: Figure, run: &str) -> Figure {
    figure.title = format!("{}, {run}", figure.title);
    figure
}

/// Figures of an effect: of what the rig has the run on which it took most, predicted by the others, and its size run by run; of what one run has
/// that run.
fn card(alone: &[Closed], outcome: &Outcome, v: &Verdict, k: usize, e: &EffectEntry) -> Vec<Figure> {
    let id = format!("effect-{}", k + 1);
    if let Some(run) = e.run.as_ref().and_then(|of| v.runs.iter().position(|r| r.run == *of)) {
        return card_alone(&alone[run], e, &id).map(|figure| named(figure, &v.runs[run].run)).into_iter().collect();
    }
    let Some(at) = outcome.model.effects.iter().position(|added| added.placed.is_told_by(e)) else { return Vec::new() };
    let shown = outcome.each.get(at).and_then(Option::as_ref);
    let most = shown.and_then(|s| Some(named(card_across(&alone[s.run], e, s, &id)?, &v.runs[s.run].run)));
    most.into_iter().chain(sizes(outcome, v, at, &id)).collect()
}

/// The parameter on which the runs differ, or else the one that is known best, as each run alone has it, beside what all share.
fn sizes(outcome: &Outcome, v: &Verdict, at: usize, id: &str) -> Option<Figure> {
    let added = outcome.model.effects.get(at)?;
    let (effect, instance, context) = (added.placed.effect, &added.placed.instance, outcome.contexts.first()?);
    let told = |e: &[Estimate]| effect.report(context, instance, e.to_vec());
    let known = |e: &&Estimate| e.se > 0.0 && e.se.is_finite() && e.name != "phase";
    let sure = |e: &Estimate| e.value.abs() / e.se;
    let half = |e: &Estimate| if e.se.is_finite() { 1.96 * e.se } else { 0.0 };
    let all = told(&added.estimates);
    let words = |p: &Estimate| (Vocabulary::RIG.parameter)(effect.id(), &p.name);
    let each: Vec<Vec<Estimate>> = outcome.alone.get(at)?.iter().map(|run| told(run)).collect();
    let differs = disagreement(&all, &each).map(|(name, _)| name);
    let differing = all.iter().find(|e| differs.as_ref() == Some(&e.name));
    let best = differing.or_else(|| all.iter().filter(known).max_by(|a, b| sure(a).total_cmp(&sure(b))))?;
    let (factor, unit) = scaled(best.value, &best.unit);
    let mark = |(run, alone): (usize, &Vec<Estimate>)| {
        let own = alone.iter().find(|e| e.name == best.name)?;
        let (y, error) = (factor * own.value, factor * half(own));
        let interval = if error > 0.0 { format!(" \u{b1} {}", digits(error, 0.1 * error)) } else { String::new() };
        let text = format!("{}: {}{interval} {unit}", v.runs.get(run)?.run, digits(y, 0.1 * error));
        Some(Mark { x: run as f64, y, error, text })
    };
    let marks: Vec<Mark> = each.iter().enumerate().filter_map(mark).collect();
    let name = words(best);
    let unit = if unit == "1" { String::new() } else { format!(", {unit}") };
    (marks.len() > 1).then(|| Figure {
        id: format!("{id}-runs"),
        title: format!("{} run by run, each run alone", upper(&name)),
        x_label: "run, in the order of the list above".to_owned(),
        y_label: format!("{name}{unit}"),
        layers: vec![
            Layer::Level { y: factor * best.value, text: "all runs".to_owned() },
            Layer::Marks { name: String::new(), class: "a", marks },
        ],
        height: 220.0,
        categories: (1..=v.runs.len())
            .map(|k| if v.runs.len() > MOST_NAMES && k % 5 != 0 { String::new() } else { k.to_string() })
            .collect(),
        ..Figure::default()
    })
}

/// The figure of what is left on a channel of the run on which it is loudest, as the others predict it, and which run that is; of what a speed
/// sensor reads beyond the others that of a run alone.
fn left_of(alone: &[Closed], u: &Unexplained, shown: Option<&Shown>) -> Option<(usize, Figure)> {
    match shown {
        Some(shown) => Some((shown.run, left_across(&alone[shown.run], u, shown)?)),
        None => alone.iter().enumerate().find_map(|(run, of)| Some((run, rest(of, u)?))),
    }
}

/// Each parameter of the rig's effects as all runs share it, and as each run alone has it.
fn parameters(outcome: &Outcome, v: &Verdict) -> Vec<Vec<String>> {
    let told = |e: &Estimate| {
        let ci95 = [e.value - 1.96 * e.se, e.value + 1.96 * e.se];
        let p = Parameter { name: e.name.clone(), value: e.value, unit: e.unit.clone(), ci95 };
        upper_bound(&p).map(|bound| format!("< {}", digits(bound, 0.05 * bound)))
    };
    let value = |e: &Estimate| {
        told(e)
            .unwrap_or_else(|| digits(e.value, if e.se.is_finite() && e.se > 0.0 { 0.2 * e.se } else { 0.005 * e.value.abs() }))
    };
    let head = ["parameter", "unit", "all runs"].into_iter().chain(v.runs.iter().map(|r| r.run.as_str()));
    let mut rows = vec![head.map(str::to_owned).collect()];
    for (added, alone) in outcome.model.effects.iter().zip(&outcome.alone) {
        let context = &outcome.contexts[0];
        let reported = added.placed.effect.report(context, &added.placed.instance, added.estimates.clone());
        for e in reported.iter().filter(|e| e.name != "phase") {
            let effect = added.placed.effect;
            let on = added.placed.instance.channels.first().map_or_else(String::new, |c| format!(" ({})", channel(c)));
            let of = format!("{}{on}: {}", effect.about().title, (Vocabulary::RIG.parameter)(effect.id(), &e.name));
            let mut row = vec![of, e.unit.clone(), value(e)];
            for run in alone {
                let run = added.placed.effect.report(context, &added.placed.instance, run.clone());
                row.push(run.iter().find(|own| own.name == e.name).map_or_else(|| "-".to_owned(), value));
            }
            rows.push(row);
        }
    }
    rows
}

/// The channels of one run, as the bars have them.
fn channels(v: &Verdict, outcome: &Outcome, run: usize, of: &Validation) -> Channels {
    let mut out = Channels::default();
    let context = &outcome.contexts[run];
    for (name, BeforeAfter { before, after }) in &of.channels {
        let (Some(whole), Some(target)) = (v.channels.get(name), context.target(name)) else { continue };
        let figures = |rms: f64| Figures { rms, heldout_rms: rms, across_runs_rms: Some(rms), whiteness_p: 1.0 };
        let floor = context.targets[target].noise.rms;
        let channel =
            Channel { unit: whole.unit.clone(), noise_floor_rms: floor, before: figures(*before), after: figures(*after) };
        out.predicted.insert(name.clone(), channel);
    }
    out
}
